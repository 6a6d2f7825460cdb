"""A study as part of a plot: its sentences, and a frame with logarithmic axes for each of its charts.

Charts that show the same stand side by side under one key. Curves that belong together have one hue, that of their
method in the plot, and every second of them is dashed. Values of 0 lie at the lower edge."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from lichen.calibration.chart import Box, Scale, Signed, apart, spanning, wrapped
from lichen.calibration.drawing import HUES, Area, Dot, Line, Shape, Text
from lichen.calibration.words import capital, scientific
from lichen.study import Chart, Study

HEIGHT = 220.0
"""of a frame"""
GAP = 60.0
"""between frames, for the numbers of the right one"""
MOST_TICKS = 12
MOST_MARKS = 24
"""Points of a curve that are marked."""
DASH = (5.0, 3.0)


def panel(
    study: Study, left: float, right: float, top: float, methods: Sequence[str] = ()
) -> tuple[list[Shape], float]:
    """The shapes, from `top` down, and where they end. `left` and `right` are those of the frames, all px; `methods`
    are those of the plot in the order of their hues."""
    shapes: list[Shape] = []
    y = top
    for sentence in study.sentences:
        for line in wrapped(sentence, right - left + 46, 13):
            y += 18
            shapes.append(Text(left - 46, y, line, "ink", 13))
    charts = [chart for chart in study.charts if any(value for curve in chart.curves.values() for value in curve)]
    for up, beside in groupby(charts, key=lambda chart: chart.up):
        row = list(beside)
        styles = _styles(row, methods)
        shapes.append(Text(left - 46, y + 30, capital(up), "ink", 13, bold=True))
        key, y = _key(styles, left, right, y + 48)
        shapes += key
        wide = sum(len(chart.places) for chart in row)
        start = left
        for chart in row:
            end = start + (right - left - GAP * (len(row) - 1)) * len(chart.places) / wide
            shapes += _chart(chart, styles, (start, y + 10, end, y + 10 + HEIGHT))
            start = end + GAP
        y += 10 + HEIGHT + 40
    return shapes, y


Style = tuple[str, tuple[float, float] | None]
"""A hue and a dash."""


def _styles(charts: Sequence[Chart], methods: Sequence[str]) -> dict[str, Style]:
    """By the name of a curve."""
    names = list(dict.fromkeys(name for chart in charts for name in chart.curves))
    groups = list(dict.fromkeys([*methods, *map(_group, names)]))
    found: dict[str, Style] = {}
    for number, name in enumerate(names):
        before = [_group(each) for each in names[:number]].count(_group(name))
        found[name] = HUES[groups.index(_group(name)) % len(HUES)], DASH if before % 2 else None
    return found


def _group(name: str) -> str:
    return name.partition(",")[0]


def _key(styles: Mapping[str, Style], left: float, right: float, y: float) -> tuple[list[Shape], float]:
    """What the curves are, in lines from the base line `y` down, and the last of these."""
    shapes: list[Shape] = []
    at = left - 46
    for name, (hue, dash) in styles.items():
        text = Text(at + 30, y, name, hue, 13, bold=True)
        if text.box[2] > right and at > left - 46:
            at, y = left - 46, y + 18
            text = Text(at + 30, y, name, hue, 13, bold=True)
        shapes += [Line([(at, y - 4), (at + 24, y - 4)], hue, 1.8, dash), text]
        at = text.box[2] + 16
    return shapes, y


def _chart(chart: Chart, styles: Mapping[str, Style], frame: Box) -> Iterator[Shape]:
    left, top, right, bottom = frame
    values = [value for curve in chart.curves.values() for value in curve if value is not None]
    x: Scale | Signed = spanning(chart.places, left + 14, right - 14, least=1.0, margin=0.05)
    if signed := min(chart.places) <= 0:
        unit = min(abs(each) for each in chart.places if each)
        x = Signed(min(chart.places), max(chart.places), unit, left + 14, right - 14)
    y = spanning(values, bottom - 12, top + 14, least=1.0, margin=0.08)
    yield Area([(left, top), (right, top), (right, bottom), (left, bottom)], "panel")
    ticks = x.ticks((1, 2, 5))
    for value in ticks:
        strong = signed and value in (0, 1)  # what a display shows lies between
        yield Line([(x(value), top), (x(value), bottom)], "front" if strong else "grid", 1.5 if strong else 0.5)
    foremost = sorted(ticks, key=lambda value: (value not in (0, 1), abs(math.log10(abs(value) or 1))))
    yield from apart(Text(x(value), bottom + 17, scientific(value), "muted", 12, "middle") for value in foremost)
    step = math.ceil(y.decades / MOST_TICKS)
    for value in y.ticks((1, 2, 5) if y.decades < 2 else (1,))[::step]:
        yield Line([(left, y(value)), (right, y(value))], "grid")
        yield Text(left - 8, y(value) + 4, scientific(value), "muted", 12, "end")
    yield Text((left + right) / 2, bottom + 36, chart.across, "muted", 12, "middle")
    for name, curve in chart.curves.items():
        hue, dash = styles[name]
        known = [(at, value) for at, value in zip(chart.places, curve, strict=True) if value is not None]
        points = [(x(at), y(value) if value else bottom - 2) for at, value in known]
        yield Line(points, hue, 1.8, dash)
        if len(known) <= MOST_MARKS:
            for point, (at, value) in zip(points, known, strict=True):
                yield Dot(*point, hue, 2.6, title=f"{name}: {scientific(value)} at {scientific(at)}")
