"""The steps that colour conversions are made of.

Theory. A conversion is a chain of steps: scalar functions applied to each channel (`Scalar`), matrices (`Linear`), and
changes of coordinates that mix channels (`Mixed`). A step computes planes in the precision it is given, so one text is
the definition in float64 and NumPy's method in float32; convert.cl holds the same steps for devices, by the same names.

Beside its values every step carries two analyses that need no pixels: the interval of each output plane for given
intervals of its input, and how an error grows. Errors are pairs: |error| <= `relative` |x| + `absolute`. Light keeps a
relative error through powers and through sums of positive terms; where terms cancel only the absolute one is left.

Rules. NaN stays NaN. A quotient whose divisor is smaller than the smallest normal float32 takes the limit named beside
it. Hue is 0 where there is too little chroma to tell it: noise of 1e-7 does not give grey a hue.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operation import ROUNDING

FLOAT_MAX = float(np.finfo(np.float32).max)
TINY = float(np.finfo(np.float32).tiny)

Planes = list[Array]
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Doubt:
    """|error| <= relative |x| + absolute."""

    relative: float = 0.0
    absolute: float = 0.0

    def at(self, interval: Interval) -> float:
        return self.relative * size(interval) + self.absolute


def size(interval: Interval) -> float:
    return max(abs(interval[0]), abs(interval[1]))


UNKNOWN = 1e300
"""The end of an interval of which nothing is known: well inside float64, so that sums of such ends are numbers."""


def bounded(low: float, high: float) -> Interval:
    low, high = (x if not math.isnan(x) else s * UNKNOWN for x, s in ((low, -1), (high, 1)))
    return max(low, -UNKNOWN), min(high, UNKNOWN)


# ------------------------------------------------------------------------------------------------ scalar functions


@dataclass(frozen=True)
class Scalar:
    """An increasing function of each channel. `odd` ones are mirrored at 0: f(-x) = -f(x)."""

    name: str
    value: Callable[[Array], Array]
    """for x >= 0 where the function is odd, else for all x"""
    elasticity: float
    """largest |x f'(x) / f(x)|: what it multiplies a relative error by"""
    convex: bool
    odd: bool = True
    exponent: float = 1.0
    """passed to the kernel"""
    roundings: float = 14.0
    rough: bool = False
    """whether small results keep no relative error: those of a steep foot"""

    @property
    def numbers(self) -> tuple[float, ...]:
        return (self.exponent,)

    def run(self, planes: Planes) -> Planes:
        return [self._one(x) for x in planes]

    def _one(self, x: Array) -> Array:
        if not self.odd:
            return self.value(x)
        y: Array = np.copysign(self.value(np.abs(x)), x)
        return y

    def at(self, x: float) -> float:
        with np.errstate(all="ignore"):
            return float(self._one(np.array([x]))[0])

    def intervals(self, given: Sequence[Interval]) -> list[Interval]:
        known = {each: bounded(self.at(each[0]), self.at(each[1])) for each in set(given)}
        return [known[each] for each in given]

    def doubts(self, given: Sequence[Doubt], intervals: Sequence[Interval]) -> list[Doubt]:
        planes = list(zip(given, intervals, strict=True))
        known = {each: self._doubt(*each) for each in set(planes)}
        return [known[each] for each in planes]

    def _doubt(self, doubt: Doubt, interval: Interval) -> Doubt:
        own, far, by = self.roundings * ROUNDING, size(interval), doubt.absolute + TINY
        if self.rough:
            top = self.at(far + doubt.at(interval) + TINY)
            return Doubt(0.0, 1.01 * (top - self.at(far)) + own * top)
        if self.odd:
            step = self.at(far + by) - self.at(far) if self.convex else 2 * self.at(by / 2)
            more = 0.5 * ROUNDING * self.exponent * abs(math.log(max(far, 1.0)))  # of the exponent, in NumPy
            return Doubt(self.elasticity * doubt.relative + own + more, 1.01 * step + by)
        slope = 1 / (3 * BEND**2) if not self.convex else 3 * max(far, BEND) ** 2
        swing = max(4 / 29, far ** (1 / 3) / 3) if not self.convex else slope * far
        top = max(abs(self.at(x)) for x in interval)
        return Doubt(0.0, doubt.relative * swing + by * slope + own * max(top, 4 / 29))


def power(exponent: float) -> Scalar:
    """x^exponent, mirrored."""
    return Scalar("power", lambda x: np.power(x, x.dtype.type(exponent)), exponent, exponent > 1, exponent=exponent)


