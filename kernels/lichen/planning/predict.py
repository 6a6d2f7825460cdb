"""What operations predict of themselves, asked once.

Passes ask for the same many times over: facts of a node's result, how far an error is carried, what its methods state.
All of it follows from the operation, its parameters and the facts of its inputs alone, so answers are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

from lichen.operation import Error, Facts, Operation, OperationParameters
from lichen.stage import Stage

KEPT = 1 << 14
"""Answers of each kind; the longest unused are dropped first."""

Key: TypeAlias = tuple[Operation[Any], OperationParameters, tuple[str, ...], tuple[Facts, ...]]
"""An operation, its parameters, the names of its inputs and their facts."""


@dataclass(frozen=True, slots=True)
class Offer:
    """A method at a setting of its knob, and what it states."""

    error: Error
    work: float
    unfit: str | None


@lru_cache(KEPT)
def result(key: Key) -> Facts:
    operation, parameters, names, known = key
    made: Facts = operation.result(parameters, dict(zip(names, known, strict=True)))
    return made


@lru_cache(KEPT)
def carried(key: Key, error: float) -> float:
    operation, parameters, names, known = key
    return operation.propagate(parameters, dict(zip(names, known, strict=True)), error)


@lru_cache(KEPT)
def offers(key: Key) -> Mapping[tuple[str, float | None], Offer]:
    """What all methods state, at all values of their knobs."""
    methods = key[0].methods.values()
    return {
        (each.name, knob): _stated(key, each.name, knob)
        for each in methods
        for knob in (each.knob.values if each.knob else (None,))
    }


@lru_cache(KEPT)
def offer(key: Key, name: str, knob: float | None) -> Offer:
    """What one method states at one setting."""
    return offers(key).get((name, knob)) or _stated(key, name, knob)


@lru_cache(KEPT)
def stage(key: Key, name: str) -> Stage | None:
    """What one method is as a step of a chain."""
    operation, parameters, names, known = key
    return operation.methods[name].stage(parameters, dict(zip(names, known, strict=True)))


def _stated(key: Key, name: str, knob: float | None) -> Offer:
    operation, parameters, names, known = key
    facts, method = dict(zip(names, known, strict=True)), operation.methods[name]
    setting = knob if knob is not None else 0.0
    error, work = method.error(parameters, setting, facts), method.work(parameters, setting, facts)
    return Offer(error, work, method.unfit(parameters, facts))
