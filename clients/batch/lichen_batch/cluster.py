"""Items on the workers of a Dask cluster: one that is there, or one of this machine's processes.

Every worker holds as many processes that do items (see `hands`) as it has threads, warm from the moment it joins; so an
item has its limits there too, and one that ends its process does not end the worker. A worker that dies costs the items
it was doing, which the scheduler gives to others; outputs are written whole or not at all, so an item that was done
twice was done once. No more items are handed out than keep all workers busy, and what comes back is an account:
pixels go straight to where they are stored.

The scheduler and its workers need this package installed, in the same version.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

import dask
from distributed import Client, LocalCluster, WorkerPlugin, get_worker
from distributed.scheduler import KilledWorker

from lichen_batch.checking import VERSION
from lichen_batch.hands import Hands, Limits
from lichen_batch.item import Item, Outcome, Problem, failure

NAME = "lichen-hands"
AHEAD = 2
"""Items for each thread of the cluster: the one at work, and one that waits for it."""
WAITING = 60.0
"""Seconds until a cluster without a worker is given up."""


class Workbench(WorkerPlugin):
    """Lives on every worker: the processes that do its items."""

    name = NAME

    def __init__(self, limits: Limits, version: str) -> None:
        self._limits = limits
        self._version = version
        self.hands: Hands | None = None

    def setup(self, worker: Any) -> None:
        if self._version != VERSION:
            raise RuntimeError(f"the worker has version {VERSION} of the engine, the batch {self._version}")
        self.hands = Hands(worker.state.nthreads, self._limits, given_by_dask())
        self.hands.start()

    def teardown(self, worker: Any) -> None:
        if self.hands is not None:
            self.hands.end()


def given_by_dask() -> set[str]:
    """Variables that Dask gave its worker, and that those who do items shall not have: other threads of BLAS round
    otherwise than in every other process, and memory that is given back at once is paid for anew by every picture."""
    given = dask.config.get("distributed.nanny.pre-spawn-environ", {})
    return {name for name, value in given.items() if os.environ.get(name) == str(value)}


def do(said: Mapping[str, Any]) -> dict[str, Any]:
    """One item, on a worker."""
    bench = get_worker().plugins[NAME]
    assert isinstance(bench, Workbench)
    assert bench.hands is not None
    return bench.hands.do(Item.from_json(said)).to_json()


class DaskEngine:
    def __init__(self, address: str, workers: int, limits: Limits) -> None:
        """`address` is that of a scheduler, HOST:PORT; empty: a cluster of `workers` processes is started here.

        Raises OSError where there is no scheduler, or no worker, within a time.
        """
        self._cluster = None
        if not address:
            with dask.config.set({"distributed.worker.profile.enabled": False}):  # its workers only wait
                self._cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=":0",  # any free port: the usual one may be taken, of which Dask would warn
                    memory_limit=None,  # items have limits of their own; Dask would end workers for what others hold
                )
        self._client = Client(self._cluster or f"tcp://{address}", timeout=WAITING, set_as_default=False)
        self._client.register_plugin(Workbench(limits, VERSION))
        self._client.wait_for_workers(1, timeout=WAITING)
        self.name = f"Dask at {self._client.scheduler_info()['address']}"
        self._threads, self._looked = 1, float("-inf")

    @property
    def capacity(self) -> int:
        """Follows the cluster as workers come and go."""
        now = time.monotonic()
        if now - self._looked > 1.0:
            self._looked = now
            self._threads = max(sum(self._client.nthreads().values()), 1)
        return AHEAD * self._threads

    def submit(self, item: Item) -> Future[Outcome]:
        promised: Future[Outcome] = Future()
        promised.set_running_or_notify_cancel()
        sent = self._client.submit(do, item.to_json(), key=f"lichen-{item.digest}-{time.monotonic_ns()}", pure=False)

        def answer(done: Any) -> None:
            try:
                promised.set_result(Outcome.from_json(done.result()))
            except KilledWorker as killed:
                promised.set_result(failure(item, Problem("died", str(killed), retryable=True)))
            except BaseException as wrong:  # whatever Dask raises, somebody waits for an answer
                promised.set_result(failure(item, Problem("lost", f"{type(wrong).__name__}: {wrong}", retryable=True)))
            finally:
                done.release()

        sent.add_done_callback(answer)
        return promised

    def end(self) -> None:
        self._client.close(timeout=5)
        if self._cluster is not None:
            self._cluster.close(timeout=10)
