"""Interpolation between the corners of a cell, for noises that have a number or a gradient there.

A corner's weight is the product over the axes of s(t) or 1 - s(t), with t the fraction along the axis and s a fade with
s(0) = 0, s(1) = 1 and no slope at either end: the quintic 6 t^5 - 15 t^4 + 10 t^3 (Perlin 2002), which has no curvature
there either, or the cubic 3 t^2 - 2 t^3 (Perlin 1985).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.hashing import Words, keyed
from lichen.memory import Array
from lichen.operations.noise.basis import Place, Slice, Values, corners, padded
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.octaves import Key
from lichen.operations.noise.parameters import LatticeParameters

STEEPEST = {"quintic": 1.875, "cubic": 1.5}
"""The largest slope of a fade."""


class Fade(StrEnum):
    """How one corner gives way to the next."""

    QUINTIC = "quintic"
    """6 t^5 - 15 t^4 + 10 t^3: curvature is continuous, so a bump map shows no cells"""
    CUBIC = "cubic"
    """3 t^2 - 2 t^3: curvature jumps at cell borders"""


class FadedParameters(LatticeParameters):
    fade: Fade = Field(Fade.QUINTIC, description="how values give way from corner to corner of a cell")


def faded(t: Array, fade: Fade) -> tuple[Array, Array]:
    """s(t) and s'(t)."""
    if fade is Fade.CUBIC:
        return t * t * (3 - 2 * t), 6 * t * (1 - t)
    return t * t * t * (t * (t * 6 - 15) + 10), 30 * (t * (1 - t)) * (t * (1 - t))


def slices(p: FadedParameters, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    """The corners along z and w, each with its weight."""
    found = []
    for own, away in corners(key, axes):
        weight = 1.0
        for distance, axis in zip(away, axes[2:], strict=True):
            s = float(faded(axis.fractions, p.fade)[0][0])
            weight *= s if distance < axis.fractions[0] else 1 - s
        found.append(Slice(own, weight=weight, **padded(away)))
    return tuple(found)


Corner = Callable[[Words, Array, Array, Slice], tuple[Array, "Array | float", "Array | float"]]
"""What a corner says: from its hash and the distances from it along x, y (and those of its slice), a value and its
derivatives along x and y."""


def interpolated(place: Place, fade: Fade, corner: Corner, derivatives: bool) -> Values:
    """The sum over all corners of weight x what the corner says."""
    x, y = place.x, place.y
    (across, across_slope), (down, down_slope) = faded(x, fade), faded(y, fade)
    total, along_x, along_y = (np.zeros(np.broadcast_shapes(x.shape, y.shape), x.dtype) for _ in range(3))
    for part in place.slices:
        for below in (0, 1):
            key = place.row(part, below)
            weight = part.weight * (down if below else 1 - down)
            slope = part.weight * (down_slope if below else -down_slope)
            left, left_x, left_y = corner(keyed(place.column(0), *key), x, y - below, part)
            right, right_x, right_y = corner(keyed(place.column(1), *key), x - 1, y - below, part)
            mixed = left + across * (right - left)
            total += weight * mixed
            if derivatives:
                along_x += weight * (across_slope * (right - left) + left_x + across * (right_x - left_x))
                along_y += slope * mixed + weight * (left_y + across * (right_y - left_y))
    return (total, along_x, along_y) if derivatives else (total, None, None)
