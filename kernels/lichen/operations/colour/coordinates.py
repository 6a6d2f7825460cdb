"""Coordinates of colour that mix channels: chromaticities, hues, saturations, inks.

Sources: CIE 15:2004 (xyY, L*u*v*, chroma and hue); A. R. Smith, Color gamut transform pairs, SIGGRAPH 1978 (HSV, HSL).
Hues are degrees in [0, 360).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lichen.memory import Array
from lichen.operations.colour.stages import BEND, TINY, UNKNOWN, Interval, Mixed, Planes, size

GREY = 2.0**-20
"""HSV and HSL: the range of a pixel's channels, as a share of the largest (1 at least), that is still grey."""
COLOURLESS = 1e-5
"""LCh and Oklch: the chroma, as a share of lightness (that of white at least), that is still grey."""
DARK = 1e-7
"""Oklch: chroma x (lightness^2 + chroma^2), about the light behind it, that is still black. The cube root's slope is
infinite at black, so noise of 1e-7 there has a chroma of 2e-3."""
ANY: Interval = (-UNKNOWN, UNKNOWN)
INF = math.inf


def quotient(a: Array, b: Array, otherwise: float | Array) -> Array:
    """a / b, and `otherwise` where b has no size; NaN stays."""
    none = np.abs(b) < TINY
    y: Array = np.where(none, a.dtype.type(0) * a + otherwise, a / np.where(none, 1, b))
    return y.astype(a.dtype, copy=False)


def _jump(errors: Sequence[float]) -> float:
    return INF if any(errors) else 0.0


def _light(given: Sequence[Interval]) -> bool:
    return all(low >= 0 for low, _ in given)


# -------------------------------------------------------------------------------------------------------------- xyY


def xyy(white: tuple[float, float]) -> Mixed:
    """XYZ to chromaticity and luminance; without light, the chromaticity of white."""

    def value(planes: Planes) -> Planes:
        x, y, z = planes
        total = x + y + z
        return [quotient(x, total, white[0]), quotient(y, total, white[1]), y]

    def reach(given: Sequence[Interval]) -> list[Interval]:
        return [(0, 1), (0, 1), given[1]] if _light(given) else [ANY, ANY, given[1]]

    return Mixed("to_xyy", value, reach, lambda e, given: [_jump(e), _jump(e), e[1]], white)


def _from_xyy(planes: Planes) -> Planes:
    x, y, light = planes
    scale = quotient(light, y, 0.0)
    return [x * scale, light, (1 - x - y) * scale]


FROM_XYY = Mixed("from_xyy", _from_xyy, lambda given: [ANY, given[2], ANY], lambda e, given: [INF, e[2], INF])

# -------------------------------------------------------------------------------------------------------------- Luv


def _ratios(white: Array) -> tuple[float, float]:
    x, y, z = map(float, white)
    return 4 * x / (x + 15 * y + 3 * z), 9 * y / (x + 15 * y + 3 * z)


def luv(white: Array) -> Mixed:
    """XYZ to L*u*v*; without light 0."""
    u0, v0 = _ratios(white)

    def value(planes: Planes) -> Planes:
        x, y, z = planes
        total = x + 15 * y + 3 * z
        f = np.where(y > BEND**3, 116 * np.cbrt(y) - 16, y * (116 / (3 * BEND**2))).astype(y.dtype, copy=False)
        return [f, 13 * f * (quotient(4 * x, total, u0) - u0), 13 * f * (quotient(9 * y, total, v0) - v0)]

    def reach(given: Sequence[Interval]) -> list[Interval]:
        top = _lightness(given[1][1])
        if not _light(given):
            return [(_lightness(given[1][0]), top), ANY, ANY]
        return [(_lightness(given[1][0]), top), (-13 * top * u0, 52 * top), (-13 * top * v0, 13 * top * 0.6)]

    def growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
        lightness = e[1] * 116 / (3 * BEND**2)
        if not _light(given):
            return [lightness, _jump(e), _jump(e)]
        total = e[0] + 15 * e[1] + 3 * e[2]
        share = 116 / (3 * BEND**2) / 15  # lightness over the divisor, at most
        own = 13 * share * 10 * 6e-8 * sum(size(interval) for interval in given)  # of the quotient, float32
        u = 13 * (4 * lightness + share * (4 * e[0] + 4 * total)) + own
        return [lightness, u, 13 * (lightness + share * (9 * e[1] + total)) + own]

    return Mixed("to_luv", value, reach, growth, (u0, v0), 16)


def _lightness(y: float) -> float:
    return 116 * y ** (1 / 3) - 16 if y > BEND**3 else 116 / (3 * BEND**2) * y


