"""JSON as the service reads it from outside: what two parsers could read differently is refused.

Refused are names given twice in one object, NaN and infinity, whole numbers that a double does not hold, numbers
that overflow it, nesting beyond `DEEPEST`, and documents that are too large; depth is counted before anything is read.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

from lichen_service.http.message import Body
from lichen_service.refusals import Refusal

DEEPEST = 64
LARGEST = 1 << 20
"""bytes"""
_EXACT = 1 << 53
_STRUCTURE = re.compile(rb'"(?:[^"\\]|\\.)*"|[\[\]{}]', re.DOTALL)


class _Refused(ValueError):
    pass


def read(body: Body, largest: int = LARGEST) -> Any:
    """The value. Raises the 400 refusal, or the 413 one for a document of more than `largest` bytes."""
    if memoryview(body).nbytes > largest:
        raise Refusal(
            413,
            "too-large",
            "A limit on size was crossed",
            "The JSON document is too large.",
            limit=largest,
            actual=memoryview(body).nbytes,
        )
    raw = bytes(body)
    try:
        _check_depth(raw)
        return json.loads(
            raw.decode("utf-8"),
            object_pairs_hook=_object,
            parse_constant=_constant,
            parse_int=_integer,
            parse_float=_float,
        )
    except (ValueError, RecursionError) as wrong:
        reason = str(wrong).partition("\n")[0] if isinstance(wrong, _Refused | json.JSONDecodeError) else "not UTF-8"
        raise Refusal(400, "malformed-json", "The JSON cannot be read", f"The document is refused: {reason}.") from None


def _check_depth(raw: bytes) -> None:
    depth = 0
    for match in _STRUCTURE.finditer(raw):
        mark = match[0][:1]
        depth += (mark in b"[{") - (mark in b"]}")
        if depth > DEEPEST:
            raise _Refused(f"it is nested more than {DEEPEST} deep")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise _Refused(f"the name {name[:60]!r} is given twice in one object")
        found[name] = value
    return found


def _constant(text: str) -> float:
    raise _Refused(f"{text} is not JSON")


def _integer(text: str) -> int:
    if len(text) > 17 or abs(int(text)) > _EXACT:
        raise _Refused(f"the whole number {text[:24]} is beyond 2^53")
    return int(text)


def _float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise _Refused(f"the number {text[:24]} is beyond what a double holds")
    return value
