"""Images of all directions as texels with directions and solid angles, and sums over them.

Solid angles of lat-long and cube texels are exact: differences of longitude times differences of the sine of latitude,
and differences of atan(x y / sqrt(1 + x^2 + y^2)) at the corners. A paraboloid's are 4 / (1 + x^2 + y^2)^2 per area of
the unit disc, a mirror ball's 4 everywhere, each over 8 x 8 points of a texel, so that texels on the rim count as far
as they lie within it. All are scaled to sum to 4 pi.

`reduced` puts blocks of texels together, with their solid angle, its mean light and its mean direction: a level of a
pyramid whose texels weigh what they cover.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array
from lichen.operations.environment.framed import TO_CHART
from lichen.operations.warp.charts import FACES, LAYOUT, SHAPE, Chart, Sphere

POINTS = 8
"""Along each side of a texel whose solid angle has no closed form."""


@dataclass(frozen=True, eq=False)
class Texels:
    """Light by direction: everything about a sphere but how it is laid out."""

    light: Array
    """(n, channels), of the image's precision"""
    direction: Array
    """(n, 3) unit vectors of the scene, float64"""
    angle: Array
    """(n,) steradians, float64, all above 0; their sum is 4 pi"""


def _cell(chart: Chart, tall: int, wide: int) -> Array:
    """Solid angles of one chart, not scaled."""
    x, y = np.linspace(-1, 1, wide + 1), np.linspace(-1, 1, tall + 1)
    if chart is Chart.LATLONG:
        made: Array = np.diff(np.sin(y * math.pi / 2))[:, np.newaxis] * np.full(wide, 2 * math.pi / wide)
        return made
    if chart in FACES:
        corner = np.arctan2(x * y[:, np.newaxis], np.sqrt(1 + x * x + y[:, np.newaxis] ** 2))
        return np.diff(np.diff(corner, axis=0), axis=1)
    total = np.zeros((tall, wide))
    for j in range(POINTS):
        for i in range(POINTS):
            s = 2 * (np.arange(wide) + (i + 0.5) / POINTS) / wide - 1
            t = (2 * (np.arange(tall) + (j + 0.5) / POINTS) / tall - 1)[:, np.newaxis]
            rr = s * s + t * t
            density = 4 / (1 + rr) ** 2 if chart is Chart.PARABOLOID else 4.0
            total += np.where(rr <= 1, density, 0.0)
    return total * (4 / (wide * tall * POINTS**2))


@lru_cache(maxsize=8)
def sphere(chart: Chart, height: int, width: int) -> tuple[Array, Array]:
    """Directions (height, width, 3) and solid angles (height, width) of an image's pixels. Both are 0 where a pixel
    shows nothing; a direction is that of its centre, or on a rim of the place within it next to that."""
    across, down = LAYOUT[chart]
    tall, wide = height // down, width // across
    charts = Sphere(chart)
    row, column = np.mgrid[0:height, 0:width]
    face = row // tall * across + column // wide
    s, t = 2 * (column % wide + 0.5) / wide - 1, 2 * (row % tall + 0.5) / tall - 1
    if chart not in FACES and chart is not Chart.LATLONG:
        r = np.hypot(s, t)
        inward = np.where(r > 1, 1 / np.where(r > 1, r, 1.0), 1.0)
        s, t = s * inward, t * inward
        over = s * s + t * t > 1
        s, t = np.where(over, s * (1 - 1e-15), s), np.where(over, t * (1 - 1e-15), t)
    d = np.stack(np.broadcast_arrays(*charts.direction(s, t, face)), axis=-1) * np.diag(TO_CHART)
    shows = charts.shows(face)
    d = np.where(shows[..., None], d, 0.0)
    angle = np.where(shows, np.tile(_cell(chart, tall, wide), (down, across)), 0.0)
    angle *= 4 * math.pi / angle.sum()
    for each in (d, angle):
        each.flags.writeable = False
    return d, angle


def shown(chart: Chart, width: int, height: int) -> tuple[Array, Array]:
    """Directions of an image's pixels, and which of them show any."""
    direction, angle = sphere(chart, height, width)
    return direction, angle > 0


def texels(pixels: Array, chart: Chart) -> Texels:
    """Every pixel that shows anything."""
    direction, angle = sphere(chart, *pixels.shape[:2])
    shown = angle > 0
    return Texels(pixels[shown], direction[shown], angle[shown])


def step_of(chart: Chart, height: int, width: int, most: float) -> int:
    """Sides of the blocks that leave no more than `most`, or one for each chart."""
    count, (across, down) = height * width, LAYOUT[chart]
    tall, wide = height // down, width // across
    step = max(1, math.isqrt(math.ceil(count / most) - 1) + 1) if count > most else 1
    while step < max(tall, wide) and across * down * -(-tall // step) * -(-wide // step) > most:
        step += 1
    return step


def reduced(pixels: Array, chart: Chart, most: float) -> Texels:
    """Blocks of texels, no more than `most` of them but for one in every chart."""
    height, width, channels = pixels.shape
    step = step_of(chart, height, width, most)
    if step == 1:
        return texels(pixels, chart)
    direction, angle = sphere(chart, height, width)
    across, down = LAYOUT[chart]
    tall, wide = height // down, width // across
    rows = np.concatenate([first * tall + np.arange(0, tall, step) for first in range(down)])
    columns = np.concatenate([first * wide + np.arange(0, wide, step) for first in range(across)])

    def summed(each: Array) -> Array:
        made: Array = np.add.reduceat(np.add.reduceat(each, rows, axis=0), columns, axis=1)
        return made

    weight = angle[..., np.newaxis]
    total = summed(angle)
    shown = total > 0
    light = summed(np.where(weight > 0, pixels * weight, 0.0)).reshape(*total.shape, channels)[shown]
    mean = summed(direction * weight)[shown]
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    # Blocks that go all the way around have no direction of their own: that of their first texel.
    first = direction[rows][:, columns][shown]
    mean = np.where(length > 1e-9, mean / np.where(length > 1e-9, length, 1.0), first)
    return Texels((light / total[shown][:, np.newaxis]).astype(pixels.dtype), mean, total[shown])


def default_size(chart: Chart, width: int | None, height: int | None, side: int) -> tuple[int, int]:
    """Width and height of an image; where one is not given, by the other and the chart's proportions, where neither is,
    with charts of about `side` pixels."""
    across, down = SHAPE[chart]
    if width and not height:
        return width, max(1, width * down // across)
    if height and not width:
        return max(1, height * across // down), height
    return width or side * across, height or side * down
