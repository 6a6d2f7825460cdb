"""The access log: one line of JSON for each answer.

JSON escapes every control character, so no request can forge a line. The query is kept, cut short, and without the
values of parameters that are secret by their name. NaN in a field of a route becomes null.

Lines are gathered, by any thread, until `flush`, which the loop calls once a round: each write to a stream lets other
threads take the interpreter, and one per request would cost more than the rest of the request.
"""

from __future__ import annotations

import re
import sys
from collections import deque
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any, TextIO

import structlog

from lichen_service.problems import to_json

LONGEST_QUERY = 256
_SECRET = re.compile(r"(?i)(^|&)([^=&]*(?:key|token|secret|signature|password)[^=&]*)=[^&]*")
_PLAIN = (str, int, float, type(None), list, tuple, dict)


class AccessLog:
    """Writes to `stream`, by default standard error."""

    def __init__(
        self, stream: TextIO | None = None, tell: Callable[[Mapping[str, object]], None] | None = None
    ) -> None:
        """`tell` hears the fields of every answer, on the loop's thread."""
        self._stream = stream or sys.stderr
        self._tell = tell
        self._gathered = _Gathered()
        self._log = structlog.wrap_logger(
            self._gathered,
            processors=[
                structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
                structlog.processors.add_log_level,
                structlog.processors.format_exc_info,
                _render,
            ],
            cache_logger_on_first_use=True,
        )

    def answered(self, fields: Mapping[str, object]) -> None:
        self._log.info("request", **fields)
        if self._tell is not None:
            try:
                self._tell(fields)
            except Exception:
                self.failed("figures")

    def failed(self, what: str, **fields: object) -> None:
        """A defect: logged with the traceback of the exception being handled."""
        self._log.error(what, exc_info=True, **fields)

    def flush(self) -> None:
        if text := self._gathered.take():
            self._stream.write(text)
            self._stream.flush()


class _Gathered:
    """The end of structlog's chain; a deque, since lines come from several threads."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque()

    def info(self, line: str) -> None:
        self._lines.append(line + "\n")

    error = info

    def take(self) -> str:
        return "".join(self._lines.popleft() for _ in range(len(self._lines)))


def shown_query(query: str) -> str:
    """
    >>> shown_query("sigma=5&api_key=123")
    'sigma=5&api_key=***'
    """
    kept = _SECRET.sub(r"\1\2=***", query)
    return kept if len(kept) <= LONGEST_QUERY else kept[:LONGEST_QUERY] + "..."


def _render(_logger: object, _method: str, event: MutableMapping[str, Any]) -> str:
    return to_json({name: value if isinstance(value, _PLAIN) else str(value) for name, value in event.items()}).decode()
