"""Drawings of what is built here: boxes in columns, and lines from what is read to what reads it."""

from __future__ import annotations

import html
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

_WIDE, _HIGH, _ACROSS, _DOWN, _EDGE = 150, 40, 190, 64, 10
"""px of a box, from one box to the next, and around them all."""
_FILLS = {"node": "#ffffff", "input": "#e8f1e4", "output": "#e6eef8"}
_FRAME, _LINE, _INK, _FAINT = "#445566", "#778899", "#000000", "#556677"
_TITLE, _SMALL, _STROKE = 12, 10, 1.5
"""px of letters and of lines"""
_DENSE, _SMOOTH = 2, 2
"""pixels of a PNG in a px, and how many times as many are drawn to smooth them"""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Box:
    column: int
    kind: str
    """node, input or output"""
    title: str
    text: str
    sources: tuple[str, ...] = ()
    """names of the boxes that it reads"""


def to_svg(boxes: Mapping[str, Box]) -> str:
    """The drawing of boxes by their names. Boxes of a column stand one below the other in the order given."""
    places, (width, height) = _placed(boxes)
    lines = [f'<path d="M{a[0]} {a[1]}C{b[0]} {b[1]} {c[0]} {c[1]} {d[0]} {d[1]}"/>' for a, b, c, d in _lines(boxes)]
    fills = "".join(f".{kind}{{fill:{fill}}}" for kind, fill in _FILLS.items())
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="{_TITLE}">\n'
        f"<style>rect{{stroke:{_FRAME};stroke-width:{_STROKE}}}{fills}"
        f"path{{fill:none;stroke:{_LINE};stroke-width:{_STROKE}}}.small{{fill:{_FAINT};font-size:{_SMALL}px}}</style>\n"
        + "\n".join([*lines, *(_svg_of(box, *places[name]) for name, box in boxes.items())])
        + "\n</svg>\n"
    )


def to_png(boxes: Mapping[str, Box]) -> bytes | None:
    """The same as a PNG of twice as many pixels a side; None where Pillow is not installed."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        return None
    places, size = _placed(boxes)
    scale = _DENSE * _SMOOTH
    picture = Image.new("RGB", (size[0] * scale, size[1] * scale), "#ffffff")
    draw = ImageDraw.Draw(picture)
    stroke = round(_STROKE * scale)
    title, small = (ImageFont.load_default(each * scale) for each in (_TITLE, _SMALL))
    for curve in _lines(boxes):
        draw.line([(round(x * scale), round(y * scale)) for x, y in _points(*curve)], _LINE, stroke)
    for name, box in boxes.items():
        x, y = (each * scale for each in places[name])
        corners = (x, y, x + _WIDE * scale, y + _HIGH * scale)
        draw.rounded_rectangle(corners, 6 * scale, _FILLS[box.kind], _FRAME, stroke)
        draw.text((x + 8 * scale, y + 17 * scale), _fitting(box.title), _INK, title, anchor="ls")
        draw.text((x + 8 * scale, y + 32 * scale), _fitting(box.text), _FAINT, small, anchor="ls")
    file = io.BytesIO()
    picture.reduce(_SMOOTH).save(file, "PNG", dpi=(96 * _DENSE, 96 * _DENSE))
    return file.getvalue()


def _placed(boxes: Mapping[str, Box]) -> tuple[dict[str, tuple[int, int]], tuple[int, int]]:
    """The corner of every box, and the size of the drawing."""
    filled: dict[int, int] = {}
    places = {}
    for name, box in boxes.items():
        row = filled.get(box.column, 0)
        places[name] = (_EDGE + box.column * _ACROSS, _EDGE + row * _DOWN)
        filled[box.column] = row + 1
    width, height = (max(each) for each in zip(*places.values(), strict=True))
    return places, (width + _WIDE + 2 * _EDGE, height + _HIGH + 2 * _EDGE)


def _lines(boxes: Mapping[str, Box]) -> Iterator[tuple[Point, Point, Point, Point]]:
    """Cubic Bezier curves from the right of a box to the left of one that reads it."""
    places, _ = _placed(boxes)
    for name, box in boxes.items():
        for source in box.sources:
            (x1, y1), (x2, y2) = places[source], places[name]
            start, end = (x1 + _WIDE, y1 + _HIGH // 2), (x2, y2 + _HIGH // 2)
            middle = (start[0] + end[0]) // 2
            yield start, (middle, start[1]), (middle, end[1]), end


def _points(a: Point, b: Point, c: Point, d: Point, count: int = 24) -> Iterator[Point]:
    """Points of a curve."""
    for at in range(count + 1):
        t = at / count
        weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3
        x, y = (sum(w * each for w, each in zip(weights, axis, strict=True)) for axis in zip(a, b, c, d, strict=True))
        yield x, y


def _svg_of(box: Box, x: int, y: int) -> str:
    return (
        f'<g><rect class="{box.kind}" x="{x}" y="{y}" width="{_WIDE}" height="{_HIGH}" rx="6"/>'
        f'<text x="{x + 8}" y="{y + 17}">{html.escape(_fitting(box.title))}</text>'
        f'<text x="{x + 8}" y="{y + 32}" class="small">{html.escape(_fitting(box.text))}</text></g>'
    )


def _fitting(text: str) -> str:
    return text if len(text) <= 26 else text[:23] + "..."
