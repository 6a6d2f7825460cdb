"""Outputs made to last while the next items are computed.

To force a file to the disk takes as long as many a picture takes to be blurred, and no processor. So who computes lays
its outputs beside their places, and threads elsewhere wait for the disk and put them there; only then is the outcome
told. Killed in between, the item is done once more.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

from lichen_batch import places
from lichen_batch.item import Item, Outcome, failure
from lichen_batch.work import unwritable


class Keeper:
    """Threads that wait for the disk."""

    def __init__(self, count: int) -> None:
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="keeper")

    def keep(self, item: Item, outcome: Outcome, token: str, promised: Future[Outcome]) -> None:
        """Promises the outcome of an item whose outputs were laid under `token`: they are in their places then."""
        self._pool.submit(_keep, item, outcome, token, promised)

    def end(self) -> None:
        """Leaves what it has not begun where it lies."""
        self._pool.shutdown(cancel_futures=True)


def _keep(item: Item, outcome: Outcome, token: str, promised: Future[Outcome]) -> None:
    try:
        kept = _kept(item, outcome, token)
    except BaseException as wrong:  # somebody waits for an answer
        promised.set_exception(wrong)
    else:
        promised.set_result(kept)


def _kept(item: Item, outcome: Outcome, token: str) -> Outcome:
    outputs = item.outputs.values()
    if not outcome.ok:
        places.drop(outputs, token)
        return outcome
    try:
        places.keep(outputs, token)
    except OSError as wrong:
        places.drop(outputs, token)
        return failure(item, unwritable(", ".join(outputs), wrong), outcome.seconds, outcome.peak_bytes)
    return outcome
