"""Pages of other origins: nothing is allowed to them unless the origin is named in the settings (the Fetch standard).

Credentials are never allowed: a page sends a key in `Authorization`, which no browser adds by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from lichen_service.http.message import Head, Response

_EXPOSED = (
    "Content-Digest, Content-Range, ETag, Link, Location, Preference-Applied, RateLimit, RateLimit-Policy, "
    "Retry-After, Server-Timing, X-Problem-Code, X-Request-ID, Lichen-Method, Lichen-Device, Lichen-Error, "
    "Lichen-Measured, Lichen-Precision, Lichen-Skipped, Lichen-Nonfinite, Lichen-Clipped, Lichen-Seed, Lichen-Space"
)
_MAY_SEND = (
    "Authorization, Content-Type, Idempotency-Key, If-Match, If-None-Match, Prefer, Range, Request-Timeout, "
    "X-Request-ID"
)
_KEPT = "600"
"""Seconds for which a browser need not ask again."""


@dataclass(frozen=True, slots=True)
class Cors:
    origins: frozenset[str] = frozenset()

    @classmethod
    def parse(cls, text: str) -> Cors:
        """From origins with commas between; `*` stands for every origin."""
        return cls(frozenset(each.strip().rstrip("/") for each in text.split(",") if each.strip()))

    def preflight(self, head: Head, allow: str) -> Response | None:
        """The answer to a browser that asks whether it may ask; None where that is not what this is."""
        if head.method != "OPTIONS" or "access-control-request-method" not in head.headers or not self._allows(head):
            return None
        headers = {
            "Access-Control-Allow-Methods": allow,
            "Access-Control-Allow-Headers": _MAY_SEND,
            "Access-Control-Max-Age": _KEPT,
        }
        return self.add(head, Response(204, headers=headers))

    def add(self, head: Head, response: Response) -> Response:
        """The response with what lets a page of an allowed origin read it."""
        if not self.origins:
            return response
        varied = [each for each in response.headers.get("Vary", "").split(", ") if each]
        response.headers["Vary"] = ", ".join(dict.fromkeys([*varied, "Origin"]))
        if self._allows(head):
            response.headers["Access-Control-Allow-Origin"] = "*" if "*" in self.origins else head.headers["origin"]
            response.headers["Access-Control-Expose-Headers"] = _EXPOSED
        return response

    def _allows(self, head: Head) -> bool:
        origin = head.headers.get("origin")
        return origin is not None and ("*" in self.origins or origin in self.origins)
