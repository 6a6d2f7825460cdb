"""What the accuracy of one operation costs: its settings judged, priced and put into words.

A report holds one example of an operation on one device and at one image size. Every method at every setting of its
knob is a `Setting` with seconds and errors, whatever became of it: settings off the Pareto front stay and say which
other one to take instead, settings that failed stay and say why. Peers, other libraries' functions that compute the
same thing, are measured in the same run and judged against our front, never on it.

Two errors count. The worst is the largest difference from truth anywhere in the corpus, the typical one the median
over its images of the RMS difference. Settings are ranked by the worst, unless it stays visible whatever is paid and
time buys far more digits of the typical error: then that ranks them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from statistics import linear_regression
from typing import Any, Literal

from lichen.accuracy.frontier import Cost, Price, compare, dominators, front, prices, worthwhile
from lichen.calibration.words import PLAIN, SHORT, capital, label_of, more, round_errors, scientific
from lichen.study import Study

Ranking = Literal["worst", "typical"]
RANKINGS: tuple[Ranking, ...] = ("typical", "worst")
Standing = Literal["worthwhile", "front", "dominated", "variant", "failed", "peer"]
SEPARATED = 4.0
"""The worst cases of settings differ by this factor at least where accuracy can be bought there."""
FURTHER = 2.0
"""How many times the digits of the worst case those of the typical error are where they are what is bought."""
VISIBLE = 1e-3
"""A quarter of the step of 8-bit samples. Where all settings lie below, that they agree is rounding, no obstacle."""
ROUNDED: Mapping[Ranking, float] = {"worst": 1e-6, "typical": 1e-7}
"""Below these errors may be float32's."""
LEAST_POINTS = 3
"""Settings that an order is fitted to."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One way to compute the example. Errors in output units; NaN where it failed."""

    method: str
    knob: float | None
    seconds: float
    worst: float
    typical: float
    p999: float
    stated: float | None = None
    """the error that a reply states; None for a peer, which states none"""
    kind: str = "measured"
    precision: str = PLAIN
    spread: float = 0.0
    """half the range in which the middle half of the timings lie, over `seconds`; 0 where time is predicted"""
    peer: bool = False
    failed: str | None = None
    delta_e: float | None = None
    """the largest CIEDE2000 on the photograph of the corpus; None where there is no colour picture to look at"""
    flip: float | None = None
    """the mean FLIP there"""

    @property
    def label(self) -> str:
        return label_of(self.method, self.knob, self.precision)

    def cost(self, ranking: Ranking) -> Cost:
        return Cost(self.worst if ranking == "worst" else self.typical, self.seconds)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Where a setting stands. `instead` is the setting to take in its place."""

    standing: Standing
    reason: str
    instead: Setting | None = None


@dataclass(frozen=True, slots=True)
class Order:
    """With which power of its knob the error of a method goes, fitted to errors that are no roundings."""

    method: str
    knob: str
    """its name"""
    expected: float
    """the power, by theory"""
    measured: float
    """the slope of log error over log knob, by least squares"""
    ranking: Ranking
    """the error it is fitted to"""


@dataclass(frozen=True, eq=False)
class Report:
    """All settings of one example on one device at one size."""

    operation: str
    parameters: Mapping[str, Any]
    example: int | None
    """its place among the operation's examples; None for other parameters"""
    device: str
    size: int
    """side of the square image, px"""
    settings: tuple[Setting, ...]
    knobs: Mapping[str, str]
    """the name of each method's knob"""
    source: str
    """how times and errors are known, a sentence"""
    machine: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
    study: Study | None = None
    """what else was measured of the operation"""
    expected: Mapping[str, float] = field(default_factory=dict)
    """the order of each method that has one, by theory"""

    @cached_property
    def ours(self) -> list[int]:
        """Indices of our own settings in the working precision, those that failed included."""
        return [i for i, each in enumerate(self.settings) if not each.peer and each.precision == PLAIN]

    @property
    def seen(self) -> bool:
        """Whether the result is a colour picture, whose errors a viewer sees."""
        return any(each.flip is not None for each in self.settings)

    @cached_property
    def ranking(self) -> Ranking:
        errors = [self.settings[i].worst for i in self.ours if self.settings[i].cost("worst").known]
        typical = [self.settings[i].typical for i in self.ours if self.settings[i].cost("worst").known]
        if len(errors) < 2 or min(errors) <= VISIBLE or max(typical) <= 0:
            return "worst"
        worst, usual = max(errors) / min(errors), max(typical) / max(min(typical), 1e-300)
        flat = worst < SEPARATED and usual > 1.5
        dwarfed = usual > SEPARATED and math.log(usual) >= FURTHER * math.log(worst)
        return "typical" if (flat or dwarfed) and max(typical) < 0.5 * max(errors) else "worst"

    @cached_property
    def costs(self) -> list[Cost]:
        """Of our settings in the working precision, in the order of `ours`."""
        return [self.settings[i].cost(self.ranking) for i in self.ours]

    @cached_property
    def front(self) -> list[Setting]:
        """Fastest first."""
        return [self.settings[self.ours[i]] for i in front(self.costs)]

    @cached_property
    def worthwhile(self) -> list[Setting]:
        """The part of the front that someone has a reason to take, fastest first."""
        return [self.settings[self.ours[i]] for i in worthwhile(self.costs)]

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """For each setting, in their order."""
        chosen, kept = {id(each) for each in self.worthwhile}, {id(each) for each in self.front}
        instead = dict(zip(self.ours, dominators(self.costs), strict=True))
        found = []
        for i, setting in enumerate(self.settings):
            if setting.failed is not None:
                found.append(Verdict("failed", setting.failed))
            elif id(setting) in chosen:
                found.append(Verdict("worthwhile", "nothing is as fast and as accurate"))
            elif id(setting) in kept:
                found.append(self._step(setting))
            elif (taken := instead.get(i)) is not None:
                better = self.settings[self.ours[taken]]
                said = compare(setting.cost(self.ranking), better.cost(self.ranking))
                found.append(Verdict("dominated", f"{better.label} is {said}", better))
            else:
                found.append(self._beside(setting))
        return tuple(found)

    def _step(self, setting: Setting) -> Verdict:
        """On the front, but nobody has a reason to take it."""
        mine = setting.cost(self.ranking)
        for other in self.worthwhile:
            theirs = other.cost(self.ranking)
            if theirs.error < mine.error and mine.seconds < theirs.seconds <= mine.seconds * 1.03:
                said = f"{other.label} is more accurate for {more(theirs.seconds / mine.seconds)}"
                return Verdict("front", said, other)
        cheaper = [each for each in self.worthwhile if each.seconds < setting.seconds]
        other = cheaper[-1] if cheaper else self.worthwhile[0]
        gain = other.cost(self.ranking).error / mine.error
        return Verdict("front", f"only {gain:.2g} times as accurate as {other.label}, which is faster", other)

    def _beside(self, setting: Setting) -> Verdict:
        """A peer, or a variant of precision, against our front."""
        mine = setting.cost(self.ranking)
        standing: Standing = "peer" if setting.peer else "variant"
        for other in self.front:
            theirs = other.cost(self.ranking)
            if theirs.error <= mine.error:
                if theirs.seconds <= mine.seconds:
                    return Verdict(standing, f"{other.label} is {compare(mine, theirs)}", other)
                said = f"{other.label}, the fastest of ours as accurate, takes {more(theirs.seconds / mine.seconds)}"
                return Verdict(standing, said, other)
        return Verdict(standing, "nothing of ours is as accurate")

    @cached_property
    def prices(self) -> list[Price]:
        """The least time for each round error between the fastest setting's and the most accurate one's.

        None where the front is not worth speaking of: it does not even halve the error.
        """
        errors = [each.cost(self.ranking).error for each in self.front if each.cost(self.ranking).error > 0]
        if not errors or max(errors) < 2 * min(errors):
            return []
        return prices(self.costs, round_errors(max(errors), min(errors)))

    @property
    def headline(self) -> str:
        """What one more digit costs, in a sentence or two."""
        if not self.front:
            return "No method could run."
        first, last = (self.front[i].cost(self.ranking) for i in (0, -1))
        what = "error" if self.ranking == "worst" else "typical error"
        if len(self.front) == 1:
            label = capital(self.front[0].label)
            return f"{label} is the fastest and the most accurate: {what} {scientific(first.error)}."
        if last.error * 2 > first.error:
            label = capital(self.front[0].label)
            return f"{label} is the fastest, and nothing is twice as accurate: {what} {scientific(first.error)}."
        span = f"from {scientific(first.error)} to {scientific(last.error)}"
        ratio = last.seconds / first.seconds
        digits = math.log10(first.error / last.error) if last.error > 0 else math.inf
        if digits >= SHORT:
            return f"One more digit costs {more(ratio ** (1 / digits))} on average; {span}, {more(ratio)}."
        return f"Half the {what} costs {more(ratio ** (math.log10(2) / digits))} on average; {span}, {more(ratio)}."

    @property
    def remark(self) -> str:
        """What the headline must not hide."""
        if self.ranking == "typical":
            worst = [self.settings[i].worst for i in self.ours if self.settings[i].failed is None]
            return (
                f"The worst case lies between {scientific(min(worst))} and {scientific(max(worst))} at every setting; "
                "what time buys is the error of all but a few pixels."
            )
        return ""

    @cached_property
    def orders(self) -> list[Order]:
        """Of the methods for which theory has one, by their typical error, or by the worst where fewer than
        `LEAST_POINTS` settings have a typical one that is no rounding; of none where both are."""
        found = []
        for method, expected in self.expected.items():
            own = [self.settings[i] for i in self.ours if self.settings[i].method == method]
            for ranking in RANKINGS:
                points = [(each.knob, each.cost(ranking).error) for each in own if each.knob]
                told = [(math.log(knob), math.log(error)) for knob, error in points if error > ROUNDED[ranking]]
                if len(told) >= LEAST_POINTS:
                    slope = linear_regression(*zip(*told, strict=True)).slope
                    found.append(Order(method, self.knobs[method], expected, round(slope, 2), ranking))
                    break
        return found

    @property
    def converging(self) -> str:
        """The orders in words, a sentence; meant for reports that have any."""
        told = [
            f"{each.method} {each.measured:.2f} (theory {each.expected:g}) in {each.knob}"
            + ("" if each.ranking == "typical" else ", worst case")
            for each in self.orders
        ]
        return f"Fitted orders of the error: {'; '.join(told)}."

    def megapoints(self, setting: Setting) -> float:
        """Million pixels a second."""
        return self.size * self.size / setting.seconds / 1e6

    @property
    def image(self) -> str:
        return f"{self.size} x {self.size} px"

    @property
    def title(self) -> str:
        brief = {name: str(value) for name, value in self.parameters.items()}
        shown = ", ".join(f"{name}={text if len(text) <= 24 else '...'}" for name, text in brief.items())
        return f"{self.operation}  {shown}" if shown else self.operation

    def to_json(self) -> dict[str, Any]:
        """JSON values, apart from errors that are NaN where a setting failed."""
        return {
            "operation": self.operation,
            "title": self.title,
            "parameters": dict(self.parameters),
            "example": self.example,
            "device": self.device,
            "size": self.size,
            "source": self.source,
            "ranked_by": self.ranking,
            "headline": self.headline,
            "remark": self.remark,
            "prices": [self._price(each) for each in self.prices],
            "settings": [
                _setting(setting, verdict, self.knobs) | {"megapoints": self.megapoints(setting)}
                for setting, verdict in zip(self.settings, self.verdicts, strict=True)
            ],
            "machine": dict(self.machine),
            "command": self.command,
            "orders": [asdict(each) for each in self.orders],
            "converging": self.converging if self.orders else "",
            "study": self.study and self.study.to_json(),
        }

    def _price(self, price: Price) -> dict[str, Any]:
        setting = None if price.index is None else self.settings[self.ours[price.index]]
        return {
            "error": price.error,
            "milliseconds": price.seconds * 1e3,
            "method": setting and setting.method,
            "knob": setting and setting.knob,
        }


def _setting(setting: Setting, verdict: Verdict, knobs: Mapping[str, str]) -> dict[str, Any]:
    instead = verdict.instead
    return {
        "method": setting.method,
        "knob": setting.knob,
        "knob_name": knobs.get(setting.method),
        "precision": setting.precision,
        "peer": setting.peer,
        "milliseconds": setting.seconds * 1e3,
        "spread": setting.spread,
        "stated": setting.stated,
        "kind": setting.kind,
        "worst": setting.worst,
        "p999": setting.p999,
        "typical": setting.typical,
        "on_front": verdict.standing in ("worthwhile", "front"),
        "standing": verdict.standing,
        "dominated_by": instead and {"method": instead.method, "knob": instead.knob},
        "reason": verdict.reason,
        "failed": setting.failed,
        "ciede2000": setting.delta_e,
        "flip": setting.flip,
    }
