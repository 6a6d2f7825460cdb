"""The service's own log: one line of JSON per event on standard error, as the access log writes them.

What the library says through the standard `logging` module takes the same form.
"""

from __future__ import annotations

import logging
import sys
from typing import TextIO

import structlog

_SHARED: list[structlog.typing.Processor] = [
    structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
    structlog.processors.add_log_level,
    structlog.processors.format_exc_info,
]
_RENDER = structlog.processors.JSONRenderer(default=str)


def configure(stream: TextIO | None = None) -> None:
    """Sends all events to `stream` (standard error by default). Called once, when the application is made."""
    target = stream or sys.stderr
    structlog.configure(processors=[*_SHARED, _RENDER], logger_factory=structlog.WriteLoggerFactory(target))
    handler = logging.StreamHandler(target)
    handler.setFormatter(structlog.stdlib.ProcessorFormatter(processor=_RENDER, foreign_pre_chain=_SHARED))
    library = logging.getLogger("lichen")
    library.handlers[:] = [handler]
    library.setLevel(logging.INFO)
    library.propagate = False
