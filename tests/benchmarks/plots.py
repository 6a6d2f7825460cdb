"""Plots of what a part found: curves over two logarithmic axes, stacked bars, and how far ahead we are of each peer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lichen.calibration.chart import Scale, spanning
from lichen.calibration.drawing import HUES, Area, Dot, Drawing, Line, Shape, Text, text_width
from lichen.calibration.words import scientific

WIDTH = 920
LEFT, RIGHT = 74.0, WIDTH - 26.0
HEIGHT = 340.0
BAR, GAP = 20.0, 11.0
COLOURS = (*HUES, "muted", "peer", "front")
"""Of stages; more than nine of them share."""


def curves(section: Mapping[str, Any]) -> Drawing:
    """A `lines` section: curves are named to the right of the frame, beside where they end."""
    series = {label: [(x, y) for x, y in points if y] for label, points in section["series"].items()}
    series = {label: points for label, points in series.items() if points}
    top, bottom = 58.0, 58.0 + HEIGHT
    right = WIDTH - 40 - max((text_width(label, 13) * 1.18 for label in series), default=0.0)
    points = [point for each in series.values() for point in each]
    x = spanning((x for x, _ in points), LEFT + 16, right - 16, least=0.5, margin=0.0)
    y = spanning((y for _, y in points), bottom - 10, top + 12, least=1.0, margin=0.05)
    shapes: list[Shape] = [
        Text(LEFT - 50, 28, section["title"], size=17, bold=True),
        Text(LEFT - 50, 47, section["up"], "muted", 12),
        Area([(LEFT, top), (right, top), (right, bottom), (LEFT, bottom)], "panel"),
    ]
    for value in y.ticks((1,) if y.decades > 2.2 else (1, 2, 5)):
        shapes.append(Line([(LEFT, y(value)), (right, y(value))], "grid"))
        shapes.append(Text(LEFT - 8, y(value) + 4, plain(value), "muted", 12, "end"))
    for value, said in marks(x, sorted({a for a, _ in points})):
        shapes.append(Line([(x(value), top), (x(value), bottom)], "grid", 0.6))
        shapes.append(Text(x(value), bottom + 18, said, "muted", 12, "middle"))
    shapes.append(Text((LEFT + right) / 2, bottom + 40, section["across"], "muted", 12, "middle"))
    hues = dict(zip(series, HUES * 3, strict=False))
    for label, each in series.items():
        shapes.append(Line([(x(a), y(b)) for a, b in each], hues[label], 2.0))
        shapes += [
            Dot(x(a), y(b), hues[label], 2.8, title=f"{label}: {plain(b)} ({section['up']}) at {plain(a)}")
            for a, b in each
        ]
    ends = {label: y(each[-1][1]) for label, each in series.items()}
    for label, at in apart(ends, 17.0, top + 6, bottom - 6).items():
        last = x(series[label][-1][0])
        shapes.append(Line([(last + 5, ends[label]), (right + 4, at), (right + 10, at)], hues[label], 0.8, (2, 3)))
        shapes.append(Text(right + 14, at + 4.5, label, hues[label], 13, bold=True))
    described = f"{section['up']} over {section['across']}: " + ", ".join(series)
    return Drawing(WIDTH, round(bottom + 54), section["title"], described, tuple(shapes))


def apart(wanted: Mapping[str, float], step: float, low: float, high: float) -> dict[str, float]:
    """The places moved so that they keep their order, lie `step` apart and within bounds, if there is room.

    >>> apart({"a": 10.0, "b": 12.0}, 8.0, 0.0, 100.0)
    {'a': 10.0, 'b': 18.0}
    """
    order = sorted(wanted, key=lambda label: wanted[label])
    places = [max(wanted[label], low) for label in order]
    for number in range(1, len(places)):
        places[number] = max(places[number], places[number - 1] + step)
    limit = high
    for number in reversed(range(len(places))):
        places[number] = limit = min(places[number], limit)
        limit -= step
    return dict(zip(order, places, strict=True))


def marks(scale: Scale, values: Sequence[float]) -> list[tuple[float, str]]:
    """The places that were measured, as far as there is room; powers of two as such where they are large."""
    powers = max(values) >= 4096 and all(math.log2(value).is_integer() for value in values)
    kept: list[tuple[float, str]] = []
    for value in values:
        said = f"2^{math.log2(value):.0f}" if powers else plain(value)
        if not kept or scale(value) - scale(kept[-1][0]) > 10 + text_width(said, 12):
            kept.append((value, said))
    return kept


def plain(value: float) -> str:
    """Two or three digits; without an exponent where that is short."""
    if 1 <= abs(value) < 1e5 and float(value).is_integer():
        return f"{value:.0f}"
    return f"{value:.3g}" if 1e-3 <= abs(value) < 1e4 else scientific(value)


# --------------------------------------------------------------------------------------------------------------- bars


def stacked(section: Mapping[str, Any]) -> Drawing:
    """A `bars` section: a row for each label, its stages one behind the other."""
    rows: Mapping[str, Mapping[str, float]] = section["rows"]
    stages = [each for each in section["stages"] if any(row.get(each) for row in rows.values())]
    largest = max(sum(row.values()) for row in rows.values()) or 1.0
    left = 40 + max(1.14 * text_width(label, 13) for label in rows)
    shapes: list[Shape] = [Text(24, 28, section["title"], size=17, bold=True)]
    top = 52.0
    hues = dict(zip(stages, COLOURS, strict=False))
    if len(stages) > 1:
        at = left
        for stage in stages:
            wide = 30 + text_width(stage, 12)
            if at + wide > RIGHT:
                at, top = left, top + 20
            shapes.append(Area(_box(at, top - 10, at + 12, top + 2), hues[stage]))
            shapes.append(Text(at + 17, top, stage, "ink", 12))
            at += wide
        top += 12
    else:
        top -= 8
    scale = (RIGHT - 70 - left) / largest
    for label, row in rows.items():
        shapes.append(Text(left - 10, top + BAR - 5, label, "ink", 13, "end"))
        at = left
        for stage in stages:
            value = row.get(stage, 0.0)
            if value > 0:
                shapes.append(Area(_box(at, top, at + value * scale, top + BAR), hues[stage]))
                if value * scale > 8 + text_width(f"{value:.0f}", 11) and len(stages) > 1:
                    middle = at + value * scale / 2
                    role = "ink" if hues[stage] == "front" else "paper"
                    shapes.append(Text(middle, top + BAR - 6, f"{value:.0f}", role, 11, "middle"))
                at += value * scale
        shapes.append(
            Text(at + 7, top + BAR - 5, f"{plain(float(f'{sum(row.values()):.3g}'))} {section['unit']}", "muted", 12)
        )
        top += BAR + GAP
    text = "; ".join(f"{label} {sum(row.values()):.3g} {section['unit']}" for label, row in rows.items())
    return Drawing(WIDTH, round(top + 12), section["title"], text, tuple(shapes))


def _box(left: float, top: float, right: float, bottom: float) -> list[tuple[float, float]]:
    return [(left, top), (right, top), (right, bottom), (left, bottom)]


# ------------------------------------------------------------------------------------------------------------- ratios


def rivals(row: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """A row's peers that were timed and compete."""
    return [peer for peer in row["peers"] if peer.get("ms") and not peer["yardstick"]]


