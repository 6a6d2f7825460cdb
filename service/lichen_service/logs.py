"""The service's own log: one line of JSON per event on standard error, as the access log writes them.

What the library says through the standard `logging` module takes the same form. JSON escapes every control character,
so nothing that is logged can forge a line.
"""

from __future__ import annotations

import json
import logging
import sys
import time
import traceback
from collections.abc import Mapping
from functools import lru_cache


class Log:
    """Says what happened: a sentence, and fields by name. Safe to use from several threads."""

    def info(self, event: str, **fields: object) -> None:
        _write(_line("info", event, fields))

    def error(self, event: str, **fields: object) -> None:
        _write(_line("error", event, fields))

    def exception(self, event: str, **fields: object) -> None:
        """A defect, with the traceback of the exception being handled."""
        _write(_line("error", event, {**fields, "exception": traceback.format_exc().rstrip()}))


log = Log()


class _Handler(logging.Handler):
    """What is said through `logging`, as one of our lines."""

    def emit(self, record: logging.LogRecord) -> None:
        fields = {} if record.exc_info is None else {"exception": logging.Formatter().formatException(record.exc_info)}
        _write(_line(record.levelname.lower(), record.getMessage(), fields))


def configure() -> None:
    """Sends what the library says to standard error. Called once, when the application is made."""
    library = logging.getLogger("lichen")
    library.handlers[:] = [_Handler()]
    library.setLevel(logging.INFO)
    library.propagate = False


def shown(moment: float) -> str:
    """A time as lines have it: UTC, to the microsecond."""
    return f"{_second(int(moment))}.{int(moment % 1 * 1e6):06d}Z"


@lru_cache(maxsize=2)
def _second(second: int) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(second))


def _line(level: str, event: str, fields: Mapping[str, object]) -> str:
    return json.dumps({**fields, "event": event, "time": shown(time.time()), "level": level}, default=str)


def _write(line: str) -> None:
    sys.stderr.write(line + "\n")  # in one piece: other threads write, too
    sys.stderr.flush()
