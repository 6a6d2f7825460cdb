"""What a part of the suite finds, as JSON: its numbers, and enough words to make a page of them without measuring
again.

A part is a list of sections, each a mapping with a `kind`: `comparison` (ours beside peers), `table`, `lines` (a plot
with two logarithmic axes) or `bars` (stacked). Numbers are kept as they were measured; how they are rounded and drawn
is the page's affair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Section = dict[str, Any]
Point = tuple[float, float]


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]], text: str = "") -> Section:
    """Rows of text and numbers."""
    return {
        "kind": "table",
        "title": title,
        "text": text,
        "columns": list(columns),
        "rows": [list(each) for each in rows],
    }


def lines(
    name: str, title: str, across: str, up: str, series: Mapping[str, Sequence[Point]], text: str = "", **further: Any
) -> Section:
    """Curves over two logarithmic axes; `across` and `up` name them, with units. `name` is that of the plot's file."""
    return {
        "kind": "lines", "name": name, "title": title, "text": text, "across": across, "up": up,
        "series": {label: [list(point) for point in points] for label, points in series.items()}, **further,
    }  # fmt: skip


def bars(
    name: str, title: str, unit: str, stages: Sequence[str], rows: Mapping[str, Mapping[str, float]], text: str = ""
) -> Section:
    """Stacked bars, a row each; stages a row lacks are 0."""
    return {
        "kind": "bars", "name": name, "title": title, "text": text, "unit": unit, "stages": list(stages),
        "rows": {label: dict(each) for label, each in rows.items()},
    }  # fmt: skip


def comparison(title: str, runs: Sequence[Mapping[str, Any]], text: str = "") -> Section:
    """Ours beside peers; each of `runs` has `threads`, `limits` and `rows` (see `comparing`)."""
    return {"kind": "comparison", "title": title, "text": text, "runs": [dict(each) for each in runs]}
