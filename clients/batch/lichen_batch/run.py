"""The loop of a batch: keeps an engine busy, writes down what became of each item, and knows when to stop.

No more items are handed out than the engine asks for, so memory does not grow with the manifest. Told to end, it begins
nothing more and waits for what was begun, within a time; told twice, it waits for nothing. Whatever was not written
down is done by the next run.
"""

from __future__ import annotations

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from lichen_batch.engines import Engine
from lichen_batch.item import Item, Outcome, Problem, failure
from lichen_batch.journal import Journal

LOOK = 0.2
"""Seconds between looks at whether to stop."""


@dataclass(frozen=True, slots=True)
class Rules:
    """How patient a batch is."""

    attempts: int = 2
    """of one item within this run, where another may help"""
    max_failure_rate: float | None = None
    """of all items; more failures end the run early"""
    grace: float = 30.0
    """seconds that items have to end when the run is told to"""


@dataclass
class Stop:
    """Whether, why and how soon the loop shall end."""

    signal: int | None = None
    at_once: bool = False
    failing: bool = False

    def __bool__(self) -> bool:
        return self.signal is not None or self.failing

    @contextmanager
    def listening(self) -> Iterator[None]:
        """SIGINT and SIGTERM end the loop while the body runs."""

        def told(number: int, _frame: FrameType | None) -> None:
            self.at_once = self.signal is not None
            self.signal = number

        before = {number: signal.signal(number, told) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


@dataclass(slots=True)
class _Try:
    item: Item
    earlier: int
    """tries of earlier runs"""
    tries: int = 0


def run(
    todo: Sequence[tuple[Item, int]],
    total: int,
    engine: Engine,
    journal: Journal,
    rules: Rules,
    stop: Stop,
    tell: Callable[[Outcome], None],
    failed_before: int = 0,
) -> int:
    """Does the items, each with the number of tries before; returns how many were left undone.

    `total` is how many items the batch has in all, `failed_before` how many of the others count as failures.
    """
    tries = deque(_Try(item, earlier) for item, earlier in todo)
    return _Loop(tries, total, engine, journal, rules, stop, tell, failed_before).run()


@dataclass(eq=False)
class _Loop:
    """Outcomes are written down, and further items handed out, by whichever thread brings an outcome: to wake another
    one for it would take the processors from items. One thread at a time does so, and also what others bring then."""

    waiting: deque[_Try]
    total: int
    engine: Engine
    journal: Journal
    rules: Rules
    stop: Stop
    tell: Callable[[Outcome], None]
    failed: int

    def __post_init__(self) -> None:
        self._flying: dict[Future[Outcome], _Try] = {}
        self._landed: deque[Future[Outcome]] = deque()
        self._turns = threading.Lock()
        """held by the thread whose turn it is"""
        self._over = False
        self._look = threading.Event()
        """that there is something for the loop to see"""
        self._wrong: BaseException | None = None

    def run(self) -> int:
        until: float | None = None
        self._turn()
        try:
            while self._going():
                if self.stop and until is None:
                    until = time.monotonic() + self.rules.grace
                    self._withdraw()
                if self.stop and (self.stop.at_once or (until is not None and time.monotonic() > until)):
                    break
                self._look.wait(LOOK)
                self._look.clear()
        finally:
            with self._turns:
                self._over = True
        if self._wrong is not None:
            raise self._wrong
        return len(self.waiting) + len(self._flying)

    def _going(self) -> bool:
        with self._turns:
            return self._wrong is None and bool(self._flying or (self.waiting and not self.stop))

    def _turn(self) -> None:
        """Sees to all that has landed, and to what shall fly, unless another thread does: it will look again."""
        while self._turns.acquire(blocking=False):
            try:
                if self._over or self._wrong is not None:
                    return
                while self._landed:
                    self._settle(self._landed.popleft())
                self._hand_out()
            except BaseException as wrong:  # for the thread that waits for the end
                self._wrong = wrong
            finally:
                self._turns.release()
            if not self._flying or self.stop or self._wrong is not None:
                self._look.set()
            if not self._landed:
                return

    def _hand_out(self) -> None:
        while self.waiting and not self.stop and len(self._flying) < self.engine.capacity:
            each = self.waiting.popleft()
            each.tries += 1
            future = self.engine.submit(each.item)
            self._flying[future] = each
            future.add_done_callback(self._land)

    def _land(self, done: Future[Outcome]) -> None:
        self._landed.append(done)
        self._turn()

    def _withdraw(self) -> None:
        """Takes back what was not begun."""
        with self._turns:
            for future in list(self._flying):
                if future.cancel():
                    self.waiting.append(self._flying.pop(future))
        self._turn()

    def _settle(self, done: Future[Outcome]) -> None:
        if done not in self._flying:  # withdrawn
            return
        each = self._flying.pop(done)
        outcome = _outcome(done, each.item)
        again = outcome.problem is not None and outcome.problem.retryable and each.tries < self.rules.attempts
        if again and not self.stop:
            self.waiting.append(each)
            return
        self.journal.add(outcome, each.earlier + each.tries)
        self.tell(outcome)
        self.failed += not outcome.ok
        if self.rules.max_failure_rate is not None and self.failed > self.rules.max_failure_rate * self.total:
            self.stop.failing = True


def _outcome(done: Future[Outcome], item: Item) -> Outcome:
    wrong = done.exception()
    if wrong is None:
        return done.result()
    return failure(item, Problem("defect", f"{type(wrong).__name__}: {wrong}"))
