"""Coordinates as whole cells and the fraction of one, so that far from the origin is as good as near it.

A pixel's coordinate is (first + i + 1/2) frequency + shift, all of them doubles. The sum and the product are taken
without error, as two doubles each (Knuth 1969, 4.2.2; Dekker, Numerische Mathematik 18, 1971), and split afterwards:
the fraction is right to 2^-52 wherever the coordinate is below `FARTHEST` cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.memory import Array

FARTHEST = 2.0**50
"""Cells from the origin; beyond it the two doubles no longer hold a fraction's last bits."""
_SPLITTER = 2.0**27 + 1


@dataclass(frozen=True, slots=True)
class Axis:
    """Coordinates along one axis: `cells` int64, `fractions` float64 in [0, 1], of one shape.

    `period` cells after one comes the same one again; 0 means never. Cells are then in [0, period).
    """

    cells: npt.NDArray[np.int64]
    fractions: npt.NDArray[np.float64]
    period: int = 0

    def wrapped(self, cells: Array) -> Array:
        """These cells as the hash is to see them."""
        return cells % self.period if self.period else cells

    def rows(self, start: int, stop: int) -> Axis:
        """A part, as a column of rows."""
        return Axis(self.cells[start:stop, None], self.fractions[start:stop, None], self.period)


def pixel_axis(first: float, count: int, frequency: float, shift: float = 0.0, period: int = 0) -> Axis:
    """The centres of `count` pixels, the first of which begins at `first` px."""
    index = np.arange(count) + 0.5
    high, low = _sum(np.float64(first), index)
    return _axis(high, low, frequency, shift, period)


def point_axis(at: float, frequency: float, shift: float = 0.0, period: int = 0) -> Axis:
    """One place, `at` `frequency` + `shift`; shape (1,)."""
    return _axis(np.array([at], np.float64), np.zeros(1), frequency, shift, period)


def _axis(high: Array, low: Array, frequency: float, shift: float, period: int) -> Axis:
    product, rest = _product(high, frequency)
    whole = np.floor(product)
    fractions = (product - whole) + (rest + low * frequency + shift)
    carried = np.floor(fractions)
    cells = whole.astype(np.int64) + carried.astype(np.int64)
    return Axis(cells % period if period else cells, fractions - carried, period)


def _sum(a: np.float64, b: Array) -> tuple[Array, Array]:
    """a + b as the nearest double and the rest."""
    total = np.asarray(a + b)
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _product(a: Array, b: float) -> tuple[Array, Array]:
    """a b as the nearest double and the rest."""
    product = a * b
    a_high, b_high = _upper(a), float(_upper(np.float64(b)))
    a_low, b_low = a - a_high, b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _upper(a: npt.ArrayLike) -> Array:
    """The upper 26 bits."""
    scaled = np.multiply(a, _SPLITTER)
    return np.asarray(scaled - (scaled - a))
