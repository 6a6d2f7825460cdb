"""Drawings: shapes in a plane, written as SVG or painted as PNG.

Shapes name a role (`ink`, `paper`, `muted`, `first` ...), not a colour; a theme gives every role its colour. An SVG
carries both themes and follows the reader's, with tooltips for whatever has a title; it has no script, no date and no
random name, so the same drawing is the same bytes. A PNG is painted in one theme, at twice the size for dense screens.

Text is ASCII, since the one font that is always at hand for painting knows little more. Coordinates are in CSS pixels,
x to the right and y down; `y` of a text is its base line.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal
from xml.sax.saxutils import escape

import numpy as np
from PIL import Image, ImageDraw, ImageFont

Points = Sequence[tuple[float, float]]
Theme = Literal["light", "dark"]
Form = Literal["circle", "square", "diamond", "triangle", "cross"]

THEMES: Mapping[Theme, Mapping[str, str]] = {
    "light": {
        "paper": "#ffffff",
        "panel": "#f5f6f8",
        "ink": "#1a1d21",
        "muted": "#5b636d",
        "grid": "#e0e3e8",
        "front": "#c9cdd4",
        "peer": "#868e98",
        "failed": "#c62828",
        "first": "#0b62c4",
        "second": "#c2500a",
        "third": "#0d7d5b",
        "fourth": "#8e36a8",
        "fifth": "#8a6a00",
        "sixth": "#b0215f",
    },
    "dark": {
        "paper": "#14171b",
        "panel": "#1c2026",
        "ink": "#eceff2",
        "muted": "#a3abb5",
        "grid": "#2d333b",
        "front": "#4b535e",
        "peer": "#8d96a1",
        "failed": "#ff7b72",
        "first": "#62adff",
        "second": "#ff9d57",
        "third": "#45cf9f",
        "fourth": "#d38ef0",
        "fifth": "#e0bf4a",
        "sixth": "#ff85b3",
    },
}
HUES = ("first", "second", "third", "fourth", "fifth", "sixth")
FONT = "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif"
WIDER = 1.2
BOLD = 1.35
"""How much wider than in the painting font a text is in the widest that readers have, DejaVu Sans, and a bold one."""
DENSITY = 2
"""Painted pixels for each CSS pixel."""
SMOOTHING = 2
"""Samples per painted pixel and direction."""


@dataclass(frozen=True, slots=True)
class Line:
    points: Points
    role: str
    width: float = 1.0
    dash: tuple[float, float] | None = None
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Area:
    """A filled polygon."""

    points: Points
    role: str
    opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class Dot:
    """A marker. Hollow ones are filled with paper."""

    x: float
    y: float
    role: str
    radius: float = 4.0
    shape: Form = "circle"
    hollow: bool = False
    opacity: float = 1.0
    title: str = ""


@dataclass(frozen=True, slots=True)
class Text:
    x: float
    y: float
    text: str
    role: str = "ink"
    size: float = 12.0
    anchor: Literal["start", "middle", "end"] = "start"
    bold: bool = False
    halo: str = ""
    """the role it is edged with, that of the ground, so that it stays readable on lines"""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom, px, whichever of the fonts draws it."""
        width = (BOLD if self.bold else WIDER) * text_width(self.text, self.size)
        left = self.x - {"start": 0.0, "middle": width / 2, "end": width}[self.anchor]
        return left, self.y - 0.8 * self.size, left + width, self.y + 0.25 * self.size


Shape = Line | Area | Dot | Text


@dataclass(frozen=True, slots=True)
class Drawing:
    width: int
    height: int
    title: str
    description: str
    shapes: tuple[Shape, ...]


def text_width(text: str, size: float) -> float:
    """px, with the painting font. `size` is that of the font, px."""
    return float(_font(64).getlength(text)) * size / 64


# -------------------------------------------------------------------------------------------------------------- SVG