def _srgb_decode(x: Array) -> Array:
    y: Array = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return y.astype(x.dtype, copy=False)


def _srgb_encode(x: Array) -> Array:
    y: Array = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return y.astype(x.dtype, copy=False)


ALPHA, BETA = 1.09929682680944, 0.018053968510807
"""ITU-R BT.2020: alpha = 1 + 5.5 beta solves both conditions that the curve and its slope are continuous."""


def _bt2020_decode(x: Array) -> Array:
    y: Array = np.where(x < 4.5 * BETA, x / 4.5, ((x + (ALPHA - 1)) / ALPHA) ** (1 / 0.45))
    return y.astype(x.dtype, copy=False)


def _bt2020_encode(x: Array) -> Array:
    y: Array = np.where(x < BETA, 4.5 * x, ALPHA * x**0.45 - (ALPHA - 1))
    return y.astype(x.dtype, copy=False)


PQ_M1, PQ_M2, PQ_C3, PQ_Q = 2610 / 16384, 2523 / 32, 2392 / 128, 21 / 128
"""SMPTE ST 2084; q = 1 - c1 = c2 - c3, from which both differences in the quotient start, so that nothing cancels"""
PQ_WHITE = 203 / 10000
"""Linear 1 over the peak: graphics white of ITU-R BT.2408"""
PQ_CEILING = 1.8396067811
"""The signal of 1e10 cd/m2, where decoding saturates; the curve has a pole at 1.992"""


def _pq_decode(x: Array) -> Array:
    kind = x.dtype.type
    w = np.expm1(np.log(np.minimum(x, kind(PQ_CEILING))) * kind(1 / PQ_M2))
    ratio = np.maximum(kind(PQ_Q) + w, 0) / (kind(PQ_Q) - kind(PQ_C3) * w)
    y: Array = np.where(np.isinf(x), x, np.power(ratio, kind(1 / PQ_M1)) * kind(1 / PQ_WHITE))
    return y


def _pq_encode(x: Array) -> Array:
    kind = x.dtype.type
    p = np.power(x, kind(PQ_M1)) * kind(PQ_WHITE**PQ_M1)
    share = kind(PQ_Q) * (p - 1) / (1 + kind(PQ_C3) * p)
    share = np.where(np.isinf(x), kind(PQ_Q / PQ_C3), share)
    y: Array = np.exp(kind(PQ_M2) * np.log1p(share))
    return y


BEND = 6 / 29
"""Of CIE 1976 lightness: above BEND^3 a cube root, below it the line that continues it."""


def _lightness(t: Array) -> Array:
    y: Array = np.where(t > BEND**3, np.cbrt(t), t / (3 * BEND**2) + 4 / 29)
    return y.astype(t.dtype, copy=False)


def _lightness_inverse(f: Array) -> Array:
    y: Array = np.where(f > BEND, f * f * f, 3 * BEND**2 * (f - 4 / 29))
    return y.astype(f.dtype, copy=False)


SRGB_DECODE = Scalar("srgb_decode", _srgb_decode, 2.4, True)
SRGB_ENCODE = Scalar("srgb_encode", _srgb_encode, 1.0, False)
BT2020_DECODE = Scalar("bt2020_decode", _bt2020_decode, 1 / 0.45, True)
BT2020_ENCODE = Scalar("bt2020_encode", _bt2020_encode, 1.0, False)
PQ_DECODE = Scalar("pq_decode", _pq_decode, 1.0, True, roundings=60, rough=True)
PQ_ENCODE = Scalar("pq_encode", _pq_encode, 1.0, False, roundings=40)
CUBE = Scalar("cube", lambda x: x * x * x, 3.0, True, roundings=4)
CBRT = Scalar("cube_root", np.cbrt, 1 / 3, False, roundings=4)
LIGHTNESS = Scalar("lightness", _lightness, 0.0, False, odd=False, roundings=4)
LIGHTNESS_INVERSE = Scalar("lightness_inverse", _lightness_inverse, 0.0, True, odd=False, roundings=5)

# --------------------------------------------------------------------------------------------------------- matrices


