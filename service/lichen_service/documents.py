"""JSON as the service writes it: canonical, and without NaN.

The same value always gives the same bytes (sorted keys, no spaces), so a document's digest can be its entity tag. JSON
has no NaN and no infinity: such numbers become null rather than text that a strict parser refuses.
"""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from lichen_service.http.message import Body, Head, Response
from lichen_service.refusals import Refusal


def plain(value: Any) -> Any:
    """`value` in JSON's own types; data classes become objects, non-finite numbers null."""
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Mapping):
        return {str(plain(key)): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {each.name.rstrip("_"): plain(getattr(value, each.name)) for each in dataclasses.fields(value)}
    number = float(value)
    return number if math.isfinite(number) else None


def canonical(value: Any) -> bytes:
    """UTF-8 JSON of `value`: sorted keys, no spaces, no NaN."""
    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def as_query(values: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Parameters as a URL gives them: text plain, everything else as JSON."""
    return tuple((name, each if isinstance(each, str) else canonical(each).decode()) for name, each in values.items())


def content_digest(body: Body) -> str:
    """The `Content-Digest` of a body (RFC 9530)."""
    return f"sha-256=:{base64.b64encode(hashlib.sha256(body).digest()).decode()}:"


def matches(head: Head, tag: str) -> bool:
    """Whether `If-None-Match` names this entity tag (weak comparison, RFC 9110 section 13.1.2)."""
    given = head.headers.get("if-none-match")
    if given is None:
        return False
    return given.strip() == "*" or tag in (each.strip().removeprefix("W/") for each in given.split(","))


def unchanged(head: Head, tag: str) -> bool:
    """Whether the client has these bytes already. Raises the 412 refusal where it wants others or none (`If-Match`,
    strong comparison)."""
    wanted = head.headers.get("if-match", "*").strip()
    if wanted != "*" and tag not in (each.strip() for each in wanted.split(",")):
        raise Refusal(
            412, "precondition-failed", "It is not what was asked for", f"If-Match names other bytes than {tag}."
        )
    return matches(head, tag)


@dataclass(frozen=True, slots=True)
class Document:
    """An answer that depends on the running engine alone: kept by caches, asked for again by its entity tag."""

    body: bytes
    tag: str
    fields: tuple[tuple[str, str], ...]
    """what the whole of it says of itself"""

    @classmethod
    def of(cls, body: bytes, media_type: str = "application/json") -> Document:
        tag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
        return cls(body, tag, (("Content-Type", media_type), ("Content-Digest", content_digest(body))))

    def answer(self, head: Head) -> Response:
        headers = {"ETag": self.tag, "Cache-Control": "no-cache"}
        if unchanged(head, self.tag):
            return Response(304, headers=headers)
        headers.update(self.fields)
        return Response(200, self.body, headers)


def document(head: Head, body: bytes, media_type: str = "application/json") -> Response:
    """The answer that holds a document made for it."""
    return Document.of(body, media_type).answer(head)


class Shelf:
    """Documents that are the same for everybody as long as the process lives, by path.

    Each is made when it is first asked for, which takes a thread; from then on the loop itself finds it here.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Document] = {}

    def answer(self, head: Head, make: Callable[[], bytes]) -> Response:
        """The document of a path, which `make` makes where there is none yet."""
        if (kept := self._kept.get(head.path)) is None:
            kept = self._kept.setdefault(head.path, Document.of(make()))
        return kept.answer(head)

    def at_once(self, head: Head) -> Response | None:
        """The answer, if it takes no more than looking it up. A query may ask for something else."""
        if head.query or head.method not in ("GET", "HEAD") or (kept := self._kept.get(head.path)) is None:
            return None
        answer = kept.answer(head)
        answer.lasting = True
        return answer


def momentary(status: int, value: Any) -> Response:
    """A JSON answer that holds only now."""
    return Response(status, canonical(value), {"Content-Type": "application/json", "Cache-Control": "no-store"})
