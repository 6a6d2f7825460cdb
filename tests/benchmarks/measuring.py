"""Timing that survives a noisy machine: all contestants in one process, in turn, with a reference copy between them.

Absolute times on a shared machine drift by a factor of two within a minute; ratios of runs that stand next to each
other do not. A copy of known length is timed before and after every run: where either took far longer than copies
usually do here, somebody else had the machine, and the run is dropped and counted. Medians and quartiles are of the
runs that are left.

The roofline: no program is faster than the bytes that it must read and write at the bandwidth of a copy, or than its
floating point operations at the peak of fused multiply-adds. Both are measured here, with as many threads as the runs.
"""

from __future__ import annotations

import gc
import math
import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lichen.memory import aligned_empty
from lichen.opencl.device import default_device
from lichen.opencl.programs import compose

if TYPE_CHECKING:
    import pyopencl as cl

Run = Callable[[], object]
QUICK = "LICHEN_BENCH_QUICK"
"""Set: everything is small and runs once or twice, to try the suite; its figures are worth nothing."""
SLOW = 1.5
"""Times the usual copy; what ran beside a slower one is dropped."""
USUAL = 0.25
"""The quantile of all copies so far that is usual."""
LEAST = 3
"""Samples that make a figure. Where fewer are left, all count, and the figure is called unsteady."""
COPIED = 1 << 23
"""Floats of the reference copy: 32 MiB read and 32 MiB written, more than a cache holds."""
LARGE = 1 << 26
"""Floats of the copy that bandwidth is taken from: 256 MiB each way, beyond every cache."""
CHAINS, STEPS = 12, 16384
"""Independent sums of 8 floats each: enough to hide the latency of a multiply-add, and few enough for 16 registers."""


@dataclass(frozen=True, slots=True)
class Figure:
    """Of one contestant, seconds."""

    median: float
    low: float
    """lower quartile"""
    high: float
    """upper quartile"""
    kept: int
    dropped: int
    """samples that were taken while somebody else had the machine"""
    steady: bool = True
    pace: float = 1.0
    """how many times as long as the quickest copy those beside the kept samples took"""

    def to_json(self) -> dict[str, float | int | bool]:
        return {
            "ms": self.median * 1e3,
            "low_ms": self.low * 1e3,
            "high_ms": self.high * 1e3,
            "kept": self.kept,
            "dropped": self.dropped,
            "steady": self.steady,
        }


class Copies:
    """The reference copy, on all threads, and what it usually takes."""

    def __init__(self, threads: int, floats: int = COPIED) -> None:
        source, target = np.ones(floats, np.float32), np.empty(floats, np.float32)
        self._bands = list(zip(np.array_split(source, threads), np.array_split(target, threads), strict=True))
        self._pool = ThreadPoolExecutor(threads)
        self.bytes = 2 * source.nbytes
        self.taken: list[float] = []
        for _ in range(12):
            self()

    def __call__(self) -> float:
        began = time.perf_counter()
        list(self._pool.map(lambda band: np.copyto(band[1], band[0]), self._bands))
        self.taken.append(time.perf_counter() - began)
        return self.taken[-1]

    @property
    def usual(self) -> float:
        return float(np.quantile(self.taken, USUAL))


@dataclass(frozen=True)
class Turns:
    """Runs contestants in turn, the reference copy between them."""

    copies: Copies
    rounds: int = 5
    """samples wanted of each"""
    longest: float = 2.5
    """seconds after which no further round begins"""
    warm: bool = True
    """whether each runs once before"""
    least: int = LEAST
    """rounds that are run however long they take"""

    def __call__(self, contestants: Mapping[str, Run]) -> dict[str, Figure]:
        if self.warm:
            for run in contestants.values():
                run()
        samples: dict[str, list[Sample]] = {name: [] for name in contestants}
        wanted, longest = (1, 0.0) if quick() else (self.rounds, self.longest)
        until, copies = time.perf_counter() + longest, self.copies
        gc.collect()
        gc.disable()
        try:
            before, rounds = copies(), 0
            while rounds < wanted or (rounds < 2 * wanted and self._short(samples, wanted)):
                for name, run in contestants.items():
                    began = time.perf_counter()
                    run()
                    took = time.perf_counter() - began
                    after = copies()
                    samples[name].append(Sample(took, before, after))
                    before = after
                rounds += 1
                if time.perf_counter() > until and rounds >= self.least:
                    break
        finally:
            gc.enable()
        best = min(copies.taken)
        return {name: figure(each, SLOW * copies.usual, best) for name, each in samples.items()}

    def _short(self, samples: Mapping[str, Sequence[Sample]], wanted: int) -> bool:
        """Whether so many were dropped that further rounds are due."""
        limit = SLOW * self.copies.usual
        return any(sum(each.beside <= limit for each in taken) < wanted for taken in samples.values())


@dataclass(frozen=True, slots=True)
class Sample:
    seconds: float
    before: float
    """seconds of the copy before it"""
    after: float
    """seconds of the copy after it"""

    @property
    def beside(self) -> float:
        return max(self.before, self.after)


