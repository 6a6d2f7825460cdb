"""Items on the workers of a Dask cluster: one that is there, or one of this machine's processes.

Every worker holds as many processes that do items (see `hands`) as it has threads, warm from their first item on until
nothing was done for minutes; so an item has its limits there too, and one that ends its process leaves the worker
alone. Batches of other limits or other times have processes of their own. A worker that dies costs the items it was
doing, which the scheduler gives to others; outputs are written whole or not at all, so an item that was done twice was
done once. No more items are handed out than keep all workers busy, and what comes back is an account: pixels go
straight to where they are stored.

A task of Dask costs its scheduler, its worker and its client some 15 ms together, so a task is as many items as take
about a second, by what the last ones took, and fewer towards the end, for all workers to end at once. A worker hands
back what it has not begun when a task lasts twice as long as that. Items of a task that several workers died of are
done one by one, which finds the one to blame.

The scheduler and its workers need this package installed, in the same version.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from itertools import repeat, takewhile
from secrets import token_hex
from typing import Any

import dask
from distributed import Client, LocalCluster, WorkerPlugin, get_worker, secede
from distributed.scheduler import KilledWorker

from lichen_batch.checking import VERSION
from lichen_batch.hands import Hands, Limits
from lichen_batch.item import Item, Outcome, Problem, failure
from lichen_batch.keeping import Keeper
from lichen_batch.places import absolute

AHEAD = 2
"""Tasks for each thread of the cluster: the one at work, and one that waits for it."""
LASTING = 1.0
"""Seconds that the items of a task take together."""
MOST = 100
"""Items of a task."""
SHARE = 10
"""The last tasks are of no fewer items than this share of a usual one."""
WAITING = 60.0
"""Seconds until a cluster without a worker is given up."""
RESTING = 300.0
"""Seconds without an item after which a worker's processes end; the next item starts them again."""

QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
"""Settings of a cluster of our own, whose workers only wait: what Dask would look at meanwhile, nobody sees."""


class Workbench(WorkerPlugin):
    """Lives on every worker: the processes that do its items, for all batches of these limits and times. Those who
    join late are given the benches of batches that are over, too: a process starts when it is wanted."""

    idempotent = True
    """another batch may be at work at it"""

    def __init__(self, limits: Limits, version: str) -> None:
        self.name = f"lichen-hands-{hashlib.sha256(repr((limits, version)).encode()).hexdigest()[:16]}"
        self._limits = limits
        self._version = version
        self.hands: Hands | None = None
        self.keeper: Keeper | None = None
        self._over = threading.Event()

    def setup(self, worker: Any) -> None:
        self.check()
        self.hands = Hands(worker.state.nthreads, self._limits, given_by_dask())
        self.keeper = Keeper(worker.state.nthreads)
        threading.Thread(target=self._rest, daemon=True).start()

    def check(self) -> None:
        if self._version != VERSION:
            raise RuntimeError(f"the worker has version {VERSION} of the engine, the batch {self._version}")

    def _rest(self) -> None:
        while not self._over.wait(RESTING / 4):
            assert self.hands is not None
            self.hands.rest(RESTING)

    def teardown(self, worker: Any) -> None:
        self._over.set()
        if self.hands is not None:
            self.hands.end()
        if self.keeper is not None:
            self.keeper.end()

    def __getstate__(self) -> dict[str, Any]:
        """It travels before it is set up."""
        return {"name": self.name, "_limits": self._limits, "_version": self._version, "hands": None, "keeper": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _over=threading.Event())


def given_by_dask() -> set[str]:
    """Variables that Dask gave its worker, and that those who do items shall not have: other threads of BLAS round
    otherwise than in every other process, and memory that is given back at once is paid for anew by every picture."""
    given = dask.config.get("distributed.nanny.pre-spawn-environ", {})
    return {name for name, value in given.items() if os.environ.get(name) == str(value)}


