"""Drawings of what is built here: boxes in columns, and lines from what is read to what reads it."""

from __future__ import annotations

import html
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

_WIDE, _HIGH, _ACROSS, _DOWN, _EDGE = 150, 40, 190, 64, 10
"""px of a box, from one box to the next, and around them all."""
_FILLS = {"node": "#ffffff", "input": "#e8f1e4", "output": "#e6eef8"}
_FRAME, _LINE, _INK, _FAINT = "#445566", "#778899", "#000000", "#556677"
_TITLE, _SMALL, _STROKE = 12, 10, 1.5
"""px of letters and of lines"""
_DENSE, _SMOOTH = 2, 2
"""pixels of a PNG in a px, and how many times as many are drawn to smooth them"""

Point = tuple[float, float]
Curve = tuple[Point, Point, Point, Point]
"""A cubic Bezier curve."""


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
    lines = [f'<path d="{_path(line)}"/>' for line in _lines(boxes)]
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
    for line in _lines(boxes):
        points = [point for curve in line for point in _points(*curve)]
        draw.line([(round(x * scale), round(y * scale)) for x, y in points], _LINE, stroke)
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
    rows = _rows(boxes)
    places = {name: _corner(box.column, rows[name, box.column]) for name, box in boxes.items()}
    width, height = (
        max(each) for each in zip(*(_corner(column, row) for (_, column), row in rows.items()), strict=True)
    )
    return places, (width + _WIDE + _EDGE, height + _HIGH + _EDGE)


def _corner(column: int, row: int) -> tuple[int, int]:
    return _EDGE + column * _ACROSS, _EDGE + row * _DOWN


def _rows(boxes: Mapping[str, Box]) -> dict[tuple[str, int], int]:
    """By name and column: the row of every box, and below the boxes of a column those in which pass the lines of what
    is read further right."""
    reached = {name: max((each.column for each in boxes.values() if name in each.sources), default=0) for name in boxes}
    passing = [(name, column) for name, box in boxes.items() for column in range(box.column + 1, reached[name])]
    filled: dict[int, int] = {}
    rows = {}
    for name, column in [*((name, box.column) for name, box in boxes.items()), *passing]:
        rows[name, column] = filled.get(column, 0)
        filled[column] = rows[name, column] + 1
    return rows


def _lines(boxes: Mapping[str, Box]) -> Iterator[list[Curve]]:
    """From the right of a box to the left of each that reads it, straight through the columns between."""
    rows = _rows(boxes)
    for name, box in boxes.items():
        for source in box.sources:
            first = boxes[source].column
            passed = [_corner(column, rows[source, column]) for column in range(first, box.column)]
            corners = [*passed, _corner(box.column, rows[name, box.column])]
            line = []
            for number, ((x1, y1), (x2, y2)) in enumerate(pairwise(corners)):
                if number:
                    line.append(_curve((x1, y1), (x1 + _WIDE, y1)))
                line.append(_curve((x1 + _WIDE, y1), (x2, y2)))
            yield line


def _curve(start: tuple[int, int], end: tuple[int, int]) -> Curve:
    """Between the middles of two sides, by the corners above them; it leaves and arrives level."""
    (x1, y1), (x2, y2) = ((x, y + _HIGH // 2) for x, y in (start, end))
    middle = (x1 + x2) // 2
    return (x1, y1), (middle, y1), (middle, y2), (x2, y2)


def _path(line: list[Curve]) -> str:
    """In words of SVG."""
    curves = "".join(f"C{b[0]} {b[1]} {c[0]} {c[1]} {d[0]} {d[1]}" for _, b, c, d in line)
    return f"M{line[0][0][0]} {line[0][0][1]}{curves}"


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
