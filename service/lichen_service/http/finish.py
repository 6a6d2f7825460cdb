"""From a route's `Response` to the bytes that leave: the one place where headers are completed and checked.

Rules
- The wire alone writes Date, Content-Length and Connection; every answer carries X-Request-ID and nosniff; no answer
  names a server or a version.
- A header that could end its line early, or is not Latin-1, is a defect of the route: `BadResponse`, and the client
  sees a 500. So is a status that requires a field (405 without Allow) and lacks it.
- HEAD gets the headers of the GET, length included, and no body; 204 and 304 never have one.
"""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass
from email.utils import formatdate
from http import HTTPStatus

from lichen_service.http.message import Body, Response

_NAME = re.compile(r"[-!#$%&'*+.^_`|~0-9A-Za-z]+")
_VALUE = re.compile(r"[\t\x20-\x7e\x80-\xff]*")
_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,128}")
_REQUIRED = {405: "allow", 401: "www-authenticate"}
_OURS = frozenset(
    ("date", "content-length", "connection", "transfer-encoding", "server", "x-request-id", "x-content-type-options")
)
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
    return offered if offered is not None and _REQUEST_ID.fullmatch(offered) else secrets.token_hex(16)


def completed(response: Response, request_id: str) -> dict[str, str]:
    """The headers of an answer that do not depend on its connection, checked; raises `BadResponse`."""
    status = response.status
    if not 200 <= status <= 599:
        raise BadResponse(f"{status} is not the status of a final answer")
    names = {name.lower() for name in response.headers}
    if len(names) != len(response.headers):
        raise BadResponse("a header is given twice, in different case")
    required = _REQUIRED.get(status)
    if required is not None and required not in names:
        raise BadResponse(f"{status} requires the header {required}")
    headers = {"X-Request-ID": request_id, "X-Content-Type-Options": "nosniff"}
    headers |= {name: value for name, value in response.headers.items() if name.lower() not in _OURS}
    for name, value in headers.items():
        _check(name, value)
    return headers


def finish(response: Response, *, request_id: str, method: str, keep_alive: bool) -> Wire:
    """Complete, check and encode an answer; raises `BadResponse`."""
    status = response.status
    headers = {"Date": formatdate(usegmt=True), **completed(response, request_id)}
    bodiless = status in (204, 304)
    if response.stream is not None:
        keep_alive = False  # the end of the connection is that of the body
    elif not bodiless:
        headers["Content-Length"] = str(memoryview(response.body).nbytes)
    headers["Connection"] = "keep-alive" if keep_alive else "close"
    lines = [f"HTTP/1.1 {status} {phrase(status)}", *(f"{name}: {value}" for name, value in headers.items())]
    head = "\r\n".join([*lines, "", ""]).encode("latin-1")
    return Wire(head, b"" if bodiless or method == "HEAD" else response.body)


def phrase(status: int) -> str:
    """What stands beside a status."""
    return _PHRASES.get(status, "")


def _check(name: str, value: str) -> None:
    if not _NAME.fullmatch(name):
        raise BadResponse(f"{name!r} is not the name of a header")
    if not _VALUE.fullmatch(value):
        raise BadResponse(f"the value of {name} holds a line end, a control character or a character outside Latin-1")
