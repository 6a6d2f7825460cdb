"""How fast the machine is just now: what small tasks take that are always the same.

A virtual machine's clock and neighbours change its speed for seconds on end, by up to 1.75 times where this was
written. What is measured at different times is made comparable by the tasks, which take turns with it: times count as
they would be at the machine's usual pace. One run of a task tells little, since it scatters as everything does; the
median of the last few does.

Not all that a machine does becomes slower alike, so there is a task for each: arithmetic within the nearest caches,
copying of memory, and on a device a kernel of multiply-adds on all of its units. The geometric mean of their speeds
counts. Of 65 requests that were timed in three processes within a minute, 86 of 100 pairs of times lay within a factor
of 1.25 of each other then, and 98 within 1.5; by the kernel alone it was 71 and 95, without any 58 and 79.
"""

from __future__ import annotations

import math
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
"""Runs of a task whose median is the pace of now."""
FIRST = 25
"""Runs of a task before anything is measured."""
REMEMBERED = 1024
"""Runs whose median is the usual pace."""
KNOWN = 512
"""As many runs counts what an earlier calibration of this machine found."""
VALUES = 1 << 15
REPEATS = 8
COPIED = 1 << 19
"""Floats: 2 MiB read and 2 MiB written."""
ITEMS, STEPS = 64, 1024

Task = Callable[[], object]


def lower_quartile(seconds: Sequence[float]) -> float:
    """What counts of several runs.

    >>> lower_quartile([3.0, 1.0, 2.0])
    1.5
    """
    return float(np.quantile(seconds, 0.25))


class Pace:
    """Of one backend. Not safe to use from several threads at once."""

    def __init__(self, tasks: Sequence[Task], known: Sequence[float] = ()) -> None:
        self._tasks = tasks
        self._taken: list[deque[float]] = [deque(maxlen=REMEMBERED) for _ in tasks]
        if len(known) == len(tasks):
            for taken, seconds in zip(self._taken, known, strict=True):
                taken.extend([seconds] * KNOWN)
        for task in tasks:
            task()
        for _ in range(FIRST):
            self._beat()

    def paced(self, run: Callable[[], float]) -> float:
        """The seconds that `run` returns, as they would be at the usual pace."""
        seconds = run()
        self._beat()
        now = [statistics.median([taken[-1 - n] for n in range(RECENT)]) for taken in self._taken]
        return seconds * math.pow(math.prod(self.usual) / math.prod(now), 1 / len(now))

    @property
    def usual(self) -> list[float]:
        """Seconds of each task."""
        return [float(np.median(taken)) for taken in self._taken]

    def _beat(self) -> None:
        for task, taken in zip(self._tasks, self._taken, strict=True):
            began = time.perf_counter()
            task()
            taken.append(time.perf_counter() - began)


@cache
def pace(backend: str) -> Pace:
    """That of a backend on this machine, begun when it is first asked for."""
    tasks = [_arithmetic(), _copying()]
    return Pace(tasks if backend == "numpy" else [*tasks, _kernel()], times.pace(backend))


def _arithmetic() -> Task:
    given, made = np.ones(VALUES, np.float32), np.empty(VALUES, np.float32)

    def run() -> None:
        for _ in range(REPEATS):
            np.multiply(given, np.float32(0.5), out=made)
            np.add(given, made, out=made)

    return run


def _copying() -> Task:
    given, made = aligned_empty((COPIED,)), aligned_empty((COPIED,))
    given[:] = 1
    return lambda: np.copyto(made, given)


def _kernel() -> Task:
    device = default_device()
    assert device is not None, "whoever measures a device has one"
    found = aligned_empty((ITEMS * device.compute_units, 8))

    def run() -> None:
        with device.session() as session:
            numbers = np.int32(len(found)), np.int32(STEPS)
            session.launch("pace.cl", "pace", (len(found),), session.write(found), *numbers, local=(1,))

    return run
