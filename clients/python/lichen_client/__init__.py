"""Lichen from Python: pixels in, pixels and a report out.

    from lichen_client import Client

    with Client("http://127.0.0.1:8080") as client:
        result = client.gaussian("photo.jpg", sigma=5)
        result.array            # NumPy, (height, width, channels)
        result.report.error     # how far it may be from the exact result

Importing this package imports neither NumPy nor an HTTP library; the first client does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lichen_client.calls import Asset
from lichen_client.client import Client, Job
from lichen_client.errors import (
    BadRequest,
    Conflict,
    ConnectionFailed,
    Flaw,
    Forbidden,
    LichenClientError,
    NotFound,
    RateLimited,
    ServerError,
    StatusError,
    TimedOut,
    TooLarge,
    Unauthorized,
    Unavailable,
    Unprocessable,
)
from lichen_client.jobs import Dismissed
from lichen_client.pipeline import Pipeline
from lichen_client.results import Error, Measured, Report, Result, Results
from lichen_client.retry import Retries
from lichen_client.scene import Scene
from lichen_client.streams import AsyncStream, Stream
from lichen_client.version import __version__

if TYPE_CHECKING:
    from lichen_client.async_client import AsyncClient

__all__ = [
    "Asset",
    "AsyncClient",
    "AsyncStream",
    "BadRequest",
    "Client",
    "Conflict",
    "ConnectionFailed",
    "Dismissed",
    "Error",
    "Flaw",
    "Forbidden",
    "Job",
    "LichenClientError",
    "Measured",
    "NotFound",
    "Pipeline",
    "RateLimited",
    "Report",
    "Result",
    "Results",
    "Retries",
    "Scene",
    "ServerError",
    "StatusError",
    "Stream",
    "TimedOut",
    "TooLarge",
    "Unauthorized",
    "Unavailable",
    "Unprocessable",
    "__version__",
]


def __getattr__(name: str) -> Any:
    if name == "AsyncClient":  # asyncio costs more to import than all the rest
        from lichen_client.async_client import AsyncClient

        return AsyncClient
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
