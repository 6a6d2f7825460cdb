"""One thread, many sockets: readiness, deadlines and calls from other threads.

It knows nothing of HTTP. Deadlines are absolute and lazy: moving one later costs nothing, since its place in the heap
is only looked at when it comes up; a connection has one entry there however many requests it carries. Everything runs
on the thread in `run`, except `post`, which any thread or signal handler may call.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import math
import select
import selectors
import signal
import socket
import time
from collections import deque
from collections.abc import Callable
from typing import Any

READ = selectors.EVENT_READ
WRITE = selectors.EVENT_WRITE

Ready = Callable[[int], None]
Call = Callable[[], None]


class Deadline:
    """A moment that can be moved; its call is made once when it has passed."""

    __slots__ = ("_call", "_queued", "_reactor", "at")

    def __init__(self, reactor: Reactor, call: Call) -> None:
        self.at = math.inf
        self._queued = math.inf
        self._reactor = reactor
        self._call: Call | None = call

    def set(self, at: float) -> None:
        """`at`: a time of `time.monotonic()`."""
        self.at = at
        if at < self._queued:
            self._queued = at
            self._reactor._push(at, self)

    def clear(self) -> None:
        self.at = math.inf

    def forget(self) -> None:
        """Never call again, and let go of what the call refers to though the heap may still hold this."""
        self.clear()
        self._call = None

    def _come_up(self, queued: float, now: float) -> None:
        if queued != self._queued:
            return  # an earlier entry has taken its place
        self._queued = math.inf
        if self.at > now:
            if self.at < math.inf:
                self.set(self.at)
            return
        self.at = math.inf
        if self._call is not None:
            self._call()


class Reactor:
    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._heap: list[tuple[float, int, Deadline]] = []
        self._order = itertools.count()
        self._posted: deque[Call] = deque()
        self._stopped = False
        self._asleep = False
        self.after_round: Call = _nothing
        """made after each round of events"""
        self.rest: Callable[[], float] = _without_rest
        """asked before each round: seconds after the last look at sockets in which none is taken, so that many events
        come together; calls and deadlines are not kept waiting"""
        self._looked = 0.0
        self._woken, self._waker = socket.socketpair()
        self._woken.setblocking(False)
        self._waker.setblocking(False)
        self.watch(self._woken, READ, self._drop_wake_ups)

    def watch(self, source: socket.socket | int, events: int, ready: Ready) -> None:
        """Call `ready(mask)` whenever the source is ready for any of `events`; 0 stops watching."""
        known = self._known(source)
        if not events:
            if known is not None:
                self._selector.unregister(source)
        elif known is None:
            self._selector.register(source, events, ready)
        elif known.events != events:
            self._selector.modify(source, events, ready)

    def deadline(self, call: Call) -> Deadline:
        return Deadline(self, call)

    def post(self, call: Call) -> None:
        """Make a call on the reactor's thread, after this round; safe from any thread and from signal handlers."""
        self._posted.append(call)
        if not self._asleep:
            return  # `run` looks for calls once more after it has set the flag
        # A full pipe of wake-ups wakes just as well; a closed one belongs to a reactor that has ended.
        with contextlib.suppress(BlockingIOError, OSError):
            self._waker.send(b"\0")

    def wake_on_signals(self) -> None:
        """Let every signal end the wait, also one that comes on the way into it, whose handler would wait with us; on
        the main thread."""
        signal.set_wakeup_fd(self._waker.fileno(), warn_on_full_buffer=False)

    def run(self) -> None:
        """Serve until `stop`; all that is called must let no exception escape."""
        self._looked = time.monotonic()
        while not self._stopped:
            self._asleep = True
            ready = self._events()
            self._asleep = False
            for key, mask in ready:
                key.data(mask)
            while self._posted:
                self._posted.popleft()()
            now = time.monotonic()
            while self._heap and self._heap[0][0] <= now:
                queued, _, deadline = heapq.heappop(self._heap)
                deadline._come_up(queued, now)
            self.after_round()

    def _events(self) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready, when something is; nothing, when a call or a deadline has ended the rest before its time."""
        if rest := self.rest():
            ends, pause = self._looked + rest, self._pause()
            left = max(0.0, ends - time.monotonic())
            if select.select([self._woken], [], [], left if pause is None else min(left, pause))[0]:
                self._drop_wake_ups(READ)
            if time.monotonic() < ends:
                return []
        ready = self._selector.select(self._pause())
        self._looked = time.monotonic()
        return ready

    def stop(self) -> None:
        self._stopped = True

    def close(self) -> None:
        self._selector.close()
        self._woken.close()
        self._waker.close()

    def _pause(self) -> float | None:
        if self._posted or self._stopped:
            return 0.0
        return max(0.0, self._heap[0][0] - time.monotonic()) if self._heap else None

    def _push(self, at: float, deadline: Deadline) -> None:
        heapq.heappush(self._heap, (at, next(self._order), deadline))

    def _known(self, source: socket.socket | int) -> Any:
        try:
            return self._selector.get_key(source)
        except KeyError:
            return None

    def _drop_wake_ups(self, _mask: int) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._woken.recv(4096):
                pass


def _nothing() -> None:
    pass


def _without_rest() -> float:
    return 0.0
