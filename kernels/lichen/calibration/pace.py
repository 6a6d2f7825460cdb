"""How fast the machine is just now: what a small task takes that is always the same.

A virtual machine's clock and neighbours change its speed for seconds on end, by up to 1.75 times where this was
written. What is measured at different times is made comparable by the task, which takes turns with it: times count as
they would be at the machine's usual pace. One run of the task tells little, since it scatters as everything does; the
median of the last few does.

On NumPy the task is arithmetic within the nearest caches, on a device a kernel of multiply-adds on all of its units.
"""

from __future__ import annotations

import statistics
import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from lichen.accuracy import times
from lichen.memory import aligned_empty
from lichen.opencl.device import default_device

RECENT = 9
"""Runs of the task whose median is the pace of now."""
FIRST = 25
"""Runs of the task before anything is measured."""
REMEMBERED = 1024
"""Runs whose median is the usual pace."""
KNOWN = 512
"""As many runs counts what an earlier calibration of this machine found."""
VALUES = 1 << 15
REPEATS = 8
ITEMS, STEPS = 64, 1024


def lower_quartile(seconds: Sequence[float]) -> float:
    """What counts of several runs.

    >>> lower_quartile([3.0, 1.0, 2.0])
    1.5
    """
    return float(np.quantile(seconds, 0.25))


class Pace:
    """Of one backend. Not safe to use from several threads at once."""

    def __init__(self, task: Callable[[], None], known: float | None = None) -> None:
        self._task = task
        self._taken: deque[float] = deque([] if known is None else [known] * KNOWN, maxlen=REMEMBERED)
        self._task()
        for _ in range(FIRST):
            self._beat()

    def paced(self, run: Callable[[], float]) -> float:
        """The seconds that `run` returns, as they would be at the usual pace."""
        seconds = run()
        self._beat()
        return seconds * self.usual / statistics.median([self._taken[-1 - n] for n in range(RECENT)])

    @property
    def usual(self) -> float:
        """Seconds of the task."""
        return statistics.median(self._taken)

    def _beat(self) -> None:
        began = time.perf_counter()
        self._task()
        self._taken.append(time.perf_counter() - began)


@cache
def pace(backend: str) -> Pace:
    """That of a backend on this machine, begun when it is first asked for."""
    device = default_device() if backend == "opencl" else None
    known = times.pace(backend)
    if device is None:
        given, made = np.ones(VALUES, np.float32), np.empty(VALUES, np.float32)

        def arithmetic() -> None:
            for _ in range(REPEATS):
                np.multiply(given, np.float32(0.5), out=made)
                np.add(given, made, out=made)

        return Pace(arithmetic, known)
    found = aligned_empty((ITEMS * device.compute_units, 8))

    def kernel() -> None:
        with device.session() as session:
            numbers = np.int32(len(found)), np.int32(STEPS)
            session.launch("pace.cl", "pace", (len(found),), session.write(found), *numbers, local=(1,))

    return Pace(kernel, known)
