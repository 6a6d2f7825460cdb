"""Problem documents: the one shape every error of the service has (RFC 9457).

The body is `application/problem+json` with the standard members and ours: `code` (stable, for programs),
`request_id`, `errors` (every bad field with a JSON pointer), `retryable`, and `limit` with `actual` where a limit was
crossed. The code also travels in `X-Problem-Code`, for clients that only see headers. Errors are never cached.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from lichen_service.http.message import Response

MEDIA_TYPE = "application/problem+json"
PATH = "/problems"
"""where codes are explained"""
_ENCODER = json.JSONEncoder(ensure_ascii=False, separators=(",", ":"), allow_nan=False)


class BadField(Protocol):
    """One bad field of a request."""

    @property
    def pointer(self) -> str: ...
    @property
    def detail(self) -> str: ...


def problem(
    status: int,
    code: str,
    title: str,
    detail: str,
    *,
    request_id: str,
    errors: Iterable[BadField] = (),
    retryable: bool = False,
    limit: float | None = None,
    actual: float | None = None,
    headers: Mapping[str, str] | None = None,
) -> Response:
    """An error answer. `type` is a path below /problems; `limit` and `actual` share the unit the detail names."""
    document: dict[str, object] = {
        "type": type_of(code),
        "title": title,
        "status": status,
        "detail": detail,
        "instance": f"urn:lichen:request:{request_id}",
        "code": code,
        "request_id": request_id,
        "retryable": retryable,
    }
    fields = [{"pointer": each.pointer, "detail": each.detail} for each in errors]
    if fields:
        document["errors"] = fields
    document |= {name: value for name, value in (("limit", limit), ("actual", actual)) if value is not None}
    return Response(
        status,
        to_json(document),
        {"Content-Type": MEDIA_TYPE, "X-Problem-Code": code, "Cache-Control": "no-store", **(headers or {})},
        {"problem": code},
    )


def type_of(code: str) -> str:
    return f"{PATH}/{code}"


def to_json(value: object) -> bytes:
    """Compact UTF-8 JSON in which NaN and infinity, which JSON does not have, are null.

    >>> to_json({"error": float("nan")})
    b'{"error":null}'
    """
    try:
        text = _ENCODER.encode(value)
    except ValueError:
        text = _ENCODER.encode(_finite(value))
    return text.encode("utf-8", "replace")


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value
