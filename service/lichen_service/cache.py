"""Answers kept for whoever asks the same again: by entity tag, within so many bytes, the oldest dropped first.

A tag stands for all that decides the bytes of an answer (inputs, plan, engine, device, format), so nothing kept is ever
stale. Requests for the same tag at the same time are computed once: the others wait for the first and take its answer,
or compute themselves where it failed.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

from lichen_service.http.message import Body, Response


@dataclass(frozen=True, slots=True)
class Kept:
    """What of an answer comes back."""

    body: Body
    headers: dict[str, str]
    log: dict[str, object] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return len(self.body) + sum(len(name) + len(value) for name, value in self.headers.items())


class Answers:
    """Safe to use from any thread. `capacity` is in bytes; with 0 nothing is kept, and nobody waits for another."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._held = 0
        self._kept: OrderedDict[str, Kept] = OrderedDict()
        self._computing: dict[str, threading.Event] = {}
        self._lock = threading.Lock()

    @property
    def held(self) -> int:
        """Bytes in use."""
        return self._held

    def answer(self, tag: str, compute: Callable[[], Response], deadline: float) -> tuple[Response, bool]:
        """The answer for a tag and whether it was kept before. Waits for one in the making until the deadline."""
        if not self._capacity:
            return compute(), False
        waited = False
        while True:
            with self._lock:
                kept = self._kept.get(tag)
                if kept is not None:
                    self._kept.move_to_end(tag)
                    return Response(200, kept.body, dict(kept.headers), dict(kept.log)), True
                made = self._computing.get(tag)
                if made is None and not waited:
                    mine = self._computing[tag] = threading.Event()
                    break
            if made is None or waited or not made.wait(max(deadline - time.monotonic(), 0)):
                return compute(), False  # the one waited for failed, or its answer was not kept
            waited = True
        try:
            response = compute()
            self._keep(tag, response)
        finally:
            with self._lock:
                del self._computing[tag]
            mine.set()
        return response, False

    def _keep(self, tag: str, response: Response) -> None:
        new = Kept(response.body, dict(response.headers), dict(response.log))
        if response.status != 200 or new.size > self._capacity:
            return
        with self._lock:
            before = self._kept.pop(tag, None)
            self._held += new.size - (before.size if before else 0)
            self._kept[tag] = new
            while self._held > self._capacity:
                _, oldest = self._kept.popitem(last=False)
                self._held -= oldest.size
