"""What `convert` is asked for, the steps that follow from it, and what is known of their result without pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from pydantic import Field

from lichen.image import Space
from lichen.once import latest
from lichen.operation import Facts, OperationParameters
from lichen.operations.colour.fitted_steps import Fitted, fitted
from lichen.operations.colour.primaries import Adaptation, White
from lichen.operations.colour.spaces import Model, path
from lichen.operations.colour.stages import FLOAT_MAX, UNKNOWN, Doubt, Interval, Mixed, Step, size

FAR = 1e30
"""Where a step's values may lie beyond it, the next could leave float32."""
DEGREES = (3, 4, 5, 6)
"""Of polynomials in place of curves."""
NEAR = 1e4
"""The largest value of pictures for which float32 is trusted next to poles."""


class Parameters(OperationParameters):
    target: Model = Field(Model.LAB)
    """the space to convert to"""
    source: Model | None = None
    """the space of the picture's numbers; what the picture says unless given"""
    white: White = White.D65
    """the white that XYZ, xyY, L*a*b*, LCh, L*u*v* and luminance are relative to"""
    adaptation: Adaptation = Adaptation.BRADFORD
    """how colours are carried from one white to another"""


STATED = {Space.SRGB: Model.SRGB, Space.LINEAR: Model.LINEAR_BT709}
MEANT = {model: space for space, model in STATED.items()}


def models_of(p: Parameters, space: Space) -> tuple[Model, Model]:
    return p.source or STATED.get(space, p.target), p.target


def steps_of(p: Parameters, space: Space, degree: int = 0) -> tuple[Step | Fitted, ...]:
    """The way; with a degree, its curves as polynomials where there are any."""
    asked = *models_of(p, space), p.white, p.adaptation
    return _fitted_path(*asked, degree) if degree else path(*asked)


@lru_cache(maxsize=256)
def _fitted_path(
    source: Model, target: Model, white: White, adaptation: Adaptation, degree: int
) -> tuple[Step | Fitted, ...]:
    return fitted(path(source, target, white, adaptation), degree)


# ------------------------------------------------------------------------------------------------ analysis of a path


@dataclass(frozen=True, slots=True)
class Walk:
    """What is known of a conversion's result without its pixels."""

    intervals: list[Interval]
    doubts: list[Doubt]

    @property
    def error(self) -> float:
        """The largest, and float32's largest number where nothing better is known."""
        worst = [doubt.at(interval) for doubt, interval in zip(self.doubts, self.intervals, strict=True)]
        return max(value if value < FLOAT_MAX else FLOAT_MAX for value in worst)


@latest
def ranges_of(p: Parameters, facts: Facts) -> list[list[Interval]]:
    """Of the channels: before the first step, and after each."""
    ranges: list[list[Interval]] = [[(facts.extent.low, facts.extent.high)] * models_of(p, facts.space)[0].channels]
    for step in steps_of(p, facts.space):
        ranges.append(step.intervals(ranges[-1]))
    return ranges


@lru_cache(maxsize=64)
def _doubts(step: Step, given: tuple[Doubt, ...], intervals: tuple[Interval, ...]) -> list[Doubt]:
    """After a step that many walks have in common."""
    return step.doubts(given, intervals)


def walked(p: Parameters, facts: Facts, by: float = 0.0, degree: int = 0, bare: bool = False) -> Walk:
    """The outputs' intervals, and how far they are from those of inputs that differ by `by`, rounding included; `bare`:
    as if polynomials were the curves that they stand for."""
    ranges = ranges_of(p, facts)
    doubts = [Doubt(0.0, by)] * len(ranges[0])
    for step, intervals in zip(steps_of(p, facts.space, degree), ranges, strict=False):
        if isinstance(step, Fitted):
            doubts = (step.rounded if bare else step).doubts(doubts, intervals)
        else:
            doubts = _doubts(step, tuple(doubts), tuple(intervals))
    return Walk(ranges[-1], doubts)


@latest
def inside(p: Parameters, facts: Facts) -> bool:
    """Whether every step stays well inside float32."""
    given, *reached = ranges_of(p, facts)
    sound, known = size(given[0]) < FAR, True
    for step, intervals in zip(steps_of(p, facts.space), reached, strict=True):
        # Next to a pole no range is known: there a result is as large as the picture makes it.
        known &= not (isinstance(step, Mixed) and any(size(each) >= UNKNOWN for each in intervals))
        sound &= size(given[0]) < NEAR if not known else all(size(each) < FAR for each in intervals)
    return sound


def held(p: Parameters, facts: Facts) -> bool:
    """Whether every curve's polynomials reach far enough."""
    steps = zip(steps_of(p, facts.space, DEGREES[0]), ranges_of(p, facts), strict=False)
    return all(step.holds(ranges) for step, ranges in steps if isinstance(step, Fitted))
