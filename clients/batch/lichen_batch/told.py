"""How many of a picture's tiles are written, told from the threads that write them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from lichen.memory import Array


class Told:
    """Counts tiles as they are written, and tells of it."""

    def __init__(self, count: int, tell: Callable[[int, int], None]) -> None:
        self.count = count
        self._done, self._tell, self._lock = 0, tell, threading.Lock()
        tell(0, self.count)

    def one(self) -> None:
        with self._lock:
            self._done += 1
            self._tell(self._done, self.count)

    def all(self) -> None:
        with self._lock:
            if self._done < self.count:
                self._done = self.count
                self._tell(self._done, self.count)

    def each(self, rows: Iterator[Array]) -> Iterator[Array]:
        """The rows, each of which is written when the next is asked for."""
        for row in rows:
            yield row
            self.one()

    def writing(self, array: Any) -> Any:
        """The array, for what writes into it."""
        return _Writing(array, self)


@dataclass(frozen=True, eq=False)
class _Writing:
    array: Any
    told: Told

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self.array.shape)

    def __setitem__(self, at: Any, tile: Array) -> None:
        self.array[at] = tile
        self.told.one()
