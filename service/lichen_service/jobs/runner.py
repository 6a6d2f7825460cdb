"""Works the queue off: takes one job after the other on the road that every request takes.

Each process has a few threads for it. A job ends before its next stage when it is dismissed, or when the service ends;
in the second case it waits again, and whoever starts next takes it up.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable

from lichen_service.http.message import CLIENT_GONE, Head, Request, Response
from lichen_service.jobs.job import Job
from lichen_service.jobs.queue import Queue
from lichen_service.logs import log
from lichen_service.problems import problem

PAUSE = 0.25
"""Seconds after which a thread looks whether another process has put something into the queue."""
RECOVERING = 2.0
"""Seconds between looks at whose process has died."""
CLEANING = 60.0
"""Seconds between looks at what has expired."""
AFTER_FAILURE = 1.0
"""Seconds until a thread that failed begins again."""
PROGRESS = {"decode": 5, "plan": 15, "run": 20, "encode": 85, "digest": 95}
"""How far a job is when a stage begins, in per cent."""


class Runner:
    def __init__(
        self, queue: Queue, handle: Callable[[Request], Response], *, threads: int, timeout: float, keep: float
    ) -> None:
        self._queue = queue
        self._handle = handle
        self._timeout = timeout
        self._keep = keep
        self._stopping = threading.Event()
        self._work = threading.Semaphore(0)
        self._threads = [threading.Thread(target=self._run, name=f"job-{at}", daemon=True) for at in range(threads)]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def notify(self) -> None:
        """There is a new job."""
        self._work.release()

    def stop(self, timeout: float | None = None) -> None:
        """Begin nothing more; with a timeout, wait for what was begun to end or to wait again."""
        self._stopping.set()
        for _ in self._threads:
            self._work.release()
        if timeout is not None:
            for thread in self._threads:
                thread.join(timeout)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                with self._queue.worker() as worker:
                    self._work_off(worker)
            except Exception:
                log.exception("work on jobs broke off, and begins again")
                self._stopping.wait(AFTER_FAILURE)

    def _work_off(self, worker: str) -> None:
        recovered = cleaned = float("-inf")
        while not self._stopping.is_set():
            now = time.monotonic()
            if now - recovered > RECOVERING:
                recovered = now
                self._recover()
            if now - cleaned > CLEANING:
                cleaned = now
                self._queue.clean()
            job = self._queue.claim(worker)
            if job is None:
                self._work.acquire(timeout=PAUSE)
            else:
                self._do(job, worker)

    def _recover(self) -> None:
        for job in self._queue.recover():
            answer = problem(
                500,
                "job-crashed",
                "The service failed",
                f"The process that computed this job died {job.attempts} times.",
                request_id=job.request.request_id,
            )
            self._queue.finish(job, job.worker, answer.status, answer.headers, answer.body, self._keep)

    def _do(self, job: Job, worker: str) -> None:
        began = time.monotonic()

        def alive() -> bool:
            return not self._stopping.is_set() and self._queue.is_running(job, worker)

        def report(stage: str) -> None:
            self._queue.report(job, worker, stage, PROGRESS.get(stage, 50))

        stored = job.request
        deadline = began + self._timeout
        head = Head(
            stored.method,
            stored.path,
            stored.query,
            stored.headers,
            stored.request_id,
            began,
            deadline,
            allowed=self._timeout,
            alive=alive,
            began=report,
        )
        try:
            answer = self._handle(Request(head, self._queue.body(job)))
        except FileNotFoundError:
            return  # dismissed before it began
        if answer.status == CLIENT_GONE or answer.status == 503:  # told to end, or there is no room now
            self._queue.release(job, worker)
            self._stopping.wait(1.0 if answer.status == 503 else 0.0)
            return
        kept = {name: value for name, value in answer.headers.items() if name != "Cache-Control"}
        try:
            done = self._queue.finish(job, worker, answer.status, kept, answer.body, self._keep)
        except (OSError, sqlite3.OperationalError) as failure:  # a full disk, most likely
            log.error("the result of a job could not be kept; it waits again", job=job.id, reason=str(failure))
            self._queue.release(job, worker)
            self._stopping.wait(AFTER_FAILURE)
            return
        log.info(
            "job",
            job=job.id,
            request_id=stored.request_id,
            path=stored.path,
            status=answer.status,
            done=done,
            attempts=job.attempts,
            waited_ms=round(1e3 * max(0.0, time.time() - job.created - (time.monotonic() - began)), 3),
            work_ms=round(1e3 * (time.monotonic() - began), 3),
        )