def from_luv(white: Array) -> Mixed:
    """L*u*v* to XYZ; lightness 0 is no light."""
    u0, v0 = _ratios(white)

    def value(planes: Planes) -> Planes:
        lightness, u, v = planes
        f = (lightness + 16) / 116
        y = np.where(f > BEND, f * f * f, lightness * (3 * BEND**2 / 116)).astype(f.dtype, copy=False)
        u1 = quotient(u, 13 * lightness, 0.0) + u0
        v1 = quotient(v, 13 * lightness, 0.0) + v0
        scale = quotient(y, 4 * v1, 0.0)
        return [9 * u1 * scale, y, (12 - 3 * u1 - 20 * v1) * scale]

    def reach(given: Sequence[Interval]) -> list[Interval]:
        ends = [((x + 16) / 116) ** 3 if x > 8 else x * 3 * BEND**2 / 116 for x in given[0]]
        return [ANY, (ends[0], ends[1]), ANY]

    def growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
        return [INF, e[0] * 3 / 116 * max((size(given[0]) + 16) / 116, BEND) ** 2, INF]

    return Mixed("from_luv", value, reach, growth, (u0, v0))


# ------------------------------------------------------------------------------------------------------------ polar


def polar(white: float, dark: float = 0.0) -> Mixed:
    """(L, a, b) to lightness, chroma and hue; `white` is white's lightness."""

    def value(planes: Planes) -> Planes:
        lightness, a, b = planes
        chroma = np.hypot(a, b)
        hue = np.degrees(np.arctan2(b, a))
        hue = np.where(hue < 0, hue + a.dtype.type(360), hue)
        none = (chroma <= COLOURLESS * np.maximum(np.abs(lightness), white)) | (hue >= 360)
        none |= chroma * (lightness * lightness + chroma * chroma) <= dark
        return [lightness, chroma, np.where(none, 0 * hue, hue).astype(a.dtype, copy=False)]

    def reach(given: Sequence[Interval]) -> list[Interval]:
        return [given[0], (0, math.hypot(size(given[1]), size(given[2]))), (0, 360)]

    def growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
        return [e[0], math.hypot(e[1], e[2]), INF]

    return Mixed("to_polar", value, reach, growth, (white, dark))


def _turn(hue: Array) -> Array:
    """In [0, 360), exact but for the sign."""
    turn = np.fmod(hue, hue.dtype.type(360))
    y: Array = np.where(turn < 0, turn + hue.dtype.type(360), turn)
    return y


def _cartesian(planes: Planes) -> Planes:
    lightness, chroma, hue = planes
    angle = np.radians(_turn(hue))
    return [lightness, chroma * np.cos(angle), chroma * np.sin(angle)]


def _within(given: Sequence[Interval]) -> list[Interval]:
    chroma = size(given[1])
    return [given[0], (-chroma, chroma), (-chroma, chroma)]


