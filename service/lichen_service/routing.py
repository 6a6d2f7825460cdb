"""Paths to handlers: one table, exact matches, and precise refusals.

A path that is nowhere in the table is a 404 that names the nearest paths, a method that a path does not take is a 405
with `Allow`. `HEAD` goes wherever `GET` goes, and `OPTIONS` is answered from the table itself.
"""

from __future__ import annotations

import importlib
import re
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple
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


class Later:
    """Handlers of a class whose module is loaded, and that is made, when one of them is first asked for: the first
    pictures that a service makes need not wait for what they do not use."""

    def __init__(self, module: str, name: str, *given: object) -> None:
        self._module, self._name, self._given = module, name, given
        self._made: object = None
        self._lock = threading.Lock()

    def by(self, method: str) -> Handler:
        def handle(request: Request, name: str) -> Response:
            with self._lock:
                if self._made is None:
                    self._made = getattr(importlib.import_module(self._module), self._name)(*self._given)
            handler: Handler = getattr(self._made, method)
            return handler(request, name)

        return handle


class Match(NamedTuple):
    route: Route
    name: str


class Table:
    """All routes. A path that one of them spells out is that one's; the others are tried in the order given."""

    def __init__(self, routes: Sequence[Route]) -> None:
        self.routes = tuple(routes)
        self._plain = {each.template: each for each in routes if "{" not in each.template}
        self._patterns = [each for each in routes if "{" in each.template]

    def match(self, path: str) -> Match | None:
        """Whatever the method."""
        if (plain := self._plain.get(path)) is not None:
            return Match(plain, "")
        for route in self._patterns:
            if found := route.pattern.fullmatch(path):
                return Match(route, found["name"])
        return None

    def find(self, head: Head) -> Match:
        """The route of a request. Raises the `Refusal` (404 or 405) for a path or method that has none."""
        match = self.match(head.path)
        if match is None:
            hint = nearest(head.path, [each.template for each in self.routes])
            raise Refusal(
                404, "not-found", "There is nothing at this path", f"Nothing is at {_shown(head.path)}; {hint}"
            )
        if head.method != "OPTIONS" and match.route.handler(head.method) is None:
            allow = match.route.allow
            raise Refusal(
                405,
                "method-not-allowed",
                "The method is not allowed here",
                f"{head.method} is not allowed on {_shown(head.path)}; allowed: {allow}.",
                headers={"Allow": allow},
            )
        return match


def _shown(path: str) -> str:
    """A path as it may stand in a message: escaped again, so that it is one line of ASCII, and not endless."""
    escaped = quote(path, safe="/{}:@!$&'()*+,;=~-._")
    return escaped if len(escaped) <= 120 else escaped[:117] + "..."
