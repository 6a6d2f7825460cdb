"""Times of this machine: which runs tell most, running them, and the rates that follow.

A `Cell` is one setting on the typical image at one size. For every method a handful of cells is taken whose predicted
times spread from the start-up cost to the longest run allowed, since the two numbers of a rate need both ends. Cells
are run in turn, several passes of them, so that a machine that is slow for a second harms one run of many cells instead
of all runs of one. A cell's quickest run counts: whatever else happens on a machine only ever adds time.

Predictions before anything is measured may be far off: where the first pass shows that all cells of a method are short,
the longest that this machine has time for is added.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from lichen.calibration.corpus import Case, typical
from lichen.calibration.fit import Sample, fit
from lichen.calibration.sweep import Setting, settings
from lichen.catalogue import operation
from lichen.operation import Operation, Rate

SIDES = (32, 64, 128, 256, 512, 1024, 1536)


@dataclass(frozen=True, slots=True)
class Plan:
    """How thoroughly to measure."""

    longest: float
    """seconds that one run may be predicted to take"""
    cells: int
    """for each method"""
    passes: int


QUICK = Plan(longest=0.016, cells=6, passes=3)
"""No run is long enough to be in anybody's way."""
THOROUGH = Plan(longest=0.2, cells=12, passes=5)


@dataclass(frozen=True, slots=True)
class Cell:
    """One setting at one example and one size."""

    operation: str
    example: int
    method: str
    knob: float | None
    size: int
    predicted: float

    def run(self, backend: str) -> float:
        """Seconds of one run."""
        owner = operation(self.operation)
        case, parameters = _prepared(self.operation, self.example, self.size)
        setting = Setting(owner.methods[self.method], self.knob)
        began = time.perf_counter()
        setting.compute(backend, case.inputs, parameters)
        return time.perf_counter() - began

    @property
    def work(self) -> float:
        case, parameters = _prepared(self.operation, self.example, self.size)
        return Setting(operation(self.operation).methods[self.method], self.knob).work(case, parameters)


@lru_cache(maxsize=32)
def _prepared(name: str, example: int, size: int) -> tuple[Case, Any]:
    owner = operation(name)
    parameters = owner.sized(owner.validate(owner.examples[example]), size, size)
    return typical(owner, parameters, size), parameters


def cells(owner: Operation[Any], backend: str, plan: Plan) -> list[Cell]:
    """For each method the cells whose predicted times lie evenly, on a scale of decades, up to the longest allowed."""
    return [cell for offered in _offered(owner, backend).values() for cell in _spread(offered, plan)]


def _offered(owner: Operation[Any], backend: str) -> dict[str, list[Cell]]:
    """All there are, by method."""
    found: dict[str, list[Cell]] = {}
    for size in SIDES:
        for example in range(len(owner.examples)):
            small, parameters = _prepared(owner.name, example, SIDES[0])
            facts = {key: dataclasses.replace(each, height=size, width=size) for key, each in small.facts.items()}
            for setting in settings(owner):
                method = setting.method
                if method.unfit(parameters, facts) is None:
                    predicted = method.seconds(backend, parameters, setting.knob or 0.0, facts)
                    cell = Cell(owner.name, example, method.name, setting.knob, size, predicted)
                    found.setdefault(method.name, []).append(cell)
    return found


def _spread(offered: Sequence[Cell], plan: Plan) -> Iterator[Cell]:
    """Cells nearest to evenly spaced times; the shortest one where all take too long."""
    affordable = [cell for cell in offered if cell.predicted <= plan.longest]
    if not affordable:
        yield min(offered, key=lambda cell: cell.predicted)
        return
    ordered = sorted(affordable, key=lambda cell: cell.predicted)
    low, high = (math.log(cell.predicted) for cell in (ordered[0], ordered[-1]))
    taken: set[int] = set()
    for step in range(plan.cells):
        wanted = low + (high - low) * step / max(plan.cells - 1, 1)
        free = [i for i in range(len(ordered)) if i not in taken]
        if not free:
            return
        # Among equals the larger image: what it costs to move memory must show.
        nearest = min(free, key=lambda i: (round(abs(math.log(ordered[i].predicted) - wanted), 1), -ordered[i].size))
        taken.add(nearest)
        yield ordered[nearest]


@dataclass
class Timing:
    """The runs of one operation on one backend, taken one at a time so that the caller may do other things between."""

    owner: Operation[Any]
    backend: str
    plan: Plan
    seconds: dict[Cell, list[float]] = field(default_factory=dict)
    _added: set[Cell] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.seconds = {cell: [] for cell in cells(self.owner, self.backend, self.plan)}

    @property
    def runs(self) -> int:
        """How many there are to come in all, one more for each cell to warm it up; cells that are added miss two."""
        return len(self.seconds) * (self.plan.passes + 1) - 2 * len(self._added)

    def steps(self, undisturbed: Callable[[], bool] = lambda: True) -> Iterator[Cell]:
        """Makes all runs, pausing after each. A run during which `undisturbed` turned false is made again, once."""
        for number in range(self.plan.passes + 1):
            if number == 2 < self.plan.passes:
                self._add_longer()
            for cell, kept in self.seconds.items():
                seconds = cell.run(self.backend)
                if not undisturbed():
                    yield cell
                    seconds = cell.run(self.backend)
                if number > (2 if cell in self._added else 0):
                    kept.append(seconds)
                yield cell

    def _add_longer(self) -> None:
        """The longest affordable cell of each method, by what the first pass took, where it is twice as long as any."""
        for method, offered in _offered(self.owner, self.backend).items():
            known = [(cell, kept[0]) for cell, kept in self.seconds.items() if cell.method == method]
            scale = statistics.median(took / cell.predicted for cell, took in known)
            short = 2 * max(took for _, took in known)
            longer = [cell for cell in offered if short < scale * cell.predicted <= self.plan.longest]
            if longer:
                cell = max(longer, key=lambda cell: cell.predicted)
                self._added.add(cell)
                self.seconds[cell] = []

    def samples(self) -> dict[str, list[Sample]]:
        """By method."""
        found: dict[str, list[Sample]] = {}
        for cell, kept in self.seconds.items():
            if kept:
                found.setdefault(cell.method, []).append(Sample(cell.work, min(kept)))
        return found

    def rates(self) -> dict[tuple[str, str], Rate]:
        """What the runs so far say, by operation and method."""
        declared = {name: method.rates[self.backend] for name, method in self.owner.methods.items()}
        return {(self.owner.name, name): fit(own, declared[name]) for name, own in self.samples().items()}