def _swung(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
    by = e[1] + size(given[1]) * math.radians(e[2])
    return [e[0], by, by]


CARTESIAN = Mixed("from_polar", _cartesian, _within, _swung, roundings=20)

# ------------------------------------------------------------------------------------------------------ HSV and HSL


def _hue(r: Array, g: Array, b: Array, top: Array, range_: Array) -> Array:
    """Degrees in [0, 360), 0 where the channels' range is too small for a hue."""
    none = range_ <= GREY * np.maximum(np.abs(top), 1)
    divisor = np.where(none, 1, range_)
    hue = np.where(
        top == r, (g - b) / divisor, np.where(top == g, (b - r) / divisor + 2, (r - g) / divisor + 4)
    ) * r.dtype.type(60)
    hue = np.where(hue < 0, hue + r.dtype.type(360), hue)
    y: Array = np.where(none | (hue >= 360), 0 * range_, hue)
    return y.astype(r.dtype, copy=False)


def _hsv(planes: Planes) -> Planes:
    r, g, b = planes
    top, low = np.maximum(np.maximum(r, g), b), np.minimum(np.minimum(r, g), b)
    return [_hue(r, g, b, top, top - low), quotient(top - low, top, 0.0), top]


def _join(given: Sequence[Interval]) -> Interval:
    return min(low for low, _ in given), max(high for _, high in given)


def _hsv_reach(given: Sequence[Interval]) -> list[Interval]:
    return [(0, 360), (0, 1) if _light(given) else ANY, _join(given)]


HSV = Mixed("to_hsv", _hsv, _hsv_reach, lambda e, given: [_jump(e), _jump(e), max(e)])


def _sector(hue: Array, n: int) -> Array:
    """How far a channel lies below the largest, as a share of the range: 0 to 1."""
    k = np.fmod(_turn(hue) / hue.dtype.type(60) + n, hue.dtype.type(6))
    y: Array = np.maximum(np.minimum(np.minimum(k, 4 - k), 1), 0)
    return y


def _from_hsv(planes: Planes) -> Planes:
    hue, saturation, top = planes
    range_ = top * saturation
    return [top - range_ * _sector(hue, n) for n in (5, 3, 1)]


def _products(a: Interval, b: Interval) -> Interval:
    ends = [x * y for x in a for y in b]
    return min(ends), max(ends)


def _hsv_back(given: Sequence[Interval]) -> list[Interval]:
    low, high = _products(given[1], given[2])
    return [(given[2][0] - max(high, 0), given[2][1] - min(low, 0))] * 3


def _hsv_back_growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
    range_ = size(given[1]) * size(given[2])
    own = 10 * 6e-8 * range_
    return [e[2] + size(given[1]) * e[2] + size(given[2]) * e[1] + e[1] * e[2] + range_ * e[0] / 60 + own] * 3


FROM_HSV = Mixed("from_hsv", _from_hsv, _hsv_back, _hsv_back_growth)


def _hsl(planes: Planes) -> Planes:
    r, g, b = planes
    top, low = np.maximum(np.maximum(r, g), b), np.minimum(np.minimum(r, g), b)
    room = np.where(top + low < 1, top + low, (1 - top) + (1 - low)).astype(r.dtype, copy=False)
    half = r.dtype.type(0.5)
    return [_hue(r, g, b, top, top - low), quotient(top - low, room, 0.0), top * half + low * half]


def _hsl_reach(given: Sequence[Interval]) -> list[Interval]:
    low, high = _join(given)
    return [(0, 360), (0, 1) if low >= 0 and high <= 1 else ANY, (low, high)]


# A rounded divisor next to its pole makes any saturation: only within [0, 1] is it exact there.
HSL = Mixed(
    "to_hsl",
    _hsl,
    _hsl_reach,
    lambda e, given: [_jump(e), INF if _hsl_reach(given)[1] == ANY else _jump(e), max(e)],
)


def _from_hsl(planes: Planes) -> Planes:
    hue, saturation, lightness = planes
    room = np.where(lightness < 0.5, 2 * lightness, 2 * (1 - lightness)).astype(hue.dtype, copy=False)
    range_ = saturation * room
    top = lightness + range_ / 2
    return [top - range_ * _sector(hue, n) for n in (5, 3, 1)]


def _hsl_back(given: Sequence[Interval]) -> list[Interval]:
    range_ = size(given[1]) * 2 * max(size(given[2]), 1)
    return [(given[2][0] - range_ / 2, given[2][1] + range_ / 2)] * 3


def _hsl_back_growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
    room = 2 * max(size(given[2]), 1)
    range_ = size(given[1]) * room
    return [e[2] + room * e[1] + 2 * size(given[1]) * e[2] + range_ * e[0] / 60 + 10 * 6e-8 * range_] * 3


FROM_HSL = Mixed("from_hsl", _from_hsl, _hsl_back, _hsl_back_growth)

# ------------------------------------------------------------------------------------------------------------- CMYK


def _cmyk(planes: Planes) -> Planes:
    """Black is what all inks have in common; where all is black there is no other ink."""
    top = np.maximum(np.maximum(planes[0], planes[1]), planes[2])
    return [*(quotient(top - x, top, 0.0) for x in planes), 1 - top]


def _cmyk_reach(given: Sequence[Interval]) -> list[Interval]:
    low, high = _join(given)
    ink: Interval = (0, 1) if low >= 0 else ANY
    return [ink, ink, ink, (1 - high, 1 - low)]


CMYK = Mixed("to_cmyk", _cmyk, _cmyk_reach, lambda e, given: [*([_jump(e)] * 3), max(e) + 6e-8])


def _from_cmyk(planes: Planes) -> Planes:
    rest = 1 - planes[3]
    return [(1 - ink) * rest for ink in planes[:3]]


def _cmyk_back(given: Sequence[Interval]) -> list[Interval]:
    rest = (1 - given[3][1], 1 - given[3][0])
    return [_products((1 - high, 1 - low), rest) for low, high in given[:3]]


def _cmyk_back_growth(e: Sequence[float], given: Sequence[Interval]) -> list[float]:
    return [(1 + size(ink)) * (e[3] + 6e-8) + (1 + size(given[3])) * (e[i] + 6e-8) for i, ink in enumerate(given[:3])]


FROM_CMYK = Mixed("from_cmyk", _from_cmyk, _cmyk_back, _cmyk_back_growth)
