"""Timing that survives a noisy machine: all contestants in one process, in turn, medians.

Absolute times on a shared machine drift by a factor of two within a minute; ratios of runs that stand next to each
other do not. Every row carries the errors of both sides against truth, since time without error says nothing.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One comparison. Times in milliseconds; errors are the largest absolute difference from truth."""

    work: str
    ours: str
    ours_ms: float
    ours_error: float
    peer: str
    peer_ms: float
    peer_error: float
    wanted: float | None = None
    """the ratio aimed at"""

    @property
    def ratio(self) -> float:
        return self.ours_ms / self.peer_ms


def medians(contestants: Sequence[Callable[[], object]], rounds: int = 9) -> list[float]:
    """Median milliseconds of each, run in turn `rounds` times after one warm-up each."""
    for contestant in contestants:
        contestant()
    times: list[list[float]] = [[] for _ in contestants]
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for contestant, kept in zip(contestants, times, strict=True):
                started = time.perf_counter()
                contestant()
                kept.append(time.perf_counter() - started)
    finally:
        gc.enable()
    return [statistics.median(kept) * 1e3 for kept in times]


def table(title: str, rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [
        f"### {title}",
        "",
        "| work | ours | ms | error | peer | ms | error | ours / peer | aim |",
        "|---|---|---:|---:|---|---:|---:|---:|---:|",
    ]
    for row in rows:
        aim = "" if row.wanted is None else f"<= {row.wanted:g}"
        lines.append(
            f"| {row.work} | {row.ours} | {row.ours_ms:.2f} | {row.ours_error:.1e} | {row.peer} | {row.peer_ms:.2f} "
            f"| {row.peer_error:.1e} | {row.ratio:.3f} | {aim} |"
        )
    return "\n".join(lines) + "\n"
