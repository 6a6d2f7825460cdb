"""Following streamlines on a grid, in NumPy: what the definition and the NumPy methods of the family share.

A vector field lies on pixels whose centres are at +0.5. Between the centres its components are interpolated, in the
half pixel along the border they continue as they are, or as at the opposite border where the image wraps. A neighbour
whose weight is zero does not count: a NaN touches nothing but points it has a part in.

Positions are kept relative to the pixel that a line started from, so that rounding does not grow with the image.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operations.streamlines.parameters import Sampling

Index = npt.NDArray[np.int64]
Cells = tuple[Index, Index]
"""Columns and rows."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Samples of shape (height x width, channels) in rows."""

    samples: Array
    height: int
    width: int
    sampling: Sampling = Sampling.BILINEAR
    wraps: bool = False

    @classmethod
    def of(cls, pixels: Array, sampling: Sampling = Sampling.BILINEAR, wraps: bool = False) -> Grid:
        height, width, channels = pixels.shape
        return cls(pixels.reshape(height * width, channels), height, width, sampling, wraps)

    def at(self, cells: Cells, x: Array, y: Array) -> Array:
        """Samples (n, channels) at the distances `x`, `y` from the centres of `cells`."""
        left, x = self._split(x, cells[0], self.width)
        top, y = self._split(y, cells[1], self.height)
        if self.sampling is Sampling.NEAREST:
            return self.samples.take(self._row(top + (y >= 0.5)) + self._column(left + (x >= 0.5)), axis=0)
        x, y = x[:, None], y[:, None]
        if self.sampling is Sampling.CUBIC:
            return self._cubic(left, top, x, y)
        right, below = left + (x[:, 0] > 0), top + (y[:, 0] > 0)
        columns, rows = (self._column(left), self._column(right)), (self._row(top), self._row(below))
        a, b, c, d = (self.samples.take(row + column, axis=0) for row in rows for column in columns)
        upper, lower = a + x * (b - a), c + x * (d - c)
        mixed: Array = upper + y * (lower - upper)
        return mixed

    def _split(self, at: Array, cells: Index, size: int) -> tuple[Index, Array]:
        """Column (or row) left of the place, and how far it lies from there, in [0, 1)."""
        if self.wraps:
            at = at - size * np.floor((cells + at) / size).astype(at.dtype)
            low, high = -cells - 1, size - cells
        else:
            low, high = -cells, size - 1 - cells
        at = np.minimum(np.maximum(at, low), high).astype(at.dtype)
        at = np.where(np.isnan(at), at.dtype.type(0), at)  # every point has a cell
        whole = np.floor(at)
        return cells + whole.astype(np.int64), at - whole

    def _column(self, columns: Index) -> Index:
        return columns % self.width if self.wraps else np.minimum(np.maximum(columns, 0), self.width - 1)

    def _row(self, rows: Index) -> Index:
        inside = rows % self.height if self.wraps else np.minimum(np.maximum(rows, 0), self.height - 1)
        return inside * self.width

    def _cubic(self, left: Index, top: Index, x: Array, y: Array) -> Array:
        """Differences from one neighbour are weighted, so that equal neighbours give their value exactly."""
        across, down = catmull_rom(x), catmull_rom(y)
        columns, rows = [self._column(left + i) for i in range(-1, 3)], [self._row(top + i) for i in range(-1, 3)]
        base = self.samples.take(rows[1] + columns[1], axis=0)
        total = np.zeros_like(base)
        for v, row in zip(down, rows, strict=True):
            for u, column in zip(across, columns, strict=True):
                weight = u * v
                total += np.where(weight != 0, weight * (self.samples.take(row + column, axis=0) - base), 0)
        mixed: Array = base + total
        return mixed


