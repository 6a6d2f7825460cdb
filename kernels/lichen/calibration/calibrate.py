"""Calibration from beginning to end: every operation on every backend, kept as soon as it is known.

The rates of an operation are stored when its runs are done, and its name is put on a list beside them. Whoever is
interrupted and starts again finds the list and goes on behind it; a calibration that has ended leaves none.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lichen.accuracy import times
from lichen.calibration.fit import misses
from lichen.calibration.pace import pace
from lichen.calibration.timing import Plan, Timing
from lichen.operation import Operation


@dataclass(frozen=True, slots=True)
class Step:
    """One run has been made: number `done` of `total` for this operation and backend."""

    operation: str
    backend: str
    done: int
    total: int


@dataclass
class Outcome:
    """What came of it."""

    samples: int = 0
    missed: int = 0
    """samples that the fitted rate misses by more than a factor of 1.5"""
    resumed: int = 0
    """operations that an earlier, interrupted calibration had measured"""
    kept: bool = True
    """False where the folder of times cannot be written"""


def calibrate(
    operations: Sequence[Operation[Any]],
    backends: Sequence[str],
    plan: Plan,
    outcome: Outcome,
    undisturbed: Callable[[], bool] = lambda: True,
) -> Iterator[Step]:
    """Measures and stores, pausing after every run. `outcome` is filled in on the way."""
    for backend in backends:
        finished = _Finished(backend, plan)
        for operation in operations:
            if operation.name in finished.names:
                outcome.resumed += 1
                continue
            timing = Timing(operation, backend, plan)
            for number, _ in enumerate(timing.steps(undisturbed), 1):
                yield Step(operation.name, backend, min(number, timing.runs), timing.runs)
            rates = timing.rates()
            for method, samples in timing.samples().items():
                outcome.samples += len(samples)
                outcome.missed += misses(rates[operation.name, method], samples)
            outcome.kept = times.store(backend, rates, pace(backend).usual) is not None
            if outcome.kept:
                finished.add(operation.name)
        finished.clear()


class _Finished:
    """The list of operations that are done."""

    def __init__(self, backend: str, plan: Plan) -> None:
        path = times.path_of(backend)
        self._path: Path = path.with_name(f"{path.stem}.unfinished-{plan.passes}x{plan.cells}")
        try:
            self.names = {str(name) for name in json.loads(self._path.read_text())}
        except (OSError, ValueError, TypeError):
            self.names = set()

    def add(self, name: str) -> None:
        self.names.add(name)
        times.write(self._path, json.dumps(sorted(self.names)))

    def clear(self) -> None:
        with suppress(OSError):  # there is none, nor a folder for it
            self._path.unlink()
