"""From a route's `Response` to the bytes that leave: the one place where headers are completed and checked.

Rules
- The wire alone writes Date, Content-Length and Connection; every answer carries X-Request-ID and nosniff; no answer
  names a server or a version.
- A header that could end its line early, or is not Latin-1, is a defect of the route: `BadResponse`, and the client
  sees a 500. So is a status that requires a field (405 without Allow) and lacks it.
- What a route does not say otherwise may load and run nothing where a browser shows it.
- HEAD gets the headers of the GET, length included, and no body; 204 and 304 never have one.
"""

from __future__ import annotations

import os
import re
import secrets
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from email.utils import formatdate
from functools import lru_cache
from http import HTTPStatus

from lichen_service.http.message import Body, Response

_NAME = re.compile(r"[-!#$%&'*+.^_`|~0-9A-Za-z]+")
_VALUE = re.compile(r"[\t\x20-\x7e\x80-\xff]*")
_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,128}")
_REQUIRED = {405: "allow", 401: "www-authenticate"}
_OURS = frozenset(
    ("date", "content-length", "connection", "transfer-encoding", "server", "x-request-id", "x-content-type-options")
)
_drawn: deque[str] = deque()
"""ids that nobody has yet"""
_DRAWN_AT_ONCE = 256
os.register_at_fork(after_in_child=_drawn.clear)
_POLICY = "content-security-policy"
_INERT = ("Content-Security-Policy", "sandbox; default-src 'none'")
_PHRASES = {status.value: status.phrase for status in HTTPStatus}


class BadResponse(ValueError):
    """A route answered with something that must not leave as it is."""


@dataclass(frozen=True, slots=True)
class Wire:
    """An answer as bytes."""

    head: bytes
    body: Body

    @property
    def size(self) -> int:
        return len(self.head) + memoryview(self.body).nbytes


def choose_request_id(offered: str | None) -> str:
    """The client's own id where it is harmless in headers and logs, else a fresh one."""
    return offered if offered is not None and _REQUEST_ID.fullmatch(offered) else _fresh_id()


def _fresh_id() -> str:
    """From any thread. Many are drawn at once: each question to the system lets other threads take the interpreter."""
    try:
        return _drawn.pop()
    except IndexError:
        drawn = secrets.token_hex(16 * _DRAWN_AT_ONCE)
        _drawn.extend(drawn[at : at + 32] for at in range(32, len(drawn), 32))
        return drawn[:32]


def completed(response: Response, request_id: str) -> dict[str, str]:
    """The headers of an answer that do not depend on its connection, checked; raises `BadResponse`."""
    own = _checked(response.status, tuple(response.headers.items()))
    _check("X-Request-ID", request_id)
    return {"X-Request-ID": request_id, "X-Content-Type-Options": "nosniff", **dict(own)}


def finish(response: Response, *, request_id: str, method: str, keep_alive: bool) -> Wire:
    """Complete, check and encode an answer; raises `BadResponse`."""
    start, rest, body = frame(response, method, keep_alive)
    _check("X-Request-ID", request_id)
    head = b"%b%b\r\nX-Request-ID: %b\r\n%b" % (
        start.encode("latin-1"),
        date(int(time.time())),
        request_id.encode("latin-1"),
        rest.encode("latin-1"),
    )
    return Wire(head, body)


def frame(response: Response, method: str, keep_alive: bool) -> tuple[str, str, Body]:
    """An answer around its date and its request's id: the head up to the one, after the other, and the body. Raises
    `BadResponse`."""
    status, body = response.status, response.body
    own = _lines(status, tuple(response.headers.items()))
    bodiless = status in (204, 304)
    length = ""
    if response.stream is not None:
        keep_alive = False  # the end of the connection is that of the body
    elif not bodiless:
        length = f"Content-Length: {len(body) if isinstance(body, bytes) else memoryview(body).nbytes}\r\n"
    start = f"HTTP/1.1 {status} {phrase(status)}\r\nDate: "
    rest = f"{own}{length}Connection: {'keep-alive' if keep_alive else 'close'}\r\n\r\n"
    return start, rest, b"" if bodiless or method == "HEAD" else body


@lru_cache(maxsize=256)
def _lines(status: int, headers: tuple[tuple[str, str], ...]) -> str:
    """Those headers as they leave. An answer that is given again and again has the same, so they are remembered."""
    own = _checked(status, headers)
    return "".join(f"{name}: {value}\r\n" for name, value in (("X-Content-Type-Options", "nosniff"), *own))


def _checked(status: int, headers: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The headers of a route's answer without those that are ours to write; raises `BadResponse`."""
    if not 200 <= status <= 599:
        raise BadResponse(f"{status} is not the status of a final answer")
    names = [name.lower() for name, _ in headers]
    if len(set(names)) != len(names):
        raise BadResponse("a header is given twice, in different case")
    required = _REQUIRED.get(status)
    if required is not None and required not in names:
        raise BadResponse(f"{status} requires the header {required}")
    own = [each for each, name in zip(headers, names, strict=True) if name not in _OURS]
    if _POLICY not in names:
        own.append(_INERT)
    for name, value in own:
        _check(name, value)
    return own


@lru_cache(maxsize=2)
def date(second: int) -> bytes:
    """The value of `Date` for seconds since the epoch."""
    return formatdate(second, usegmt=True).encode()


def phrase(status: int) -> str:
    """What stands beside a status."""
    return _PHRASES.get(status, "")


def _check(name: str, value: str) -> None:
    if not _NAME.fullmatch(name):
        raise BadResponse(f"{name!r} is not the name of a header")
    if not _VALUE.fullmatch(value):
        raise BadResponse(f"the value of {name} holds a line end, a control character or a character outside Latin-1")
