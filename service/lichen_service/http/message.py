"""The values that cross the border between the wire and the routes.

`Head` is what is known before the body is read; `Request` adds the body; `Response` goes back. They hold plain data,
so routes are tested without a socket and the wire without an image.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

CLIENT_GONE = 499
"""The status, for the log alone, of a request whose client has hung up."""

Body = bytes | bytearray | memoryview
Lend = Callable[[int], memoryview]
"""Memory for so many bytes of a body; uninitialised."""


def _always() -> bool:
    return True


def _nobody(_stage: str) -> None:
    pass


class Head(NamedTuple):
    """A request whose head passed the wire's rules."""

    method: str
    path: str
    """percent-decoded, always starting with a slash"""
    query: tuple[tuple[str, str], ...]
    """decoded pairs in the order given, repeats kept"""
    headers: Mapping[str, str]
    """lower-case names; repeated fields joined with a comma"""
    request_id: str
    received: float
    """`time.monotonic()` when the head was complete"""
    deadline: float
    """`time.monotonic()` by which the answer must be ready"""
    peer: str = ""
    allowed: float = math.inf
    """seconds from the moment the whole request is here until `deadline`"""
    alive: Callable[[], bool] = _always
    """whether anybody still waits for the answer; from any thread"""
    apart: bool = False
    """whether it came to the address of figures"""
    began: Callable[[str], None] = _nobody
    """is told the name of each stage of the work as it begins"""

    @property
    def length(self) -> int | None:
        """Declared bytes of the body; None when it comes in chunks."""
        if "transfer-encoding" in self.headers:
            return None
        return int(self.headers.get("content-length", 0))


@dataclass(frozen=True, slots=True)
class Request:
    head: Head
    body: Body
    caller: Any = None
    """what the routes' admission said of who asks; the wire only hands it on"""


class Stream(Protocol):
    """A source of bytes that come when they come."""

    def open(self, send: Callable[[bytes], None], end: Callable[[], None]) -> None:
        """Called once when the head has left; both may be called from any thread, also during this call."""

    def close(self) -> None:
        """The client has gone, or the stream has ended; nothing that is sent now will arrive."""


@dataclass(slots=True)
class Response:
    status: int
    body: Body = b""
    headers: dict[str, str] = field(default_factory=dict)
    log: dict[str, object] = field(default_factory=dict)
    """fields for the access log that only the route knows: operation, pixels, method, device, queue and work time"""
    stream: Stream | None = None
    """what goes on after the head, instead of a body, until it ends with the connection"""
    lasting: bool = False
    """whether it answers every request with the same head, whoever sends it, as long as the process lives"""


@dataclass(frozen=True, slots=True)
class Admission:
    """The routes' word that the body of this request may be read."""

    largest_body: int
    """bytes; more than this is refused with 413 while it arrives"""
    caller: Any = None
    """who asks, as the routes know it; it comes back in `Request`"""


class Application(Protocol):
    """What the wire asks of the service."""

    def admit(self, head: Head) -> Admission | Response:
        """Called before a byte of the body is read, on the selector thread: quick, no image work."""

    def handle(self, request: Request) -> Response:
        """Called on a pool thread. Raises nothing the wire has to understand: any escape becomes a 500."""
