"""The application: paths, what answers them, and how errors leave.

`admit` sees a request's head on the thread that serves every connection, so it only looks things up: unknown paths,
methods and operations, bodies that are too large or of a type nobody reads are refused before a byte of the body is
taken in. What only has to be looked up (`/livez`, `/readyz` while the canary is fresh, documents that do not change) is
answered right there, so it is when every other thread is busy. `handle` does the rest.
"""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from traceback import clear_frames
from typing import Any

from lichen import catalogue
from lichen.errors import LichenError
from lichen.files import Data, encode
from lichen.memory import room
from lichen_service import logs, meanings, tracing
from lichen_service.access import signing
from lichen_service.access.cors import Cors
from lichen_service.access.guard import Caller, Guard
from lichen_service.assets import Assets
from lichen_service.assets_elsewhere import open_assets
from lichen_service.cache import Answers
from lichen_service.calibrating import Calibrating, Traffic
from lichen_service.decoding.pool import Decoders
from lichen_service.decoding.processes import Begun
from lichen_service.descriptions import path_of
from lichen_service.documents import Shelf, as_query
from lichen_service.formats import readable
from lichen_service.http.message import Admission, Head, Request, Response
from lichen_service.jobs.service import Jobs
from lichen_service.logs import log
from lichen_service.memory import Memory, keep_pages
from lichen_service.metrics import Metrics
from lichen_service.problems import PATH as PROBLEMS
from lichen_service.readiness import Readiness, Tried, example
from lichen_service.refusals import Refusal, internal, refusal_of
from lichen_service.routes.assets import PATH as ASSETS
from lichen_service.routes.assets import AssetRoutes
from lichen_service.routes.catalogue import Catalogue
from lichen_service.routes.figures import Figures
from lichen_service.routes.jobs import wants_a_job
from lichen_service.routes.pipelines import PATH as PIPELINES
from lichen_service.routes.pipelines import Pipelines
from lichen_service.routes.running import Running
from lichen_service.routes.studio import Studio
from lichen_service.routes.system import ALIVE, READY, System
from lichen_service.routes.textures import PATH as TEXTURES
from lichen_service.routes.textures import Textures
from lichen_service.routing import Later, Match, Route, Table
from lichen_service.settings import SHARED, Settings
from lichen_service.uploads import JSON, check_type

SCENES = "/v1/scenes"
FIGURES = "/metrics"
SMALL_BODY = 4096
"""Bytes; what a request to a path that reads no body may still send."""


