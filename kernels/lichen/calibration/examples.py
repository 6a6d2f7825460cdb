"""Which example of an operation stands for it in reports, and what the corpus holds for one."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import Any

from lichen.calibration.corpus import cases, typical
from lichen.operation import InputFacts, Operation

SIZE = 512
"""Side of the image that times are for, px, unless another is asked for."""
SIZES = (64, 4096)
"""The least and the largest that may be asked for."""


@lru_cache(256)
def default_example(operation: Operation[Any]) -> int:
    """The number of the example that shows most: the corpus has images for it, all methods take it, another than the
    first leads clearly; of equals the first."""
    return max(range(len(operation.examples)), key=lambda number: (*_shows(operation, number), -number))


def _shows(operation: Operation[Any], number: int) -> tuple[int, bool]:
    """How many methods take an example, and whether one is predicted to be twice as fast as the first of them."""
    if next(cases(operation, operation.validate(operation.examples[number]), 32), None) is None:
        return 0, False
    parameters = operation.sized(operation.validate(operation.examples[number]), SIZE, SIZE)
    facts = facts_of(operation, number, SIZE)
    fit = [each for each in operation.methods.values() if each.unfit(parameters, facts) is None]
    knobs = [each.knob.values[len(each.knob.values) // 2] if each.knob else 0.0 for each in fit]
    seconds = [each.seconds("opencl", parameters, knob, facts) for each, knob in zip(fit, knobs, strict=True)]
    return len(fit), min(seconds) < seconds[0] / 2


@lru_cache(256)
def facts_of(operation: Operation[Any], number: int, size: int) -> InputFacts:
    """Of the corpus's typical image for an example, by its number, at `size` px, without making it so large."""
    facts = typical(operation, operation.validate(operation.examples[number]), 32).facts
    return {name: dataclasses.replace(each, height=size, width=size) for name, each in facts.items()}
