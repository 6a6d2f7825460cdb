"""Following streamlines on a grid, in NumPy: what the definition and the NumPy methods of the family share.

A vector field lies on pixels whose centres are at +0.5. Between four centres its components are interpolated
bilinearly, in the half pixel along the border they continue as they are. A neighbour whose weight is zero does not
count: a NaN touches nothing but points it has a part in.

Positions are kept relative to the pixel that a line started from, so that rounding does not grow with the image.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from lichen.memory import Array

Index = npt.NDArray[np.int64]
Points = tuple[Array, Array]
"""Columns and rows."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Samples of shape (height x width, channels) in rows."""

    samples: Array
    height: int
    width: int

    @classmethod
    def of(cls, pixels: Array) -> Grid:
        height, width, channels = pixels.shape
        return cls(pixels.reshape(height * width, channels), height, width)

    def at(self, cells: tuple[Index, Index], x: Array, y: Array) -> Array:
        """Bilinear samples (n, channels) at the distances `x`, `y` from the centres of `cells` (columns, rows)."""
        columns, rows = cells
        x = _bounded(x, -columns, self.width - 1 - columns)
        y = _bounded(y, -rows, self.height - 1 - rows)
        left, top = np.floor(x), np.floor(y)
        x, y = (x - left)[:, None], (y - top)[:, None]
        corner = (rows + top.astype(np.int64)) * self.width + columns + left.astype(np.int64)
        right = (x[:, 0] > 0).astype(np.int64)
        below = corner + np.where(y[:, 0] > 0, self.width, 0)
        take = self.samples.take
        a, c = take(corner, axis=0), take(below, axis=0)
        upper = a + x * (take(corner + right, axis=0) - a)
        lower = c + x * (take(below + right, axis=0) - c)
        mixed: Array = upper + y * (lower - upper)
        return mixed


def _bounded(x: Array, low: Index, high: Index) -> Array:
    """`x` within [low, high]; NaN becomes a number, so that every point has a cell."""
    inside = np.minimum(np.maximum(x, low), high).astype(x.dtype)
    return np.where(np.isnan(inside), x.dtype.type(0), inside)


def texture_cells(cells: Index, size: int, texture_size: int, dtype: npt.DTypeLike) -> tuple[Index, Array]:
    """Where pixel centres lie along one side of a texture that covers the same rectangle: texel, and the rest.

    >>> texture_cells(np.array([0, 1]), 2, 4, np.float64)
    (array([0, 2]), array([0.5, 0.5]))
    """
    part, whole = (2 * cells + 1) * texture_size - size, 2 * size
    texel = part // whole
    return texel, ((part - texel * whole) / whole).astype(dtype)


def displacements(vectors: Array, step: float, arc: bool) -> Array:
    """Steps along `vectors` (n, 2): of length |step| where `arc`, else step x vector. NaN where there is no direction.

    The larger component is brought near 1 by an exact power of two first: no square overflows or vanishes.
    """
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    moves = (largest > 0) & np.isfinite(largest)
    if arc:
        scaled = np.ldexp(vectors, -np.frexp(largest)[1])
        length = np.sqrt(np.square(scaled).sum(axis=1, keepdims=True))
        stepped = scaled * (vectors.dtype.type(step) / length)
    else:
        stepped = vectors * vectors.dtype.type(step)
    going: Array = np.where(moves, stepped, vectors.dtype.type(np.nan))
    return going


def border_share(field: Grid, cells: tuple[Index, Index], at: Array, moves: Array) -> Array:
    """How much of each step lies inside the field: 1, or less for a step that crosses its border."""
    share = np.ones(len(at), at.dtype)
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


Slope = Callable[[Array], Array]
"""Displacements (n, 2) of a whole step from the positions (n, 2)."""


Advance = Callable[[Slope, Array, Array], Array]
"""Displacements of one step from the slope, the positions, and the displacements that the slope has there."""


def euler(slope: Slope, at: Array, first: Array) -> Array:
    return first


def runge_kutta_2(slope: Slope, at: Array, first: Array) -> Array:
    second = slope(at + first / 2)
    return unopposed(first, second, second)


def runge_kutta_4(slope: Slope, at: Array, first: Array) -> Array:
    second = slope(at + first / 2)
    third = slope(at + second / 2)
    fourth = slope(at + third)
    return unopposed(first, (first + 2 * second + 2 * third + fourth) / 6, second, third, fourth)


def unopposed(first: Array, moves: Array, *stages: Array) -> Array:
    """`moves`, but Euler's step where a later stage opposes it: a critical point lies ahead, and stages on both of its
    sides would cancel and leave the line standing short of it. NaN where Euler's step is."""
    opposed: Array = np.isnan(first[:, :1])
    for stage in stages:
        opposed = opposed | ((stage * first).sum(axis=1, keepdims=True) < 0)
    chosen: Array = np.where(opposed, first, moves)
    return chosen


