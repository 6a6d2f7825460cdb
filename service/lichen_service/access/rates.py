"""How often one caller may ask: a leaky bucket by the generic cell rate algorithm, shared by all worker processes.

Theory. For each caller one number is kept, the time at which its bucket will be empty. A request moves it on by
`1 / rate`; it is refused if that would lie more than `burst / rate` ahead of now. Nothing has to be counted down, and
a caller that has gone costs nothing.

The numbers lie in a table of fixed size in memory that the processes share, at a place found by a hash of the caller.
Where two callers fall on the same place, a number in the past gives way, and one in the future is shared: then both
are held to one rate together, which errs towards safety. Two processes that write at the same instant may let
one request too many pass; no number is ever torn, since each is one aligned word.
"""

from __future__ import annotations

import hashlib
import math
import mmap
import time
from dataclasses import dataclass
from pathlib import Path

SLOTS = 1 << 16
_SIZE = SLOTS * 16


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a request is within its rate; how many more would be; seconds until one is again, and until all are."""

    allowed: bool
    remaining: int
    retry_after: float
    reset: float


class Rates:
    def __init__(self, path: Path | None = None) -> None:
        """`path` names a file that all processes map; None keeps the table to this process."""
        if path is None:
            memory = mmap.mmap(-1, _SIZE)
        else:
            with path.open("a+b") as file:
                file.truncate(_SIZE)
                memory = mmap.mmap(file.fileno(), _SIZE)
        self._owners = memoryview(memory)[: SLOTS * 8].cast("Q")
        self._empty_at = memoryview(memory)[SLOTS * 8 :].cast("d")

    def ask(self, caller: str, rate: float, burst: int, now: float | None = None) -> Verdict:
        """Counts one request of a caller at `rate` a second. Times are those of `time.monotonic()`."""
        now = time.monotonic() if now is None else now
        owner = int.from_bytes(hashlib.blake2b(caller.encode(), digest_size=8).digest(), "little")
        slot = owner % SLOTS
        empty_at = max(self._empty_at[slot], now)
        if self._owners[slot] != owner and empty_at <= now:
            self._owners[slot] = owner
        step, capacity = 1 / rate, burst / rate
        after = empty_at + step
        if after - now > capacity * (1 + 1e-9):
            return Verdict(False, 0, after - now - capacity, empty_at - now)
        self._empty_at[slot] = after
        return Verdict(True, math.floor((capacity - (after - now)) / step + 1e-6), 0.0, after - now)
