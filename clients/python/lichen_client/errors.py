"""What can go wrong between a caller and the service, as types.

    LichenClientError
    ├── ConnectionFailed        no whole answer came: refused, reset, cut short
    │   └── TimedOut            ... within the time allowed
    └── StatusError             an answer came, and it says no
        ├── BadRequest          400
        ├── Unauthorized        401
        ├── Forbidden           403
        ├── NotFound            404
        ├── Conflict            409
        ├── TooLarge            413
        ├── Unprocessable       422
        ├── RateLimited         429
        └── ServerError         5xx
            └── Unavailable     503

A `StatusError` carries the fields of the service's problem document (RFC 9457). Where something between the two
answered instead (a proxy's page), `code` is empty and `detail` holds the beginning of what it said.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar


class LichenClientError(Exception):
    """Base of every error of this package."""


class ConnectionFailed(LichenClientError):
    """No whole answer came: the connection was refused, reset or closed too early."""


class TimedOut(ConnectionFailed):
    """No whole answer came within the time allowed."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """One bad field: a JSON pointer to it, and what is wrong with it."""

    pointer: str
    detail: str


class StatusError(LichenClientError):
    """The service refused or failed; the fields are those of its problem document."""

    statuses: ClassVar[range] = range(300, 600)
    """the statuses this type is raised for, unless a subclass says it more precisely"""

    def __init__(
        self,
        status: int,
        *,
        code: str = "",
        title: str = "",
        detail: str = "",
        errors: tuple[Flaw, ...] = (),
        request_id: str = "",
        retryable: bool = False,
        limit: float | None = None,
        actual: float | None = None,
        retry_after: float | None = None,
    ) -> None:
        super().__init__(status, code, detail)
        self.status = status
        self.code = code
        self.title = title
        self.detail = detail
        self.errors = errors
        self.request_id = request_id
        self.retryable = retryable
        self.limit = limit
        self.actual = actual
        self.retry_after = retry_after
        """seconds the service asks to be left alone, or None"""

    def __str__(self) -> str:
        flaws = "; ".join(f"{flaw.pointer}: {flaw.detail}" for flaw in self.errors)
        said = " ".join(part for part in (self.detail or self.title, flaws) if part)
        request = f" (request {self.request_id})" if self.request_id else ""
        return f"{self.status}{f' {self.code}' if self.code else ''}: {said or 'no reason given'}{request}"


class BadRequest(StatusError):
    statuses = range(400, 401)


class Unauthorized(StatusError):
    """No key was sent, or one that nobody has."""

    statuses = range(401, 402)


class Forbidden(StatusError):
    """The key does not allow it."""

    statuses = range(403, 404)


class NotFound(StatusError):
    statuses = range(404, 405)


class Conflict(StatusError):
    """What was asked for does not fit what is there, such as an idempotency key that went with another request."""

    statuses = range(409, 410)


class TooLarge(StatusError):
    statuses = range(413, 414)


class Unprocessable(StatusError):
    statuses = range(422, 423)


class RateLimited(StatusError):
    statuses = range(429, 430)


class ServerError(StatusError):
    statuses = range(500, 600)


class Unavailable(ServerError):
    statuses = range(503, 504)


_MOST_PRECISE_FIRST = (
    BadRequest,
    Unauthorized,
    Forbidden,
    NotFound,
    Conflict,
    TooLarge,
    Unprocessable,
    RateLimited,
    Unavailable,
    ServerError,
    StatusError,
)


def status_error(status: int, headers: Mapping[str, str], body: bytes, retry_after: float | None = None) -> StatusError:
    """The error for an answer outside 2xx. `headers` has lower-case names. Never raises, whatever the body holds."""
    kind = next((kind for kind in _MOST_PRECISE_FIRST if status in kind.statuses), StatusError)
    request_id = headers.get("x-request-id", "")
    problem = _problem(headers.get("content-type", ""), body)
    if problem is None:
        beginning = " ".join(body[:400].decode("utf-8", "replace").split())[:200]
        return kind(status, detail=beginning, request_id=request_id, retry_after=retry_after)
    return kind(
        status,
        code=_text(problem.get("code")),
        title=_text(problem.get("title")),
        detail=_text(problem.get("detail")),
        errors=_flaws(problem.get("errors")),
        request_id=_text(problem.get("request_id")) or request_id,
        retryable=problem.get("retryable") is True,
        limit=_number(problem.get("limit")),
        actual=_number(problem.get("actual")),
        retry_after=retry_after,
    )


def _problem(content_type: str, body: bytes) -> dict[str, Any] | None:
    if content_type.partition(";")[0].strip().lower() != "application/problem+json":
        return None
    try:
        document = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return document if isinstance(document, dict) else None


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _number(value: object) -> float | None:
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def _flaws(value: object) -> tuple[Flaw, ...]:
    entries = value if isinstance(value, list) else []
    return tuple(
        Flaw(_text(entry.get("pointer")), _text(entry.get("detail"))) for entry in entries if isinstance(entry, dict)
    )
