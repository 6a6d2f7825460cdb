"""Of a method the number that trades accuracy for time, and how fast it is.

Operations declare both (`lichen.operation`); calibration measures the second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Knob:
    """A number that trades accuracy for time, swept over `values`, cheapest first; errors go with its power `order`."""

    name: str
    values: tuple[float, ...]
    description: str
    low: float
    high: float
    order: float | None = None
    rising: bool = True
    """whether no value takes less work than one before it"""


@dataclass(frozen=True, slots=True)
class Rate:
    """Predicted seconds of a method on one backend: `start` + `step` x work."""

    start: float
    step: float
    kinds: Mapping[str, Rate] = field(default_factory=dict)
    """those of requests of one kind, where they are known apart (`lichen.kind`)"""

    def of(self, kind: str) -> Rate:
        """That of requests of one kind."""
        return self.kinds.get(kind, self) if self.kinds else self

    def seconds(self, work: float, kind: str = "") -> float:
        known = self.of(kind)
        return known.start + known.step * work
