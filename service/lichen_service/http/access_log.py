"""The access log: one line of JSON for each answer.

JSON escapes every control character, so no request can forge a line. The query is kept, cut short, and without the
values of parameters that are secret by their name. NaN in a field of a route becomes null.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, MutableMapping
from typing import Any, TextIO

import structlog

from lichen_service.problems import to_json

LONGEST_QUERY = 256
_SECRET = re.compile(r"(?i)(^|&)([^=&]*(?:key|token|secret|signature|password)[^=&]*)=[^&]*")


class AccessLog:
    """Writes to `stream`, by default standard error."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._log = structlog.wrap_logger(
            structlog.WriteLogger(stream or sys.stderr),
            processors=[
                structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
                structlog.processors.add_log_level,
                structlog.processors.format_exc_info,
                _render,
            ],
        )

    def answered(self, fields: Mapping[str, object]) -> None:
        self._log.info("request", **fields)

    def failed(self, what: str, **fields: object) -> None:
        """A defect: logged with the traceback of the exception being handled."""
        self._log.error(what, exc_info=True, **fields)


def shown_query(query: str) -> str:
    """
    >>> shown_query("sigma=5&api_key=123")
    'sigma=5&api_key=***'
    """
    kept = _SECRET.sub(r"\1\2=***", query)
    return kept if len(kept) <= LONGEST_QUERY else kept[:LONGEST_QUERY] + "..."


def _render(_logger: object, _method: str, event: MutableMapping[str, Any]) -> str:
    return to_json({name: value if _is_plain(value) else str(value) for name, value in event.items()}).decode()


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, str | int | float | bool | list | tuple | dict)
