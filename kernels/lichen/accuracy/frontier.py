"""Which settings are worth their time: the Pareto front of error against seconds.

A setting is on the front when no other is at least as accurate and at least as fast, and better in one of the two. Of
equals the first given stays. A setting off the front is dominated, and the setting to take instead is the fastest one
on the front that is at least as accurate.

Being on the front is not yet being worth it: measured times scatter, and a step that gives up half a digit to save a
hundredth of the time is no choice anyone makes. `worthwhile` keeps those a caller has a reason to take.

`prices` reads the front the other way: the least time for an error no larger than each of those asked for. The ratio of
neighbours is what one more digit costs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cost:
    """What a setting costs: its error, in output units, and its seconds. Both at least 0; NaN for one that failed."""

    error: float
    seconds: float

    @property
    def known(self) -> bool:
        return math.isfinite(self.error) and math.isfinite(self.seconds)

    def dominates(self, other: Cost) -> bool:
        """At least as good in both, better in one."""
        return self.error <= other.error and self.seconds <= other.seconds and self != other


@dataclass(frozen=True, slots=True)
class Price:
    """The least time for an error of at most `error`; `index` is the setting that has it, None where none does."""

    error: float
    index: int | None
    seconds: float


def front(costs: Sequence[Cost]) -> list[int]:
    """Indices of the settings on the front, fastest and least accurate first.

    >>> front([Cost(1e-2, 1.0), Cost(1e-3, 2.0), Cost(1e-3, 3.0), Cost(1e-1, 1.0)])
    [0, 1]
    """
    order = sorted((i for i, cost in enumerate(costs) if cost.known), key=lambda i: (costs[i].seconds, costs[i].error))
    kept: list[int] = []
    for i in order:
        if not kept or costs[i].error < costs[kept[-1]].error:
            kept.append(i)
    return kept


def dominators(costs: Sequence[Cost]) -> list[int | None]:
    """For each setting the one to take instead: None for those on the front and for those that failed."""
    kept = front(costs)
    return [
        None
        if i in kept or not cost.known
        else next(j for j in kept if costs[j].error <= cost.error and costs[j].seconds <= cost.seconds)
        for i, cost in enumerate(costs)
    ]


def worthwhile(costs: Sequence[Cost], *, gain: float = 1.25, saving: float = 0.03) -> list[int]:
    """The front without the steps nobody has a reason to take, fastest first.

    A setting is left out when a more accurate one that stays takes at most `saving` more of its time, or when it is not
    `gain` times as accurate as the faster one that stays before it. The most accurate setting always stays.
    """
    kept: list[int] = []
    for i in reversed(front(costs)):
        if not kept or costs[i].seconds * (1 + saving) < costs[kept[-1]].seconds:
            kept.append(i)
    kept.reverse()
    last = kept[-1:]
    chosen: list[int] = []
    for i in kept:
        if not chosen or i in last or costs[i].error * gain <= costs[chosen[-1]].error:
            chosen.append(i)
    return chosen


def prices(costs: Sequence[Cost], errors: Sequence[float]) -> list[Price]:
    """The least time for each of `errors`, in their order; infinite where no setting is so accurate.

    >>> [price.seconds for price in prices([Cost(1e-2, 1.0), Cost(1e-4, 3.0)], [1e-1, 1e-3, 1e-5])]
    [1.0, 3.0, inf]
    """
    kept = front(costs)
    found = []
    for error in errors:
        index = next((i for i in kept if costs[i].error <= error), None)
        found.append(Price(error, index, math.inf if index is None else costs[index].seconds))
    return found


def compare(cost: Cost, instead: Cost) -> str:
    """In words, what taking `instead` in place of `cost` gives.

    >>> compare(Cost(1e-2, 4e-3), Cost(1e-3, 2e-3))
    '2 times as fast and 10 times as accurate'
    """
    faster = _times(cost.seconds, instead.seconds)
    better = _times(cost.error, instead.error)
    speed = f"{faster} times as fast" if faster else "as fast"
    accuracy = f"{better} times as accurate" if better else "as accurate"
    if better == "infinitely many":
        accuracy = "exact"
    return f"{speed} and {accuracy}"


def _times(mine: float, theirs: float) -> str:
    """The ratio to two digits; empty where it rounds to 1."""
    if mine <= theirs:
        return ""
    if theirs == 0:
        return "infinitely many"
    ratio = mine / theirs
    if ratio < 1.05:
        return ""
    if ratio > 1000:
        return "more than 1000"
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.1f}".removesuffix(".0")