class Lines:
    """All lines of an image, followed at once in blocks. The arithmetic is of the vectors' precision.

    `weights` are the kernel's values at the ends of equal steps that together are `length` long, each way.
    """

    block: ClassVar[int] = 1 << 14
    """Pixels followed together: what stays in cache."""

    def __init__(self, vectors: Array, texture: Array, weights: Array, length: float, arc: bool) -> None:
        self.field, self.texture = Grid.of(vectors), Grid.of(texture.astype(vectors.dtype))
        self.dtype, self.arc = vectors.dtype, arc
        self.weights = weights.astype(self.dtype)
        self.count = len(weights) - 1
        self.step = length / max(self.count, 1)

    def convolve(self, advance: Advance) -> Array:
        """The result by the Runge-Kutta method `advance`, (height, width, channels)."""
        pixels = np.arange(self.field.height * self.field.width)
        blocks = np.split(pixels, range(self.block, len(pixels), self.block))
        with np.errstate(all="ignore"):  # NaN and infinity are values here
            rows = [self._convolve(block, advance) for block in blocks]
        return np.concatenate(rows).reshape(self.field.height, self.field.width, -1)

    def _convolve(self, pixels: Index, advance: Advance) -> Array:
        field, k = self.field, self.weights
        cells = (pixels % field.width, pixels // field.width)
        columns, x = texture_cells(cells[0], field.width, self.texture.width, self.dtype)
        rows, y = texture_cells(cells[1], field.height, self.texture.height, self.dtype)
        scale = np.array([self.texture.width / field.width, self.texture.height / field.height], self.dtype)
        own = self.texture.at((columns, rows), x, y)
        total, weight = np.zeros_like(own), np.zeros_like(own[:, :1])
        for sign in (1.0, -1.0):
            step = sign * self.step

            def slope(at: Array, step: float = step) -> Array:
                return displacements(field.at(cells, at[:, 0], at[:, 1]), step, self.arc)

            at, alive = np.zeros((len(pixels), 2), self.dtype), np.ones(len(pixels), bool)
            last, here = own - own, field.samples[pixels]
            for j in range(self.count):
                moves = advance(slope, at, displacements(here, step, self.arc))
                there = field.at(cells, at[:, 0] + moves[:, 0], at[:, 1] + moves[:, 1])
                share = np.minimum(border_share(field, cells, at, moves), critical_share(here, there, moves, sign))
                share = np.where(alive & (share > 0), share, 0)[:, None].astype(self.dtype)
                at = np.where(share > 0, at + share * moves, at)
                sample = self.texture.at((columns, rows), x + scale[0] * at[:, 0], y + scale[1] * at[:, 1]) - own
                end = k[j] + share * (k[j + 1] - k[j])
                total += np.where(share > 0, share / 2 * (k[j] * last + end * sample), 0)
                weight += share / 2 * (k[j] + end)
                alive, here, last = share[:, 0] == 1, there, sample
                if not alive.any():
                    break
        return np.where(weight > 0, own + total / weight, own)

    def walk(self) -> Array:
        """The result by Euler's steps through the vectors of whole pixels, reading whole texels."""
        field, texture, k = self.field, self.texture, trapezoid(self.weights)
        size, texels = np.array([field.width, field.height]), np.array([texture.width, texture.height])
        start = np.stack(np.meshgrid(np.arange(field.width), np.arange(field.height)), axis=-1).reshape(-1, 2)
        same, scale = (size == texels).all(), (texels / size).astype(self.dtype)

        def cell(at: Array) -> Index:
            column, row = (start + np.floor(at).astype(np.int64)).T
            return np.asarray(row * field.width + column)

        def read(at: Array) -> Array:
            column, row = np.minimum(((start + at).astype(self.dtype) * scale).astype(np.int64), texels - 1).T
            return texture.samples.take(cell(at) if same else row * texture.width + column, axis=0)

        with np.errstate(all="ignore"):
            steps = displacements(field.samples, self.step, self.arc)
            steps = np.where(np.isnan(steps), 0, steps)
            origin = np.full(start.shape, 0.5, self.dtype)  # from the corner of the pixel
            own = read(origin)
            total, weight = np.zeros_like(own), np.full_like(own[:, :1], k[0])
            for sign in (1, -1):
                at, move = origin, steps
                alive = (move != 0).any(axis=1, keepdims=True)
                for j in range(1, self.count + 1):
                    ahead = at + sign * move
                    alive = alive & ((ahead >= -start) & (ahead < size - start)).all(axis=1, keepdims=True)
                    at = np.where(alive, ahead, at)
                    share = np.where(alive, k[j], 0).astype(self.dtype)
                    total += np.where(share != 0, share * (read(at) - own), 0)
                    weight += share
                    further = steps[cell(at)]
                    alive = alive & ((further * move).sum(axis=1, keepdims=True) > 0)
                    move = further
            mean: Array = own + total / weight
        return mean.reshape(field.height, field.width, -1)


def trapezoid(weights: Array) -> Array:
    """Weights of single samples on a line that goes on to both sides of the first of them."""
    halved = weights.copy()
    halved[1:][-1:] /= 2
    return halved
