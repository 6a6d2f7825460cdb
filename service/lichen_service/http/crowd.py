"""How many connections each worker holds, in memory that all of them share.

Workers share a listener, and the system wakes all of them for a new connection. Left to that, the few connections of a
busy client are often all taken by one worker, which then computes alone. So a worker that holds more than another lets
that one go first, for a moment.
"""

from __future__ import annotations

import mmap
import os
from dataclasses import dataclass

_NUMBER = 4
"""bytes"""


@dataclass(frozen=True, slots=True)
class Crowd:
    """The numbers of all, one more than their connections; 0 where nobody takes any. `place` is one's own."""

    numbers: memoryview
    place: int

    @classmethod
    def at(cls, descriptor: int, place: int) -> Crowd:
        """In the memory of a file that `shared` made."""
        return cls(memoryview(mmap.mmap(descriptor, 0)).cast("i"), place)

    def tell(self, connections: int) -> None:
        """That this one holds so many, and takes more."""
        self.numbers[self.place] = 1 + connections

    def leave(self) -> None:
        self.numbers[self.place] = 0

    def ahead(self) -> bool:
        """Whether this one holds more than another who takes connections, by more than one of each eight."""
        own = self.numbers[self.place]
        least = min((each for each in self.numbers if each), default=own)
        return own > least + least // 8


def shared(places: int) -> int:
    """A file of memory for so many numbers, as a descriptor."""
    descriptor = os.memfd_create("lichen-crowd")
    os.ftruncate(descriptor, places * _NUMBER)
    return descriptor
