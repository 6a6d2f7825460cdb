"""Transfer curves of several pieces: one text for truth, both backends and the error they state.

Every piece of every curve is y = outer K(inner x + lift) + drop, with K one of a few functions: the number itself,
log, exp, a power, and those of two standards that are neither. That form is closed under inversion, so a decoding curve
follows from the encoding one: inner and outer change places, K becomes its inverse.

A curve holds for all x, piece by piece as x grows. Or it is mirrored about a centre (x0, y0): then the pieces are those
of the distance a = |x - x0|, and y is y0 give or take theirs.

Rounding. What K is taken of is computed as inner ((x + high) + low), high + low being lift / inner: x + high is exact
where it cancels, so the argument is right to a few roundings however small it is, and no condition number of its sum
enters. A factor in front of exp is brought to [1, 2) and the rest moved into the exponent, or the power would leave
float32's range before the result does. The error of a piece is that of its argument times K's slope, K's own, and the
roundings of the result; each is largest at an end of the stretch, where the terms are monotone.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operation import ROUNDING
from lichen.operations.tone.bodies import BODIES, Body

FLOAT_MAX = float(np.finfo(np.float32).max)
SMALLEST = float(np.finfo(np.float32).tiny)


@dataclass(frozen=True, slots=True)
class Piece:
    """y = outer K(inner x + lift) + drop from `start` on."""

    body: str
    inner: float = 1.0
    lift: float = 0.0
    outer: float = 1.0
    drop: float = 0.0
    exponent: float = 1.0
    start: float = -math.inf

    @property
    def kind(self) -> Body:
        return BODIES[self.body]

    def argument(self, x: Array) -> Array:
        return self.inner * x + self.lift

    def value(self, x: npt.ArrayLike) -> Array:
        made: Array = np.asarray(x, np.float64)
        with np.errstate(all="ignore"):
            if self.body == "constant":
                return np.where(np.isnan(made), made, self.drop)
            y: Array = self.outer * self.kind.value(self.argument(made), self.exponent) + self.drop
        return y

    def slope(self, x: float) -> float:
        with np.errstate(all="ignore"):
            rise = self.kind.slope(np.asarray(self.inner * x + self.lift), self.exponent)
        return abs(float(self.outer * self.inner * rise)) if self.body != "constant" else 0.0

    def error(self, x: Array, around: Array) -> float:
        """The largest difference of float32's results at any x, whose own distances from a centre are off by
        `around`."""
        if self.body == "constant":
            return ROUNDING * abs(self.drop)
        t = self.argument(x)
        apart = ROUNDING * (4 * np.abs(t) + 2 * abs(self.inner) * around)
        y = self.value(x)
        with np.errstate(all="ignore"):
            own = self.kind.own(t, self.exponent)
            # The argument is a few roundings from where the slope may be larger.
            slopes = np.abs(self.kind.slope(np.array([t - apart, t + apart]), self.exponent))
            if self.body == "power":
                own = own + SMALLEST**self.exponent  # what is smaller counts as 0
            steep = np.where(np.isfinite(slopes), slopes, 0.0).max(axis=0)
            bare = np.where(np.isfinite(y), np.abs(y - self.drop), FLOAT_MAX)
            made = abs(self.outer) * (apart * steep + own) + ROUNDING * (2 * bare + abs(self.drop) + 2 * np.abs(y))
        return float(np.fmax.reduce(made))

    def inverse(self, start: float) -> Piece:
        """The same piece the other way; one that is constant has none but a constant."""
        if self.body == "constant":
            raise ValueError("a constant piece has no inverse")
        return Piece(
            self.kind.inverse, 1 / self.outer, -self.drop / self.outer, 1 / self.inner, -self.lift / self.inner,
            1 / self.exponent, start,
        )  # fmt: skip


@dataclass(frozen=True)
class Piecewise:
    """A curve in one direction. `centre`: mirrored about it; `held`: light below 0 is none, which holds the input of
    an encoding curve and the result of a decoding one."""

    pieces: tuple[Piece, ...]
    centre: tuple[float, float] | None = None
    held: str = ""

    # ---------------------------------------------------------------------------------------------------- values

    def __call__(self, x: npt.ArrayLike) -> Array:
        """In float64, for any array."""
        given: Array = np.asarray(x, np.float64)
        if self.held == "input":
            given = np.where(given < 0, 0.0, given)
        away = given - self.centre[0] if self.centre else given
        a = np.abs(away) if self.centre else away
        y = self.pieces[0].value(a)
        for piece in self.pieces[1:]:
            y = np.where(a >= piece.start, piece.value(a), y)
        if self.centre:
            y = np.where(away < 0, -y, y) + self.centre[1]
        return np.where(y < 0, 0.0, y) if self.held == "result" else y

    def at(self, x: float) -> float:
        return float(self(x))

    @cached_property
    def jumps(self) -> tuple[tuple[float, float], ...]:
        """Where pieces meet, and how far the upper one starts above the end of the lower; at a centre too."""
        starts = [piece.start for piece in self.pieces[1:]]
        made = [
            (s, float(upper.value(s) - lower.value(s)))
            for s, lower, upper in zip(starts, self.pieces, self.pieces[1:], strict=False)
        ]
        if self.centre:
            made.append((0.0, 2 * float(self.pieces[0].value(0.0))))
        return tuple(made)

    @property
    def jump(self) -> float:
        return sum(abs(by) for _, by in self.jumps)

    @property
    def limits(self) -> list[float]:
        """Finite results of infinite values."""
        return [y for y in (self.at(-math.inf), self.at(math.inf)) if math.isfinite(y)]

    # ---------------------------------------------------------------------------------------------------- analysis

    def _stretches(self, low: float, high: float) -> list[tuple[Piece, float, float]]:
        """The pieces that [low, high] meets, and where it does; distances of a mirrored curve."""
        if self.held == "input":
            low, high = max(low, 0.0), max(high, 0.0)
        if self.centre:
            ends = low - self.centre[0], high - self.centre[0]
            near = 0.0 if ends[0] <= 0 <= ends[1] else min(map(abs, ends))
            low, high = near, max(map(abs, ends))
        made = []
        for piece, end in zip(self.pieces, [*(each.start for each in self.pieces[1:]), math.inf], strict=True):
            if piece.start <= high and end >= low:
                made.append((piece, max(piece.start, low), min(end, high)))
        return made

    def span(self, low: float, high: float) -> tuple[float, float]:
        """The results' range, jumps included."""
        return self.at(low) - self.jump, self.at(high) + self.jump

    def modulus(self, low: float, high: float, change: float) -> float:
        """The largest change of the result for a change of x in [low, high].

        A stretch with a finite slope makes at most its steepest times the change. Where a power starts vertically,
        |a^e - b^e| is at most |a - b|^e, twice half of it across a centre.
        """
        steepest, vertical = 0.0, 0.0
        for piece, start, end in self._stretches(low - change, high + change):
            steep = max(piece.slope(start), piece.slope(end))
            if math.isfinite(steep):
                steepest = max(steepest, steep)
            elif piece.body == "power" and piece.exponent < 1:
                by = abs(piece.inner) * change
                vertical += abs(piece.outer) * 2 * (by / 2) ** piece.exponent
            else:
                return FLOAT_MAX
        return min(steepest * change + vertical + self.jump, FLOAT_MAX)

    def error(self, low: float, high: float) -> float:
        """The largest difference of float32's result for x in [low, high]."""
        shifted = self.centre is not None and self.centre[0] != 0
        worst = 0.0
        for piece, start, end in self._stretches(low, high):
            ends = np.array([min(max(x, -FLOAT_MAX), FLOAT_MAX) for x in (start, end)])
            worst = max(worst, piece.error(ends, np.abs(ends) * shifted))
        if self.centre:
            worst += ROUNDING * abs(self.centre[1]) * 2 + (self.jump if shifted else 0.0)
            worst += ROUNDING * max(abs(y) for y in map(self._large, (low, high)))
        return worst if worst < FLOAT_MAX else FLOAT_MAX

    def _large(self, x: float) -> float:
        y = abs(self.at(x))
        return y if y < FLOAT_MAX else FLOAT_MAX

    @property
    def cost(self) -> float:
        """In powers, for each sample."""
        return sum(piece.kind.cost for piece in self.pieces)


@lru_cache(maxsize=256)
def computed_error(curve: Piecewise, low: float, high: float) -> float:
    """A curve's error where it is computed: the same for tables of all sizes."""
    return curve.error(low, high)


def inverted(pieces: Sequence[Piece], signals: Sequence[float] | None) -> tuple[Piece, ...]:
    """The other direction's pieces. `signals` are where they start as a standard prints them; unless given, where the
    piece below ends."""
    starts = [float(below.value(piece.start)) for below, piece in itertools.pairwise(pieces)]
    chosen = [-math.inf, *(starts if signals is None else signals)]
    return tuple(piece.inverse(start) for piece, start in zip(pieces, chosen, strict=True))


def held(curve: Piecewise, encode: bool) -> Piecewise:
    """The curve to which negative light is none."""
    return replace(curve, held="input" if encode else "result")
