"""The kind of a request: what it has in common with those that take the same paths through a method.

How long a method takes follows from its work, which it counts by itself, and from what no count of steps knows: whether
there is a mask, which border, which chart. So times are measured for each kind apart, as far as the examples of an
operation show them. Parameters of one kind agree in all that is no number, in which numbers are given at all, and in
which are 0; so do the names of the inputs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from pydantic import BaseModel

_NAMES, _NUMBERS = (str, bool), (int, float)


def kind(parameters: BaseModel, inputs: Iterable[str]) -> str:
    """A few letters that stand for it."""
    # Not what iterating a model gives, which is what it keeps of its own findings, too.
    told = [(name, _shape(getattr(parameters, name))) for name in type(parameters).model_fields]
    return _letters(tuple(told), tuple(sorted(inputs)))


@lru_cache(1024)
def _letters(told: tuple[tuple[str, str | bool | None], ...], inputs: tuple[str, ...]) -> str:
    return hashlib.sha256(json.dumps([told, inputs]).encode()).hexdigest()[:12]


def _shape(value: Any) -> str | bool | None:
    """What is left of a value without its amount."""
    if value is None or isinstance(value, _NAMES):
        return value
    return bool(value) if isinstance(value, _NUMBERS) else type(value).__name__
