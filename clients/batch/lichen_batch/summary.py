"""What a batch came to: counts, rates, why items failed, and how times and errors are distributed."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lichen_batch.item import Outcome

QUANTILES = (0.5, 0.9, 0.99)
SLOWEST = 5


@dataclass
class Account:
    """Gathers outcomes as they come."""

    total: int
    """items of this run's share"""
    done_before: int = 0
    failed_before: int = 0
    began: float = field(default_factory=time.monotonic)
    ok: int = 0
    failed: int = 0
    permanent: int = 0
    """failures of this run that no further try would help"""
    bytes_written: int = 0
    codes: Counter[str] = field(default_factory=Counter)
    methods: Counter[str] = field(default_factory=Counter)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    errors: list[float] = field(default_factory=list)
    measured: list[float] = field(default_factory=list)
    slowest: list[tuple[float, str]] = field(default_factory=list)
    peak_bytes: int = 0

    def add(self, outcome: Outcome) -> None:
        self.peak_bytes = max(self.peak_bytes, outcome.peak_bytes)
        if outcome.problem is not None:
            self.failed += 1
            self.permanent += not outcome.problem.retryable
            self.codes[outcome.problem.code] += 1
            return
        self.ok += 1
        self.methods[outcome.method] += bool(outcome.method)
        self.bytes_written += sum(int(each["bytes"]) for each in outcome.outputs.values())
        for stage, taken in outcome.seconds.items():
            self.seconds.setdefault(stage, []).append(taken)
        self.seconds.setdefault("item", []).append(outcome.whole)
        self.slowest = sorted([*self.slowest, (outcome.whole, outcome.id)], reverse=True)[:SLOWEST]
        if outcome.error is not None:
            self.errors.append(outcome.error)
        if outcome.measured is not None:
            self.measured.append(outcome.measured)

    def to_json(self, left: int, stopped: str | None, **further: Any) -> dict[str, Any]:
        """The summary; `left` items were not done, because of `stopped`."""
        elapsed = time.monotonic() - self.began
        return {
            **further,
            "items": self.total,
            "ok": self.ok,
            "failed": self.failed,
            "done_before": self.done_before,
            "failed_before": self.failed_before,
            "left": left,
            "stopped": stopped,
            "seconds": round(elapsed, 3),
            "items_per_second": round((self.ok + self.failed) / elapsed, 3) if elapsed > 0 else 0.0,
            "bytes_written": self.bytes_written,
            "peak_bytes": self.peak_bytes,
            "problems": dict(self.codes.most_common()),
            "methods": {name: count for name, count in self.methods.most_common() if count},
            "stage_seconds": {stage: distribution(values) for stage, values in self.seconds.items()},
            "stated_errors": distribution(self.errors),
            "measured_errors": distribution(self.measured),
            "slowest": [{"id": id, "seconds": round(taken, 6)} for taken, id in self.slowest],
        }


def distribution(values: Sequence[float]) -> dict[str, float] | None:
    """Count, mean, quantiles and the largest; None of nothing."""
    if not values:
        return None
    order = sorted(values)
    at: Mapping[str, float] = {f"p{q * 100:g}": order[min(int(q * len(order)), len(order) - 1)] for q in QUANTILES}
    return {"count": len(order), "mean": sum(order) / len(order), **at, "max": order[-1]}
