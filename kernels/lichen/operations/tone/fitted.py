"""Increasing functions as four polynomials, chosen by the bits of a float: the quickest way through a transfer curve.

Theory. A square root or two make a function of light that starts steeply nearly straight. Of the root u the place
t = factor u + added is taken. Its leading bits, those of the exponent and perhaps one of the fraction, are the number
of one of four pieces, each twice or half as long again as the one before: so they are short where a curve bends most,
near its start, and no search is made. On every piece the function is a polynomial in t, through Chebyshev's points,
which errs at most a few times as much as the best one.

Where a function starts with a toe, the pieces begin at its end and the toe is computed apart.

What it costs. A vector of eight picks its numbers from four with one instruction of half a cycle: a polynomial of
degree five costs six of these and five fused steps, where a power by its logarithm takes three times as many.

The error stated is that of the rounded polynomials at POINTS places of each piece, which resolves every wave of the
difference to a thousandth, with what rounding adds there in float32 without fused steps, twice over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lichen.memory import Array

PIECES = 4
POINTS = 1024
SLACK = 2.0**-12
"""What the last piece reaches beyond the top, of it."""
MARGIN = 2.0**-18
"""How far the ends stay from the edges of pieces, beyond which rounding must not take a place."""
MANTISSA = 23
F = np.float32


@dataclass(frozen=True, slots=True)
class Layout:
    """How a place is found, by trial what errs least for a function."""

    roots: int
    bits: int
    """of the fraction that count"""


@dataclass(frozen=True, eq=False)
class Fit:
    """The function on [start, top]. `numbers`: factor, added, then PIECES numbers for each power of t, in the order of
    the last two bits of a piece's number, the lowest power first."""

    roots: int
    shift: int
    """the bits of a place that do not count for its piece's number"""
    degree: int
    top: float
    numbers: tuple[float, ...]
    error: float
    """of the polynomials"""
    rounding: float
    """what float32 adds"""
    relative: float
    """both, of the function's value"""
    relative_rounding: float

    @property
    def rounded(self) -> Fit:
        """As if the polynomials were the function."""
        return replace(self, error=0.0, relative=self.relative_rounding)

    def __call__(self, x: Array) -> Array:
        """In float32; beyond [start, top] anything."""
        u = x
        for _ in range(self.roots):
            u = np.sqrt(u)
        t = u * F(self.numbers[0]) + F(self.numbers[1])
        return _polynomial(t, self.table, self.shift)

    @property
    def table(self) -> Array:
        return np.array(self.numbers[2:], F).reshape(self.degree + 1, PIECES)


def _polynomial(t: Array, table: Array, shift: int) -> Array:
    """Of places in float32, in the precision of the table."""
    at = (t.view(np.int32) >> shift) & (PIECES - 1)
    made: Array = table[-1].take(at)
    for row in table[-2::-1]:
        made = made * t + row.take(at)
    return made


def fit(function: Callable[[Array], Array], top: float, degree: int, layout: Layout, start: float = 0.0) -> Fit:
    """`function` is increasing and takes float64 in [start, top]."""
    roots, shift = layout.roots, MANTISSA - layout.bits
    one = int(np.float32(1).view(np.int32)) >> shift
    edges = (np.arange(one, one + PIECES + 1, dtype=np.int32) << shift).view(F).astype(np.float64)
    power = 0.5**roots
    low, high = start**power, (top * (1 + SLACK)) ** power
    first, last = 1 + MARGIN, edges[-1] * (1 - MARGIN)
    factor = float(F((last - first) / (high - low)))
    plus = float(F(first - factor * low))

    def value(t: Array) -> Array:
        return function(np.maximum((t - plus) / factor, low) ** (2**roots))

    table, places = np.zeros((degree + 1, PIECES)), []
    s = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    for number in range(PIECES):
        left, right = edges[number], edges[number + 1]
        middle, half = (left + right) / 2, (right - left) / 2
        near = np.linalg.solve(np.vander(s, increasing=True), value(middle + half * s))
        line, made = np.polynomial.Polynomial([-middle / half, 1 / half]), np.polynomial.Polynomial([0.0])
        for each in near[::-1]:
            made = made * line + each
        table[:, (one + number) & (PIECES - 1)] = made.coef[: degree + 1]
        places.append(np.linspace(left, np.nextafter(right, left), POINTS))
    rounded = table.astype(F)
    x = (np.clip((np.concatenate(places) - plus) / factor, low, high) ** (2**roots)).astype(F)
    x = x[x.astype(np.float64) >= start]
    reach = float(F(top * (1 + SLACK / 2)))
    shape = Fit(roots, shift, degree, reach, (factor, plus, *map(float, rounded.reshape(-1))), 0.0, 0.0, 0.0, 0.0)
    true, got = function(x.astype(np.float64)), shape(x)
    place = (x.astype(np.float64) ** power * factor + plus).astype(F)
    exact = _polynomial(place, rounded.astype(np.float64), shift)
    apart, off = 1.01 * np.abs(exact - true), 2 * np.abs(got - exact)
    with np.errstate(all="ignore"):
        both, own = (float(np.max(np.where(each > 0, each / np.abs(true), 0.0))) for each in (apart + off, off))
    return replace(shape, error=float(apart.max()), rounding=float(off.max()), relative=both, relative_rounding=own)