def ahead(title: str, rows: Sequence[Mapping[str, Any]], threads: int) -> Drawing:
    """How many times faster ours is than each peer that computes the same work: bars to the right are ours, to the left
    the peer's."""
    shown = [(row["work"], peer["name"], peer["ms"] / row["ours"]["ms"]) for row in rows for peer in rivals(row)]
    label = {(work, name): f"{work}: {name}" for work, name, _ in shown}
    left = 40 + max(1.14 * text_width(each, 12) for each in label.values())
    low, high = min([0.5, *(ratio for *_, ratio in shown)]), max([2.0, *(ratio for *_, ratio in shown)])
    scale = Scale(low, high, left + 10, RIGHT - 52)
    top, step = 76.0, 22.0
    bottom = top + step * len(shown) + 4
    shapes: list[Shape] = [
        Text(24, 28, title, size=17, bold=True),
        Text(24, 48, f"How many times as fast Lichen is, {threads} thread{'s' if threads > 1 else ''}; "
             "left of 1 the peer is faster", "muted", 12),
    ]  # fmt: skip
    for value in scale.ticks((1, 2, 5) if scale.decades < 1.8 else (1,)):
        shapes.append(Line([(scale(value), top - 6), (scale(value), bottom)], "grid"))
        shapes.append(Text(scale(value), top - 11, plain(value), "muted", 12, "middle"))
    for number, (work, name, ratio) in enumerate(shown):
        y = top + step * number
        shapes.append(Text(left, y + 13, label[work, name], "ink", 12, "end"))
        role = "first" if ratio >= 1 else "second"
        ends = sorted((scale(1), scale(ratio)))
        shapes.append(Area(_box(ends[0], y + 2, max(ends[1], ends[0] + 1), y + step - 5), role))
        shapes.append(
            Text(max(scale(ratio), scale(1)) + 6, y + 13, f"{ratio:.2f}" if ratio < 10 else f"{ratio:.0f}", "muted", 11)
        )
    shapes.append(Line([(scale(1), top - 6), (scale(1), bottom)], "ink", 1.2))
    text = "; ".join(f"{work} {ratio:.2f} times {name}" for work, name, ratio in shown)
    return Drawing(WIDTH, round(bottom + 14), title, text, tuple(shapes))
