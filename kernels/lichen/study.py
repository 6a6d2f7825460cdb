"""What is measured of an operation beside its errors: numbers, sentences that tell them, and charts.

An operation declares how to measure it (`Operation.study`), and pointwise ones are studied by the value of what they
read (`lichen.calibration.by_value`). `lichen calibrate --errors` does so and keeps what came of it beside the error
table, and reports show it: as JSON, in words, and as charts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Curve = tuple[float | None, ...]
"""A value, 0 or above, for each place along a chart; None where there is none."""


@dataclass(frozen=True, slots=True)
class Chart:
    """Curves over one logarithmic axis; one that reaches below 0 is logarithmic on both sides of it."""

    across: str
    """what the curves go along, with its unit"""
    up: str
    """what their values are, with its unit: charts that agree in it stand side by side"""
    places: tuple[float, ...]
    """where the curves have values, ascending or descending"""
    curves: Mapping[str, Curve]
    """by name: those that agree up to a comma belong together"""

    def to_json(self) -> dict[str, Any]:
        """JSON values, which `parse` takes."""
        curves = {name: list(curve) for name, curve in self.curves.items()}
        return {"across": self.across, "up": self.up, "places": list(self.places), "curves": curves}

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Chart:
        """Of JSON values. Raises KeyError where one is missing."""
        curves = {name: tuple(curve) for name, curve in values["curves"].items()}
        return cls(values["across"], values["up"], tuple(values["places"]), curves)


@dataclass(frozen=True, slots=True)
class Study:
    """What was found, in words, numbers and pictures."""

    sentences: tuple[str, ...]
    """what a reader should know, each complete"""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    """JSON values by name"""
    charts: tuple[Chart, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """JSON values, which `parse` takes."""
        charts = [chart.to_json() for chart in self.charts]
        return {"sentences": list(self.sentences), "numbers": dict(self.numbers), "charts": charts}

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Study:
        """Of JSON values. Raises KeyError where one is missing."""
        return cls(tuple(values["sentences"]), values["numbers"], tuple(map(Chart.parse, values["charts"])))


def brief(value: float) -> float:
    """Three digits: what is kept, and what another processor's roundings do not change."""
    return float(f"{value:.3g}")
