"""Parameters on their way out: Python's and NumPy's values as text and as JSON."""

from __future__ import annotations

import json
from enum import Enum
from typing import Any


def as_text(value: Any) -> str:
    """A parameter as the query carries it."""
    value = plain(value)
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, int | float) else json.dumps(value, separators=(",", ":"), default=plain)


def plain(value: Any) -> Any:
    """Enumerations by value, NumPy's numbers and vectors as Python's own, tuples as lists."""
    if isinstance(value, Enum):
        return plain(value.value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, str | bool | int | float | list | tuple | dict) or value is None:
        return value
    raise TypeError(f"a parameter is a number, text, boolean, sequence or mapping, not {type(value).__name__}")
