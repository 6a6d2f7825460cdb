"""How many processors this process may use, and how wide their vectors are. Needs no OpenCL runtime.

A CPU device starts one thread per processor it sees, but a container may be given less time than that, or be pinned to
a few of them. The scheduler's affinity mask and the control groups' quota say what is really there.
"""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

LIMIT = "LICHEN_PROCESSORS"
"""Environment variable: how many of them this process may use, set where several processes share them."""
_CGROUPS = Path("/sys/fs/cgroup")
_In = TypeVar("_In")
_Out = TypeVar("_Out")


def processors() -> int:
    """Processors this process may keep busy: the affinity mask, lowered to the control group's quota. At least 1."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = _quota(int(time.monotonic()))
    return max(1, available if quota is None else min(available, math.ceil(quota)))


@lru_cache(1)
def _quota(second: int) -> float | None:
    """Read once in each second of the clock: it takes 0.27 ms, and predictions ask for it by the dozen."""
    return cgroup_quota()


def threads() -> int:
    """Threads that kernels and codecs of this process run on: one for each processor that is left to it."""
    said = os.environ.get(LIMIT, "")
    return min(processors(), max(int(said), 1)) if said.isdigit() else processors()


def each(function: Callable[[_In], _Out], items: Iterable[_In]) -> list[_Out]:
    """`[function(item) for item in items]` on all its processors; functions release the interpreter while they work."""
    todo = list(items)
    if len(todo) < 2 or threads() < 2:
        return [function(item) for item in todo]
    with ThreadPoolExecutor(min(threads(), len(todo))) as pool:
        return list(pool.map(function, todo))


def cgroup_quota(root: Path = _CGROUPS, membership: Path = Path("/proc/self/cgroup")) -> float | None:
    """The smallest processor quota over this process's control groups and their parents; None where none is set.

    Both versions are read: `cpu.max` ("50000 100000" is half a processor) and `cpu.cfs_quota_us`.
    """
    try:
        lines = membership.read_text().splitlines()
    except OSError:
        return None
    quotas = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        base = root / controllers if controllers else root
        folder = base / path.lstrip("/")
        for candidate in (folder, *folder.parents):
            if candidate != base and base not in candidate.parents:
                break
            quota = _quota_of(candidate)
            if quota is not None:
                quotas.append(quota)
    return min(quotas, default=None)


def _quota_of(folder: Path) -> float | None:
    try:
        limit, period = (folder / "cpu.max").read_text().split()
    except (OSError, ValueError):
        try:
            limit = (folder / "cpu.cfs_quota_us").read_text().strip()
            period = (folder / "cpu.cfs_period_us").read_text().strip()
        except OSError:
            return None
    if limit in ("max", "-1"):
        return None
    return int(limit) / int(period)


def vector_width() -> int:
    """How many float32 values one vector register of this processor holds: 16, 8 or 4."""
    try:
        flags = Path("/proc/cpuinfo").read_text()
    except OSError:
        flags = ""
    if platform.machine().lower() in ("x86_64", "amd64"):
        return 16 if " avx512f" in flags else 8 if " avx" in flags else 4
    return 4
