"""What the nodes of a colour transform file make of a number, as curves of pieces.

Source: Common LUT Format Implementation Guide, version 3, 2021; ASC CDL 1.2, 2008.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

from lichen.operations.tone.chain import Curves, Matrix, Step
from lichen.operations.tone.piecewise import SMALLEST, Piece, Piecewise

LUMA = (0.2126, 0.7152, 0.0722)
SMALL, LARGE = 0.01, 100.0
"""Of exponents."""


def _line(slope: float, added: float, start: float = -math.inf) -> Piece:
    return Piece("line", slope, added, start=start) if slope else Piece("constant", drop=added, start=start)


def ranged(
    low: float | None, high: float | None, to_low: float | None, to_high: float | None, *, clamp: bool
) -> Piecewise:
    """A line through both ends, held beyond them where there is an end and `clamp`."""
    if (low is None) != (to_low is None) or (high is None) != (to_high is None):
        raise ValueError("each InValue needs its OutValue")
    slope, added = 1.0, 0.0
    if low is not None and high is not None and to_low is not None and to_high is not None:
        if high <= low:
            raise ValueError("maxInValue must lie above minInValue")
        if to_high < to_low:
            raise ValueError("maxOutValue must not lie below minOutValue")
        slope = (to_high - to_low) / (high - low)
        added = to_low - slope * low
    elif low is not None and to_low is not None:
        added = to_low - low
    elif high is not None and to_high is not None:
        added = to_high - high
    pieces = [_line(slope, added)]
    if clamp and low is not None and to_low is not None:
        pieces = [Piece("constant", drop=to_low), _line(slope, added, low)]
    if clamp and high is not None and to_high is not None:
        pieces.append(Piece("constant", drop=to_high, start=high))
    return Piecewise(tuple(pieces))


def indexed(pairs: Sequence[tuple[float, float]]) -> Piecewise:
    """A polygon through the pairs, held to its ends: from a number to its place in a table."""
    if any(right[0] <= left[0] or right[1] < left[1] for left, right in itertools.pairwise(pairs)):
        raise ValueError("the IndexMap must ascend")
    pieces = [Piece("constant", drop=pairs[0][1])]
    for (x0, y0), (x1, y1) in itertools.pairwise(pairs):
        slope = (y1 - y0) / (x1 - x0)
        pieces.append(_line(slope, y0 - slope * x0, x0))
    return Piecewise((*pieces, Piece("constant", drop=pairs[-1][1], start=pairs[-1][0])))


def exponent(style: str, power: float, offset: float) -> Piecewise:
    """basic: x^e for x >= 0, below it 0, mirrored or passed; monCurve: a power with an offset and a line below it."""
    if not SMALL <= power <= LARGE:
        raise ValueError(f"exponent is {power:g}; it must be from {SMALL:g} to {LARGE:g}")
    if style.startswith("monCurve"):
        return _mon_curve(style, power, offset)
    e = power if style.endswith("Fwd") else 1 / power
    above = Piece("power", exponent=e, start=0.0)
    match style.removesuffix("Fwd").removesuffix("Rev"):
        case "basic" if style != "basic":
            return Piecewise((Piece("constant"), above))
        case "basicMirror" if style != "basicMirror":
            return Piecewise((Piece("power", exponent=e),), centre=(0.0, 0.0))
        case "basicPassThru" if style != "basicPassThru":
            return Piecewise((Piece("line"), above))
    raise ValueError(f"style is {style!r}, which is none of the format's")


def _mon_curve(style: str, power: float, offset: float) -> Piecewise:
    if not (1 < power <= 10 and 0 < offset <= 0.9):
        raise ValueError("a monCurve needs an exponent above 1, up to 10, and an offset above 0, up to 0.9")
    bend = offset / (power - 1)
    value = (offset * power / ((power - 1) * (1 + offset))) ** power
    slope = value / bend
    curve = Piece("power", 1 / (1 + offset), offset / (1 + offset), exponent=power, start=bend)
    pieces = (_line(slope, 0.0), curve)
    if style.removeprefix("monCurve") in ("Rev", "MirrorRev"):
        pieces = (_line(1 / slope, 0.0), curve.inverse(value))
    elif style.removeprefix("monCurve") not in ("Fwd", "MirrorFwd"):
        raise ValueError(f"style is {style!r}, which is none of the format's")
    return Piecewise(pieces, centre=(0.0, 0.0) if "Mirror" in style else None)


def logarithm(style: str, values: Mapping[str, float]) -> Piecewise:
    """Logarithms of the smallest normal float's place and above; with a break, a line below it."""
    base = values.get("base", 10.0 if style.endswith("10") else 2.0)
    if not 1 < base <= 100:
        raise ValueError(f"base is {base:g}; it must be above 1, up to 100")
    inner, lift = values.get("linSideSlope", 1.0), values.get("linSideOffset", 0.0)
    outer, drop = values.get("logSideSlope", 1.0) / math.log(base), values.get("logSideOffset", 0.0)
    if inner <= 0 or outer <= 0:
        raise ValueError("linSideSlope and logSideSlope must be above 0")
    if style in ("log2", "log10", "linToLog"):
        start = (SMALLEST - lift) / inner
        piece = Piece("log", inner, lift, outer, drop, start=start)
        return Piecewise((Piece("constant", drop=outer * math.log(SMALLEST) + drop), piece))
    forward = Piece("log", inner, lift, outer, drop)
    if style in ("antiLog2", "antiLog10", "logToLin"):
        return Piecewise((forward.inverse(-math.inf),))
    if style not in ("cameraLinToLog", "cameraLogToLin"):
        raise ValueError(f"style is {style!r}, which is none of the format's")
    if "linSideBreak" not in values or inner * values["linSideBreak"] + lift <= 0:
        raise ValueError("a camera's curve needs a linSideBreak at which the logarithm is defined")
    bend = values["linSideBreak"]
    at = float(forward.value(bend))
    slope = values.get("linearSlope", forward.slope(bend))
    if slope <= 0:
        raise ValueError("linearSlope must be above 0")
    line = _line(slope, at - slope * bend)
    after = math.nextafter(bend if style == "cameraLinToLog" else at, math.inf)
    if style == "cameraLinToLog":
        return Piecewise((line, Piece("log", inner, lift, outer, drop, start=after)))
    return Piecewise((line.inverse(-math.inf), forward.inverse(after)))


