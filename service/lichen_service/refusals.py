"""Errors on their way out: which status an error of the library has, and refusals of the service's own.

One table holds the whole mapping. What is not in it is a defect of ours: it leaves as a 500 that says nothing of the
inside.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from lichen.errors import (
    DeviceFailure,
    Flaw,
    InvalidRequest,
    LichenError,
    NonfiniteInput,
    TooLarge,
    Unattainable,
    UnknownOperation,
    UnknownTexture,
    UnreadableImage,
    UnsupportedFormat,
)
from lichen_service.http.message import CLIENT_GONE, Head, Response
from lichen_service.problems import problem

STATUS: Mapping[type[LichenError], int] = {
    UnknownOperation: 404,
    UnknownTexture: 404,
    TooLarge: 413,
    UnsupportedFormat: 415,
    InvalidRequest: 422,
    UnreadableImage: 422,
    NonfiniteInput: 422,
    Unattainable: 422,
    DeviceFailure: 503,
}
RETRY_AFTER = "1"
"""Seconds; a device that failed once is worth one more try soon."""


class Refusal(Exception):
    """The service says no: the fields of a problem document."""

    def __init__(
        self,
        status: int,
        code: str,
        title: str,
        detail: str,
        flaws: Sequence[Flaw] = (),
        *,
        headers: Mapping[str, str] | None = None,
        retryable: bool = False,
        limit: float | None = None,
        actual: float | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.code = code
        self.title = title
        self.detail = detail
        self.flaws = tuple(flaws)
        self.headers = dict(headers or {})
        self.retryable = retryable
        self.limit = limit
        self.actual = actual

    def response(self, head: Head) -> Response:
        return problem(
            self.status,
            self.code,
            self.title,
            self.detail,
            request_id=head.request_id,
            errors=self.flaws,
            retryable=self.retryable,
            limit=self.limit,
            actual=self.actual,
            headers=self.headers,
        )


def refusal_of(error: LichenError) -> Refusal:
    """The library's error as the service answers it."""
    status = next((STATUS[kind] for kind in type(error).__mro__ if kind in STATUS), 500)
    if status == 500:
        return internal()
    return Refusal(
        status,
        error.code,
        error.title,
        error.detail.partition("\n")[0],  # what follows is a compiler's log: ours to read, not the client's
        error.flaws,
        headers={"Retry-After": RETRY_AFTER} if status == 503 else {},
        retryable=status == 503,
        limit=error.limit,
        actual=error.actual,
    )


def internal() -> Refusal:
    return Refusal(500, "internal-error", "The service failed", "The request could not be answered; the fault is ours.")


def too_late(stage: str) -> Refusal:
    """The deadline passed before `stage` could begin."""
    return Refusal(
        504,
        "deadline-exceeded",
        "The request took too long",
        f"The time allowed for this request ended before the step '{stage}' could begin.",
        retryable=True,
    )


def client_gone(stage: str) -> Refusal:
    """Nobody waits any more; the wire logs the status and sends nothing."""
    return Refusal(CLIENT_GONE, "client-gone", "The client has hung up", f"Nobody waits for the step '{stage}'.")


def too_costly(predicted: float, allowed: float) -> Refusal:
    """What a request asks for would by prediction take far longer than it is allowed to."""
    return Refusal(
        422,
        "too-costly",
        "The request would take too long",
        f"By prediction this takes {predicted:.3g} s, and {allowed:.3g} s are left for it.",
        limit=allowed,
        actual=predicted,
    )


@contextmanager
def relocated() -> Iterator[None]:
    """Errors of the library point at its arguments; leaving this context they point into the request.

    The library knows `/method` and `/knobs/...`; in a request both come from the query.
    """
    try:
        yield
    except LichenError as error:
        error.flaws = tuple(Flaw(_relocated(flaw.pointer), flaw.detail) for flaw in error.flaws)
        raise


_OWN = (
    "parameters", "inputs", "query", "nodes", "outputs", "concatenate", "pipeline",
    "scene", "camera", "objects", "buffers", "lights", "ambient", "surface", "fog", "environment", "lens", "shutter",
    "background", "output",
)  # fmt: skip
"""What documents and pictures are made of: places that are the request's own."""


def _relocated(pointer: str) -> str:
    head, _, rest = pointer.removeprefix("/").partition("/")
    if head == "knobs":
        return f"/parameters/{rest}"
    return pointer if head in _OWN else f"/query{pointer}"