@dataclass(frozen=True)
class Linear:
    """y = M x + b. A factor of zero takes no part, so it cannot carry a NaN."""

    matrix: tuple[tuple[float, ...], ...]
    added: tuple[float, ...]

    name = "linear"

    @classmethod
    def of(cls, matrix: Array, added: Array | Sequence[float] | None = None) -> Linear:
        rows = np.atleast_2d(np.asarray(matrix, np.float64))
        more = np.zeros(len(rows)) if added is None else np.asarray(added, np.float64)
        return cls(tuple(tuple(map(float, row)) for row in rows), tuple(map(float, more)))

    @property
    def inverse(self) -> Linear:
        back = np.linalg.inv(np.array(self.matrix))
        return Linear.of(back, -back @ np.array(self.added))

    def after(self, first: Linear) -> Linear:
        """This step and the one before it as one."""
        matrix = np.array(self.matrix)
        return Linear.of(matrix @ np.array(first.matrix), matrix @ np.array(first.added) + np.array(self.added))

    @property
    def trivial(self) -> bool:
        same = np.array_equal(np.array(self.matrix), np.eye(len(self.matrix), len(self.matrix[0])))
        return same and not any(self.added)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Rows of five: factors, zeros, what is added. Four rows."""
        rows = np.zeros((4, 5))
        rows[: len(self.matrix), : len(self.matrix[0])] = self.matrix
        rows[: len(self.matrix), 4] = self.added
        return tuple(map(float, rows.reshape(-1)))

    @property
    def present(self) -> int:
        """Which of the numbers are not zero, as bits."""
        return sum(1 << at for at, number in enumerate(self.numbers) if number)

    def run(self, planes: Planes) -> Planes:
        kind = planes[0].dtype.type
        made = []
        for row, more in zip(self.matrix, self.added, strict=True):
            terms = [kind(factor) * plane for factor, plane in zip(row, planes, strict=True) if factor]
            total: Array = sum(terms[1:], terms[0]) if terms else np.zeros_like(planes[0])
            made.append(total + kind(more) if more else total)
        return made

    def intervals(self, given: Sequence[Interval]) -> list[Interval]:
        made = []
        for row, more in zip(self.matrix, self.added, strict=True):
            ends = [sorted((m * low, m * high)) for m, (low, high) in zip(row, given, strict=True)]
            made.append(bounded(sum(e[0] for e in ends) + more, sum(e[1] for e in ends) + more))
        return made

    def doubts(self, given: Sequence[Doubt], intervals: Sequence[Interval]) -> list[Doubt]:
        positive = all(low >= 0 for low, _ in intervals)
        made = []
        for row, more in zip(self.matrix, self.added, strict=True):
            own = (2 * len(row) + 2) * ROUNDING
            apart = sum(abs(m) * d.absolute for m, d in zip(row, given, strict=True)) + TINY
            if positive and more >= 0 and all(m >= 0 for m in row):
                made.append(Doubt(max(d.relative for d in given) + own, apart))
            else:
                terms = sum(
                    abs(m) * size(x) * (d.relative + own) for m, d, x in zip(row, given, intervals, strict=True)
                )
                made.append(Doubt(0.0, terms + apart + own * abs(more)))
        return made


# ------------------------------------------------------------------------------------------- changes of coordinates


@dataclass(frozen=True)
class Mixed:
    """A change of coordinates over all channels.

    `reach` gives the intervals of its outputs. `growth` gives, for absolute errors of the inputs, those of the outputs:
    infinite where a coordinate can jump (a hue near grey, a quotient near its pole), which then means the whole reach.
    """

    name: str
    value: Callable[[Planes], Planes]
    reach: Callable[[Sequence[Interval]], list[Interval]]
    growth: Callable[[Sequence[float], Sequence[Interval]], list[float]]
    numbers: tuple[float, ...] = ()
    roundings: float = 10.0

    def run(self, planes: Planes) -> Planes:
        return self.value(planes)

    def intervals(self, given: Sequence[Interval]) -> list[Interval]:
        return [bounded(*interval) for interval in self.reach(given)]

    def doubts(self, given: Sequence[Doubt], intervals: Sequence[Interval]) -> list[Doubt]:
        errors = [doubt.at(interval) for doubt, interval in zip(given, intervals, strict=True)]
        made = []
        for by, interval in zip(self.growth(errors, intervals), self.intervals(intervals), strict=True):
            spread = interval[1] - interval[0]
            made.append(Doubt(0.0, min(by, spread) + self.roundings * ROUNDING * size(interval)))
        return made


Step = Scalar | Linear | Mixed


def merged(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Neighbouring matrices as one, and none that changes nothing."""
    made: list[Step] = []
    for step in steps:
        if isinstance(step, Linear) and made and isinstance(made[-1], Linear):
            made[-1] = step.after(made[-1])
        else:
            made.append(step)
    return tuple(step for step in made if not (isinstance(step, Linear) and step.trivial))
