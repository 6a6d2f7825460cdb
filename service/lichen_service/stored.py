"""Answers whose bytes are stored: known by their tag, and sent in part where a range is asked for (RFC 9110, 14).

Only stored bytes have ranges: those of a computed answer would have to be computed again for each part. One range is
answered; what asks for several, or for one that does not exist, is told how many bytes there are.
"""

from __future__ import annotations

import re

from lichen_service.documents import content_digest, unchanged
from lichen_service.http.message import Body, Head, Response
from lichen_service.refusals import Refusal

_RANGES = re.compile(r"bytes=\s*([0-9]*-[0-9]*(?:\s*,\s*[0-9]*-[0-9]*)*)\s*", re.IGNORECASE)


def respond(head: Head, body: Body, media_type: str, tag: str, headers: dict[str, str] | None = None) -> Response:
    """The whole, a part (206), nothing new (304), or the 416 refusal."""
    common = {"ETag": tag, "Content-Type": media_type, "Accept-Ranges": "bytes", **(headers or {})}
    if unchanged(head, tag):
        return Response(304, headers=common)
    total = memoryview(body).nbytes
    asked = _asked(head, tag)
    if asked is None:
        return Response(200, body, common | {"Content-Digest": content_digest(body)})
    found = _resolve(asked, total)
    if found is None:
        raise Refusal(
            416,
            "range-not-satisfiable",
            "The range cannot be sent",
            f"One range within {total} bytes is answered.",
            headers={"Content-Range": f"bytes */{total}"},
        )
    first, last = found
    part = memoryview(body)[first : last + 1]
    return Response(206, part, common | {"Content-Range": f"bytes {first}-{last}/{total}"})


def _asked(head: Head, tag: str) -> str | None:
    """The ranges of a GET that means them; a unit nobody knows, and a copy that is out of date, mean the whole."""
    match = _RANGES.fullmatch(head.headers.get("range", ""))
    current = head.headers.get("if-range", tag).strip() == tag
    return match[1] if match and current and head.method == "GET" else None


def _resolve(asked: str, total: int) -> tuple[int, int] | None:
    if "," in asked or not total:
        return None
    first, _, last = asked.partition("-")
    if not first:
        count = int(last[:20] or 0)
        return (max(0, total - count), total - 1) if count else None
    start, end = int(first[:20]), min(int(last[:20]), total - 1) if last else total - 1
    return (start, end) if start <= end else None
