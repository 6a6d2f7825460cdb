"""Times of calls that take turns, so that what else a machine does meets all of them alike.

Every call runs once before it counts, which builds programs, and once more, which tells how often it fits into a turn:
quick ones run several times, since single calls scatter more. Turns are repeated as often as an `Effort` affords: where
calls take long, fewer runs know them as well. One that takes by itself as long as all rounds should is run no more, and
one that takes longer than any program takes to build is known by its first run.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lichen.errors import LichenError

FAILURES = (LichenError, RuntimeError, ValueError)
"""What ours and other libraries raise where they cannot take a case."""
REPEATS = 8
"""Runs of a call in one turn at most."""
BUILT = 10.0
"""Seconds that no first run takes for building programs alone."""

Call = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Effort:
    """How thoroughly to measure."""

    rounds: tuple[int, int]
    """the fewest and the most"""
    seconds: float
    """that all rounds together should take; the fewest are made whatever they take"""
    turn: float
    """seconds that a call may take in each of its turns"""
    longest: float
    """predicted seconds above which a setting is not timed but predicted"""


QUICK = Effort((1, 9), seconds=0.15, turn=0.005, longest=0.5)
FULL = Effort((9, 21), seconds=20.0, turn=0.02, longest=4.0)


@dataclass(frozen=True, slots=True)
class Timed:
    """Seconds of a call: the lower quartile, since what else a machine does only ever adds; what failed has none."""

    seconds: float
    spread: float = 0.0
    """half the range in which the middle half of the timings lie, over `seconds`; 0 where there are none"""
    failed: str | None = None


def timed(calls: Mapping[str, Call], effort: Effort) -> dict[str, Timed]:
    """All calls by their names."""
    found: dict[str, Timed] = {}
    repeats: dict[str, int] = {}
    first: dict[str, float] = {}
    for name, call in calls.items():
        try:
            took = _seconds(call)
            if took < BUILT:
                took = _seconds(call)
        except FAILURES as failure:
            found[name] = Timed(math.nan, failed=brief(failure))
            continue
        first[name] = took
        if took < effort.seconds:
            repeats[name] = max(1, min(REPEATS, int(effort.turn / (took + 1e-6))))
    fewest, most = effort.rounds
    one = sum(first[name] * count for name, count in repeats.items())
    rounds = max(fewest, min(most, int(effort.seconds / (one + 1e-6))))
    taken = _in_turn({name: calls[name] for name in repeats}, repeats, rounds)
    return found | {name: _lower_quartile([took, *taken.get(name, ())]) for name, took in first.items()}


def once(call: Call) -> Timed:
    """A single run, the first, of what takes long and has nothing to build."""
    try:
        return Timed(_seconds(call))
    except FAILURES as failure:
        return Timed(math.nan, failed=brief(failure))


def _in_turn(calls: Mapping[str, Call], repeats: Mapping[str, int], rounds: int) -> dict[str, list[float]]:
    kept: dict[str, list[float]] = {name: [] for name in calls}
    collecting = gc.isenabled()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, call in calls.items():
                kept[name] += [_seconds(call) for _ in range(repeats[name])]
    finally:
        if collecting:
            gc.enable()
    return kept


def _seconds(call: Call) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def _lower_quartile(kept: list[float]) -> Timed:
    low, high = (float(each) for each in np.quantile(kept, (0.25, 0.75)))
    return Timed(low, (high - low) / 2 / low)


def brief(failure: Exception) -> str:
    """The first line."""
    return str(failure).partition("\n")[0]
