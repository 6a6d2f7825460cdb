"""What a picture of normals, and of positions where there is one, says of the surface that every pixel shows.

Normals count in any length; two channels are x and y of a unit normal whose z, towards the viewer, is not negative.
Encoded ones hold (n + 1) / 2. Where the normal is 0, or the position infinite, the pixel shows no surface; what is not
a number stays so.

The direction v to the viewer is towards `eye` where positions are given, through the pixel's centre where a field of
view is, and (0, 0, 1), an orthographic camera's, otherwise. A surface seen from behind is seen from inside its body:
the normal is turned to the viewer, and the ratio of the indices inverted.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import Degrees, Inputs, OperationParameters
from lichen.operations.environment.fresnel import beyond


class Encoding(StrEnum):
    """How normals are stored."""

    SIGNED = "signed"
    """as they are"""
    UNIT = "unit"
    """(n + 1) / 2, as pictures hold them"""


class Convention(StrEnum):
    """Which way y of a normal runs."""

    OPENGL = "opengl"
    """up"""
    DIRECTX = "directx"
    """down"""


Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]


class Seen(OperationParameters):
    """How a surface is seen."""

    encoding: Encoding = Field(Encoding.SIGNED, description="signed normals, or unit: (n + 1) / 2")
    convention: Convention = Field(Convention.OPENGL, description="y of normals runs up (opengl) or down (directx)")
    fov: Degrees | None = Field(
        None, ge=0.01, le=179, description="of the camera from top to bottom; orthographic if left out"
    )
    eye: tuple[Coordinate, Coordinate, Coordinate] = Field(
        (0.0, 0.0, 0.0), description="where the viewer is, in the space of the positions"
    )


class Surface(NamedTuple):
    """Of every pixel; vectors are (3, height, width), unit, float64."""

    normal: Array
    """turned to the viewer"""
    view: Array
    """to the viewer"""
    outward: Array
    """the normal as it was given"""
    c: Array
    """cosine between normal and view"""
    ratio: Array
    """of the indices"""
    empty: Array
    """where there is no surface"""


def decoded(pixels: Array, p: Seen) -> Array:
    """(3, height, width), float64."""
    given = np.moveaxis(pixels.astype(np.float64), -1, 0)
    if p.encoding is Encoding.UNIT:
        given = given * 2 - 1
    x, y = given[0], given[1] if p.convention is Convention.OPENGL else -given[1]
    if len(given) == 3:
        return np.stack([x, y, given[2]])
    rest = 1 - (x * x + y * y)
    return np.stack([x, y, np.sqrt(np.where(rest < 0, 0, rest))])


def _unit(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """Divided by the length; 0 where that is 0. And where it is."""
    length = np.sqrt(x * x + y * y + z * z)
    nothing = length == 0
    inverse = 1 / np.where(nothing, 1.0, length)
    return np.stack(np.broadcast_arrays(x * inverse, y * inverse, z * inverse)), nothing


def surface(inputs: Inputs, p: Seen, index: float) -> Surface:
    """Evaluates the definition above. The kernel's steps are the same, in the same order, so that no rounding decides
    which chart a direction falls in."""
    with np.errstate(invalid="ignore", over="ignore"):
        normal, empty = _unit(*decoded(inputs["normal"].pixels, p))
        height, width = normal.shape[1:]
        if "position" in inputs:
            place = np.moveaxis(inputs["position"].pixels.astype(np.float64), -1, 0)
            far = np.isinf(place).any(axis=0) & ~np.isnan(place).any(axis=0)
            view, here = _unit(*(e - np.where(far, 0, x) for e, x in zip(p.eye, place, strict=True)))
            empty = empty | far | here
        elif p.fov is not None:
            scale = math.tan(math.radians(p.fov) / 2) / (0.5 * height)
            x = (np.arange(width) + 0.5 - 0.5 * width) * -scale
            y = (np.arange(height) + 0.5 - 0.5 * height) * scale
            view, _ = _unit(*np.broadcast_arrays(x[np.newaxis, :], y[:, np.newaxis], 1.0))
        else:
            view = np.broadcast_to(np.array([0.0, 0.0, 1.0]).reshape(3, 1, 1), normal.shape)
        c = normal[0] * view[0] + normal[1] * view[1] + normal[2] * view[2]
        inside = c < 0
        ratio = np.where(inside, 1 / index, index)
        turned = np.where(inside, -1.0, 1.0) * normal
        c = np.abs(c)
        return Surface(turned, view, normal, np.where(c > 1, 1.0, c), ratio, empty)


def mirrored(s: Surface) -> Array:
    """2 c n - v."""
    made: Array = 2 * s.c * s.normal - s.view
    return made


def refracted(s: Surface) -> tuple[Array, Array]:
    """Where what comes from the viewer goes on behind the surface, and cos^2 of its angle: where that is below 0 it is
    reflected wholly, and the direction is the mirror's."""
    k = beyond(s.c, s.ratio)
    eta = 1 / s.ratio
    along = eta * s.c - np.sqrt(np.where(k < 0, 0, k))
    made = along * s.normal - eta * s.view
    return np.where(k < 0, mirrored(s), made), k
