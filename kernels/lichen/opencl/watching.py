"""Long work that can be ended: whoever waits for it is asked every so often whether it shall go on.

A kernel that has been launched runs to its end. Where nobody may want it any more meanwhile, its work-items are
launched in parts, each of which takes about `EVERY` seconds, and is waited for; between two of them the watch is asked.
Kernels know their items by global numbers alone, and groups share nothing, so parts make the same bytes as the whole.

A part that does not begin at zero makes PoCL compile a kernel once more, and waiting costs what launching ahead
saves. So only steps are watched that take long by prediction.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

EVERY = 0.025
"""Seconds of a part, about."""
FIRST = 64
"""Parts of a whole, as long as it is not known how long they take."""

Launch = Callable[[tuple[int, ...], tuple[int, ...] | None], None]
"""Launches work-items, so many, from an offset on (None: from the beginning), and waits for them."""


class Watch:
    """Asks `look` before each part; what it raises ends the work there."""

    def __init__(self, look: Callable[[], None]) -> None:
        self._look = look
        self._pace: dict[str, float] = {}
        """seconds that a work-group of a kernel took last"""

    def run(self, kernel: str, grid: tuple[int, ...], group: tuple[int, ...], launch: Launch) -> None:
        """Launch a grid of whole work-groups, part after part along the axis that has most of them."""
        axis = max(range(len(grid)), key=lambda at: grid[at] // group[at])
        count, done = grid[axis] // group[axis], 0
        while done < count:
            self._look()
            pace = self._pace.get(kernel)
            part = min(count - done, max(1, count // FIRST if pace is None else int(EVERY / pace)))
            began = time.perf_counter()
            offset = _along((0,) * len(grid), axis, done * group[axis]) if done else None
            launch(_along(grid, axis, part * group[axis]), offset)
            self._pace[kernel] = max(time.perf_counter() - began, 1e-9) / part
            done += part


def _along(values: tuple[int, ...], axis: int, value: int) -> tuple[int, ...]:
    return (*values[:axis], value, *values[axis + 1 :])


_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)


def watch() -> Watch | None:
    """Who is to be asked in this thread, if anybody."""
    return _watch.get()


@contextmanager
def watched(look: Callable[[], None]) -> Iterator[None]:
    """Kernels that this thread launches meanwhile go on as long as `look`, which is asked often, raises nothing."""
    token = _watch.set(Watch(look))
    try:
        yield
    finally:
        _watch.reset(token)
