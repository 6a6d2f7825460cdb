"""Who does the items: processes here, a service at a URL, or the workers of a Dask cluster.

All three take an item and promise an outcome. They differ in where the work is done and in nothing else: the requests
are the same, so are the bytes.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from secrets import token_hex
from typing import Protocol

from lichen_batch.hands import Limits, LocalEngine
from lichen_batch.item import Item, Outcome
from lichen_batch.keeping import Keeper
from lichen_batch.work import perform

AT_ONCE = 2
"""Requests to a service for each processor, where nobody says how many: one is computed while another is on its way."""


class Engine(Protocol):
    """Does items, several at a time."""

    name: str

    @property
    def capacity(self) -> int:
        """How many items it should hold at a time: those at work, and as many as keep it from waiting for more."""

    def submit(self, item: Item) -> Future[Outcome]:
        """The outcome, once there is one. Cancelling works until the item is begun."""

    def end(self) -> None:
        """Ends it; what is still at work is broken off."""


class UrlEngine:
    """Items done by a service; this process only reads, sends and writes."""

    def __init__(self, url: str, count: int, limits: Limits) -> None:
        from lichen_client import Client

        self.capacity = 3 * count  # one being kept, one at work, and one for when that is begun
        self.name = f"{url}, {count} at a time"
        seconds = 3600.0 if limits.seconds is None else limits.seconds
        self._client = Client(url, timeout=seconds, connections=count)
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="request")
        self._keeper, self._token = Keeper(count), token_hex(8)

    def submit(self, item: Item) -> Future[Outcome]:
        promised: Future[Outcome] = Future()
        self._pool.submit(self._do, item, promised)
        return promised

    def _do(self, item: Item, promised: Future[Outcome]) -> None:
        if not promised.set_running_or_notify_cancel():
            return
        try:
            outcome = perform(self._client, item, self._token)
        except BaseException as wrong:  # somebody waits for an answer
            promised.set_exception(wrong)
        else:
            self._keeper.keep(item, outcome, self._token, promised)

    def end(self) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._client.close()
        self._keeper.end()


def choose(engine: str, url: str | None, workers: int, limits: Limits) -> Engine:
    """The engine of these names: `local`, `dask` or `dask://HOST:PORT`, or the service at `url`. Raises ValueError."""
    if url is not None:
        return UrlEngine(url, workers, limits)
    if engine == "local":
        return LocalEngine(workers, limits)
    if engine == "dask" or engine.startswith("dask://"):
        from lichen_batch.cluster import DaskEngine

        return DaskEngine(engine.removeprefix("dask").removeprefix("://"), workers, limits)
    raise ValueError(f"{engine!r} is no engine; there are: local, dask, dask://HOST:PORT")
