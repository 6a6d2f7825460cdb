"""The application: paths, what answers them, and how errors leave.

`admit` sees a request's head on the thread that serves every connection, so it only looks things up: unknown paths,
methods and operations, bodies that are too large or of a type nobody reads are refused before a byte of the body is
taken in. `/livez` is answered right there, so it answers when every other thread is busy. `handle` does the rest.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import structlog

from lichen import catalogue
from lichen.errors import LichenError
from lichen.files import encode
from lichen_service import logs
from lichen_service.cache import Answers
from lichen_service.calibrating import Calibrating, Traffic
from lichen_service.descriptions import path_of
from lichen_service.documents import canonical
from lichen_service.formats import readable
from lichen_service.http.message import Admission, Head, Request, Response
from lichen_service.readiness import Readiness, example
from lichen_service.refusals import Refusal, internal, refusal_of
from lichen_service.routes.accuracy import Accuracy
from lichen_service.routes.catalogue import Catalogue
from lichen_service.routes.pipelines import PATH as PIPELINES
from lichen_service.routes.pipelines import Pipelines
from lichen_service.routes.running import Running
from lichen_service.routes.system import System
from lichen_service.routing import Route, find
from lichen_service.settings import Settings
from lichen_service.uploads import JSON, check_type

log = structlog.get_logger("lichen_service")

SMALL_BODY = 4096
"""Bytes; what a request to a path that reads no body may still send."""


class Service:
    """The routes under one roof; an `Application` for the wire."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.readiness = Readiness(self._canary)
        self.traffic = Traffic()
        self.calibrating = Calibrating(self.readiness, self.traffic)
        self.answers = Answers(settings.cache)
        self._running = Running(settings, self.answers)
        self._described = described = Catalogue(settings)
        system, accuracy = System(settings, self.readiness), Accuracy()
        run, pipeline = self._running.run, Pipelines(settings, self._running).run
        self.routes = (
            Route("/", {"GET": system.index}),
            Route("/v1/operations", {"GET": described.list}),
            Route("/v1/operations/{name}", {"GET": self._get, "POST": run, "QUERY": run}, bodies=True),
            Route(PIPELINES, {"POST": pipeline, "QUERY": pipeline}, bodies=True),
            Route("/v1/accuracy", {"GET": accuracy.list}),
            Route("/v1/accuracy/{name}", {"GET": accuracy.one}),
            Route("/v1/limits", {"GET": system.limits}),
            Route("/v1/version", {"GET": system.version}),
            Route("/openapi.json", {"GET": system.openapi}),
            Route("/livez", {"GET": system.alive}),
            Route("/readyz", {"GET": system.ready}),
        )

    def admit(self, head: Head) -> Admission | Response:
        """The word that the body may be read, or the answer without it."""
        return _answer(head, lambda: self._admit(head))

    def handle(self, request: Request) -> Response:
        """The answer to a whole request. Every error becomes a problem document."""
        with self.traffic.request():
            response = _answer(request.head, lambda: self._handle(request))
        assert isinstance(response, Response)
        return response

    def _admit(self, head: Head) -> Admission | Response:
        match = find(self.routes, head)
        if match.name and match.route.bodies:
            catalogue.operation(match.name)
        if match.route.template == "/livez" and not head.length:
            return self._handle(Request(head, b""))
        if not (match.route.bodies and head.method in ("POST", "QUERY")):
            return Admission(SMALL_BODY)
        if head.length is not None and head.length > self._settings.max_body:
            raise Refusal(
                413,
                "too-large",
                "A limit on size was crossed",
                "The body is larger than the service takes.",
                limit=self._settings.max_body,
                actual=head.length,
            )
        check_type(head, _readable(match.route))
        return Admission(self._settings.max_body)

    def _handle(self, request: Request) -> Response:
        head = request.head
        if head.method == "OPTIONS":
            return self._options(head)
        match = find(self.routes, head)
        handler = match.route.handler(head.method)
        assert handler is not None, "find refuses methods without a handler"
        return handler(request, match.name)

    def _get(self, request: Request, name: str) -> Response:
        """The declaration of an operation, or a run of one that needs no image where the query asks for something."""
        needs = any(each.required for each in catalogue.operation(name).inputs)
        answer = self._described.describe if needs or not request.head.query else self._running.run
        return answer(request, name)

    def _options(self, head: Head) -> Response:
        match = find(self.routes, head)
        headers = {"Allow": match.route.allow}
        if "QUERY" in match.route.handlers:
            headers["Accept-Query"] = ", ".join([*_readable(match.route), "multipart/form-data"])
        return Response(204, headers=headers)

    def _canary(self) -> None:
        """A tiny request of our own on the road that every request takes."""
        body, path, query = _smallest_request()
        now = time.monotonic()
        headers = {"content-length": str(len(body)), "content-type": "application/x-npy", "accept": "*/*"}
        head = Head("QUERY", path, query, headers, "canary", now, now + self._settings.request_timeout)
        response = self._handle(Request(head, body))
        if response.status != 200 or not response.body:
            raise RuntimeError(f"the canary was answered with {response.status}")


def _readable(route: Route) -> tuple[str, ...]:
    """The media types of bodies that a route reads, beside forms."""
    return (*readable(), JSON) if route.template == PIPELINES else readable()


def _answer(head: Head, work: Callable[[], Admission | Response]) -> Admission | Response:
    """What `work` returns, or the problem document of what it raises."""
    try:
        return work()
    except Refusal as refusal:
        return refusal.response(head)
    except LichenError as error:
        answered = refusal_of(error)
        if answered.status >= 500:
            log.error("request failed", request_id=head.request_id, code=error.code, reason=str(error))
        return answered.response(head)
    except Exception:
        log.exception("request broke off", request_id=head.request_id)
        return internal().response(head)


def _smallest_request() -> tuple[bytes, str, tuple[tuple[str, str], ...]]:
    """Body, path and query of a tiny run of the first operation that reads a single image."""
    for operation in catalogue.operations().values():
        made = example(operation)
        if made is None or len(made[0]) != 1:
            continue
        inputs, parameters = made
        body = encode(next(iter(inputs.values())), "npy").data
        return body, path_of(operation.name), (*as_query(parameters), ("prune", "false"))
    raise RuntimeError("no operation of the catalogue offers an example with one image")


def as_query(parameters: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Parameters as a URL gives them: text plain, everything else as JSON."""
    return tuple(
        (name, value if isinstance(value, str) else canonical(value).decode()) for name, value in parameters.items()
    )


def create_application() -> Service:
    """The service with the settings of the environment; its warm-up has begun and goes on in the background, and so
    does, after it, the calibration of a machine that has none."""
    logs.configure()
    settings = Settings.load()
    service = Service(settings)
    service.readiness.start()
    if settings.calibrate == "on":
        service.calibrating.start()
    return service
