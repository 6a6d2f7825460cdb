"""What may run for a node: methods at settings of their knobs, of which the passes choose one.

Most are never looked at. The quickest are asked for their errors first, and of a method nothing is asked before it may
be the quickest that is left: first not its work, which may take long to find, and then not its error. Settings that are
known at once to err too much are left out before either. Where errors are known at once and fall from setting to
setting, the last is asked whether any will do, the first that does is looked for by halves, and nothing is asked of
those before it.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

from lichen.once import once
from lichen.operation import Error, Method, Rate
from lichen.planning import predict

Measure = Callable[[Error], float]

IN_SECONDS = Rate(0.0, 1.0)
"""Of work that is counted in seconds."""


class Candidate(NamedTuple):
    """A method at one setting of its knob, with what it would make of a node."""

    method: str
    knob: float | None
    stated: predict.Offer | predict.Told
    rate: Rate = IN_SECONDS
    """how fast it does its work in requests of this kind"""
    passes: str | None = None
    """the input that is handed on as it is, where the method is to leave the node out"""

    @property
    def seconds(self) -> float:
        return self.rate.start + self.rate.step * self.stated.work

    @property
    def error(self) -> Error:
        return self.stated.error

    @property
    def unfit(self) -> str | None:
        """Why it cannot be taken at all."""
        return self.stated.unfit


class Way(NamedTuple):
    """A method of a node at some settings of its knob."""

    about: predict.About
    method: Method[Any]
    settings: tuple[float | None, ...]
    rate: Rate

    @property
    def unfit(self) -> str | None:
        """Why none of them can be taken at all."""
        return self.about.unfit(self.method.name)

    def at(self, setting: float | None) -> Candidate:
        return Candidate(self.method.name, setting, self.about.offer(self.method, setting), self.rate)

    def within(self, limit: float) -> Way | None:
        """Those that can be taken and of which it is not known at once that they err by more."""
        about, method, settings, rate = self
        if self.unfit is not None:
            return None
        if (least := method.least) is None or limit == math.inf:
            return self
        near = tuple([each for each in settings if least(about.parameters, each or 0.0, about.facts) <= limit])
        return Way(about, method, near, rate) if near else None

    @property
    def shortest(self) -> float:
        """Seconds that each of them takes at least: by the work of the first where no other takes less."""
        about, method, settings, rate = self
        if method.lightest is not None:
            return rate.start + rate.step * method.lightest(about.parameters, settings[0] or 0.0, about.facts)
        return self.at(settings[0]).seconds if method.knob is None or method.knob.rising else rate.start

    def in_turn(self, limit: float) -> Iterator[Candidate]:
        """The quickest first, of those that are not found to err by more."""
        method, settings = self.method, self.settings
        if method.orderly and limit < math.inf and self._better(settings[-1]) < -limit:
            return
        if method.orderly and method.knob is not None and method.knob.rising and self._alike:
            settings = settings[-1:]  # the most accurate of equally quick ones
        elif method.orderly and limit < math.inf:
            settings = settings[bisect_left(settings, -limit, 0, len(settings) - 1, key=self._better) :]
        found = map(self.at, settings)
        yield from found if method.knob is None or method.knob.rising else sorted(found, key=_seconds)

    @property
    def _alike(self) -> bool:
        """Whether all take the same, where none takes less than one before it."""
        return self.at(self.settings[0]).seconds == self.at(self.settings[-1]).seconds

    def _better(self, setting: float | None) -> float:
        """Larger for smaller errors, rounding aside."""
        error = self.about.offer(self.method, setting).error
        return error.rounding - min(error.value, error.usual)


@dataclass(frozen=True)
class Offers:
    """Candidates of a node: of ways to compute it, then single ones. What is sought among them is found once."""

    single: tuple[Candidate, ...] = ()
    ways: tuple[Way, ...] = ()

    @once
    def _all(self) -> tuple[Candidate, ...]:
        return (*[way.at(setting) for way in self.ways for setting in way.settings], *self.single)

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self._all)

    def __len__(self) -> int:
        return sum([len(way.settings) for way in self.ways]) + len(self.single)

    @property
    def possible(self) -> bool:
        """Whether any of them can be taken."""
        return any(way.unfit is None for way in self.ways) or any(offer.unfit is None for offer in self.single)

    @once
    def usable(self) -> Offers:
        """Those that can be taken."""
        single = tuple([offer for offer in self.single if offer.unfit is None])
        return Offers(single, tuple([way for way in self.ways if way.unfit is None]))

    def named(self, method: str, setting: float | None) -> Candidate | None:
        """That method at that setting, if it is among them."""
        for way in self.ways:
            if way.method.name == method and setting in way.settings:
                return way.at(setting)
        return next((offer for offer in self.single if (offer.method, offer.knob) == (method, setting)), None)

    def best(self, measure: Measure) -> Candidate:
        """The most accurate that can be taken, of equally accurate ones the quickest. Those that are known to be less
        accurate are not asked."""
        found = self._best.get(measure)
        if found is None:
            least, alike = (math.inf, math.inf), list[Candidate]()
            for offer in sorted((offer for offer in self if offer.unfit is None), key=_least):
                if offer.stated.least > least[0]:
                    break
                error = offer.stated.error
                if (told := (measure(error), error.usual)) <= least:
                    least, alike = told, [*alike, offer] if told == least else [offer]
            found = self._best[measure] = alike[0] if len(alike) == 1 else min(alike, key=_seconds)
        return found

    def first(self, measure: Measure, limit: float) -> Candidate | None:
        """The quickest that can be taken whose error measures no more than the limit; of equally quick ones the most
        accurate."""
        question = measure, limit
        if question not in self._first:
            if len(self._first) >= MOST_LIMITS:
                self._first.clear()
            able = self.in_turn(limit)
            self._first[question] = next((offer for offer in able if measure(offer.stated.error) <= limit), None)
        return self._first[question]

    def in_turn(self, limit: float = math.inf) -> Iterator[Candidate]:
        """Those that can be taken and of which it is not known at once that they err by more: the quickest first, of
        equally quick ones the most accurate. No error is asked for but theirs."""
        turns = self._turns.get(limit)
        if turns is not None:
            yield from turns
            return
        turns = []
        for equal in self._together(limit):
            turns += equal
            yield from equal
        if len(self._turns) >= MOST_LIMITS:
            self._turns.clear()
        self._turns[limit] = turns

    def _together(self, limit: float) -> Iterator[list[Candidate]]:
        """As `in_turn`, together with those that take as long."""
        if len(self) == 1:
            yield [offer for offer in self if offer.unfit is None]
            return
        # By what they take, which of a way that nobody has looked into is what it takes at least; and by their places.
        heap: list[tuple[float, int, Candidate | None, Way | Iterator[Candidate]]] = []
        place = 0
        for way in self.ways:
            heap.append((way.rate.start, place, None, way))
            place += len(way.settings)
        for offer in self.single:
            if offer.unfit is None:
                heap.append((offer.seconds, place, offer, iter(())))
            place += 1
        heapify(heap)
        equal = list[tuple[int, Candidate]]()
        while heap:
            seconds, place, found, others = heappop(heap)
            if isinstance(others, Way):
                near, others = others.within(limit), iter(())
                if near is not None and (least := near.shortest) > seconds:
                    heappush(heap, (least, place, None, near.in_turn(limit)))
                elif near is not None:
                    others = near.in_turn(limit)
            if found is not None:
                equal.append((place, found))
                place += 1
            if (further := next(others, None)) is not None:
                heappush(heap, (further.seconds, place, further, others))
            if equal and not (heap and heap[0][0] <= seconds):
                if len(equal) > 1:
                    equal.sort(key=lambda each: (each[1].error.value, each[0]))
                yield [offer for _, offer in equal]
                equal.clear()

    @once
    def quickest(self) -> Candidate:
        return next(self.in_turn())

    @once
    def _first(self) -> dict[tuple[Measure, float], Candidate | None]:
        return {}

    @once
    def _turns(self) -> dict[float, list[Candidate]]:
        return {}

    @once
    def _best(self) -> dict[Measure, Candidate]:
        return {}


def _least(offer: Candidate) -> float:
    return offer.stated.least


def _seconds(offer: Candidate) -> float:
    return offer.seconds


NOTHING = Offers()
MOST_LIMITS = 16
"""By which the same candidates are told apart and remembered."""
