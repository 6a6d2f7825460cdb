"""Two ways to blur by depth that know of more than one surface: the NumPy bodies of depth_of_field's `layered` and
`light_field`, and what both backends prepare for them.

Circles are signed here: negative for what is nearer than the plane in focus. Layers are ranges of equal width of signed
circles, the farthest first; all of a layer is blurred alike, by the mean circle of what is in it, together with its
coverage, and laid over those behind it:

    colour <- colour (1 - a) + c,    alpha <- alpha (1 - a) + a

with c and a the layer's blurred colour and coverage; the picture is colour / alpha. A surface on a slant falls apart
into strips that cover each other a little, so that many thin layers gain nothing there.

Views are seen from points of the lens, in which a pixel q lies at p = q + (point) circle(q). What lies at p is found
backwards, by STEPS steps of q <- p - (point) circle(q) from p on: right where surfaces are smooth, undecided where one
hides another. Before the plane in focus the aperture's shape is upside down, as it is in a camera.

Sources: J. Demers, Depth of field: a survey of techniques, GPU Gems, 2004; P. Haeberli and K. Akeley, The accumulation
buffer, SIGGRAPH 1990; M. Kraus and M. Strengert, Depth-of-field rendering by pyramidal image processing, Computer
Graphics Forum 26, 2007 (layers).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operations.lens.circles import NOTHING, Bokeh, grouped, padded, spiral

STEPS = 4
FIRST = np.float32(1)


def signed(depth: Array, radius: Array, focus: float) -> Array:
    """Circles of all pixels, float32; 0 where there is no depth."""
    with np.errstate(invalid="ignore"):
        near = depth < focus
    return np.where(radius == NOTHING, np.float32(0), np.where(near, -radius, radius)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Layers:
    """Which layer each pixel is in, -1 for none, and the taps of each layer: down, across, and their weight."""

    index: Array
    taps: tuple[Array, ...]

    @property
    def around(self) -> int:
        return int(max((np.abs(each[:, :2]).max() for each in self.taps if len(each)), default=0))

    @classmethod
    def of(cls, depth: Array, radius: Array, focus: float, bokeh: Bokeh, count: int) -> Layers:
        circles, there = signed(depth, radius, focus), radius != NOTHING
        if not there.any():
            return cls(np.full(depth.shape, -1, np.int32), ())
        low, high = float(circles[there].min()), float(circles[there].max())
        step = (high - low) / count
        at = np.minimum((high - circles) / step if step else np.zeros_like(circles), count - 1)
        index = np.where(there, at, -1).astype(np.int32)
        taps = []
        for layer in range(count):
            own = radius[index == layer]
            taps.append(
                weighted(float(own.mean(dtype=np.float64)), bokeh) if own.size else np.zeros((0, 3), np.float32)
            )
        return cls(index, tuple(taps))


def weighted(radius: float, bokeh: Bokeh) -> Array:
    """(n, 3): offsets down and across within a circle and their weights, which add up to 1."""
    offsets = np.array(grouped(math.ceil(radius + 0.5)), np.float64)
    w = np.clip(radius - bokeh.distance(-offsets[:, 1], -offsets[:, 0]) + 0.5, 0, 1)
    some = w > 0
    return np.column_stack([offsets[some], w[some] / w.sum()]).astype(np.float32)


def layered(pixels: Array, layers: Layers, radius: Array) -> Array:
    """The layers one over the other, float32."""
    height, width, channels = pixels.shape
    around = layers.around
    index = padded(layers.index, around, -1)
    colour = np.pad(pixels, ((around, around), (around, around), (0, 0)))
    total, alpha = np.zeros((height, width, channels), np.float32), np.zeros((height, width), np.float32)
    for number, taps in enumerate(layers.taps):
        if not len(taps):
            continue
        own = index == number
        held = np.where(own[..., np.newaxis], colour, np.float32(0))
        c, a = np.zeros_like(total), np.zeros_like(alpha)
        for dy, dx, w in taps:
            part = slice(around + int(dy), around + int(dy) + height), slice(around + int(dx), around + int(dx) + width)
            a += w * own[part]
            c += np.where(own[part][..., np.newaxis], w * held[part], np.float32(0))
        behind = FIRST - np.minimum(a, FIRST)
        alpha = alpha * behind + a
        total = np.where(behind[..., np.newaxis] > 0, total * behind[..., np.newaxis], np.float32(0)) + c
    with np.errstate(invalid="ignore", divide="ignore"):
        made: Array = np.where(radius[..., np.newaxis] == NOTHING, np.nan, total / alpha[..., np.newaxis])
    return made.astype(np.float32)


def lens_points(views: int, bokeh: Bokeh) -> Array:
    """(views, 2) points of the lens, down and across, float32; the first its centre."""
    points = spiral(views)
    length = np.hypot(points[:, 0], points[:, 1])
    shape = bokeh.distance(points[:, 1], points[:, 0])
    scale = np.divide(length, shape, out=np.ones_like(length), where=shape > 0)
    return np.asarray(points * scale[:, np.newaxis], np.float32)


def viewed(pixels: Array, circles: Array, radius: Array, points: Array) -> Array:
    """The mean of the views, float32."""
    height, width, channels = pixels.shape
    rows, columns = np.meshgrid(np.arange(height, dtype=np.float32), np.arange(width, dtype=np.float32), indexing="ij")
    total, count = np.zeros((height, width, channels), np.float32), np.zeros((height, width), np.float32)
    half = np.float32(0.5)
    for down, across in points:
        at = rows.astype(np.int32), columns.astype(np.int32)
        for _ in range(STEPS):
            circle = circles[at]
            at = (
                np.clip(np.floor(rows - down * circle + half), 0, height - 1).astype(np.int32),
                np.clip(np.floor(columns - across * circle + half), 0, width - 1).astype(np.int32),
            )
        seen = radius[at] != NOTHING
        count += seen
        total += np.where(seen[..., np.newaxis], pixels[at], np.float32(0))
    with np.errstate(invalid="ignore", divide="ignore"):
        made: Array = np.where(radius[..., np.newaxis] == NOTHING, np.nan, total / count[..., np.newaxis])
    return made.astype(np.float32)
