"""Images of all directions with a frame around each of their charts, and where in them a direction lies.

An image is one or more charts (`lichen.operations.warp.charts`). Between texels it is bilinear; so that what lies
across an edge takes part there, every chart gets a frame of one texel with what the others show at these places:

* lat-long: columns go around, and the rows over the poles go on half way around;
* cubes and paraboloids: the neighbour's bilinear value; of a disc, that is all texels whose centre lies outside it and
  which a place inside may touch, so nothing that is stored around a disc is ever seen;
* a mirror ball's rim, all of which is one direction, is repeated outwards.

Directions of scenes have x to the right, y up and z towards the viewer, who looks along -z; those of charts have x to
the right, y down and z ahead, so the middle of a lat-long image lies where a camera without a turn looks.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lichen.errors import Flaw
from lichen.image import Image
from lichen.memory import Array, aligned_empty
from lichen.operation import Facts
from lichen.operations.warp.charts import LAYOUT, Chart, Sphere, Vectors

DISCS = (Chart.PARABOLOID, Chart.MIRROR_BALL)
TO_CHART = np.diag([1.0, -1.0, -1.0])
"""From directions of a scene to those of charts."""


def cell(chart: Chart, height: int, width: int) -> tuple[int, int]:
    """Height and width of one chart of an image."""
    across, down = LAYOUT[chart]
    return height // down, width // across


def flaws_of(name: str, chart: Chart, facts: Facts) -> list[Flaw]:
    """What is wrong with an image as one of this kind."""
    across, down = LAYOUT[chart]
    if facts.width % across or facts.height % down:
        text = f"is {facts.width}x{facts.height}; a {chart} is {across} x {down} charts of whole pixels"
        return [Flaw(f"/inputs/{name}", text)]
    return []


def turn(yaw: float, pitch: float, roll: float) -> Array:
    """The matrix that takes directions of a scene to those of charts turned by these degrees: the camera looks `yaw` to
    the right, then `pitch` up, then is tilted clockwise by `roll`."""
    y, p, r = (math.radians(each) for each in (yaw, pitch, roll))
    tilted = np.array([[math.cos(r), -math.sin(r), 0], [math.sin(r), math.cos(r), 0], [0, 0, 1.0]])
    raised = np.array([[1.0, 0, 0], [0, math.cos(p), -math.sin(p)], [0, math.sin(p), math.cos(p)]])
    around = np.array([[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]])
    made: Array = around @ raised @ tilted @ TO_CHART
    return made


class Seams(NamedTuple):
    """Texels of a framed image, numbered through, that are means of others."""

    targets: Array
    """(n,)"""
    sources: Array
    """(n, 4)"""
    weights: Array
    """(n, 4); each row's sum is 1"""


def framed(pixels: Array, chart: Chart) -> Array:
    """The image's charts, each with its frame: (charts, height + 2, width + 2, channels), of the image's precision."""
    return in_memory(pixels, chart)[0]


def kept(image: Image, chart: Chart) -> tuple[Array, Array]:
    """As `in_memory`, and kept as long as the image is: frames of a scene ask for the same."""
    held: dict[Chart, tuple[Array, Array]] = vars(image).setdefault("framed", {})
    if chart not in held:
        held[chart] = in_memory(image.pixels, chart)
    return held[chart]


def in_memory(pixels: Array, chart: Chart) -> tuple[Array, Array]:
    """The framed image, and the memory it lies in, with room behind it for reads of 8 numbers."""
    across, down = LAYOUT[chart]
    height, width, channels = pixels.shape
    tall, wide = height // down, width // across
    shape = (down * across, tall + 2, wide + 2, channels)
    size = math.prod(shape)
    memory = aligned_empty((size + 8,), pixels.dtype)
    memory[size:] = 0
    made = memory[:size].reshape(shape)
    inside = pixels.reshape(down, tall, across, wide, channels).transpose(0, 2, 1, 3, 4)
    made.reshape(down, across, tall + 2, wide + 2, channels)[:, :, 1:-1, 1:-1] = inside
    if chart is Chart.LATLONG:
        _close_latlong(made[0])
    else:
        seams, flat = _seams(chart, tall, wide), made.reshape(-1, channels)
        flat[seams.targets] = np.einsum("nk,nkc->nc", seams.weights.astype(pixels.dtype), flat[seams.sources])
    return made, memory


