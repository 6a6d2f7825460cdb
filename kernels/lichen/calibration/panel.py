"""A study as part of a plot: its sentences, and its curves in a frame with two logarithmic axes."""

from __future__ import annotations

from collections.abc import Iterator

from lichen.calibration.chart import Labels, spanning, wrapped
from lichen.calibration.drawing import HUES, Area, Dot, Line, Shape, Text
from lichen.calibration.report import scientific
from lichen.study import Study

HEIGHT = 220.0
"""of the frame"""


def panel(study: Study, left: float, right: float, top: float) -> tuple[list[Shape], float]:
    """The shapes, from `top` down, and where they end. `left` and `right` are those of the frame."""
    shapes: list[Shape] = []
    y = top
    for sentence in study.sentences:
        for line in wrapped(sentence, right - left + 46, 13):
            y += 18
            shapes.append(Text(left - 46, y, line, "ink", 13))
    if not study.curves:
        return shapes, y
    return [*shapes, *_chart(study, left, right, y + 18)], y + 18 + HEIGHT + 44


def _chart(study: Study, left: float, right: float, top: float) -> Iterator[Shape]:
    bottom = top + HEIGHT
    points = [point for curve in study.curves.values() for point in curve]
    x = spanning((x for x, _ in points), left + 14, right - 14, least=1.0, margin=0.05)
    y = spanning((y for _, y in points), bottom - 8, top + 10, least=1.0, margin=0.08)
    yield Area([(left, top), (right, top), (right, bottom), (left, bottom)], "panel")
    for value in x.ticks((1, 2, 5)):
        yield Line([(x(value), top), (x(value), bottom)], "grid", 0.5)
        yield Text(x(value), bottom + 17, scientific(value, 1), "muted", 12, "middle")
    for value in y.ticks():
        yield Line([(left, y(value)), (right, y(value))], "grid")
        yield Text(left - 8, y(value) + 4, scientific(value, 1), "muted", 12, "end")
    yield Text((left + right) / 2, bottom + 36, f"{study.across}; up: {study.up}", "muted", 12, "middle")
    labels = Labels((left, top, right, bottom), ())
    for number, (name, curve) in enumerate(study.curves.items()):
        hue = HUES[number % len(HUES)]
        shown = [(x(a), y(b)) for a, b in curve]
        yield Line(shown, hue, 1.8)
        for (across, up), (a, b) in zip(shown, curve, strict=True):
            yield Dot(across, up, hue, 2.6, title=f"{name}: {scientific(b)} at {scientific(a)}")
        highest = min(shown, key=lambda point: point[1])
        places = [highest, min(shown), max(shown)]
        for place in places[::-1] if number % 2 else places:  # lines that run beside each other
            if labels.put(*place, name, role=hue, size=13, bold=True):
                break
    yield from labels.placed