def figure(samples: Sequence[Sample], limit: float, best: float) -> Figure:
    """Of the samples that stand beside copies within `limit`; `best` is what the quickest copy took.

    >>> samples = [Sample(1.0, 0.1, 0.1), Sample(2.0, 0.1, 0.1), Sample(3.0, 0.1, 0.1), Sample(9.0, 0.1, 0.5)]
    >>> found = figure(samples, 0.2, 0.05)
    >>> found.median, found.dropped, found.pace
    (2.0, 1, 2.0)
    """
    good = [each for each in samples if each.beside <= limit]
    steady = len(good) >= LEAST
    kept = good if steady else samples
    taken = [each.seconds for each in kept]
    low, middle, high = (float(np.quantile(taken, share)) for share in (0.25, 0.5, 0.75))
    pace = statistics.median((each.before + each.after) / 2 for each in kept) / best
    return Figure(middle, low, high, len(taken), len(samples) - len(good), steady, pace)


# ------------------------------------------------------------------------------------------------------------- limits


@dataclass(frozen=True)
class Limits:
    """What this machine can do with so many threads."""

    threads: int
    bandwidth: float
    """bytes a second that a copy reads and writes"""
    peak: float
    """floating point operations a second, a fused multiply-add counting as two"""

    def seconds(self, moved: float, flops: float = 0.0) -> float:
        """The least time for so many bytes and operations."""
        return max(moved / self.bandwidth, flops / self.peak if self.peak else 0.0)


def limits(threads: int) -> Limits:
    """Measured now, the best of several runs: what else happens on a machine only ever takes away."""
    large = Copies(threads, COPIED if quick() else LARGE)
    return Limits(threads, large.bytes / min(large.taken), _peak(threads))


def _fma() -> str:
    """A kernel that does nothing but multiply-adds."""
    names = [f"s{k}" for k in range(CHAINS)]
    return f"""
__kernel void fma_peak(__global float *out, const float a, const float b)
{{
    const size_t i = get_global_id(0);
    float8 {", ".join(f"{name} = (float8)(i + {k}.0f)" for k, name in enumerate(names))};
    const float8 x = (float8)(a), y = (float8)(b);
    for (int n = 0; n < {STEPS}; ++n) {{
        {" ".join(f"{name} = fma({name}, x, y);" for name in names)}
    }}
    vstore8({" + ".join(names)}, i, out);
}}
"""


def _peak(threads: int) -> float:
    """Of the OpenCL device; NaN where there is none."""
    device, name = default_device(), compose(_fma())
    if device is None or name is None:
        return math.nan
    items, best = 64 * threads, math.inf
    out = aligned_empty((items, 8))
    for _ in range(8):
        began = time.perf_counter()
        with device.session() as session:
            arguments = (session.write(out), np.float32(0.999), np.float32(1e-3))
            session.launch(name, "fma_peak", (items,), *arguments, local=(1,))
        best = min(best, time.perf_counter() - began)
    return items * CHAINS * STEPS * 8 * 2 / best


# ------------------------------------------------------------------------------------------------------------- growth


@dataclass(frozen=True, slots=True)
class Growth:
    """How time grows: seconds ~ x ** exponent, fitted to logarithms."""

    exponent: float
    points: int


def growth(points: Sequence[tuple[float, float]], start: float = 0.0) -> Growth:
    """Of (x, seconds) from `start` on; what it costs to begin hides how smaller ones grow.

    >>> round(growth([(1, 2.0), (2, 8.0), (4, 32.0)]).exponent, 6)
    2.0
    """
    used = [(math.log(x), math.log(y)) for x, y in points if x >= start and x > 0 and y > 0]
    if len(used) < 2:
        return Growth(math.nan, len(used))
    return Growth(statistics.linear_regression(*zip(*used, strict=True)).slope, len(used))


def quick() -> bool:
    """Whether the suite is only tried."""
    return bool(os.environ.get(QUICK))


def available() -> list[int]:
    """The processors this process may use."""
    return sorted(os.sched_getaffinity(0))


class Noted:
    """A run that notes which share of its time its kernels take, as the device tells it: meanwhile sessions are given
    queues that note it. Only what is of one call can be compared: kernels of runs that stand behind each other find
    pictures in a cache that copies between them empty, and the machine may have slowed down since."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._calls: list[tuple[float, list[cl.Event]]] = []

    def __call__(self) -> object:
        import pyopencl as cl

        queue, launch = cl.CommandQueue, cl.enqueue_nd_range_kernel
        noting = cl.command_queue_properties.PROFILING_ENABLE
        launched: list[cl.Event] = []
        cl.CommandQueue = lambda context, device: queue(context, device, properties=noting)
        cl.enqueue_nd_range_kernel = lambda *given: launched.append(launch(*given))
        began = time.perf_counter()
        try:
            return self._run()
        finally:
            self._calls.append((time.perf_counter() - began, launched))
            cl.CommandQueue, cl.enqueue_nd_range_kernel = queue, launch

    @property
    def share(self) -> float:
        """The median of all calls."""
        return statistics.median(
            1e-9 * sum(each.profile.end - each.profile.start for each in launched) / seconds
            for seconds, launched in self._calls
        )
