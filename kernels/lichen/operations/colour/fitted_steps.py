"""The curves of a conversion as polynomials: quicker steps in place of those that take powers.

A step's polynomials hold for magnitudes up to 1 (tone/fitted.py); what lies beyond, and NaN, is computed as before,
lane by lane. A straight start is computed as it is, so that darkness keeps its relative error, on which a curve that is
steep at 0 depends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from lichen.memory import Array
from lichen.once import once
from lichen.operation import ROUNDING
from lichen.operations.colour import stages
from lichen.operations.colour.stages import Doubt, Interval, Scalar, Step, size
from lichen.operations.tone.evaluate import ceiling32
from lichen.operations.tone.fitted import Fit, Layout, fit

F = np.float32
ENOUGH = {0: 5, 1: 5, 2: 6}
"""Degrees, by roots, above which float32 rounds more than polynomials err."""
DARK = 1e-30
"""An absolute error that is none: what is added for denormals."""


@dataclass(frozen=True, slots=True)
class Foot:
    """Where a curve's straight start ends, its slope, and how the rest is laid out."""

    knee: float
    slope: float
    layout: Layout


FEET = {
    stages.SRGB_DECODE: Foot(np.nextafter(0.04045, 1), 1 / 12.92, Layout(roots=0, bits=0)),
    stages.SRGB_ENCODE: Foot(np.nextafter(0.0031308, 1), 12.92, Layout(roots=1, bits=0)),
    stages.BT2020_DECODE: Foot(4.5 * stages.BETA, 1 / 4.5, Layout(roots=0, bits=0)),
    stages.BT2020_ENCODE: Foot(stages.BETA, 4.5, Layout(roots=1, bits=0)),
    stages.PQ_ENCODE: Foot(0.0, 0.0, Layout(roots=2, bits=0)),
}


@dataclass(frozen=True)
class Fitted:
    """A scalar step as polynomials."""

    exact: Scalar
    foot: Foot
    found: Fit

    @property
    def numbers(self) -> tuple[float, ...]:
        """As convert.cl reads them."""
        return (self.found.top, float(ceiling32(self.foot.knee)), self.foot.slope, *self.found.numbers)

    @once
    def rounded(self) -> Fitted:
        """With no error but that of rounding."""
        return replace(self, found=self.found.rounded)

    def run(self, planes: list[Array]) -> list[Array]:
        return [self._one(x) for x in planes]

    def _one(self, x: Array) -> Array:
        a: Array = np.abs(np.ascontiguousarray(x))
        y = np.where(a < ceiling32(self.foot.knee), a * F(self.foot.slope), self.found(a))
        far = ~(a <= F(self.found.top))
        if far.any():
            y[far] = self.exact.value(a[far])
        made: Array = np.copysign(y, x)
        return made

    def intervals(self, given: Sequence[Interval]) -> list[Interval]:
        return self.exact.intervals(given)

    def doubts(self, given: Sequence[Doubt], intervals: Sequence[Interval]) -> list[Doubt]:
        """A convex curve keeps a relative error. Of a concave one an absolute is left: the relative one times the
        largest slope over the logarithm, and what an absolute one makes of darkness."""
        if self.exact.convex:
            more = self.found.relative + 2 * ROUNDING
            return [Doubt(each.relative + more, each.absolute) for each in self.exact.doubts(given, intervals)]
        planes = list(zip(given, intervals, strict=True))
        known = {each: self._doubt(*each) for each in set(planes)}
        return [known[each] for each in planes]

    def _doubt(self, doubt: Doubt, interval: Interval) -> Doubt:
        own, dark = self.found.error + self.found.rounding, doubt.absolute < DARK and interval[0] >= 0
        step = _step(self.exact, doubt.absolute, dark)
        swing = doubt.relative * _swing(self.exact, size(interval)) if doubt.relative else 0.0
        return Doubt(0.0, own + swing + 1.01 * step + ROUNDING)

    def holds(self, given: Sequence[Interval]) -> bool:
        """Whether the polynomials reach far enough."""
        return all(size(each) <= self.found.top for each in given)


@lru_cache(maxsize=256)
def _step(curve: Scalar, by: float, dark: bool) -> float:
    """How far a curve rises over so much at most: from 0 on, or either way of it."""
    return curve.at(by) - curve.at(0.0) if dark else 2 * curve.at(by / 2)


@lru_cache(maxsize=256)
def _swing(curve: Scalar, far: float) -> float:
    """The largest x f'(x) for x up to `far`, give or take the steps it is looked for in."""
    top = max(far, 1e-9)
    x = np.geomspace(top * 1e-15, top, 2000)
    return 1.05 * float(np.max(np.diff(curve.value(x)) / np.diff(np.log(x))))


@lru_cache(maxsize=64)
def _fitted(curve: Scalar, degree: int) -> Fitted:
    foot = FEET[curve]
    return Fitted(curve, foot, fit(curve.value, 1.0, min(degree, ENOUGH[foot.layout.roots]), foot.layout, foot.knee))


def fitted(steps: Sequence[Step], degree: int) -> tuple[Step | Fitted, ...]:
    """The steps with polynomials where there are any."""
    return tuple(_fitted(step, degree) if isinstance(step, Scalar) and step in FEET else step for step in steps)
