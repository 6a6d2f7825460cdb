"""Where the time of a request went, whether any is left, and whether anybody still waits.

Each stage of a run is entered through `Stages.stage`, which refuses to begin one after the deadline, or for a client
that has hung up, and measures the rest. The measurements leave as `Server-Timing` (milliseconds); stages that did not
happen are not listed.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from lichen_service.http.message import Head
from lichen_service.refusals import client_gone, too_costly, too_late

ORDER = ("queue", "decode", "plan", "upload", "kernel", "download", "encode", "total")
"""How the stages are listed; others follow in the order they were met."""

DOUBT = 4.0
"""How many times too long a prediction must be before it is believed: the machine may be faster than its model."""

_NOT_TOKEN = re.compile(r"[^!#$%&'*+.^_`|~0-9A-Za-z-]")


class Stages:
    """The stopwatch of one request, which has `allowed` seconds, or as few as the client asked for, from the moment it
    waits for a thread."""

    def __init__(self, head: Head, allowed: float) -> None:
        self._head = head
        self._began = min(head.deadline - min(allowed, head.allowed), time.monotonic())
        self.seconds: dict[str, float] = {"queue": time.monotonic() - self._began}

    @property
    def remaining(self) -> float:
        """Seconds until the deadline."""
        return self._head.deadline - time.monotonic()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measures its body as `name`. Raises the 504 refusal instead when the deadline has passed, and the one that
        nobody reads when the client has hung up."""
        self.go_on(name)
        began = time.monotonic()
        self._head.began(name)
        try:
            yield
        finally:
            self.add(name, time.monotonic() - began)

    def go_on(self, name: str) -> None:
        """Raises what `stage` raises; also between the steps of a run, and the bands of one."""
        if not self._head.alive():
            raise client_gone(name)
        if time.monotonic() >= self._head.deadline:
            raise too_late(name)

    def afford(self, predicted: float) -> None:
        """Raises the refusal of work that by prediction takes far longer than is left."""
        if predicted > DOUBT * max(self.remaining, 0.0):
            raise too_costly(predicted, self.remaining)

    def add(self, name: str, seconds: float) -> None:
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds

    def split(self, name: str, timing: Mapping[str, float]) -> None:
        """Replaces a stage of ours by the stages that the library measured inside it."""
        del self.seconds[name]
        for inner, seconds in timing.items():
            self.add(inner, seconds)

    def header(self) -> str:
        """The value of `Server-Timing`; `total` is the time since the whole request was here."""
        seconds = self.seconds | {"total": time.monotonic() - self._began}
        names = sorted(seconds, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER) - 1.5)
        return ", ".join(f"{_NOT_TOKEN.sub('-', name)};dur={seconds[name] * 1e3:.3f}" for name in names)
