"""Paths to handlers: one table, exact matches, and precise refusals.

A path that is nowhere in the table is a 404 that names the nearest paths, a method that a path does not take is a 405
with `Allow`. `HEAD` goes wherever `GET` goes, and `OPTIONS` is answered from the table itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from urllib.parse import quote

from lichen.errors import nearest
from lichen_service.http.message import Head, Request, Response
from lichen_service.refusals import Refusal

Handler = Callable[[Request, str], Response]
"""Receives the request and the part of the path that stood for `{name}` (empty where there is none)."""


@dataclass(frozen=True)
class Route:
    """One path template, such as `/v1/operations/{name}`, and what answers each method."""

    template: str
    handlers: Mapping[str, Handler]
    bodies: bool = False
    """whether any of its methods reads a body"""
    reads: Collection[str] | None = None
    """media types of those bodies; None: images and forms of them"""
    check: Callable[[Request, str], object] | None = None
    """raises what is wrong with a request that is to become a job"""
    scope: str | None = ""
    """what a key must be for; empty: any key will do; None: no key is needed"""
    pattern: re.Pattern[str] = field(init=False)

    def __post_init__(self) -> None:
        escaped = re.escape(self.template).replace(r"\{name\}", "(?P<name>[^/]+)")
        object.__setattr__(self, "pattern", re.compile(escaped))

    @property
    def allow(self) -> str:
        methods = {*self.handlers, "OPTIONS"} | ({"HEAD"} if "GET" in self.handlers else set())
        return ", ".join(sorted(methods))

    def handler(self, method: str) -> Handler | None:
        return self.handlers.get("GET" if method == "HEAD" else method)


@dataclass(frozen=True, slots=True)
class Match:
    route: Route
    name: str


def find(routes: Sequence[Route], head: Head) -> Match:
    """The route of a request. Raises the `Refusal` (404 or 405) for a path or method that has none."""
    for route in routes:
        found = route.pattern.fullmatch(head.path)
        if found:
            match = Match(route, found.groupdict().get("name", ""))
            if head.method != "OPTIONS" and route.handler(head.method) is None:
                raise Refusal(
                    405,
                    "method-not-allowed",
                    "The method is not allowed here",
                    f"{head.method} is not allowed on {_shown(head.path)}; allowed: {route.allow}.",
                    headers={"Allow": route.allow},
                )
            return match
    hint = nearest(head.path, [route.template for route in routes])
    raise Refusal(404, "not-found", "There is nothing at this path", f"Nothing is at {_shown(head.path)}; {hint}")


def _shown(path: str) -> str:
    """A path as it may stand in a message: escaped again, so that it is one line of ASCII, and not endless."""
    escaped = quote(path, safe="/{}:@!$&'()*+,;=~-._")
    return escaped if len(escaped) <= 120 else escaped[:117] + "..."