def _close_latlong(one: Array) -> None:
    wide = one.shape[1] - 2
    one[1:-1, 0], one[1:-1, -1] = one[1:-1, wide], one[1:-1, 1]
    opposite = (np.arange(-1, wide + 1) + wide // 2) % wide + 1
    one[0], one[-1] = one[1][opposite], one[-2][opposite]


@lru_cache(maxsize=32)
def _seams(chart: Chart, tall: int, wide: int) -> Seams:
    """Depends on sizes alone, and on no more texels than lie along edges."""
    sphere, (across, down) = Sphere(chart), LAYOUT[chart]
    s = (2 * np.arange(-1, wide + 1) + 1)[np.newaxis, :] / wide - 1
    t = (2 * np.arange(-1, tall + 1) + 1)[:, np.newaxis] / tall - 1
    s, t = np.broadcast_arrays(s, t)
    held = sphere.holds(s, t)
    wanted = ~held
    if chart in DISCS:
        wanted &= np.hypot(s, t) <= 1 + 2 * math.sqrt(2) / min(tall, wide)
    row, column = np.nonzero(wanted)
    cells = np.nonzero(sphere.shows(np.arange(across * down)))[0]
    face = np.repeat(cells, len(row))
    row, column = np.tile(row, len(cells)), np.tile(column, len(cells))
    at, places = _across(sphere, s[row, column], t[row, column], face, 1 - 1 / min(tall, wide))
    x = np.clip((places[0] + 1) / 2 * wide, 0.5, wide - 0.5) - 0.5
    y = np.clip((places[1] + 1) / 2 * tall, 0.5, tall - 0.5) - 0.5
    left, top = np.minimum(x.astype(np.int64), max(wide - 2, 0)), np.minimum(y.astype(np.int64), max(tall - 2, 0))
    fx, fy = x - left, y - top
    right, low = np.minimum(left + 1, wide - 1), np.minimum(top + 1, tall - 1)
    corners = [(top, left), (top, right), (low, left), (low, right)]
    shares = [(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx]
    weights = np.stack([share * held[r + 1, c + 1] for (r, c), share in zip(corners, shares, strict=True)], axis=-1)
    nothing = weights.sum(axis=1, keepdims=True) == 0
    weights = np.where(nothing, np.stack(shares, axis=-1), weights)
    weights /= weights.sum(axis=1, keepdims=True)

    def number(face: Array, row: Array, column: Array) -> Array:
        made: Array = (face * (tall + 2) + row) * (wide + 2) + column
        return made

    sources = np.stack([number(at, r + 1, c + 1) for r, c in corners], axis=-1)
    heaviest = np.take_along_axis(sources, weights.argmax(axis=1)[:, np.newaxis], axis=1)
    return Seams(number(face, row, column), np.where(weights > 0, sources, heaviest), weights)


def _across(sphere: Sphere, s: Array, t: Array, face: Array, inner: float) -> tuple[Array, tuple[Array, Array]]:
    """The chart that shows what lies at a place beyond an edge, and where; in discs, no farther out than `inner`."""
    if sphere.chart is Chart.MIRROR_BALL:
        r = np.hypot(s, t)
        return face, (s * inner / r, t * inner / r)
    d = sphere.direction(s, t, face)
    at = sphere.face(d)
    s, t = sphere.place(d, at)
    if sphere.chart is Chart.PARABOLOID:
        r = np.hypot(s, t)
        inward = np.where(r > inner, inner / np.where(r > 0, r, 1), 1.0)
        s, t = s * inward, t * inward
    return at, (s, t)


class Found(NamedTuple):
    """Where directions lie between the texels of a framed image."""

    texel: Array
    """the number of the one before, in both directions"""
    x: Array
    """how far past it, in [0, 1); NaN where there is no direction"""
    y: Array


def locate(d: Vectors, chart: Chart, tall: int, wide: int) -> Found:
    """Of directions of charts, not all zero, of any length; float64."""
    sphere = Sphere(chart)
    with np.errstate(invalid="ignore"):
        face = sphere.face(d)
        s, t = sphere.place(d, face)
        x, y = (s + 1) / 2 * wide - 0.5, (t + 1) / 2 * tall - 0.5
        left, top = np.floor(x), np.floor(y)
        column = np.where(np.isnan(x), 0, left).astype(np.int64) + 1
        row = np.where(np.isnan(y), 0, top).astype(np.int64) + 1
        return Found((face * (tall + 2) + row) * (wide + 2) + column, x - left, y - top)


def between(image: Array, found: Found) -> Array:
    """Bilinear values of a framed image, of its precision: (..., channels). A texel of no weight takes no part."""
    wide = image.shape[2]
    flat = image.reshape(-1, image.shape[3])
    kind = image.dtype.type
    x, y = found.x.astype(kind)[..., np.newaxis], found.y.astype(kind)[..., np.newaxis]
    upper = _mixed(flat[found.texel], flat[found.texel + 1], x)
    lower = _mixed(flat[found.texel + wide], flat[found.texel + wide + 1], x)
    return _mixed(upper, lower, y)


def nearest(image: Array, found: Found) -> Array:
    """The texel that a direction falls in."""
    flat = image.reshape(-1, image.shape[3])
    step = np.where(found.x >= 0.5, 1, 0) + np.where(found.y >= 0.5, image.shape[2], 0)
    made: Array = flat[found.texel + step]
    return np.where(np.isnan(found.x + found.y)[..., np.newaxis], np.nan, made).astype(image.dtype)


def _mixed(a: Array, b: Array, t: Array) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):
        made: Array = np.where(t == 0, a, (1 - t) * a + t * b)
    return made
