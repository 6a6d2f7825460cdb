"""Curves through points: cubic pieces that keep the points' order, and tables of them with a proved error.

Theory. Between two points the curve is the cubic with given values and slopes at both ends (Hermite). It is monotone
where the slopes are at most three times the chord's; Fritsch and Butland take, at an inner point, the weighted harmonic
mean of the chords beside it, and 0 where these differ in sign, so that the curve never leaves its points' range. The
ends' slopes come from the three-point difference, held to the same limits. With two points, or where straight pieces
are asked for, the curve is the polygon.

The table. Linear interpolation on a uniform grid of spacing h. Over one cell the curve differs from its chord by at
most h^2/8 sup |f''|, and by at most h/4 times the integral of |f''|, which is the smaller where a piece is narrower
than a cell. Every kink inside the cell, where the slope jumps by j, adds h j / 4. All are taken over the cells they
fall in, so the bound needs no sampling: f'' is linear on each piece, hence largest at a piece's ends. And as neither
curve nor chord leaves the range of the points, they never differ by more than that.

Sources: F. N. Fritsch and J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM J.
Sci. Stat. Comput. 5(2), 1984; C. Moler, Numerical Computing with MATLAB, 2004, section 3.6 (the ends).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array, aligned
from lichen.once import once
from lichen.operation import ROUNDING

Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Pieces:
    """`knots` (n,), and `coefficients` (n - 1, 4): y = c0 + t (c1 + t (c2 + t c3)), t = x - knot. All float64."""

    knots: Array
    coefficients: Array
    last: tuple[float, float]
    """value and slope at the last knot"""

    @property
    def first(self) -> tuple[float, float]:
        return float(self.coefficients[0, 0]), float(self.coefficients[0, 1])

    @once
    def range(self) -> tuple[float, float]:
        values = np.append(self.coefficients[:, 0], self.last[0])
        return float(values.min()), float(values.max())

    def __call__(self, x: Array) -> Array:
        """The curve for x within the knots, in the precision of x."""
        at = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.coefficients) - 1)
        c = self.coefficients[at].astype(x.dtype, copy=False)
        t = x - self.knots[at].astype(x.dtype, copy=False)
        value: Array = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
        return value

    @once
    def steepest(self) -> float:
        """The largest slope: of a quadratic, at an end or at its turning point."""
        _, b, c, d = self.coefficients.T
        width = np.diff(self.knots)
        with np.errstate(all="ignore"):
            turn = np.where(d != 0, -c / (3 * d), 0.0)
        turn = np.clip(np.nan_to_num(turn), 0, width)
        slopes = [np.abs(b + t * (2 * c + 3 * d * t)) for t in (np.zeros_like(width), width, turn)]
        return max(float(np.max(slopes)), abs(self.last[1]))

    @once
    def terms(self) -> float:
        """The largest sum of the magnitudes of a piece's four terms: what roundings are relative to."""
        width = np.diff(self.knots)[:, np.newaxis]
        return float((np.abs(self.coefficients) * width ** np.arange(4)).sum(axis=1).max())


def _slopes(width: Array, chord: Array) -> Array:
    """Fritsch and Butland's slopes at the points."""
    slopes = np.empty(len(width) + 1)
    before, after = chord[:-1], chord[1:]
    w1, w2 = 2 * width[1:] + width[:-1], width[1:] + 2 * width[:-1]
    monotone = np.sign(before) * np.sign(after) > 0
    with np.errstate(all="ignore"):
        harmonic = (w1 + w2) / (w1 / before + w2 / after)
    slopes[1:-1] = np.where(monotone, harmonic, 0.0)
    slopes[0] = _end(width[0], width[1], chord[0], chord[1])
    slopes[-1] = _end(width[-1], width[-2], chord[-1], chord[-2])
    return slopes


def _end(near: float, far: float, chord: float, next_chord: float) -> float:
    """The slope at an end, from the chords of the two pieces nearest to it."""
    slope = ((2 * near + far) * chord - near * next_chord) / (near + far)
    if np.sign(slope) != np.sign(chord):
        return 0.0
    if np.sign(chord) != np.sign(next_chord) and abs(slope) > 3 * abs(chord):
        return 3 * chord
    return slope


@lru_cache(maxsize=64)
def through(points: Points, straight: bool) -> Pieces:
    """The curve through the points, whose x ascend."""
    x, y = np.array(points, dtype=np.float64).T
    width, chord = np.diff(x), np.diff(y) / np.diff(x)
    if straight or len(points) == 2:
        zero = np.zeros_like(chord)
        return Pieces(x, np.stack([y[:-1], chord, zero, zero], 1), (float(y[-1]), float(chord[-1])))
    slope = _slopes(width, chord)
    c = (3 * chord - 2 * slope[:-1] - slope[1:]) / width
    d = (slope[:-1] - 2 * chord + slope[1:]) / width**2
    return Pieces(x, np.stack([y[:-1], slope[:-1], c, d], 1), (float(y[-1]), float(slope[-1])))


@dataclass(frozen=True, eq=False)
class Grid:
    """`nodes` (cells + 1, 2), float32: value and rise to the next node; the last rise is 0."""

    nodes: Array
    bound: float
    rounding: float


@lru_cache(maxsize=64)
def tabulated(points: Points, straight: bool, cells: int) -> Grid:
    """The curve at the ends of `cells` equal cells, and the proved distance of the chords to it."""
    pieces = through(points, straight)
    edges = np.linspace(pieces.knots[0], pieces.knots[-1], cells + 1)
    values = pieces(edges)
    nodes = np.zeros((cells + 1, 2), dtype=np.float32)
    nodes[:, 0] = values
    nodes[:-1, 1] = np.diff(values)
    nodes = aligned(nodes)
    nodes.flags.writeable = False
    # The position is rounded thrice, which the largest rise of a cell turns into value; value and rise once each.
    position = 4 * ROUNDING * cells * float(np.abs(np.diff(values)).max())
    return Grid(nodes, _distance(pieces, cells), position + 4 * ROUNDING * float(np.abs(values).max()))


def _distance(pieces: Pieces, cells: int) -> float:
    """The bound of the module's docstring, over every cell."""
    span = pieces.knots[-1] - pieces.knots[0]
    h, width = span / cells, np.diff(pieces.knots)
    _, b, c, d = pieces.coefficients.T
    bend = np.maximum(np.abs(2 * c), np.abs(2 * c + 6 * d * width))
    ends = b + width * (2 * c + 3 * d * width)
    jumps = np.abs(np.append(b[1:], pieces.last[1]) - ends)[:-1]
    first = np.floor((pieces.knots[:-1] - pieces.knots[0]) / h - 1e-9).astype(int).clip(0, cells - 1)
    last = np.floor((pieces.knots[1:] - pieces.knots[0]) / h + 1e-9).astype(int).clip(0, cells - 1)
    curved, turned, kinked = np.zeros((3, cells))
    for low, high, size, wide in zip(first, last, bend, width, strict=True):
        np.maximum(curved[low : high + 1], size, out=curved[low : high + 1])
        turned[low : high + 1] += size * min(wide, h)
    for low, high, jump in zip(last[:-1], first[1:], jumps, strict=True):
        kinked[min(low, high) : max(low, high) + 1] += jump
    low, high = pieces.range
    return min(float((np.minimum(h * h / 8 * curved, h / 4 * turned) + h / 4 * kinked).max()), high - low)
