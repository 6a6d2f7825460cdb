"""What is measured of an operation beside its errors: numbers, sentences that tell them, and curves.

An operation declares how to measure it (`Operation.study`); `lichen calibrate --errors` does so and keeps what came of
it beside the error table, and reports show it: as JSON, in words, and as a chart with logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Curve = tuple[tuple[float, float], ...]
"""Points, both coordinates above 0."""


@dataclass(frozen=True, slots=True)
class Study:
    sentences: tuple[str, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)
    """JSON values by name"""
    across: str = ""
    """what the curves go along, with its unit"""
    up: str = ""
    curves: Mapping[str, Curve] = field(default_factory=dict)
    """by name"""

    def to_json(self) -> dict[str, Any]:
        return {
            "sentences": list(self.sentences),
            "numbers": dict(self.numbers),
            "across": self.across,
            "up": self.up,
            "curves": {name: [list(point) for point in curve] for name, curve in self.curves.items()},
        }

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Study:
        curves = {name: tuple((float(x), float(y)) for x, y in curve) for name, curve in values["curves"].items()}
        return cls(tuple(values["sentences"]), values["numbers"], values["across"], values["up"], curves)


def brief(value: float) -> float:
    """Three digits: what is kept, and what another processor's roundings do not change."""
    return float(f"{value:.3g}")