def catmull_rom(t: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the samples at -1, 0, 1, 2 for the place t in [0, 1). They sum to 1; (0, 1, 0, 0) at 0.

    Source: E. Catmull and R. Rom, A class of local interpolating splines, 1974.
    """
    before = t * (t * (1 - t / 2) - 0.5)
    after, last = t * (t * (2 - 1.5 * t) + 0.5), t * t * (t / 2 - 0.5)
    return before, 1 - (before + after + last), after, last


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """A field, or two between which it changes: `now` at the line's start, and as much of `later` instead as time has
    gone on since, of `interval`."""

    now: Grid
    later: Grid | None = None
    time: float = 0.0
    interval: float = 1.0

    def at(self, cells: Cells, at: Array, s: Array | float) -> Array:
        """Vectors (n, 2) at the displacements `at` (n, 2) from the centres of `cells`, at `s` from the start."""
        here = self.now.at(cells, at[:, 0], at[:, 1])
        if self.later is None:
            return here
        share = np.clip(self.time + np.asarray(s) / self.interval, 0, 1).astype(at.dtype).reshape(-1, 1)
        mixed: Array = here + share * (self.later.at(cells, at[:, 0], at[:, 1]) - here)
        return mixed


def texture_cells(cells: Index, size: int, texture_size: int, dtype: npt.DTypeLike) -> tuple[Index, Array]:
    """Where pixel centres lie along one side of a texture that covers the same rectangle: texel, and the rest.

    >>> texture_cells(np.array([0, 1]), 2, 4, np.float64)
    (array([0, 2]), array([0.5, 0.5]))
    """
    part, whole = (2 * cells + 1) * texture_size - size, 2 * size
    texel = part // whole
    return texel, ((part - texel * whole) / whole).astype(dtype)


def displacements(vectors: Array, step: Array | float, arc: bool) -> Array:
    """Steps along `vectors` (n, 2): of length |step| where `arc`, else step x vector. NaN where there is no direction.

    The larger component is brought near 1 by an exact power of two first: no square overflows or vanishes.
    """
    step = np.asarray(step, vectors.dtype).reshape(-1, 1)
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    moves = (largest > 0) & np.isfinite(largest)
    if arc:
        scaled = np.ldexp(vectors, -np.frexp(largest)[1])
        length = np.sqrt(np.square(scaled).sum(axis=1, keepdims=True))
        stepped = scaled * (step / length)
    else:
        stepped = vectors * step
    going: Array = np.where(moves, stepped, vectors.dtype.type(np.nan))
    return going


def border_share(field: Grid, cells: Cells, at: Array, moves: Array) -> Array:
    """How much of each step lies inside the field: 1, or less for a step that crosses its border."""
    share = np.ones(len(at), at.dtype)
    if field.wraps:
        return share
    for axis, size in enumerate((field.width, field.height)):
        start, move = at[:, axis], moves[:, axis]
        low = (-0.5 - cells[axis]).astype(at.dtype)
        wall = np.minimum(np.maximum(start + move, low), low + size)
        share = np.minimum(share, np.where(wall != start + move, (wall - start) / move, 1))
    return share


def critical_share(here: Array, there: Array, moves: Array, sign: float) -> Array:
    """How much of each step lies before a critical point: less than 1 where the field at its end opposes the step.

    The component along the step, taken as linear, is zero at the critical point. 0 for a step without direction.
    """
    moves = moves / 16  # the products stay finite
    before, after = np.abs((here * moves).sum(axis=1)), sign * (there * moves).sum(axis=1)
    share = np.where(after < 0, before / (before - after), 1)
    return np.where(np.isnan(moves).any(axis=1), 0, share).astype(moves.dtype)


Slope = Callable[[Array, float], Array]
"""Displacements (n, 2) of a whole step from the positions (n, 2), and the part of the step that has been made."""


Advance = Callable[[Slope, Array, Array], Array]
"""Displacements of one step from the slope, the positions, and the displacements that the slope has there."""


def euler(slope: Slope, at: Array, first: Array) -> Array:
    return first


def runge_kutta_2(slope: Slope, at: Array, first: Array) -> Array:
    second = slope(at + first / 2, 0.5)
    return unopposed(first, second, second)


def runge_kutta_4(slope: Slope, at: Array, first: Array) -> Array:
    second = slope(at + first / 2, 0.5)
    third = slope(at + second / 2, 0.5)
    fourth = slope(at + third, 1.0)
    return unopposed(first, (first + 2 * second + 2 * third + fourth) / 6, second, third, fourth)


def unopposed(first: Array, moves: Array, *stages: Array) -> Array:
    """`moves`, but Euler's step where a later stage opposes it: a critical point lies ahead, and stages on both of its
    sides would cancel and leave the line standing short of it. NaN where Euler's step is."""
    opposed: Array = np.isnan(first[:, :1])
    for stage in stages:
        opposed = opposed | ((stage * first).sum(axis=1, keepdims=True) < 0)
    chosen: Array = np.where(opposed, first, moves)
    return chosen
