"""What operations predict of themselves, asked once and not before it is needed.

Passes ask for the same many times over: facts of a node's result, how far an error is carried, what its methods state.
All of it follows from the operation, its parameters and the facts of its inputs alone, so answers are kept: `about`
finds what was asked before of the same three, and `About` keeps what it is told.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

from lichen.joining import Link
from lichen.kind import kind
from lichen.once import once
from lichen.operation import Error, Facts, Method, Operation, OperationParameters
from lichen.stage import Stage

KEPT = 1 << 12
"""Of which answers are kept; the longest unused are dropped first. What a Gaussian says of itself takes 11 kB."""

Key: TypeAlias = tuple[Operation[Any], OperationParameters, tuple[str, ...], tuple[Facts, ...]]
"""An operation, its parameters, the names of its inputs and their facts."""


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of a candidate without asking a method."""

    error: Error
    work: float = 0.0
    unfit: str | None = None
    least: float = 0.0


class Offer:
    """A method at a setting of its knob, and what it states when asked: an error may take milliseconds to prove."""

    def __init__(self, about: About, method: Method[Any], knob: float | None) -> None:
        self._about, self._method = about, method
        self._setting = 0.0 if knob is None else knob

    @once
    def error(self) -> Error:
        return self._method.error(self._about.parameters, self._setting, self._about.facts)

    @once
    def least(self) -> float:
        """What the error is at least, rounding aside."""
        least = self._method.least
        return 0.0 if least is None else least(self._about.parameters, self._setting, self._about.facts)

    @once
    def work(self) -> float:
        return self._method.work(self._about.parameters, self._setting, self._about.facts)

    @property
    def unfit(self) -> str | None:
        """Why it cannot be taken at all."""
        return self._about.unfit(self._method.name)


class About:
    """What an operation says of itself for some parameters and inputs. Answers are the same whoever asks first, so
    threads need no turns."""

    def __init__(self, key: Key) -> None:
        self.operation, self.parameters, names, self.known = key
        self.facts = dict(zip(names, self.known, strict=True))
        pictures = {each.name for each in self.operation.inputs if each.picture}
        self.data = tuple([number for number, name in enumerate(names) if name not in pictures])
        """which of its inputs are no pictures"""
        self.kept: dict[object, Any] = {}
        """what passes make of it, by their own keys"""
        self._carried: dict[float, float] = {}
        self._stages: dict[str, Stage | None] = {}
        self._unfit: dict[str, str | None] = {}
        self._offers: dict[tuple[str, float | None], Offer] = {}

    @once
    def result(self) -> Facts:
        return self.operation.result(self.parameters, self.facts)

    @once
    def kind(self) -> str:
        """Of the request, by which rates may differ."""
        return kind(self.parameters, self.facts)

    def carried(self, error: float) -> float:
        found = self._carried.get(error)
        if found is None:
            if len(self._carried) >= MOST_ERRORS:
                self._carried.clear()
            found = self._carried[error] = self.operation.propagate(self.parameters, self.facts, error)
        return found

    def unfit(self, name: str) -> str | None:
        """Why a method cannot be taken at all; None where it can."""
        if name not in self._unfit:
            self._unfit[name] = self.operation.methods[name].unfit(self.parameters, self.facts)
        return self._unfit[name]

    @once
    def offers(self) -> Mapping[tuple[str, float | None], Offer]:
        """What all methods state, at all values of their knobs."""
        return {
            (method.name, setting): self.offer(method, setting)
            for method in self.operation.methods.values()
            for setting in method.settings
        }

    def offer(self, method: Method[Any], knob: float | None) -> Offer:
        """What one method states at one setting."""
        found = self._offers.get((method.name, knob))
        if found is None:
            found = Offer(self, method, knob)
            if knob in method.settings:  # there is no end of others
                self._offers[method.name, knob] = found
        return found

    def stage(self, name: str) -> Stage | None:
        """What one method is as a step of a chain."""
        if name not in self._stages:
            self._stages[name] = self.operation.methods[name].stage(self.parameters, self.facts)
        return self._stages[name]

    @once
    def staged(self) -> tuple[str, ...]:
        """The methods that are steps of a chain."""
        return tuple([name for name in self.operation.methods if self.stage(name) is not None])

    @once
    def departure(self) -> Mapping[str, float]:
        """How far its output is from its inputs at most."""
        return self.operation.departure(self.parameters, self.facts)

    @once
    def identity(self) -> str | None:
        """Why it returns its first input."""
        return self.operation.identity(self.parameters, self.facts) if self.facts else None

    @once
    def link(self) -> Link | None:
        """What it is for its neighbours."""
        return self.operation.link(self.parameters, self.facts)


MOST_ERRORS = 256
"""That are carried through one operation and remembered."""


@lru_cache(KEPT)
def about(key: Key) -> About:
    return About(key)
