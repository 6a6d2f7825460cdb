"""Where rays meet a terrain: heights over a grid of x and z, two triangles in each cell.

The lines between triangles are those of whole g, of whole h and of whole g + h, g and h being x and z counted in cells.
Along a ray the height above the ground is linear from one of these lines to the next, so a ray meets the ground where
its sign changes between two of them, and where in between is a quotient. The value at a line serves the pieces on both
sides of it, whichever triangle rounding takes it from: there are no cracks.

terrain.clh does the same operations in the same order.

Source: K. Musgrave, Grid tracing: fast ray tracing for height fields, 1988.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from lichen.memory import Array
from lichen.operations.scene.objects import Terrain

Triple: TypeAlias = tuple[Array, Array, Array]
SWELL = 2.0**-20
"""Of its height, by which the box around a terrain is higher, so that rays enter it above the ground."""


def encoded(each: Terrain, offset: int) -> tuple[list[float], Array]:
    """Its doubles after the kind, and its heights, which lie from `offset` on in those of all objects."""
    heights = np.array(each.heights, np.float64) + each.corner[1]
    rows, columns = heights.shape
    low, high = float(heights.min()), float(heights.max())
    slack = (high - low + 1) * SWELL
    cells = (each.size[0] / (columns - 1), each.size[1] / (rows - 1))
    numbers = [each.corner[0], each.corner[2], *cells, columns - 1, rows - 1, offset, low - slack, high + slack]
    return [float(number) for number in numbers], heights.ravel()


def meet(row: Array, extras: Array, origin: Triple, direction: Triple) -> tuple[Array, Triple]:
    """Where rays meet it, NaN where they do not, and its normal there."""
    x0, z0, wide, deep, across, down, offset, low, high = row[1:10]
    g0, h0 = (origin[0] - x0) / wide, (origin[2] - z0) / deep
    dg, dh = direction[0] / wide, direction[2] / deep
    enter, leave = np.zeros(g0.shape), np.full(g0.shape, np.inf)
    for o, d, first, last in ((g0, dg, 0.0, across), (h0, dh, 0.0, down), (origin[1], direction[1], low, high)):
        level, inside = d == 0, (o >= first) & (o <= last)
        a, b = (first - o) / d, (last - o) / d
        near = np.where(level, np.where(inside, -np.inf, np.inf), np.where(a < b, a, b))
        far = np.where(level, np.where(inside, np.inf, -np.inf), np.where(a < b, b, a))
        enter, leave = np.where(near > enter, near, enter), np.where(far < leave, far, leave)
    ground = _Ground(extras[int(offset) :], int(across), int(down))
    lines = [(g0, dg), (h0, dh), (g0 + h0, dg + dh)]
    coming = []
    for o, d in lines:
        at = o + enter * d
        coming.append(np.where(d > 0, np.floor(at) + 1, np.ceil(at) - 1))
    t, found, middle = enter, np.full(g0.shape, np.nan), np.full(g0.shape, np.nan)
    live = enter < leave
    above = (origin[1] + t * direction[1]) - ground.height(g0 + t * dg, h0 + t * dh)
    for _ in range(2 * int(across + down) + 4):
        if not live.any():
            break
        crossing = [np.where(d == 0, np.inf, (line - o) / d) for line, (o, d) in zip(coming, lines, strict=True)]
        following = leave
        for each in crossing:
            following = np.where(each < following, each, following)
        for k, (each, (_, d)) in enumerate(zip(crossing, lines, strict=True)):
            coming[k] = np.where(each <= following, coming[k] + np.where(d > 0, 1.0, -1.0), coming[k])
        following = np.where(following > t, following, t)
        beyond = (origin[1] + following * direction[1]) - ground.height(g0 + following * dg, h0 + following * dh)
        met = live & ((above > 0) != (beyond > 0))
        found = np.where(met, t + (following - t) * (above / (above - beyond)), found)
        middle = np.where(met, (t + following) * 0.5, middle)
        live = live & ~met & (following < leave)
        t, above = following, beyond
    along, aside = ground.slopes(g0 + middle * dg, h0 + middle * dh)
    a, c = -(along / wide), -(aside / deep)
    size = np.sqrt((a * a + 1.0) + c * c)
    return found, (a / size, 1.0 / size, c / size)


class _Ground:
    """Heights over a grid of so many cells."""

    def __init__(self, heights: Array, across: int, down: int) -> None:
        self._heights, self._across, self._down = heights, across, down

    def _corners(self, g: Array, h: Array) -> tuple[Array, ...]:
        """Place within a cell, and the heights of its corners."""
        i, j = (
            np.where(each < last, np.where(each > 0, np.floor(each), 0.0), last - 1.0)
            for each, last in ((g, float(self._across)), (h, float(self._down)))
        )
        at = (np.nan_to_num(j) * (self._across + 1) + np.nan_to_num(i)).astype(np.int64)
        four = [self._heights[at + step] for step in (0, 1, self._across + 1, self._across + 2)]
        return g - i, h - j, *four

    def height(self, g: Array, h: Array) -> Array:
        u, v, h00, h10, h01, h11 = self._corners(g, h)
        near = (h00 + u * (h10 - h00)) + v * (h01 - h00)
        far = (h11 + (1 - u) * (h01 - h11)) + (1 - v) * (h10 - h11)
        made: Array = np.where(u + v < 1, near, far)
        return made

    def slopes(self, g: Array, h: Array) -> tuple[Array, Array]:
        """Changes of the height for a cell along x and z."""
        u, v, h00, h10, h01, h11 = self._corners(g, h)
        near = u + v < 1
        return np.where(near, h10 - h00, h11 - h01), np.where(near, h01 - h00, h11 - h10)
