"""Processes that do items, each within a time and a memory of its own.

A codec or a kernel that hangs cannot be stopped from within its process, and one that takes all memory takes its
neighbours along. So items are done by processes that are watched from here: one that takes too long or holds too
much is killed, its item has failed, and another process takes its place. Whatever else ends a process (a signal, the
system's own killer) costs the item that it was doing, which is worth another try. Outcomes are those of outputs that
are laid, not yet kept (see `keeping`).
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import select
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Set
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex

from lichen.accuracy.times import Known
from lichen.processors import LIMIT
from lichen_batch.item import Item, Outcome, Problem, failure
from lichen_batch.keeping import Keeper

STARTING = 300.0
"""Seconds a process has to be ready: on a machine that never ran one, kernels are compiled meanwhile."""
LOOK = 0.02
"""Seconds between looks at the memory of a process at work."""
SHORT = 1.0
"""Seconds: behind an item that took less, the next is handed to the same process before it is asked for."""
_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True, slots=True)
class Limits:
    """What one item may take, and by which times its methods are chosen."""

    seconds: float | None = None
    memory: int | None = None
    """bytes that the process doing it may hold"""
    threads: int = 1
    """that kernels and codecs run on"""
    times: Known | None = None
    """None: those that the process doing it knows"""


class Ended(Exception):
    """A process ended before it answered; the text says how."""


class Hand:
    """One process. Belongs to one thread at a time."""

    def __init__(self, limits: Limits, without: Set[str] = frozenset()) -> None:
        """`without` are variables of our environment that are not to be the process's."""
        self._limits, self._without = limits, without
        self._process: subprocess.Popen[bytes] | None = None
        self._said = bytearray()
        self._errors: Path | None = None
        self._warm = False
        """whether it has said that it is ready"""
        self._given = 0
        """items it was handed and has not answered"""
        self._before = float("inf")
        """seconds that the last item took"""
        self._closed = False
        self.token = token_hex(8)
        """under which it lays outputs"""
        self._lock = threading.RLock()
        self.used = time.monotonic()
        """when it was last at work"""

    def do(self, item: Item) -> Outcome:
        """The outcome of an item, whatever becomes of the process."""
        return next(self.each(item, lambda: None))[1]

    def each(self, first: Item, more: Callable[[], Item | None]) -> Iterator[tuple[Item, Outcome]]:
        """The outcomes of an item and of all that `more` gives, one after the other, until it gives None."""
        todo = deque([first])
        while todo:
            if self._before < SHORT and len(todo) < 2 and (following := more()) is not None:
                todo.append(following)
            began = time.monotonic()
            outcome = self._first(todo)
            self._before = time.monotonic() - began
            yield todo.popleft(), outcome
            if not todo and (following := more()) is not None:
                todo.append(following)

    def _first(self, todo: deque[Item]) -> Outcome:
        """The outcome of the first of these items, all of which the process is given."""
        began = time.monotonic()
        try:
            process = self._ready()
            began = time.monotonic()
            assert process.stdin is not None
            while self._given < len(todo):
                process.stdin.write(json.dumps(todo[self._given].to_json(), separators=(",", ":")).encode() + b"\n")
                self._given += 1
            process.stdin.flush()
            outcome = Outcome.from_line(self._line(self._limits.seconds, self._limits.memory))
            self._given -= 1
            return outcome
        except TimeoutError:
            self.end()
            problem = Problem("too-slow", f"It took longer than {self._limits.seconds:g} s.")
        except MemoryError as held:
            self.end()
            problem = Problem("out-of-memory", str(held))
        except (Ended, OSError) as died:
            how = self._how(died)
            self.end()
            problem = Problem("died", f"The process that did it ended: {how}", retryable=True)
        return failure(todo[0], problem, {"ask": round(time.monotonic() - began, 6)})

    def start(self) -> None:
        """Begins to start the process, which takes seconds."""
        with self._lock:
            if not self._closed and (self._process is None or self._process.poll() is not None):
                self._start()

    def _start(self) -> None:
        self.end()
        handle, name = tempfile.mkstemp(prefix="lichen-hand-", suffix=".log")
        self._errors = Path(name)
        threads = str(self._limits.threads)
        # Not those of BLAS: its products are rounded by their number, which must be that of every other process.
        names = (LIMIT, "OPENCV_FOR_THREADS_NUM")
        environment = {**dict.fromkeys(names, threads), "MALLOC_ARENA_MAX": "2", **os.environ}
        environment = {name: value for name, value in environment.items() if name not in self._without}
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "lichen_batch.hand"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=handle,
                env=environment,
                start_new_session=True,  # a Ctrl-C in the terminal is ours to answer
            )
        finally:
            os.close(handle)
        self._said.clear()
        assert self._process.stdin is not None
        told = {"memory": self._limits.memory, "times": self._limits.times, "token": self.token}
        self._process.stdin.write(json.dumps(told).encode() + b"\n")
        self._process.stdin.flush()

    def _ready(self) -> subprocess.Popen[bytes]:
        fresh = self._process is None or self._process.poll() is not None
        if fresh:
            self.start()
        if self._process is None:
            raise Ended("nothing more is done")
        if fresh or not self._warm:
            try:
                self._line(STARTING, None)
            except TimeoutError:
                raise Ended(f"it was not ready within {STARTING:g} s") from None
            self._warm = True
        return self._process

    def end(self) -> None:
        """Kills the process; the next item starts another."""
        self._warm, self._given = False, 0
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):
                        pipe.close()
            self._process = None
        if self._errors is not None:
            self._errors.unlink(missing_ok=True)
            self._errors = None

    def close(self) -> None:
        """Kills the process for good. From any thread."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()

    def _line(self, seconds: float | None, memory: int | None) -> bytes:
        """The next line it says. Raises `TimeoutError`, `MemoryError` or `Ended`."""
        process = self._process
        assert process is not None
        assert process.stdout is not None
        descriptor = process.stdout.fileno()
        deadline = None if seconds is None else time.monotonic() + seconds
        while b"\n" not in self._said:
            left = None if deadline is None else deadline - time.monotonic()
            if left is not None and left <= 0:
                raise TimeoutError
            pause = min(LOOK if memory is not None else 1.0, left if left is not None else 1.0)
            if select.select([descriptor], [], [], pause)[0]:
                piece = os.read(descriptor, 1 << 16)
                if not piece:
                    raise Ended("")
                self._said += piece
            elif memory is not None and (held := _resident(process.pid)) > memory:
                raise MemoryError(f"Its process held {held} bytes, {memory} are allowed.")
        line, _, rest = bytes(self._said).partition(b"\n")
        self._said[:] = rest
        return line

    def _how(self, died: Exception) -> str:
        """How the process ended, and the last that it said."""
        if self._process is None:
            return str(died)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        status = self._process.returncode
        how = str(died) if status is None else f"signal {-status}" if status < 0 else f"status {status}"
        said = self._errors.read_text(errors="replace").strip().splitlines() if self._errors is not None else []
        return f"{how}; {said[-1][:300]}" if said else how


def _resident(process: int) -> int:
    """Bytes of memory a process holds; 0 where it is gone."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * _PAGE
    except (OSError, IndexError, ValueError):
        return 0


