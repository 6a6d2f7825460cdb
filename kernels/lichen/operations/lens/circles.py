"""Circles of confusion, and sums over what lies within them: the NumPy bodies of depth_of_field.

Planes are (height, width); with `reach` pixels of nothing around them, whose radius is -1, no offset leaves them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array

NOTHING = np.float32(-1)
SEGMENT = 64
"""Pixels of a row that look the same way."""
GOLDEN = math.pi * (3 - math.sqrt(5))
"""The golden angle: points of a spiral that turn by it lie evenly over a disc (Vogel 1979)."""


@dataclass(frozen=True)
class Bokeh:
    """The shape of the aperture: a disc, or a polygon with corners on its rim."""

    blades: int
    rotation: float

    def distance(self, x: Array, y: Array) -> Array:
        """The radius of the shape on whose edge (x, y) lies; y runs down."""
        if self.blades == 0:
            made: Array = np.sqrt(x * x + y * y)
            return made
        half = math.pi / self.blades
        turns = [math.radians(self.rotation) + half + 2 * half * k for k in range(self.blades)]
        sides: Array = np.max([x * math.cos(a) - y * math.sin(a) for a in turns], axis=0)
        return sides / math.cos(half)


def radii(depth: Array, focus: float, blur: float, largest: float) -> Array:
    """Of every pixel, float32; NOTHING where the depth is NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        z = depth.astype(np.float64)
        found = blur * np.abs(1 - focus / z) if blur > 0 else np.where(np.isnan(z), np.nan, 0.0)
    found = np.where(found > largest, largest, found)
    return np.where(np.isnan(found), NOTHING, found).astype(np.float32)


def area(radius: Array) -> Array:
    """Of the disc of a radius whose edge fades over a pixel, over pi; float64."""
    doubled = radius.astype(np.float64)
    made: Array = doubled * doubled + 1 / 12
    return made


def padded(plane: Array, around: int, value: float) -> Array:
    return np.pad(plane, around, constant_values=value)


def nearby(radius: Array, around: int) -> Array:
    """The largest radius within a square of `around` pixels about each."""
    found = padded(radius, around, float(NOTHING))
    for axis in (0, 1):
        found = _largest(found, 2 * around + 1, axis)
    return found


def _largest(plane: Array, window: int, axis: int) -> Array:
    """Of as many neighbours from each on: windows of powers of two, the last two of which overlap."""
    moved, reach = np.moveaxis(plane, axis, 0), 1
    while 2 * reach <= window:
        moved = np.maximum(moved[:-reach], moved[reach:])
        reach *= 2
    rest = window - reach
    return np.moveaxis(np.maximum(moved[: len(moved) - rest], moved[rest:]) if rest else moved, 0, axis)


def grouped(offsets: int) -> list[tuple[int, int]]:
    """All offsets (down, across) of a square, row by row."""
    return [(dy, dx) for dy in range(-offsets, offsets + 1) for dx in range(-offsets, offsets + 1)]


def gathered(pixels: Array, depth: Array, radius: Array, bokeh: Bokeh) -> Array:
    """The definition, float64; `depth` and `radius` are planes."""
    height, width, channels = pixels.shape
    reach = max(math.ceil(float(radius.max()) + 0.5), 0)
    r, z = padded(radius, reach, float(NOTHING)).astype(np.float64), padded(depth, reach, np.inf)
    colour = np.pad(pixels.astype(np.float64), ((reach, reach), (reach, reach), (0, 0)))
    own = radius.astype(np.float64)
    total, weights = np.zeros((height, width, channels)), np.zeros((height, width))
    for dy, dx in grouped(reach):
        part = slice(reach + dy, reach + dy + height), slice(reach + dx, reach + dx + width)
        d = float(bokeh.distance(np.array(-dx, float), np.array(-dy, float)))
        theirs = r[part]
        if theirs.max() + 0.5 <= d:
            continue
        seen = np.where((z[part] > depth) & (own < theirs), own, theirs)
        w = np.clip(seen - d + 0.5, 0, 1) / area(seen)
        weights += w
        total += np.where(w[..., np.newaxis] == 0, 0, w[..., np.newaxis] * colour[part])
    with np.errstate(invalid="ignore"):
        made: Array = np.where(radius[..., np.newaxis] == NOTHING, np.nan, total / weights[..., np.newaxis])
    return made


def spiral(samples: int) -> Array:
    """(samples, 2) points, down and across, evenly over the unit disc; the first at its centre."""
    k = np.arange(samples)
    r = np.sqrt(k / samples)
    return np.stack([r * np.sin(k * GOLDEN), r * np.cos(k * GOLDEN)], axis=-1)


def segmented(radius: Array, around: int) -> Array:
    """How far the pixels of each segment may have to look: (height, segments) whole numbers."""
    reach: Array = np.ceil(segment_most(radius, around) + 0.5)
    return np.maximum(reach, 0).astype(np.int32, copy=False)


def segment_most(plane: Array, around: int) -> Array:
    """The largest within `around` pixels of each segment's: (height, segments); NOTHING where there is none."""
    height, width = plane.shape
    segments = -(-width // SEGMENT)
    found = np.full((height, segments * SEGMENT), NOTHING)
    found[:, :width] = nearby(plane, around)
    return np.asarray(found.reshape(height, segments, SEGMENT).max(axis=2))


def taps(reach: int, samples: int, bokeh: Bokeh) -> Array:
    """(n, 3) offsets, down and across, none twice, and the radius of the shape through each, float32: as many as there
    are samples, or all within reach where they are no more. The pixel itself is one of them."""
    if (2 * reach + 1) ** 2 <= samples:
        offsets = np.array(grouped(reach), np.float64)
    else:
        offsets = np.unique(np.rint(spiral(samples) * reach), axis=0)
    distance = bokeh.distance(-offsets[:, 1], -offsets[:, 0])
    return np.column_stack([offsets, distance]).astype(np.float32)


def sampled(pixels: Array, depth: Array, radius: Array, bokeh: Bokeh, largest: float, samples: int) -> Array:
    """The mean over the taps of every segment; sums in float32."""
    height, width, channels = pixels.shape
    around = math.ceil(largest + 0.5)
    r, z = padded(radius, around, float(NOTHING)), padded(depth, around, np.inf)
    colour = np.pad(pixels, ((around, around), (around, around), (0, 0)))
    reaches = np.repeat(segmented(radius, around), SEGMENT, axis=1)[:, :width]
    total, weights = np.zeros((height, width, channels), np.float32), np.zeros((height, width), np.float32)
    for reach in np.unique(reaches):
        rows, columns = np.nonzero(reaches == reach)
        own, behind = radius[rows, columns], depth[rows, columns]
        for dy, dx, d in taps(int(reach), samples, bokeh):
            at = rows + around + int(dy), columns + around + int(dx)
            theirs = r[at]
            seen = np.where((z[at] > behind) & (own < theirs), own, theirs)
            w = np.clip(seen - d + np.float32(0.5), 0, 1) / (seen * seen + np.float32(1 / 12))
            weights[rows, columns] += w
            total[rows, columns] += np.where(w[:, np.newaxis] == 0, 0, w[:, np.newaxis] * colour[at])
    with np.errstate(invalid="ignore"):
        made: Array = np.where(radius[..., np.newaxis] == NOTHING, np.nan, total / weights[..., np.newaxis])
    return made.astype(np.float32)
