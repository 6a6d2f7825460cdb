"""How much memory the requests of one process may take together, reserved before any of it is taken.

What a request will need is known from the headers of its images and from the size of its result: decoding holds the
stored samples and the floats made of them, a run holds its inputs, its result and one step between, and encoding
holds the result once more. Who does not fit now is refused at once and told to come back; who never will is told so.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from lichen.files import Header
from lichen.memory import KEPT, keep
from lichen.operation import Facts
from lichen_service.refusals import RETRY_AFTER, Refusal


def to_decode(header: Header) -> int:
    """Bytes at the height of decoding an image."""
    return 2 * header.decoded_bytes


def to_run(result: Facts) -> int:
    """Bytes of a result, of one step before it, and of its encoded form."""
    return 3 * 4 * result.height * result.width * result.channels


KEPT_OF = 1 / 4
"""of the memory that requests may take, kept for those that follow"""
IDLE = 60.0
"""Seconds without a request after which no more is kept than the library keeps by itself."""


def keep_pages(total: int, arrivals: Callable[[], int], idle: float = IDLE) -> None:
    """For as long as the process lives. Fresh pages cost more than kernels do: of four requests at a time that make a
    picture of 12 megapixels smaller, each takes 0.2 s of the processor where it finds pages of those before, and 0.7
    where 512 MB are kept. `arrivals` counts requests."""
    seen = -1
    while True:
        if (now := arrivals()) == seen:
            keep(KEPT)
        keep(max(KEPT, int(total * KEPT_OF)))
        seen = now
        time.sleep(idle)


class Reservation:
    """What one request holds of the memory, all given back together."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self.held = 0

    def grow(self, count: int) -> None:
        """Takes `count` bytes more. Raises the 413 refusal where they never fit, the 503 where they do not now."""
        self._memory.take(count, self.held)
        self.held += count


_current: ContextVar[Reservation] = ContextVar("reservation")


def reserve(count: int) -> None:
    """Takes `count` bytes for the request that this thread works on; raises as `Reservation.grow`."""
    if (reservation := _current.get(None)) is not None:
        reservation.grow(count)


class Memory:
    def __init__(self, total: int) -> None:
        self.total = total
        self.held = 0
        self._lock = threading.Lock()
        self.on_change: Callable[[int], None] = lambda _: None

    @contextmanager
    def request(self) -> Iterator[None]:
        """What the body reserves, on this thread, it holds until it ends."""
        reservation = Reservation(self)
        token = _current.set(reservation)
        try:
            yield
        finally:
            _current.reset(token)
            with self._lock:
                self.held -= reservation.held
                self.on_change(self.held)

    def take(self, count: int, own: int) -> None:
        with self._lock:
            if own + count > self.total:
                raise Refusal(
                    413,
                    "too-large",
                    "A limit on size was crossed",
                    "The images of this request and its result need more memory than one request may take.",
                    limit=self.total,
                    actual=own + count,
                )
            if self.held + count > self.total:
                raise Refusal(
                    503,
                    "overloaded",
                    "The service is busy",
                    "The memory for images is used up by other requests.",
                    headers={"Retry-After": RETRY_AFTER},
                    retryable=True,
                )
            self.held += count
            self.on_change(self.held)