def _saturated(saturation: float) -> Matrix:
    rows = [[(1 - saturation) * weight + saturation * (i == j) for j, weight in enumerate(LUMA)] for i in range(3)]
    return Matrix(tuple(tuple(row) for row in rows), (0.0, 0.0, 0.0))


PLAIN = ranged(None, None, None, None, clamp=False)
UNIT = ranged(0.0, 1.0, 0.0, 1.0, clamp=True)


def asc_cdl(
    style: str, slope: Sequence[float], offset: Sequence[float], power: Sequence[float], saturation: Sequence[float]
) -> list[Step]:
    """Slope, offset and power of each channel, then saturation; held to [0, 1] between unless the style is NoClamp."""
    if style not in ("Fwd", "Rev", "FwdNoClamp", "RevNoClamp"):
        raise ValueError(f"style is {style!r}; it must be Fwd, Rev, FwdNoClamp or RevNoClamp")
    reverse, clamp, amount = style.startswith("Rev"), "NoClamp" not in style, saturation[0]
    if any(each < (1e-6 if reverse else 0) for each in (*slope, amount)):
        raise ValueError("slopes and saturation must not be negative, nor 0 in reverse")
    if not all(SMALL <= each <= LARGE for each in power):
        raise ValueError(f"powers must be from {SMALL:g} to {LARGE:g}")
    hold: list[Step] = [Curves((UNIT,) * 3)] if clamp else []
    plain = amount == 1
    if reverse:
        back: list[Step] = [] if plain else [_saturated(1 / amount)]
        roots = tuple(exponent("basicPassThruRev", e, 0.0) for e in power)
        lines = tuple(Piecewise((_line(1 / s, -o / s),)) for s, o in zip(slope, offset, strict=True))
        return [*hold, *back, *hold, Curves(roots), Curves(lines), *hold]  # type: ignore[arg-type]
    lines = tuple(Piecewise((_line(s, o),)) for s, o in zip(slope, offset, strict=True))
    powers = tuple(exponent("basicPassThruFwd", e, 0.0) for e in power)
    turned: list[Step] = [] if plain else [_saturated(amount), *hold]
    return [Curves(lines), *hold, Curves(powers), *turned]  # type: ignore[arg-type]
