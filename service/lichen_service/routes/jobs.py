"""Work in the background: `Prefer: respond-async` on whatever computes, POST /v1/jobs, and what becomes of a job.

A job is a request that was kept. Its answer is the answer to that request, kept as well: GET on its result gives the
same status, headers and bytes, whole or in part. A job is seen by the key that made it alone.

An `Idempotency-Key` makes asking twice safe: the same request gets the job that there is, another one is refused.
"""

from __future__ import annotations

import re
import sqlite3
from dataclasses import dataclass
from typing import Any

from lichen_service.access.guard import Caller
from lichen_service.assets import is_id
from lichen_service.descriptions import path_of
from lichen_service.documents import as_query, canonical, momentary
from lichen_service.http.message import Body, Request, Response
from lichen_service.jobs.events import Events
from lichen_service.jobs.job import FINAL, PATH, Job, State, Stored
from lichen_service.jobs.queue import Exists, Queue, TooMany
from lichen_service.jobs.runner import Runner
from lichen_service.logs import log
from lichen_service.refusals import RETRY_AFTER, Refusal
from lichen_service.settings import Settings
from lichen_service.stored import respond

LISTED = 100
"""Jobs in a list, the newest."""
_KEY = re.compile(r"[\x21-\x7e]{1,255}")
_KINDS = {"operation": "parameters", "pipeline": "options", "scene": "options"}
"""What a job that comes as JSON may ask for, and where the rest of its query stands."""


def wants_a_job(request: Request) -> bool:
    """Whether a request asks to be answered later."""
    asked = [each.split(";")[0].strip().lower() for each in request.head.headers.get("prefer", "").split(",")]
    return "respond-async" in asked and request.head.method in ("POST", "QUERY")


class JobRoutes:
    def __init__(self, settings: Settings, queue: Queue, runner: Runner) -> None:
        self._settings = settings
        self._queue = queue
        self._runner = runner
        self._events = Events(queue)

    def accept(self, request: Request, stored: Stored | None = None, body: Body | None = None) -> Response:
        """Keeps a request and answers 202 with where to ask for it."""
        caller = request.caller if isinstance(request.caller, Caller) else Caller()
        if "jobs" not in caller.scopes:
            raise Refusal(403, "forbidden", "The key is not for this", "The key lacks the scope 'jobs'.")
        key = request.head.headers.get("idempotency-key")
        if key is not None and not _KEY.fullmatch(key):
            raise Refusal(
                400, "malformed-key", "The request is malformed", "Idempotency-Key has 1 to 255 visible characters."
            )
        settings = self._settings
        try:
            job = self._queue.submit(
                stored or Stored.of(request.head),
                request.body if body is None else body,
                owner=caller.name,
                key=key,
                most=settings.max_jobs,
                most_each=caller.jobs or settings.max_jobs_each,
                room=settings.job_store,
            )
        except Exists as exists:
            if not exists.same:
                raise Refusal(
                    409,
                    "key-used",
                    "The idempotency key was used for another request",
                    "A key stands for one request; use a new one.",
                ) from None
            job = exists.job
        except TooMany as full:
            raise Refusal(
                429,
                "too-many-jobs",
                "There are too many jobs",
                str(full),
                headers={"Retry-After": RETRY_AFTER},
                retryable=True,
            ) from None
        except (OSError, sqlite3.OperationalError) as failure:
            log.error("a job could not be kept", reason=str(failure))
            raise Refusal(
                507, "no-room", "There is no room for the job", "It could not be written to the disk.", retryable=True
            ) from None
        self._runner.notify()
        response = momentary(202, job.document())
        response.headers |= {"Location": f"{PATH}/{job.id}", "Preference-Applied": "respond-async"}
        response.log = {"job": job.id}
        return response

    def list(self, request: Request, name: str) -> Response:
        return momentary(200, {"jobs": [each.document() for each in self._queue.of(_owner(request), LISTED)]})

    def one(self, request: Request, name: str) -> Response:
        job = self._find(request, name)
        response = momentary(200, job.document())
        if job.state not in FINAL:
            response.headers["Retry-After"] = RETRY_AFTER
        return response

    def events(self, request: Request, name: str) -> Response:
        """Server-sent events until the job has ended."""
        job = self._find(request, name)
        if self._events.full:
            detail = "Too many clients watch jobs."
            raise Refusal(
                503, "overloaded", "The service is busy", detail, headers={"Retry-After": RETRY_AFTER}, retryable=True
            )
        seen = request.head.headers.get("last-event-id", "")
        known = int(seen) if seen.isascii() and seen.isdigit() and len(seen) < 18 else -1
        headers = {"Content-Type": "text/event-stream", "Cache-Control": "no-store"}
        return Response(200, headers=headers, stream=self._events.watch(job, known))

    def result(self, request: Request, name: str) -> Response:
        """The answer to the request that the job stands for."""
        job = self._find(request, name)
        if job.state is State.DISMISSED:
            raise Refusal(410, "dismissed", "The job was dismissed", "It has no result.")
        if job.state not in FINAL:
            detail = f"The job is {job.state}; ask again, or watch its events."
            retry = {"Retry-After": RETRY_AFTER}
            raise Refusal(409, "not-finished", "The job has not ended", detail, headers=retry, retryable=True)
        try:
            body = self._queue.result(job)
        except FileNotFoundError:
            raise _missing() from None
        headers = dict(job.headers)
        if job.status != 200:
            assert job.status is not None
            return Response(job.status, body, headers | {"Cache-Control": "no-store"})
        media_type = headers.pop("Content-Type", "application/octet-stream")
        headers.pop("Content-Digest", None)
        tag = headers.pop("ETag", f'"{job.id}"')
        return respond(request.head, body, media_type, tag, headers | {"Cache-Control": "private, no-cache"})

    def dismiss(self, request: Request, name: str) -> Response:
        """Ends a job that has not ended, or forgets one that has."""
        job = self._find(request, name)
        if self._queue.dismiss(job, self._settings.job_ttl):
            return momentary(200, self._find(request, name).document())
        self._queue.forget(job)
        return Response(204)

    def _find(self, request: Request, name: str) -> Job:
        job = self._queue.find(name)
        if job is None or job.owner != _owner(request):
            raise _missing()
        return job


