"""The loop of a batch: keeps an engine busy, writes down what became of each item, and knows when to stop.

No more items are handed out than the engine asks for, so memory does not grow with the manifest. Told to end, it begins
nothing more and waits for what was begun, within a time; told twice, it waits for nothing. Whatever was not written
down is done by the next run.
"""

from __future__ import annotations

import queue
import signal
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
    waiting = deque(_Try(item, earlier) for item, earlier in todo)
    flying: dict[Future[Outcome], _Try] = {}
    landed: queue.SimpleQueue[Future[Outcome]] = queue.SimpleQueue()
    failed = failed_before
    until: float | None = None
    while (waiting and not stop) or flying:
        if stop and until is None:
            until = time.monotonic() + rules.grace
            for future in list(flying):
                if future.cancel():
                    waiting.append(flying.pop(future))
        if stop and (stop.at_once or (until is not None and time.monotonic() > until)):
            break
        while waiting and not stop and len(flying) < engine.capacity:
            each = waiting.popleft()
            each.tries += 1
            future = engine.submit(each.item)
            flying[future] = each
            future.add_done_callback(landed.put)
        try:
            done = landed.get(timeout=LOOK)
        except queue.Empty:
            continue
        if done not in flying:  # cancelled
            continue
        each = flying.pop(done)
        outcome = _outcome(done, each.item)
        again = outcome.problem is not None and outcome.problem.retryable and each.tries < rules.attempts
        if again and not stop:
            waiting.append(each)
            continue
        journal.add(outcome, each.earlier + each.tries)
        tell(outcome)
        failed += not outcome.ok
        if rules.max_failure_rate is not None and failed > rules.max_failure_rate * total:
            stop.failing = True
    return len(waiting) + len(flying)


def _outcome(done: Future[Outcome], item: Item) -> Outcome:
    wrong = done.exception()
    if wrong is None:
        return done.result()
    return failure(item, Problem("defect", f"{type(wrong).__name__}: {wrong}"))