class Service:
    """The routes under one roof; an `Application` for the wire."""

    def __init__(self, settings: Settings, shared: Path | None = None, begun: Sequence[Begun] = ()) -> None:
        """`shared` is a folder that all worker processes of this service have in common, `begun` are decoders."""
        self._settings = settings
        self.memory = Memory(settings.memory // settings.workers)
        self._guard = Guard(settings, shared)
        self._cors = Cors.parse(settings.cors_origins)
        self.traffic = Traffic()
        self.readiness = Readiness(self._canary, give_way=self.traffic.give_way)
        self.calibrating = Calibrating(self.readiness, self.traffic)
        self.assets = open_assets(settings.assets, settings.asset_folder, settings.asset_store)
        self.decoders = Decoders(settings.decoders, settings.decoder_memory, settings.decoder_seconds, begun=begun)
        self.answers = Answers(settings.cache)
        self._running = Running(settings, self.assets, self.decoders, self.answers)
        self._shelf = shelf = Shelf()
        self._described = described = Catalogue(settings, shelf)
        self._system = system = System(settings, self.readiness, shelf)
        accuracy = Later("lichen_service.routes.accuracy", "Accuracy")
        run, check, stored = self._running.run, self._running.check, AssetRoutes(self.assets)
        pipelines, textures = Pipelines(settings, self._running), Textures()
        scenes = Later("lichen_service.routes.scenes", "Scenes", settings, self._running)
        self.jobs = _jobs(settings, self.assets, self.handle, self._check)
        self.metrics = Metrics(catalogue.known)
        self._tracing = tracing.start() if settings.traces == "on" else None
        routes = (
            *(self.jobs.table if self.jobs else ()),
            *Studio().routes,
            Route("/v1/operations", {"GET": described.list}),
            Route("/v1/operations/{name}", {"GET": self._get, "POST": run, "QUERY": run}, True, None, check, "run"),
            Route(PIPELINES, dict.fromkeys(("POST", "QUERY"), pipelines.run), True, None, pipelines.check, "run"),
            Route(SCENES, dict.fromkeys(("POST", "QUERY"), scenes.by("run")), True, None, scenes.by("check"), "run"),
            Route(TEXTURES, {"GET": textures.list}),
            Route(f"{TEXTURES}/{{name}}", {"GET": textures.one}),
            Route(ASSETS, {"PUT": stored.put}, True, readable(), scope="assets"),
            Route(f"{ASSETS}/{{name}}", {"GET": stored.get, "DELETE": stored.delete}, scope="assets"),
            Route("/v1/accuracy", {"GET": accuracy.by("list")}),
            Route("/v1/accuracy/{name}", {"GET": accuracy.by("one")}),
            Route(PROBLEMS, {"GET": meanings.listed}, scope=None),
            Route(f"{PROBLEMS}/{{name}}", {"GET": meanings.one}, scope=None),
            Route("/v1/limits", {"GET": system.limits}),
            Route("/v1/version", {"GET": system.version}),
            Route("/openapi.json", {"GET": system.openapi}),
            Route(FIGURES, {"GET": Figures(self.metrics).text}, scope="metrics"),
            Route(ALIVE, {"GET": system.alive}, scope=None),
            Route(READY, {"GET": system.ready}, scope=None),
        )
        told = [each for each in routes if each.template in (FIGURES, ALIVE, READY)]
        rest = [each for each in routes if each.template != FIGURES]
        self._tables = {True: Table(told), False: Table(rest if settings.metrics else routes)}
        self._measure()

    def _table(self, head: Head) -> Table:
        """What there is at the address that a request came to."""
        return self._tables[head.apart]

    def admit(self, head: Head) -> Admission | Response:
        """The word that the body may be read, or the answer without it."""
        answer = _answer(head, partial(self._admit, head))
        return self._outgoing(head, answer) if isinstance(answer, Response) else answer

    def handle(self, request: Request) -> Response:
        """The answer to a whole request. Every error becomes a problem document."""
        with self.traffic.request(), self.memory.request(), self.assets.request():
            response = _answer(request.head, partial(self._handle, request))
        assert isinstance(response, Response)
        return self._outgoing(request.head, _told(response, request.head, request.caller))

    def lend(self, length: int) -> memoryview:
        """Memory for the body of a request: of what pictures leave, whose pages are there already."""
        return room(length)

    def answered(self, lines: Sequence[Mapping[str, Any]]) -> None:
        """Hears of every answer that has left, as the access log has it."""
        self.metrics.answered(lines)
        if self._tracing is not None:
            for line in lines:
                self._tracing.answered(line)

    def _outgoing(self, head: Head, response: Response) -> Response:
        """The response with what does not depend on its route, and what the log shall know."""
        if (match := self._table(head).match(head.path)) is not None:
            response.log["route"] = match.route.template
        return self._cors.add(head, response)

    def _admit(self, head: Head) -> Admission | Response:
        if (preflight := self._preflight(head)) is not None:
            return preflight
        match, caller = self._let_in(head)
        if match.name and match.route.bodies:  # an operation's
            catalogue.operation(match.name)
        if not head.length and (known := self._system.at_once(head) or self._shelf.at_once(head)) is not None:
            known.lasting &= match.route.scope is None or self._guard.indifferent
            return _told(known, head, caller)
        if not (match.route.bodies and head.method in ("POST", "PUT", "QUERY")):
            return Admission(SMALL_BODY, caller)
        if head.length is not None and head.length > self._settings.max_body:
            raise Refusal(
                413,
                "too-large",
                "A limit on size was crossed",
                "The body is larger than the service takes.",
                limit=self._settings.max_body,
                actual=head.length,
            )
        if match.route.reads is None:
            check_type(head, _readable(match.route))
        else:
            check_type(head, match.route.reads, forms=False)
        return Admission(self._settings.max_body, caller)

    def drain(self) -> None:
        """The service ends: be sent nothing, and begin no job any more."""
        self.readiness.leave()
        if self.jobs:
            self.jobs.runner.stop()

    def end(self, seconds: float = 10.0) -> None:
        """For a process whose interpreter will be torn down, which a thread that comes back from C++ does not outlive:
        begin nothing any more, and let what runs in the background come back."""
        self.drain()
        self.readiness.stop(seconds)
        self.calibrating.stop(seconds)
        self.decoders.end()

    def _measure(self) -> None:
        """Connects what happens to the figures that tell of it."""
        self.metrics.routes = frozenset(each.template for table in self._tables.values() for each in table.routes)
        self.memory.on_change = self.metrics.held
        self.decoders.on_death = self.metrics.decoders_died.inc
        self.metrics.ask(
            "lichen_asset_bytes", "images that are stored", "store", lambda: {"disk": self.assets.stored()}
        )
        if self.jobs:
            self.metrics.ask("lichen_jobs", "jobs by state", "state", self.jobs.queue.counts)

    def _preflight(self, head: Head) -> Response | None:
        if head.method != "OPTIONS" or not self._cors.origins:
            return None
        return self._cors.preflight(head, self._table(head).find(head).route.allow)

    def _let_in(self, head: Head) -> tuple[Match, Caller]:
        """Where a request goes, and who sends it. Who may not come in does not learn what there is."""
        try:
            match = self._table(head).find(head)
        except Refusal:
            self._guard.admit(head, "")
            raise
        scope = match.route.scope
        return match, Caller(head.peer) if scope is None else self._guard.admit(head, scope)

    def _handle(self, request: Request) -> Response:
        if signing.is_signed(request.head.query):
            query = signing.without_signature(request.head.query)
            request = replace(request, head=request.head._replace(query=query))
        head = request.head
        if head.method == "OPTIONS":
            return self._options(head)
        match = self._table(head).find(head)
        handler = match.route.handler(head.method)
        assert handler is not None, "find refuses methods without a handler"
        if self.jobs and match.route.scope == "run" and wants_a_job(request):
            self._check(request)
            return self.jobs.routes.accept(request)
        return handler(request, match.name)

    def _check(self, request: Request) -> None:
        """Raises all that can be seen to be wrong with a request that is to become a job."""
        match = self._table(request.head).find(request.head)
        if match.route.check is not None:
            match.route.check(request, match.name)

    def _get(self, request: Request, name: str) -> Response:
        """The declaration of an operation, or a run of one whose images the query names, or that needs none."""
        named = {each for each, _ in request.head.query}
        inputs = catalogue.operation(name).inputs
        runs = named and (not any(each.required for each in inputs) or any(each.name in named for each in inputs))
        return (self._running.run if runs else self._described.describe)(request, name)

    def _options(self, head: Head) -> Response:
        match = self._table(head).find(head)
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


def _jobs(
    settings: Settings,
    assets: Assets,
    handle: Callable[[Request], Response],
    check: Callable[[Request], None],
) -> Jobs | None:
    """Jobs where they are wanted and can be kept; a service whose disk cannot be written still computes."""
    if settings.jobs == "off":
        return None
    try:
        return Jobs(settings, assets, handle, check)
    except (OSError, sqlite3.Error) as failure:
        log.error("jobs cannot be kept and are not offered", folder=str(settings.data_folder), reason=str(failure))
        return None


def _told(response: Response, head: Head, caller: Any) -> Response:
    """The response with what is left of its caller's rate, and the caller in the log."""
    if isinstance(caller, Caller):
        response.headers |= caller.rate_headers
        response.log |= {"client": caller.address} if caller.address != head.peer else {}
        response.log |= {"key": caller.name} if caller.name else {}
    return response


def _readable(route: Route) -> tuple[str, ...]:
    """The media types of bodies that a route reads, beside forms."""
    return (*readable(), JSON) if route.template in (PIPELINES, SCENES) else readable()


def _answer(head: Head, work: Callable[[], Admission | Response]) -> Admission | Response:
    """What `work` returns, or the problem document of what it raises."""
    try:
        return work()
    except Exception as error:
        try:
            return _told_wrong(error, head)
        finally:
            _let_go(error)


def _told_wrong(error: Exception, head: Head) -> Response:
    if isinstance(error, Refusal):
        return error.response(head)
    if not isinstance(error, LichenError):
        log.exception("request broke off", request_id=head.request_id)
        return internal().response(head)
    answered = refusal_of(error)
    if answered.status >= 500:
        log.error("request failed", request_id=head.request_id, code=error.code, reason=str(error))
    return answered.response(head)


def _let_go(error: BaseException | None) -> None:
    """Empty the frames that an error has passed. One that a local variable names keeps its own frame, and with it the
    body of the request and its pixels, until the collector of cycles comes by, which may be minutes later."""
    while error is not None:
        clear_frames(error.__traceback__)
        error = error.__cause__ or error.__context__


def _smallest_request() -> tuple[Data, str, tuple[tuple[str, str], ...]]:
    """Body, path and query of a tiny run of the first operation that reads a single image."""
    for operation in catalogue.loaded():
        made = example(operation)
        if made is None or len(made[0]) != 1:
            continue
        inputs, parameters = made
        body = encode(next(iter(inputs.values())), "npy").data
        return body, path_of(operation.name), (*as_query(parameters), ("prune", "false"))
    raise RuntimeError("no operation of the catalogue offers an example with one image")


def prepare() -> None:
    """Load what takes longest before the service can be made: all operations. Nothing is computed yet."""
    catalogue.operations()


def create_application(
    begun: Sequence[Begun] = (), settings: Settings | None = None, tried: Tried | None = None
) -> Service:
    """The service with these settings (by default those of the environment) and decoders; its warm-up has begun, behind
    the operation that is `tried`, and goes on in the background, and so does, after it, the calibration of a machine
    that has none."""
    logs.configure()
    settings = settings or Settings.load()
    shared = os.environ.get(SHARED)
    service = Service(settings, Path(shared) if shared else None, begun)
    service.readiness.start(tried)
    pages = (service.memory.total, lambda: service.traffic.arrivals)
    threading.Thread(target=keep_pages, args=pages, name="pages", daemon=True).start()
    service.assets.clean()
    service.decoders.start()
    if service.jobs:
        service.jobs.runner.start()
    if settings.calibrate == "on":
        service.calibrating.start()
    return service
