"""What may run for a node: methods at settings of their knobs, of which the passes choose one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from lichen.once import once
from lichen.operation import Error, Rate
from lichen.planning import predict

IN_SECONDS = Rate(0.0, 1.0)
"""Of work that is counted in seconds."""


@dataclass(frozen=True, slots=True)
class Candidate:
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


class Offers(tuple[Candidate, ...]):
    """Candidates of a node. What is sought among them is found once."""

    def least(self, key: Callable[[Candidate], Any]) -> Candidate:
        """The least by a key; one function for every question, or it is asked anew."""
        if key not in self._least:
            self._least[key] = min(self, key=key)
        return self._least[key]

    @once
    def usable(self) -> Offers:
        """Those that can be taken."""
        return Offers([offer for offer in self if offer.unfit is None])

    def able(self, limit: float) -> Offers:
        """Those whose errors are not known to be larger. No more than that is asked of the others: neither their errors
        nor their work, which may take long to find."""
        found = self._able.get(limit)
        if found is None:
            if len(self._able) >= MOST_LIMITS:
                self._able.clear()
            found = self._able[limit] = Offers([offer for offer in self if offer.stated.least <= limit])
        return found

    def in_turn(self) -> Iterator[Candidate]:
        """The quickest first, and of equally quick ones the most accurate. No error is asked for but theirs."""
        known = self.__dict__.get("_turns")
        if known is not None:
            yield from known
            return
        turns: list[Candidate] = []
        for _, together in groupby(sorted(self, key=_seconds), key=_seconds):
            equal = list(together)
            if len(equal) > 1:
                equal.sort(key=lambda offer: offer.error.value)
            turns += equal
            yield from equal
        self.__dict__["_turns"] = turns

    @once
    def quickest(self) -> Candidate:
        return next(self.in_turn())

    @once
    def _able(self) -> dict[float, Offers]:
        return {}

    @once
    def _least(self) -> dict[Callable[[Candidate], Any], Candidate]:
        return {}


def _seconds(offer: Candidate) -> float:
    return offer.seconds


NOTHING = Offers()
MOST_LIMITS = 16
"""By which the same candidates are told apart and remembered."""
