"""A fixed number of threads that take jobs in order.

It has no bound of its own: the loop, which alone submits, counts what is in flight and refuses first.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable

Job = Callable[[], None]


class Pool:
    def __init__(self, threads: int, name: str = "work") -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        # Daemons, since a kernel that does not end must not keep a worker from ending.
        self._threads = [
            threading.Thread(target=self._run, name=f"{name}-{number}", daemon=True) for number in range(threads)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, job: Job) -> None:
        """The job must let no exception escape."""
        self._jobs.put(job)

    def stop(self, timeout: float) -> None:
        """Let each thread end after the jobs already submitted."""
        for _ in self._threads:
            self._jobs.put(None)
        for thread in self._threads:
            thread.join(timeout)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()
            del job  # it holds a request's pixels; they must not wait for the next request to be let go