def do(name: str, said: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The first of these items, as many as are begun in time, on a worker, at the bench of this name."""
    bench = get_worker().plugins[name]
    assert isinstance(bench, Workbench)
    bench.check()
    assert bench.hands is not None
    assert bench.keeper is not None
    kept: list[Future[Outcome]] = []
    first, *others = (Item.from_json(each) for each in said)
    with bench.hands.one() as hand:
        following = _in_time(others, time.monotonic() + 2 * LASTING)
        for item, outcome in hand.each(first, lambda: next(following)):
            kept.append(Future())
            bench.keeper.keep(item, outcome, hand.token, kept[-1])
    return [each.result().to_json() for each in kept]


def _in_time(items: Sequence[Item], until: float) -> Iterator[Item | None]:
    """The items, up to that time, and then None. While the last is done the worker may begin its next task, which then
    is there when the process is free: the disk is waited for without either."""
    yield from takewhile(lambda _: time.monotonic() < until, items)
    secede()
    yield from repeat(None)


def _seen_from_elsewhere(item: Item) -> Item:
    """The item for a process in another folder."""
    inputs, outputs = ({name: absolute(place) for name, place in each.items()} for each in (item.inputs, item.outputs))
    return replace(item, inputs=inputs, outputs=outputs)


@dataclass(frozen=True, slots=True)
class _Asked:
    item: Item
    promised: Future[Outcome]
    begun: bool = False
    """whether it was in a task before, so that it cannot be cancelled"""
    alone: bool = False
    """whether it shall be a task of its own"""

    def answer(self, outcome: Outcome) -> None:
        self.promised.set_result(outcome)

    def fail(self, code: str, detail: str) -> None:
        self.answer(failure(self.item, Problem(code, detail, retryable=True)))


def _lost(asked: Sequence[_Asked], wrong: BaseException) -> None:
    for each in asked:
        each.fail("lost", f"{type(wrong).__name__}: {wrong}")


class DaskEngine:
    def __init__(self, address: str, workers: int, limits: Limits) -> None:
        """`address` is that of a scheduler, HOST:PORT; empty: a cluster of `workers` processes is started here.

        Raises OSError where there is no scheduler, or no worker, within a time.
        """
        self._cluster = None
        if not address:
            with dask.config.set(QUIET):
                self._cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=":0",  # any free port: the usual one may be taken, of which Dask would warn
                    memory_limit=None,  # items have limits of their own; Dask would end workers for what others hold
                )
        self._client = Client(self._cluster or f"tcp://{address}", timeout=WAITING, set_as_default=False)
        bench = Workbench(limits, VERSION)
        self._client.register_plugin(bench)
        self._bench = bench.name
        self._client.wait_for_workers(1, timeout=WAITING)
        self.name = f"Dask at {self._client.scheduler_info()['address']}"
        self._threads, self._looked = 1, float("-inf")
        self._todo: deque[_Asked] = deque()
        self._at_work = 0
        """tasks"""
        self._seconds = LASTING
        """that an item takes, about"""
        self._lock = threading.RLock()
        """held again by who is answered: that may hand in the next item"""

    @property
    def capacity(self) -> int:
        """Follows the cluster as workers come and go. What keeps it busy, and as much to choose the next tasks from."""
        now = time.monotonic()
        if now - self._looked > 2.0:
            self._looked = now
            self._threads = max(sum(self._client.nthreads().values()), 1)
        return 2 * AHEAD * self._threads * self._usual

    def submit(self, item: Item) -> Future[Outcome]:
        promised: Future[Outcome] = Future()
        with self._lock:
            self._todo.append(_Asked(item, promised))
            self._hand_out()
        return promised

    @property
    def _usual(self) -> int:
        """Items of a task."""
        return max(1, int(LASTING / self._seconds))

    def _hand_out(self) -> None:
        """Gives tasks to the cluster while it has too few. The lock is held."""
        while self._at_work < AHEAD * self._threads and (asked := self._next()):
            self._at_work += 1
            said = [_seen_from_elsewhere(each.item).to_json() for each in asked]
            try:
                sent = self._client.submit(do, self._bench, said, key=f"lichen-{token_hex(8)}", pure=False)
            except Exception as wrong:
                self._at_work -= 1
                _lost(asked, wrong)
            else:
                sent.add_done_callback(lambda done, asked=asked: self._answer(done, asked))

    def _next(self) -> list[_Asked]:
        """The items of a task; none where there are none."""
        usual = self._usual
        share = -(-len(self._todo) // (AHEAD * self._threads))
        asked: list[_Asked] = []
        while self._todo and len(asked) < max(min(share, usual), usual // SHARE, 1):
            if asked and (self._todo[0].alone or asked[0].alone):
                break
            each = self._todo.popleft()
            if each.begun or each.promised.set_running_or_notify_cancel():
                asked.append(replace(each, begun=True))
        return asked

    def _answer(self, done: Any, asked: list[_Asked]) -> None:
        """A task has ended, whatever came of it."""
        outcomes: list[Outcome] = []
        again: list[_Asked] = []
        try:
            outcomes = [Outcome.from_json(each) for each in done.result()]
            again = asked[len(outcomes) :]
        except KilledWorker as killed:
            if len(asked) == 1:
                asked[0].fail("died", str(killed))
            else:
                again = [replace(each, alone=True) for each in asked]
        except BaseException as wrong:  # whatever Dask raises, somebody waits for an answer
            _lost(asked, wrong)
        finally:
            done.release()
        with self._lock:
            self._at_work -= 1
            if outcomes:
                lately = sum(each.whole for each in outcomes) / len(outcomes)
                self._seconds = max(min(lately, (self._seconds + lately) / 2), LASTING / MOST)
            self._todo.extendleft(reversed(again))
            self._hand_out()
        for each, outcome in zip(asked, outcomes, strict=False):
            each.answer(outcome)

    def end(self) -> None:
        with self._lock:
            self._todo.clear()
        self._client.close(timeout=5)
        if self._cluster is not None:
            self._cluster.close(timeout=10)
