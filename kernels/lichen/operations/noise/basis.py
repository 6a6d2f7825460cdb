"""What a basis is to the machinery that sums octaves of it: a noise on a lattice whose rows run along x.

A pixel's row meets the lattice in a few *lines*: rows of lattice points beside it, one for each of the nearest rows
along y in each of the nearest slices along z and w. A line has a hash key and its distances from the pixel's row, so
what is left to do for every pixel is to hash the nearest points along x and to weigh what they say."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, Generic, TypeVar

import numpy as np

from lichen.hashing import Words
from lichen.memory import Array
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.octaves import Key, Lattice, chained
from lichen.operations.noise.parameters import LatticeParameters

P = TypeVar("P", bound=LatticeParameters)


@dataclass(frozen=True, slots=True)
class Slice:
    """A plane of lattice points at a constant z and w."""

    key: Key
    z: float
    """from it to the picture, in cells"""
    w: float
    weight: float = 1.0
    """of all its points, where the basis interpolates"""
    centred: bool = False
    """whether its points lie half a cell off along x and y"""
    table: Array | None = None
    """numbers of its cells, (rows, columns), that repeat, where the basis has no hash say them"""


@dataclass(frozen=True, slots=True)
class Place:
    """Pixels on the lattice of one octave: whole cells (int64) and fractions, x as a row and y as a column, or both of
    the picture's shape where places have been moved."""

    x_cells: Array
    x: Array
    y_cells: Array
    y: Array
    x_period: int
    y_period: int
    slices: tuple[Slice, ...]

    def row(self, part: Slice, offset: int | Array) -> tuple[Words, Words]:
        """The key of the line of a slice, `offset` rows below the pixel's own cell."""
        cells = self.y_cells + offset
        return chained(part.key, cells % self.y_period if self.y_period else cells)

    def column(self, offset: int | Array) -> Array:
        """Numbers of the cells `offset` to the right."""
        cells = self.x_cells + offset
        return cells % self.x_period if self.x_period else cells


Values = tuple[Array, Array | None, Array | None]
"""A noise and its derivatives along x and y, per cell; None where they are not asked for."""


@dataclass(frozen=True)
class Basis(Generic[P]):
    """A noise in [-1, 1] on a lattice."""

    lattice: Callable[[P], Lattice]
    slices: Callable[[P, Key, tuple[Axis, ...]], tuple[Slice, ...]]
    evaluate: Callable[[Place, P, bool], Values]
    """the definition with NumPy, in the precision of the fractions"""
    mean: Callable[[P], tuple[float, float]]
    """of the noise and of its magnitude, as measured"""
    slope: Callable[[P], float]
    """bound of the derivative along any direction, per cell"""
    rounding: Callable[[P], float]
    """bound of the error of the noise in units of the roundoff"""
    slope_rounding: Callable[[P], float | None]
    """the same of the derivative along x or y; None where it jumps, so that roundings can turn it over"""
    work: Callable[[P], float]
    """of one octave at one pixel, in gradients hashed and weighed"""
    defines: Callable[[P], dict[str, int]]
    numbers: Callable[[P], tuple[float, ...]] = lambda p: (0.0,)
    """that its kernel takes"""


def corners(key: Key, axes: tuple[Axis, ...], reach: tuple[int, ...] = (0, 1)) -> Iterator[tuple[Key, list[float]]]:
    """Slices through the cells around z and w, `reach` cells from their own: the key and the distances of each."""
    for offsets in product(reach, repeat=len(axes) - 2):
        found = (np.atleast_1d(np.uint32(key[0])), np.atleast_1d(np.uint32(key[1])))
        away: list[float] = []
        for axis, offset in reversed(list(zip(axes[2:], offsets, strict=True))):
            found = chained((found[0], found[1]), axis.wrapped(axis.cells + offset))
            away.insert(0, float(axis.fractions[0]) - offset)
        yield (int(found[0][0]), int(found[1][0])), away


def padded(away: list[float]) -> dict[str, Any]:
    """Distances along z and w by name; 0 where there is no such axis."""
    return {"z": away[0] if away else 0.0, "w": away[1] if len(away) > 1 else 0.0}
