"""Progress as server-sent events: one thread of the process looks at all jobs that anybody watches.

    id: 7
    event: status
    data: {"id":"...","status":"running","progress":20,...}

The number of an event counts the changes of its job, so a client that comes back with `Last-Event-ID` is told only what
is new. A comment goes out now and then, so that the wire notices who has gone. After the last state the stream ends.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from lichen_service.documents import canonical
from lichen_service.jobs.job import FINAL, Job
from lichen_service.jobs.queue import Queue
from lichen_service.logs import log

PAUSE = 0.2
"""Seconds between looks at the queue while anybody watches."""
HEARTBEAT = 15.0
MOST_WATCHERS = 256
"""Streams of one process at a time."""


@dataclass(eq=False)
class Watching:
    """One client that watches one job: a `Stream` for the wire."""

    events: Events
    name: str
    seen: int
    """changes it knows of"""
    spoken: float = 0.0
    _send: Callable[[bytes], None] | None = None
    _end: Callable[[], None] | None = None

    def open(self, send: Callable[[bytes], None], end: Callable[[], None]) -> None:
        self._send, self._end = send, end
        self.spoken = time.monotonic()
        self.events.add(self)

    def close(self) -> None:
        self.events.remove(self)

    def look(self, job: Job | None, now: float) -> bool:
        """Says what is new; true when there will be nothing more."""
        assert self._send is not None
        assert self._end is not None
        if job is not None and job.changes != self.seen:
            self.seen, self.spoken = job.changes, now
            self._send(b"id: %d\nevent: status\ndata: %s\n\n" % (job.changes, canonical(job.document())))
        elif now - self.spoken > HEARTBEAT:
            self.spoken = now
            self._send(b": still here\n\n")
        if job is None or job.state in FINAL:
            self._end()
            return True
        return False


class Events:
    def __init__(self, queue: Queue) -> None:
        self._queue = queue
        self._lock = threading.Lock()
        self._watching: set[Watching] = set()
        self._thread: threading.Thread | None = None

    @property
    def full(self) -> bool:
        return len(self._watching) >= MOST_WATCHERS

    def watch(self, job: Job, seen: int) -> Watching:
        return Watching(self, job.id, seen)

    def add(self, watching: Watching) -> None:
        with self._lock:
            self._watching.add(watching)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="events", daemon=True)
                self._thread.start()

    def remove(self, watching: Watching) -> None:
        with self._lock:
            self._watching.discard(watching)

    def _run(self) -> None:
        while True:
            with self._lock:
                watching = list(self._watching)
                if not watching:
                    self._thread = None
                    return
            try:
                jobs = {name: self._queue.find(name) for name in {each.name for each in watching}}
            except sqlite3.Error as failure:
                log.error("the queue cannot be read", reason=str(failure))
                time.sleep(1.0)
                continue
            now = time.monotonic()
            for each in watching:
                if each.look(jobs[each.name], now):
                    self.remove(each)
            time.sleep(PAUSE)
