"""One streamline at a time, in plain floating-point numbers: where each line decides how far the next one goes.

The same rules as those of `lichen.operations.streamlines.tracing.Tracer`, which follows many at once: the bilinear
field, classical Runge-Kutta steps of equal arc length, cut at the border and at critical points.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.memory import Array
from lichen.operations.streamlines.lines import Grid

Vector = tuple[float, float]
NOWHERE: Vector = (math.nan, math.nan)


class Walker:
    """Follows lines at most `length` px each way, in steps of `step` px."""

    def __init__(self, grid: Grid, length: float, step: float) -> None:
        self.width, self.height, self.length = grid.width, grid.height, length
        self._u = np.ascontiguousarray(grid.samples[:, 0]).data
        self._v = np.ascontiguousarray(grid.samples[:, 1]).data
        self._count = max(math.ceil(length / step), 1)

    def vector(self, x: float, y: float) -> Vector:
        """At a place relative to the centre of the first pixel. A neighbour of weight zero does not count."""
        x, y = min(max(x, 0.0), self.width - 1.0), min(max(y, 0.0), self.height - 1.0)
        column, row = int(x), int(y)
        x, y = x - column, y - row
        a = row * self.width + column
        b = a + (x > 0)
        c = a + (self.width if y > 0 else 0)
        d = c + (b - a)
        u, v = self._u, self._v
        upper_u, upper_v = u[a] + x * (u[b] - u[a]), v[a] + x * (v[b] - v[a])
        lower_u, lower_v = u[c] + x * (u[d] - u[c]), v[c] + x * (v[d] - v[c])
        return upper_u + y * (lower_u - upper_u), upper_v + y * (lower_v - upper_v)

    def half(self, seed: Vector, sign: float) -> Array:
        """The points (n, 2) of the line from a seed in pixels, centres at +0.5, which is the first of them."""
        step = sign * self.length / self._count
        x, y = seed[0] - 0.5, seed[1] - 0.5
        here, points = self.vector(x, y), [(x, y)]
        for _ in range(self._count):
            dx, dy = self._move(x, y, here, step)
            if not math.isfinite(dx):
                break
            there = self.vector(x + dx, y + dy)
            share = min(self._inside(x, y, dx, dy), _before_critical(here, there, dx, dy, sign))
            if not share > 0:
                break
            x, y, here = x + share * dx, y + share * dy, there
            points.append((x, y))
            if share < 1:
                break
        return np.array(points) + 0.5

    def _move(self, x: float, y: float, here: Vector, step: float) -> Vector:
        """Runge and Kutta's step of order 4; Euler's where a later stage opposes it or has no direction."""
        a = _along(here, step)
        if not math.isfinite(a[0]):
            return NOWHERE
        b = _along(self.vector(x + a[0] / 2, y + a[1] / 2), step)
        c = _along(self.vector(x + b[0] / 2, y + b[1] / 2), step) if math.isfinite(b[0]) else NOWHERE
        d = _along(self.vector(x + c[0], y + c[1]), step) if math.isfinite(c[0]) else NOWHERE
        if any(a[0] * each[0] + a[1] * each[1] < 0 for each in (b, c, d)):
            return a
        return (a[0] + 2 * b[0] + 2 * c[0] + d[0]) / 6, (a[1] + 2 * b[1] + 2 * c[1] + d[1]) / 6

    def _inside(self, x: float, y: float, dx: float, dy: float) -> float:
        share = 1.0
        for at, move, size in ((x, dx, self.width), (y, dy, self.height)):
            wall = min(max(at + move, -0.5), size - 0.5)
            if wall != at + move:
                share = min(share, (wall - at) / move)
        return share


def _along(vector: Vector, step: float) -> Vector:
    length = math.hypot(*vector)
    if not 0 < length < math.inf:
        return NOWHERE
    return vector[0] / length * step, vector[1] / length * step


def _before_critical(here: Vector, there: Vector, dx: float, dy: float, sign: float) -> float:
    after = sign * (there[0] * dx + there[1] * dy)
    if not after < 0:
        return 1.0
    before = abs(here[0] * dx + here[1] * dy)
    return before / (before - after)