@dataclass(frozen=True, slots=True)
class Order:
    """A run that came as JSON: where it would have been sent, with which query and body."""

    path: str
    query: tuple[tuple[str, str], ...]
    body: bytes = b""


def order_of(document: Any) -> Order:
    """The run that a document asks for. Raises the 422 refusal with what is wrong with it.

    An operation has `parameters`; a pipeline (an object, or its text) and a scene have `options`. All three name their
    `inputs` among the stored images.
    """
    if not isinstance(document, dict):
        raise _invalid("the document is an object with 'operation', 'pipeline' or 'scene'")
    kinds = [kind for kind in _KINDS if kind in document]
    if len(kinds) != 1:
        raise _invalid(f"it has one of 'operation', 'pipeline' and 'scene', and has {len(kinds)} of them")
    (kind,) = kinds
    settings = _KINDS[kind]
    unknown = sorted(set(document) - {kind, settings, "inputs"})
    if unknown:
        raise _invalid(f"{', '.join(map(repr, unknown))} means nothing here")
    said, values, inputs = document[kind], document.get(settings, {}), document.get("inputs", {})
    if not isinstance(values, dict) or not isinstance(inputs, dict):
        raise _invalid(f"'{settings}' and 'inputs' are objects")
    if not all(isinstance(each, str) and is_id(each) for each in inputs.values()):
        raise _invalid("'inputs' are names of stored images, sha256:...")
    if both := sorted(values.keys() & inputs.keys()):
        raise _invalid(f"{', '.join(map(repr, both))} is given among '{settings}' and among 'inputs'")
    query = as_query({**values, **inputs})
    if kind == "operation":
        if not isinstance(said, str):
            raise _invalid("'operation' is a name")
        return Order(path_of(said), query)
    if isinstance(said, str):
        return Order(f"/v1/{kind}s", (*query, (kind, said)))
    if not isinstance(said, dict):
        raise _invalid(f"'{kind}' is an object")
    return Order(f"/v1/{kind}s", query, canonical(said))


def _invalid(detail: str) -> Refusal:
    return Refusal(422, "invalid-job", "The job is well formed but not valid", f"A job is wrong: {detail}.")


def _owner(request: Request) -> str:
    return request.caller.name if isinstance(request.caller, Caller) else ""


def _missing() -> Refusal:
    return Refusal(404, "unknown-job", "There is no such job", "No job of yours has this name, or not any more.")
