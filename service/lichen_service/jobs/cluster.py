"""Jobs computed by the workers of a Dask cluster (`--jobs dask://HOST:PORT`).

The queue stays what it is: states, results and idempotency keys are kept here, on the disk, so nothing that was
accepted is lost with a cluster. A thread of the runner hands a job over with the stored images it names, and waits for
the answer, which is the one it would have computed itself, byte for byte: workers choose methods by the times that are
known here. A worker that dies costs a repetition, by another worker; a cluster that cannot be reached lets jobs wait.
Workers hold jobs to the limits of this service, and decode images in a process of their own.

Scheduler and workers need this package installed, in the same version.
"""

from __future__ import annotations

import secrets
import threading
import time
from functools import lru_cache
from typing import Any

import lichen
from lichen.accuracy import times
from lichen_service.assets import Assets, is_id
from lichen_service.http.message import CLIENT_GONE, Body, Head, Request, Response
from lichen_service.inside import Inside
from lichen_service.jobs.service import SCHEME
from lichen_service.logs import log
from lichen_service.problems import problem
from lichen_service.settings import Settings

WAITING = 10.0
"""Seconds until a scheduler that does not answer is taken for gone."""
LOOK = 0.2
"""Seconds between looks at whether a job was dismissed."""


class Cluster:
    """Answers requests by having a worker answer them. Safe to use from several threads."""

    def __init__(self, settings: Settings, assets: Assets) -> None:
        """Connects when the first job comes."""
        self._address = f"tcp://{settings.jobs.removeprefix(SCHEME)}"
        self._settings = settings
        self._assets = assets
        self._client: Any = None
        self._lock = threading.Lock()

    def handle(self, request: Request) -> Response:
        """The answer of a worker; 503 where there is none to be had now."""
        head = request.head
        try:
            client = self._connected()
            head.began("run")
            images = [self._assets.read(value) for value in {each for _, each in head.query if is_id(each)}]
            given = [bytes(request.body), [each for each in images if each is not None]]
            # Apart from the call, which the scheduler keeps, while these go to a worker.
            sent = client.scatter(given, hash=False)
            plain = head._replace(alive=_always, began=_nobody, received=0.0, deadline=head.deadline - time.monotonic())
            asked = (self._settings, lichen.__version__, times.known(), plain)
            done = client.submit(compute, *asked, *sent, key=f"lichen-job-{secrets.token_hex(8)}", pure=False)
            return self._wait(head, client, done)
        except Exception as failure:
            log.error(
                "the cluster did not answer", cluster=self._address, reason=f"{type(failure).__name__}: {failure}"
            )
            return _busy(head)

    def _wait(self, head: Head, client: Any, done: Any) -> Response:
        from distributed import TimeoutError as NotYet
        from distributed.scheduler import KilledWorker

        while True:
            try:
                status, headers, body = done.result(timeout=LOOK)
            except NotYet:
                if not head.alive():
                    done.cancel(force=True)
                    return Response(CLIENT_GONE)
                if client.status != "running":
                    raise ConnectionError("the scheduler has gone") from None
            except KilledWorker as killed:
                detail = f"The processes that computed this job died: {killed.allowed_failures + 1} of them."
                return problem(500, "job-crashed", "The service failed", detail, request_id=head.request_id)
            else:
                return Response(status, body, headers)

    def _connected(self) -> Any:
        from distributed import Client

        with self._lock:
            if self._client is None or self._client.status != "running":
                if self._client is not None:
                    self._client.close(timeout=1)
                self._client = Client(self._address, timeout=WAITING, set_as_default=False)
            return self._client


def compute(
    settings: Settings, version: str, known: times.Known, head: Head, body: Body, images: list[Body]
) -> tuple[int, Any, bytes]:
    """On a worker: status, headers and body of the answer."""
    if version != lichen.__version__:
        raise RuntimeError(f"the worker has version {lichen.__version__} of the engine, the service {version}")
    now = time.monotonic()
    request = Request(head._replace(received=now, deadline=now + head.deadline), body)
    with times.held(known):
        answer = _inside(settings).respond(request, images)
    return answer.status, answer.headers, bytes(answer.body)


@lru_cache(maxsize=1)
def _inside(settings: Settings) -> Inside:
    """This worker's own service, warm from the first job on."""
    return Inside(settings=settings)


def _always() -> bool:
    return True


def _nobody(_stage: str) -> None:
    pass


def _busy(head: Head) -> Response:
    detail = "The cluster that computes jobs cannot be reached."
    return problem(503, "overloaded", "The service is busy", detail, request_id=head.request_id, retryable=True)
