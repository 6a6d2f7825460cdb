"""Measures the times of this machine at first start, behind the back of requests.

A thread begins when the process is warm and finds no times for this machine. It works in runs of a few milliseconds,
only while no request is in flight, and throws away a run that met one; readiness never waits for it. Of several worker
processes one measures: it holds a lock, and the others see what it has stored.
"""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lichen.accuracy import times
from lichen.catalogue import operations
from lichen_service.logs import log
from lichen_service.readiness import Readiness

PAUSE = 0.003
"""Seconds between runs, in which whatever waits for a processor gets it."""
QUIET = 0.05
"""Seconds without a request before the next run."""


class Traffic:
    """Knows whether requests are in flight, and whether any came. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._within = 0
        self._ended = -QUIET
        self.arrivals = 0

    @contextmanager
    def request(self) -> Iterator[None]:
        """One request is in flight as long as the body lasts."""
        with self._lock:
            self._within += 1
            self.arrivals += 1
        try:
            yield
        finally:
            with self._lock:
                self._within -= 1
                self._ended = time.monotonic()

    def give_way(self, longest: float) -> None:
        """Wait until it is quiet, for so many seconds at most."""
        ends = time.monotonic() + longest
        while not self.quiet and time.monotonic() < ends:
            time.sleep(QUIET)

    @property
    def quiet(self) -> bool:
        """Nobody is being answered, or has been within the last moment."""
        with self._lock:
            return not self._within and time.monotonic() - self._ended >= QUIET


class Calibrating:
    """The thread and what it waits for."""

    def __init__(self, readiness: Readiness, traffic: Traffic) -> None:
        self._readiness = readiness
        self._traffic = traffic
        self._seen = 0
        self.done = threading.Event()
        """set when everything is measured, or nothing was to be"""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="calibration", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self, seconds: float) -> None:
        """Ends it after the run that it measures, for which it waits so long at most."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(seconds)

    def _run(self) -> None:
        try:
            while not self._readiness.wait(60) and not self._stopping.is_set():
                pass
            from lichen.calibration.sweep import backends  # slow to load, and nobody waits for it

            missing = [backend for backend in backends() if not self._known(backend)]
            with _alone(times.folder() / "measuring") as mine:
                if missing and mine and not self._stopping.is_set():
                    self._measure(missing)
        except Exception:
            log.exception("calibration broke off")
        finally:
            self.done.set()

    @staticmethod
    def _known(backend: str) -> bool:
        """Whether every operation has been measured, by this process or by any other before."""
        return {name for name, _ in times.current(backend)} >= operations().keys()

    def _measure(self, missing: list[str]) -> None:
        from lichen.calibration.calibrate import Outcome, calibrate
        from lichen.calibration.timing import QUICK

        began, outcome = time.monotonic(), Outcome()
        self._wait()
        for _ in calibrate(list(operations().values()), missing, QUICK, outcome, self._undisturbed):
            if self._stopping.is_set():
                return
            time.sleep(PAUSE)
            self._wait()
        log.info(
            "calibrated",
            seconds=round(time.monotonic() - began, 3),
            samples=outcome.samples,
            missed=outcome.missed,
            kept=outcome.kept,
        )

    def _wait(self) -> None:
        """Until nobody is being answered."""
        while not self._traffic.quiet and not self._stopping.is_set():
            time.sleep(QUIET)
        self._seen = self._traffic.arrivals

    def _undisturbed(self) -> bool:
        return self._traffic.arrivals == self._seen


@contextmanager
def _alone(path: Path) -> Iterator[bool]:
    """Whether this process is the one that measures, until the body ends; where no lock can be written it is, too.

    The lock is the kernel's, so it ends with a process that is killed.
    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        yield True
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        yield False
        return
    try:
        yield True
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)
