"""How much of what a pixel shows comes through the fog: the definition, in the precision that is asked for.

Distances and rises are found in doubles; what follows from them is computed in `dtype`. fog.cl does the same sixteen
pixels at a time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from lichen.image import Alpha
from lichen.memory import Array
from lichen.operation import Inputs
from lichen.operations.fog.column import Column
from lichen.operations.fog.parameters import Background, Distance, Kind, Parameters
from lichen.operations.scene.view import planar, pointed, rays

LEAST = 2.0**-149
"""The smallest share that comes through; less is none, and hides even infinite light."""


def paths(inputs: Inputs, p: Parameters, rows: slice) -> tuple[Array, Array, Array]:
    """Of every pixel of some rows, float64 of shape (rows, width): the distance, how far the ray rises on the way, and
    how much it rises for a unit of distance. Where there is nothing, distances are infinite; rises may be NaN there. An
    infinite position has no direction: its ray counts as level.
    """
    with np.errstate(all="ignore"):
        if pointed(inputs["depth"]):
            ray = inputs["depth"].pixels[rows].astype(np.float64) - np.array(p.eye)
            length = np.sqrt(np.sum(ray * ray, axis=-1))
            length = np.where(np.isnan(ray).any(axis=-1), np.nan, length)
            rise = _along(ray, p.upward)
            ahead = _along(ray, p.ahead) if p.distance is Distance.PLANAR else length
            return np.where(np.isinf(length), np.inf, np.maximum(ahead, 0)), rise, np.zeros_like(rise)
        image = inputs["image"]
        x, y = rays(p, image.height, image.width)
        y = y[rows]
        z = planar(inputs["depth"].pixels[rows, :, 0].astype(np.float64), p, x, y)
        z = np.maximum(z, 0)
        long = np.sqrt(1 + x * x + y * y)
        climb = p.upward[0] * x + p.upward[1] * y - p.upward[2]
        return (z if p.distance is Distance.PLANAR else z * long), z * climb, climb / long


def _along(ray: Array, direction: Array) -> Array:
    """The part of rays in a direction; what a direction does not look at may be infinite."""
    total = np.zeros(ray.shape[:-1])
    for at, share in enumerate(direction):
        if share:
            total = total + share * ray[..., at]
    return total


def transmittance(inputs: Inputs, p: Parameters, rows: slice, dtype: npt.DTypeLike = np.float64) -> Array:
    """From 0 (nothing) to 1 (everything), shape (rows, width), before what shines through the fog."""
    kind: Any = np.dtype(dtype).type
    if p.clear:
        return np.ones((rows.stop - rows.start, inputs["image"].width), dtype)
    distance, rise, climb = paths(inputs, p, rows)
    nothing = np.isinf(distance)
    d = distance.astype(dtype)
    with np.errstate(all="ignore"):
        if p.kind is Kind.LINEAR:
            through = np.clip((kind(p.end) - d) * kind(1 / (p.end - p.start)), 0, 1)
        else:
            depth = optical_depth(p, d, rise.astype(dtype), climb, nothing)
            through = np.where(np.isnan(distance), kind(math.nan), np.exp(-depth))
        through = np.where(through < LEAST, kind(0), through)
    made: Array = np.where(nothing, kind(1), through) if p.background is Background.KEEP else through
    return made


def shown(inputs: Inputs, p: Parameters, rows: slice, through: Array) -> Array:
    """Some rows of the picture through fog, of which `through` comes through, in its precision."""
    image, kind = inputs["image"], through.dtype.type
    pixels = image.pixels[rows].astype(through.dtype, copy=False)
    if "emissive" in inputs:
        own = np.clip(inputs["emissive"].pixels[rows, :, 0].astype(through.dtype, copy=False), 0, 1)
        through = through + own * (kind(1) - through)
    t = through[..., None]
    covered = image.alpha is not Alpha.NONE
    hidden = (kind(1) - t) * pixels[..., -1:] if covered else kind(1) - t
    made = pixels.copy()
    with np.errstate(all="ignore"):
        colour = pixels[..., : image.colours]
        mine = np.where((t == 0) & np.isinf(colour), kind(0), t * colour)
        made[..., : image.colours] = mine + hidden * np.array(p.light(image.colours), through.dtype)
    return made


def optical_depth(p: Parameters, d: Array, rise: Array, climb: Array, nothing: Array) -> Array:
    """By what power of e light fades on the way."""
    kind = d.dtype.type
    density = kind(p.density)
    if p.kind is Kind.EXPONENTIAL:
        return np.asarray(density * d)
    if p.kind is Kind.SQUARED:
        return np.asarray(np.square(density * d))
    finite = np.where(nothing | ~np.isfinite(rise), kind(0), rise)
    if p.kind is Kind.LAYERED:
        column = p.column
        within = density * column.mean(finite, d.dtype) * d
        return np.asarray(np.where(nothing, density * endless_layers(column, climb, d.dtype), within))
    u = finite * kind(1 / p.falloff)
    a = np.abs(u)
    share = np.divide(-np.expm1(-a), a, out=np.ones_like(a), where=a > 0)
    within = density * share * np.exp(kind(p.lift) + np.maximum(-u, kind(0))) * d
    endless = np.where(
        climb > 0, density * np.exp(kind(p.lift)) * kind(p.falloff) / climb.astype(d.dtype), kind(np.inf)
    )
    return np.asarray(np.where(nothing, endless, within))


def endless_layers(column: Column, climb: Array, dtype: npt.DTypeLike) -> Array:
    """The optical depth of a ray that never ends: infinite unless the fog ends, or the ray stays where there is none.

    A ray that rises by `climb` for a unit of distance crosses every layer 1 / |climb| times as far as a vertical one.
    """
    level = np.inf if column.above[0, 2] > 0 else 0.0
    slanted = []
    for side in range(2):
        density, integral = column.ends(side)
        slanted.append(
            np.inf if density > 0 else np.divide(integral, np.abs(climb), out=np.zeros_like(climb), where=climb != 0)
        )
    made: Array = np.where(climb == 0, level, np.where(climb > 0, *slanted))
    return made.astype(dtype)
