"""The access log: one line of JSON for each answer.

JSON escapes every control character, so no request can forge a line. The query is kept, cut short, and without the
values of parameters that are secret by their name. NaN in a field of a route becomes null.

Lines are gathered, by any thread, until `flush`, which the loop calls every few milliseconds: each write to a stream
lets other threads take the interpreter, and a line costs a third as much when it is made beside others.
"""

from __future__ import annotations

import re
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TextIO

from pydantic_core import PydanticSerializationError
from pydantic_core import to_json as quickly_to_json

from lichen_service.logs import shown
from lichen_service.problems import to_json

LONGEST_QUERY = 256
_SECRETIVE = ("key", "token", "secret", "signature", "password")
_SECRET = re.compile(rf"(?i)(^|&)([^=&]*(?:{'|'.join(_SECRETIVE)})[^=&]*)=[^&]*")
_PLAIN = (str, int, float, type(None), list, tuple, dict)


class Recorded(Protocol):
    def record(self) -> dict[str, Any]:
        """The fields of a line, made anew."""


Tell = Callable[[Sequence[Mapping[str, Any]]], None]


class AccessLog:
    """Writes to `stream`, by default standard error."""

    def __init__(self, stream: TextIO | None = None, tell: Tell | None = None) -> None:
        """`tell` hears the lines of answers as they are written."""
        self._stream = stream or sys.stderr
        self._tell = tell
        self._answered: deque[tuple[float, Recorded]] = deque()
        self._failed: deque[str] = deque()

    def answered(self, exchange: Recorded) -> None:
        """An answer has left; what is written of it is asked of the exchange then."""
        self._answered.append((time.time(), exchange))

    def failed(self, what: str, **fields: object) -> None:
        """A defect: logged with the traceback of the exception being handled."""
        raised = traceback.format_exc().rstrip()
        said = {"event": what, "time": shown(time.time()), "level": "error", "exception": raised}
        self._failed.append(_written({**fields, **said}))

    @property
    def failures(self) -> int:
        """Defects whose lines are not written yet."""
        return len(self._failed)

    def flush(self) -> None:
        lines = []
        for _ in range(len(self._answered)):
            moment, exchange = self._answered.popleft()
            line = exchange.record()
            line["event"], line["time"], line["level"] = "request", shown(moment), "info"
            lines.append(line)
        if lines and self._tell is not None:
            try:
                self._tell(lines)
            except Exception:
                self.failed("figures")
        failed = [self._failed.popleft() for _ in range(len(self._failed))]
        if text := "".join([*failed, *map(_written, lines)]):
            self._stream.write(text)
            self._stream.flush()


def shown_query(query: str) -> str:
    """
    >>> shown_query("sigma=5&api_key=123")
    'sigma=5&api_key=***'
    """
    lower = query.lower()
    kept = _SECRET.sub(r"\1\2=***", query) if any(each in lower for each in _SECRETIVE) else query
    return kept if len(kept) <= LONGEST_QUERY else kept[:LONGEST_QUERY] + "..."


def _written(line: Mapping[str, Any]) -> str:
    try:
        return quickly_to_json(line, inf_nan_mode="null", fallback=str).decode() + "\n"
    except PydanticSerializationError:  # text that is not Unicode
        return to_json(_plain(line)).decode() + "\n"


def _plain(line: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value if isinstance(value, _PLAIN) else str(value) for name, value in line.items()}
