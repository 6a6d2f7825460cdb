"""The path of a pixel to texture coordinates, and texture coordinates to texels: the definition of pixel_texture.

Written once for both precisions and in the order of pixel_texture.cl: in doubles both give the same bits, so that no
pixel falls on another texel on one backend than on the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operation import Border

MOST = 4
"""Channels that are read, coordinates that are made, and dimensions of a texture."""
FARTHEST = float(2**30)
"""Texels; coordinates beyond it, infinite ones too, count as this far."""
TAPS = {"nearest": 1, "linear": 2, "cubic": 4}


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """From channels to coordinates. `tables_*` have shape (MOST, length), or are None; `matrix` is (MOST, MOST + 1)."""

    scale: Array
    bias: Array
    before: Array | None
    matrix: Array
    after: Array | None
    projective: bool
    dimensions: int

    def coordinates(self, pixels: Array, dtype: npt.DTypeLike) -> tuple[Array, Array]:
        """Of pixels (n, channels): coordinates (n, dimensions), and whether each lies before the projector (n,)."""
        kind: Any = np.dtype(dtype).type
        read = min(pixels.shape[1], MOST)
        c = [pixels[:, k].astype(kind) if k < read else np.zeros(len(pixels), kind) for k in range(MOST)]
        c = [c[k] * kind(self.scale[k]) + kind(self.bias[k]) for k in range(MOST)]
        if self.before is not None:
            c = [looked_up(c[k], self.before[k].astype(kind)) for k in range(MOST)]
        made = []
        for row in self.matrix[: self.dimensions + self.projective]:
            total = np.full(len(pixels), kind(row[MOST]))
            for k in range(MOST):
                if row[k]:
                    total = total + kind(row[k]) * c[k]
            made.append(total)
        if self.after is not None:
            made = [looked_up(each, self.after[k].astype(kind)) for k, each in enumerate(made)]
        before = np.ones(len(pixels), bool)
        if self.projective:
            q = made.pop()
            before = ~(q <= 0)
            made = [each / np.where(q <= 0, kind(1), q) for each in made]
        return np.stack(made, axis=-1), before


def looked_up(x: Array, table: Array) -> Array:
    """Linear between a table's entries, the first at 0 and the last at 1, which go on beyond; NaN stays."""
    last = len(table) - 1
    place = np.clip(x, 0, 1) * x.dtype.type(last)
    cell = np.clip(np.nan_to_num(place).astype(np.int32), 0, max(last - 1, 0))
    part = place - cell.astype(x.dtype)
    made: Array = table[cell] + part * (table[np.minimum(cell + 1, last)] - table[cell])
    return made


def cubic(t: Array) -> list[Array]:
    """Catmull and Rom's weights of the four texels around a place."""
    half = t.dtype.type(0.5)
    return [
        half * t * ((2 - t) * t - 1),
        half * (t * t * (3 * t - 5) + 2),
        half * t * ((4 - 3 * t) * t + 1),
        half * t * t * (t - 1),
    ]


def bordered(index: Array, size: int, border: Border) -> Array:
    """The texel that stands for each index of an axis; -1 for a constant."""
    if border is Border.CLAMP:
        return np.clip(index, 0, size - 1)
    if border is Border.WRAP:
        return index % size
    if border is Border.REFLECT:
        at = index % (2 * size)
        return np.where(at < size, at, 2 * size - 1 - at)
    if border is Border.REFLECT101:
        at = index % max(2 * size - 2, 1)
        return np.where(at < size, at, 2 * size - 2 - at)
    return np.where((index >= 0) & (index < size), index, -1)


@dataclass(frozen=True, slots=True, eq=False)
class Texture:
    """Texels (count, channels), x fastest, and the sizes of the axes."""

    texels: Array
    sizes: tuple[int, ...]
    borders: tuple[Border, ...]
    taps: int
    unit: bool
    background: float

    def sample(self, coordinates: Array, dtype: npt.DTypeLike) -> Array:
        """(n, channels) in `dtype`, from coordinates in either precision."""
        kind: Any = np.dtype(dtype).type
        axes = [self._axis(coordinates[:, k], k) for k in range(len(self.sizes))]
        total = np.zeros((len(coordinates), self.texels.shape[1]), kind)
        texels = self.texels.astype(kind, copy=False)
        strides = np.cumprod((1, *self.sizes[:-1]))
        # The first axis is the innermost, as in the kernel: products of weights from the last axis to the first.
        for choice in product(*(range(self.taps) for _ in self.sizes)):
            index = np.zeros(len(coordinates), np.int64)
            outside = np.zeros(len(coordinates), bool)
            weight = np.ones(len(coordinates), kind)
            for k in range(len(self.sizes) - 1, -1, -1):
                at, w = axes[k][choice[len(self.sizes) - 1 - k]]
                outside |= at < 0
                index += np.where(at < 0, 0, at) * strides[k]
                weight = weight * w.astype(kind)
            value = np.where(outside[:, None], kind(self.background), texels[index])
            total += np.where(weight[:, None] == 0, kind(0), weight[:, None] * value)
        total[np.isnan(coordinates).any(axis=1)] = np.nan
        return total

    def _axis(self, u: Array, k: int) -> list[tuple[Array, Array]]:
        """Index and weight of each tap along an axis."""
        size, real = self.sizes[k], u.dtype.type
        place = np.clip(np.nan_to_num(u * real(size) if self.unit else u, nan=0.0), -FARTHEST, FARTHEST)
        if self.taps == 1:
            return [(bordered(np.floor(place).astype(np.int64), size, self.borders[k]), np.ones_like(place))]
        place = place - real(0.5)
        left = np.floor(place)
        t = place - left
        first = left.astype(np.int64) - (self.taps // 2 - 1)
        weights = [1 - t, t] if self.taps == 2 else cubic(t)
        return [(bordered(first + j, size, self.borders[k]), w) for j, w in enumerate(weights)]
