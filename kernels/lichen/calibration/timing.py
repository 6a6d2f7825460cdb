"""Times of this machine: which runs tell most, running them, and the rates that follow.

A `Cell` is one setting on the typical image at one size. For every method and every kind of request among the examples
a few cells are taken whose predicted times spread from the start-up cost to the longest run allowed, since the two
numbers of a rate need both ends. Cells are run in turn, several passes of them, so that a machine that is slow for a
second harms one run of many cells instead of all runs of one. The lower quartile of a cell's runs counts: whatever
else happens on a machine only ever adds time, but nobody meets the quickest run of all.

A quick plan measures of each method one setting at one example, and takes from elsewhere how requests of other kinds
compare with it (`lichen.calibration.kinds`); a thorough one measures all kinds.

Predictions before anything is measured may be far off. Of each method the cells are warmed up from the shortest on, and
none is begun that would take far too long by what shorter ones took; where the first pass shows that there is time for
others, up to the longest that this machine affords, they are added.

A machine whose clock or neighbours change runs everything slower for seconds on end, by up to 1.75 times where this was
written. So what a run took counts as much of what a `Pace` took beside it, a small task that is always the same.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any

from lichen.calibration.corpus import Case, typical
from lichen.calibration.fit import Sample, apart, fit
from lichen.calibration.kinds import PLAIN, compared, general, known
from lichen.calibration.pace import lower_quartile, pace
from lichen.calibration.sweep import Setting, settings
from lichen.catalogue import operation
from lichen.kind import kind
from lichen.operation import Method, Operation, Rate

SIDES = (32, 64, 120, 250, 500, 1000, 1500)
"""px; powers of two are no typical ones: rows that start so far apart share places of a cache."""
LEAST = 2
"""Cells of a method and a kind: what is left of a few when there are many kinds."""
ALIKE = 1.25
"""A kind of request whose runs lie within this factor of what all kinds together tell, in the median, is none of its
own: it has few runs, which scatter as much, and methods would compare by that."""
TOO_LONG = 4.0
"""Times the longest run allowed, beyond which no run is begun that is known to take so long."""


@dataclass(frozen=True, slots=True)
class Plan:
    """How thoroughly to measure."""

    longest: float
    """seconds that one run may be predicted to take"""
    cells: int
    """for each method, two at least for each kind"""
    passes: int
    kinds: bool = True
    """whether every kind of request is measured, or one alone and the others by how they compare with it"""


QUICK = Plan(longest=0.006, cells=2, passes=3, kinds=False)
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
        """Seconds of one run, on pictures of which nothing is kept."""
        owner = operation(self.operation)
        case, parameters = _prepared(self.operation, self.example, self.size)
        setting = Setting(owner.methods[self.method], self.knob)
        inputs = {name: image.replace() for name, image in case.inputs.items()}
        began = time.perf_counter()
        setting.compute(backend, inputs, parameters)
        return time.perf_counter() - began

    @property
    def kind(self) -> str:
        """Of the request."""
        return _kind(self.operation, self.example)

    @property
    def work(self) -> float:
        case, parameters = _prepared(self.operation, self.example, self.size)
        return Setting(operation(self.operation).methods[self.method], self.knob).work(case, parameters)


@lru_cache(maxsize=32)
def _prepared(name: str, example: int, size: int) -> tuple[Case, Any]:
    owner = operation(name)
    parameters = owner.sized(owner.validate(owner.examples[example]), size, size)
    return typical(owner, parameters, size), parameters


@lru_cache(maxsize=1024)
def _kind(name: str, example: int) -> str:
    case, parameters = _prepared(name, example, SIDES[0])
    return kind(parameters, case.inputs)


def cells(owner: Operation[Any], backend: str, plan: Plan) -> list[Cell]:
    """For each method and kind the cells whose predicted times lie evenly, on a scale of decades, up to the longest
    allowed."""
    offered = _offered(owner, backend, plan)
    return [cell for way, own in offered.items() for cell in _spread(own, plan, _wanted(way, offered, plan))]


Way = tuple[str, str]
"""A method and a kind of request."""


def _wanted(way: Way, offered: Mapping[Way, Sequence[Cell]], plan: Plan) -> int:
    """How many cells."""
    return max(LEAST, plan.cells // sum(method == way[0] for method, _ in offered))


def _offered(owner: Operation[Any], backend: str, plan: Plan) -> dict[Way, list[Cell]]:
    """All there are."""
    found: dict[Way, list[Cell]] = {}
    for example, tried in _tried(owner, plan):
        small, fitted = _prepared(owner.name, example, SIDES[0])
        for size in SIDES:
            parameters = owner.sized(fitted, size, size)
            facts = {key: dataclasses.replace(each, height=size, width=size) for key, each in small.facts.items()}
            for setting in tried:
                method = setting.method
                if method.unfit(parameters, facts) is None:
                    rate = _foretold(owner, method, backend, _kind(owner.name, example))
                    predicted = rate.seconds(method.work(parameters, setting.knob or 0.0, facts))
                    cell = Cell(owner.name, example, method.name, setting.knob, size, predicted)
                    found.setdefault((method.name, cell.kind), []).append(cell)
    return found


def _foretold(owner: Operation[Any], method: Method[Any], backend: str, kind: str) -> Rate:
    """As some machine took it: the table of kinds knows more than the declaration."""
    told = known(backend, owner.name, method.name)
    return told.get(kind) or told.get(PLAIN) or method.rates[backend]


def _tried(owner: Operation[Any], plan: Plan) -> Iterator[tuple[int, list[Setting]]]:
    """Examples with the settings that are looked at there: all of them, or of each method the middle one at the first
    example that it takes."""
    left = dict(owner.methods)
    for example in range(len(owner.examples)):
        if plan.kinds:
            yield example, list(settings(owner))
            continue
        case, parameters = _prepared(owner.name, example, SIDES[0])
        able = [each for each in left.values() if each.unfit(parameters, case.facts) is None]
        for each in able:
            del left[each.name]
        if able:
            yield example, [Setting(each, _middle(each)) for each in able]


def _middle(method: Method[Any]) -> float | None:
    return method.knob.values[len(method.knob.values) // 2] if method.knob else None


def _spread(offered: Sequence[Cell], plan: Plan, count: int, scale: float = 1.0) -> Iterator[Cell]:
    """So many cells, nearest to evenly spaced times, on a machine that takes `scale` times what is predicted; the
    shortest one where all take too long."""
    affordable = [cell for cell in offered if scale * cell.predicted <= plan.longest]
    if not affordable:
        yield min(offered, key=lambda cell: cell.predicted)
        return
    ordered = sorted(affordable, key=lambda cell: cell.predicted)
    low, high = (math.log(cell.predicted) for cell in (ordered[0], ordered[-1]))
    taken: set[int] = set()
    for step in range(count):
        wanted = low + (high - low) * step / max(count - 1, 1)
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
        chosen = sorted(cells(self.owner, self.backend, self.plan), key=lambda cell: cell.predicted)
        self.seconds = {cell: [] for cell in chosen}

    @property
    def runs(self) -> int:
        """How many there are to come in all, one more for each cell to warm it up; cells that are added miss two."""
        return len(self.seconds) * (self.plan.passes + 1) - 2 * len(self._added)

    def steps(self, undisturbed: Callable[[], bool] = lambda: True) -> Iterator[Cell]:
        """Makes all runs, pausing after each. A run during which `undisturbed` turned false is made again, once."""
        beside = pace(self.backend)
        yield from self._warm()
        for number in range(1, self.plan.passes + 1):
            if number == 2 < self.plan.passes:
                self._add()
            for cell, kept in self.seconds.items():
                seconds = beside.paced(partial(cell.run, self.backend))
                if not undisturbed():
                    yield cell
                    seconds = beside.paced(partial(cell.run, self.backend))
                if number > (2 if cell in self._added else 0):
                    kept.append(seconds)
                yield cell

    def _warm(self) -> Iterator[Cell]:
        """Runs all cells for the first time, shortest first, but those that are bound to take far too long."""
        scales: dict[Way, float] = {}
        for cell in list(self.seconds):
            way = cell.method, cell.kind
            if scales.get(way, 0.0) * cell.predicted > TOO_LONG * self.plan.longest:
                del self.seconds[cell]
                continue
            took = cell.run(self.backend)
            if took > self.plan.longest:  # a program may have been built
                took = cell.run(self.backend)
            scales[way] = took / cell.predicted
            yield cell

    def _add(self) -> None:
        """Cells that the first pass shows to be affordable, where there are fewer than there might be; in any case the
        longest, where it takes twice as long as any."""
        all_of_them = _offered(self.owner, self.backend, self.plan)
        for way, offered in all_of_them.items():
            known = {cell: kept[0] for cell, kept in self.seconds.items() if (cell.method, cell.kind) == way}
            count = _wanted(way, all_of_them, self.plan)
            scale = statistics.median(took / cell.predicted for cell, took in known.items())
            further = [cell for cell in _spread(offered, self.plan, count, scale) if cell not in known]
            short = 2 * max(known.values())
            longer = [cell for cell in further if short < scale * cell.predicted <= self.plan.longest]
            chosen = [max(longer, key=lambda cell: cell.predicted)] if longer else []
            room = count - len(known) - len(chosen)
            chosen += [cell for cell in further if cell not in chosen][: max(room, 0)]
            self._added.update(chosen)
            self.seconds.update((cell, []) for cell in chosen)

    def samples(self) -> dict[str, list[Sample]]:
        """By method."""
        found: dict[str, list[Sample]] = {}
        for cell, kept in self.seconds.items():
            if kept:
                found.setdefault(cell.method, []).append(Sample(cell.work, lower_quartile(kept)))
        return found

    def rates(self) -> dict[tuple[str, str], Rate]:
        """What the runs so far say, by operation and method."""
        runs: dict[tuple[str, ...], dict[str, list[Sample]]] = {}
        for cell, kept in self.seconds.items():
            if kept:
                own = runs.setdefault(self._alike(cell.method), {})
                own.setdefault(cell.kind, []).append(Sample(cell.work, lower_quartile(kept)))
        found = {names: self._rate(names[0], own) for names, own in runs.items()}
        return {(self.owner.name, name): rate for names, rate in found.items() for name in names}

    def _alike(self, name: str) -> tuple[str, ...]:
        """The methods that run what this one does, itself among them."""
        body = self.owner.methods[name].body
        return tuple(each.name for each in self.owner.methods.values() if body and each.body == body) or (name,)

    def _rate(self, name: str, own: Mapping[str, Sequence[Sample]]) -> Rate:
        """Of the methods that run what `name` does, by samples of each kind."""
        declared = self.owner.methods[name].rates[self.backend]
        overall = fit([each for taken in own.values() for each in taken], declared)
        if self.plan.kinds:
            odd = [each for each, taken in own.items() if apart(overall, taken) > ALIKE]
            alike = [each for kind, taken in own.items() if kind not in odd for each in taken]
            overall = fit(alike, declared) if alike else overall
            kinds = {each: fit(own[each], overall) for each in odd}
        else:
            kind, taken = next(iter(own.items()))
            told = known(self.backend, self.owner.name, name)
            kinds = compared(told, kind, taken, general(self.backend, pace(self.backend).usual))
            overall = kinds.pop(PLAIN, kinds.get(kind, overall))
        return Rate(overall.start, overall.step, kinds)
