"""A study as part of a plot: its sentences, and a frame with logarithmic axes for each of its charts.

Curves that belong together have one hue, and every second of them is dashed. Values of 0 lie at the lower edge."""

from __future__ import annotations

import math
from collections.abc import Iterator

from lichen.calibration.chart import Labels, Scale, Signed, spanning, wrapped
from lichen.calibration.drawing import HUES, Area, Dot, Line, Shape, Text
from lichen.calibration.report import scientific, short
from lichen.study import Chart, Study

HEIGHT = 220.0
"""of a frame"""
MOST_TICKS = 12
MOST_MARKS = 30
"""Points of a curve that are marked."""


def panel(study: Study, left: float, right: float, top: float) -> tuple[list[Shape], float]:
    """The shapes, from `top` down, and where they end. `left` and `right` are those of the frame."""
    shapes: list[Shape] = []
    y = top
    for sentence in study.sentences:
        for line in wrapped(sentence, right - left + 46, 13):
            y += 18
            shapes.append(Text(left - 46, y, line, "ink", 13))
    for chart in study.charts:
        if any(value for curve in chart.curves.values() for value in curve):
            shapes += _chart(chart, left, right, y + 18)
            y += 18 + HEIGHT + 44
    return shapes, y


def _chart(chart: Chart, left: float, right: float, top: float) -> Iterator[Shape]:
    bottom = top + HEIGHT
    values = [value for curve in chart.curves.values() for value in curve if value is not None]
    x: Scale | Signed = spanning(chart.places, left + 14, right - 14, least=1.0, margin=0.05)
    if signed := min(chart.places) <= 0:
        unit = min(abs(each) for each in chart.places if each)
        x = Signed(min(chart.places), max(chart.places), unit, left + 14, right - 14)
    y = spanning(values, bottom - 12, top + 14, least=1.0, margin=0.08)
    yield Area([(left, top), (right, top), (right, bottom), (left, bottom)], "panel")
    for value in x.ticks((1, 2, 5)):
        strong = signed and value in (0, 1)  # what a display shows lies between
        yield Line([(x(value), top), (x(value), bottom)], "front" if strong else "grid", 1.5 if strong else 0.5)
        yield Text(x(value), bottom + 17, short(value), "muted", 12, "middle")
    apart = math.ceil(y.decades / MOST_TICKS)
    for value in y.ticks((1, 2, 5) if y.decades < 2 else (1,))[::apart]:
        yield Line([(left, y(value)), (right, y(value))], "grid")
        yield Text(left - 8, y(value) + 4, scientific(value, 1), "muted", 12, "end")
    yield Text((left + right) / 2, bottom + 36, f"{chart.across}; up: {chart.up}", "muted", 12, "middle")
    labels = Labels((left, top, right, bottom), ())
    groups = list(dict.fromkeys(_group(name) for name in chart.curves))
    for number, (name, curve) in enumerate(chart.curves.items()):
        hue = HUES[groups.index(_group(name)) % len(HUES)]
        before = [_group(each) for each in list(chart.curves)[:number]].count(_group(name))
        found = [(at, value) for at, value in zip(chart.places, curve, strict=True) if value is not None]
        shown = [(x(at), y(value) if value else bottom - 2) for at, value in found]
        yield Line(shown, hue, 1.8, (5.0, 3.0) if before % 2 else None)
        for (across, up), (at, value) in zip(shown, found, strict=True):
            if len(found) <= MOST_MARKS:
                yield Dot(across, up, hue, 2.6, title=f"{name}: {scientific(value)} at {scientific(at)}")
        highest = min(shown, key=lambda point: point[1])
        places = [highest, min(shown), max(shown), shown[len(shown) // 2], shown[len(shown) // 3]]
        for place in places[::-1] if number % 2 else places:  # lines that run beside each other
            if labels.put(*place, name, role=hue, size=13, bold=True):
                break
    yield from labels.placed


def _group(name: str) -> str:
    return name.partition(",")[0]