def to_svg(drawing: Drawing) -> bytes:
    """The drawing as a stand-alone SVG document, UTF-8."""
    body = "\n".join(_element(shape) for shape in drawing.shapes)
    return f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {drawing.width} {drawing.height}" \
width="{drawing.width}" height="{drawing.height}" role="img" font-family="{FONT}">
<title>{escape(drawing.title)}</title>
<desc>{escape(drawing.description)}</desc>
<style>
{_style()}
</style>
<rect width="100%" height="100%" class="f-paper"/>
{body}
</svg>
""".encode()


def _style() -> str:
    def rules(theme: Theme) -> str:
        return "".join(f".f-{role}{{fill:{hue}}}.s-{role}{{stroke:{hue}}}" for role, hue in THEMES[theme].items())

    fixed = "text{font-variant-numeric:tabular-nums}.n{fill:none}.h{paint-order:stroke;stroke-width:3px}"
    return f"{fixed}\n{rules('light')}\n@media(prefers-color-scheme:dark){{{rules('dark')}}}"


def _element(shape: Shape) -> str:
    opacity = "" if isinstance(shape, Text) or shape.opacity == 1 else f' opacity="{shape.opacity:g}"'
    if isinstance(shape, Line):
        dash = f' stroke-dasharray="{shape.dash[0]:g} {shape.dash[1]:g}"' if shape.dash else ""
        return (
            f'<polyline points="{_joined(shape.points)}" class="n s-{shape.role}" stroke-width="{shape.width:g}" '
            f'stroke-linejoin="round"{dash}{opacity}/>'
        )
    if isinstance(shape, Area):
        return f'<polygon points="{_joined(shape.points)}" class="f-{shape.role}"{opacity}/>'
    if isinstance(shape, Text):
        anchor = "" if shape.anchor == "start" else f' text-anchor="{shape.anchor}"'
        bold = ' font-weight="600"' if shape.bold else ""
        names = f"f-{shape.role} h s-{shape.halo}" if shape.halo else f"f-{shape.role}"
        where = f'x="{_short(shape.x)}" y="{_short(shape.y)}"'
        return f'<text {where} class="{names}" font-size="{shape.size:g}"{anchor}{bold}>{escape(shape.text)}</text>'
    return _marker(shape, opacity)


def _marker(dot: Dot, opacity: str) -> str:
    fill = "n" if dot.shape == "cross" else "f-paper" if dot.hollow else f"f-{dot.role}"
    style = f'class="{fill} s-{dot.role}" stroke-width="1.6"{opacity}'
    if dot.shape == "circle":
        drawn = f'circle cx="{_short(dot.x)}" cy="{_short(dot.y)}" r="{_short(dot.radius)}" {style}'
    elif dot.shape == "cross":
        (a, b), (c, d), (e, f), (g, h) = corners(dot)
        drawn = f'path d="M{_joined([(a, b)])}L{_joined([(e, f)])}M{_joined([(c, d)])}L{_joined([(g, h)])}" {style}'
    else:
        drawn = f'polygon points="{_joined(corners(dot))}" {style}'
    if dot.opacity < 1 and dot.shape != "cross":  # no line shows through a pale mark
        under = drawn.replace(style, 'class="f-panel"')
        drawn = f"{under}/><{drawn}"
    if not dot.title:
        return f"<{drawn}/>"
    # A wider, unseen circle makes the tooltip easy to meet with a pointer.
    wide = f'<circle cx="{_short(dot.x)}" cy="{_short(dot.y)}" r="{dot.radius + 5:g}" fill-opacity="0"/>'
    return f"<g><title>{escape(dot.title)}</title>{wide}<{drawn}/></g>"


def corners(dot: Dot) -> list[tuple[float, float]]:
    """Of a marker that is no circle; equal areas look equally heavy."""
    x, y, r = dot.x, dot.y, dot.radius
    if dot.shape == "diamond":
        r *= 1.25
        return [(x, y - r), (x + r, y), (x, y + r), (x - r, y)]
    if dot.shape == "triangle":
        return [(x, y - 1.25 * r), (x + 1.1 * r, y + 0.75 * r), (x - 1.1 * r, y + 0.75 * r)]
    r *= 0.9
    return [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]


def _joined(points: Points) -> str:
    return " ".join(f"{_short(x)},{_short(y)}" for x, y in points)


def _short(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")


# -------------------------------------------------------------------------------------------------------------- PNG


def to_png(drawing: Drawing, theme: Theme = "light") -> bytes:
    """The drawing painted, `DENSITY` pixels for each CSS pixel."""
    fine = DENSITY * SMOOTHING
    canvas = Image.new("RGB", (drawing.width * fine, drawing.height * fine), THEMES[theme]["paper"])
    brush = _Brush(ImageDraw.Draw(canvas), theme, fine)
    for shape in drawing.shapes:
        brush.paint(shape)
    out = io.BytesIO()
    _of_few_colours(canvas.reduce(SMOOTHING)).save(out, "png", compress_level=8)
    return out.getvalue()


def _of_few_colours(picture: Image.Image) -> Image.Image:
    """The picture in the 256 colours of which it has most, all others as the nearest of these: neighbouring greys stay
    apart, and grounds what they are."""
    pixels = np.asarray(picture).astype(np.int32)
    found = sorted(picture.getcolors(picture.width * picture.height) or (), reverse=True)
    colours = np.array([colour for _, colour in found], np.int32)
    kept = colours[:256]
    table = np.zeros(1 << 24, np.uint8)
    apart = np.square(colours[:, np.newaxis] - kept).sum(axis=2)
    table[colours @ _PLACES] = apart.argmin(axis=1)
    few = Image.fromarray(table[pixels @ _PLACES], "P")
    few.putpalette(kept.astype(np.uint8).tobytes())
    return few


_PLACES = np.array([1 << 16, 1 << 8, 1], np.int32)
"""What red, green and blue count in a number that stands for a colour."""


class _Brush:
    def __init__(self, draw: ImageDraw.ImageDraw, theme: Theme, scale: int) -> None:
        self._draw, self._theme, self._scale = draw, theme, scale

    def paint(self, shape: Shape) -> None:
        if isinstance(shape, Line):
            self._line(shape)
        elif isinstance(shape, Area):
            self._draw.polygon(self._scaled(shape.points), fill=self._colour(shape.role, shape.opacity))
        elif isinstance(shape, Text):
            self._text(shape)
        else:
            self._dot(shape)

    def _colour(self, role: str, opacity: float = 1.0) -> tuple[int, int, int]:
        """A role's colour, mixed with paper where it is not opaque."""
        over, under = (_rgb(THEMES[self._theme][each]) for each in (role, "paper"))
        red, green, blue = (round(opacity * a + (1 - opacity) * b) for a, b in zip(over, under, strict=True))
        return red, green, blue

    def _scaled(self, points: Points) -> list[tuple[float, float]]:
        return [(x * self._scale, y * self._scale) for x, y in points]

    def _line(self, line: Line) -> None:
        colour, width = self._colour(line.role, line.opacity), round(line.width * self._scale)
        for stretch in dashes(line.points, line.dash) if line.dash else [list(line.points)]:
            self._draw.line(self._scaled(stretch), fill=colour, width=width, joint="curve")

    def _dot(self, dot: Dot) -> None:
        colour, scale = self._colour(dot.role, dot.opacity), self._scale
        fill, width = self._colour("paper") if dot.hollow else colour, round(1.6 * scale)
        if dot.shape == "circle":
            self._draw.circle((dot.x * scale, dot.y * scale), (dot.radius + 0.8) * scale, fill, colour, width)
        elif dot.shape == "cross":
            a, b, c, d = self._scaled(corners(dot))
            self._draw.line([a, c], fill=colour, width=width)
            self._draw.line([b, d], fill=colour, width=width)
        else:
            self._draw.polygon(self._scaled(corners(dot)), fill, colour, width)

    def _text(self, text: Text) -> None:
        where = (text.x * self._scale, text.y * self._scale)
        anchor = {"start": "ls", "middle": "ms", "end": "rs"}[text.anchor]
        colour = self._colour(text.role)
        edge = 1.5 * self._scale if text.halo else 0
        font = _font(round(text.size * self._scale))
        if edge:
            self._draw.text(where, text.text, self._colour(text.halo), font, anchor, stroke_width=edge)
        bold = 0.022 * text.size * self._scale if text.bold else 0
        self._draw.text(where, text.text, colour, font, anchor, stroke_width=bold, stroke_fill=colour)


def dashes(points: Points, dash: tuple[float, float]) -> list[list[tuple[float, float]]]:
    """The strokes of a dashed line, which go on around its corners."""
    strokes: list[list[tuple[float, float]]] = []
    on, left = True, dash[0]
    for (ax, ay), (bx, by) in pairwise(points):
        length, done = math.hypot(bx - ax, by - ay), 0.0
        if on:
            strokes.append([(ax, ay)])
        while length - done > 1e-9:
            step = min(left, length - done)
            done, left = done + step, left - step
            at = (ax + (bx - ax) * done / length, ay + (by - ay) * done / length)
            if on:
                strokes[-1].append(at)
            if left <= 1e-9:
                on = not on
                left = dash[0] if on else dash[1]
                if on:
                    strokes.append([at])
    return [stroke for stroke in strokes if len(stroke) > 1]


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


@lru_cache(64)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("this Pillow was built without FreeType")
    return font