class Hands:
    """Several of them, each used by one item at a time."""

    def __init__(self, count: int, limits: Limits, without: Set[str] = frozenset()) -> None:
        self._all = [Hand(limits, without) for _ in range(count)]
        self._free: queue.SimpleQueue[Hand] = queue.SimpleQueue()
        self._started = False
        self._lock = threading.Lock()
        for each in self._all:
            self._free.put(each)

    def start(self) -> None:
        """Starts all processes at once, and waits for none."""
        with self._lock:
            started, self._started = self._started, True
        if not started:
            for each in self._all:
                each.start()

    @contextlib.contextmanager
    def one(self) -> Iterator[Hand]:
        hand = self._free.get()
        try:
            yield hand
        finally:
            hand.used = time.monotonic()
            self._free.put(hand)

    def rest(self, seconds: float) -> None:
        """Ends the processes of those that have done nothing for so long."""
        for _ in self._all:
            with contextlib.suppress(queue.Empty):
                hand = self._free.get_nowait()
                if time.monotonic() - hand.used > seconds:
                    hand.end()
                self._free.put(hand)

    def close(self) -> None:
        """Kills all processes: whoever waits for one gets an answer, and none is started any more."""
        for each in self._all:
            each.close()

    def end(self) -> None:
        """Clears away what is left when nobody uses them."""
        self.close()
        for each in self._all:
            each.end()


class LocalEngine:
    """Items done by processes of this machine."""

    def __init__(self, count: int, limits: Limits) -> None:
        self.capacity = 4 * count  # one being kept, one at work, one behind it, and one for when that is begun
        self.name = f"{count} process{'es' if count > 1 else ''} here"
        self._hands = Hands(count, limits)
        self._hands.start()
        self._keeper = Keeper(count)
        self._todo: queue.SimpleQueue[tuple[Item, Future[Outcome]] | None] = queue.SimpleQueue()
        self._threads = [threading.Thread(target=self._work, name=f"hand-{at}", daemon=True) for at in range(count)]
        for each in self._threads:
            each.start()

    def submit(self, item: Item) -> Future[Outcome]:
        promised: Future[Outcome] = Future()
        self._todo.put((item, promised))
        return promised

    def _work(self) -> None:
        """Has one process do what there is to do, until there will be no more."""
        begun: deque[Future[Outcome]] = deque()

        def taken(wait: bool = False) -> Item | None:
            while True:
                try:
                    each = self._todo.get(block=wait)
                except queue.Empty:
                    return None
                if each is None:
                    self._todo.put(None)  # for the other threads
                    return None
                if each[1].set_running_or_notify_cancel():
                    begun.append(each[1])
                    return each[0]

        with self._hands.one() as hand:
            while (item := taken(wait=True)) is not None:
                try:
                    for done, outcome in hand.each(item, taken):
                        self._keeper.keep(done, outcome, hand.token, begun.popleft())
                except Exception as wrong:  # somebody waits for an answer
                    hand.end()
                    while begun:
                        begun.popleft().set_exception(wrong)

    def end(self) -> None:
        """Kills what is still at work."""
        with contextlib.suppress(queue.Empty):
            while (each := self._todo.get_nowait()) is not None:
                each[1].cancel()
        self._todo.put(None)
        self._hands.close()
        for thread in self._threads:
            thread.join()
        self._keeper.end()
        self._hands.end()
