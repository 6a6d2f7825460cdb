"""The transfer curves that are made of pieces, as their publishers print them, in one table.

Each is the encoding curve; the decoding one follows from it by inversion. `signals` are the places where a decoding
curve changes its formula, where a publisher prints them; `decode` is a decoding curve printed with constants of its
own. Light is relative: 0.18 is mid grey, unless a comment says otherwise; signals are code values over the largest.

Where a standard leaves negative light open the curve is mirrored. Where it ends in a logarithm of 0: one with an offset
goes on by its tangent at signal 0; one without holds light below 2^-126 to that. Where an encoding leaves a gap in the
signal that its publisher does not fill, decoding takes the gap to the light at its foot.

Sources: AMPAS S-2014-003 (ACEScc), S-2016-001 (ACEScct); ARRI, ALEXA Log C Curve, 2017, and LogC4 Specification, 2022;
Apple Log Profile White Paper, 2023; ARIB STD-B67; Blackmagic Generation 5 Color Science, 2021; Canon Log Gamma Curves,
2018; Kodak, Conversion of 10-bit Log Film Data, 1995 (Cineon); DJI D-Log White Paper, 2017; Spaulding et al., RIMM and
ERIMM RGB, 2000; Fujifilm F-Log and F-Log2 Data Sheets, 2022; Baselight T-Log; GoPro Protune, 2013; ITU-R BT.1361-0,
BT.2020-2; ITU-T H.273; Leica L-Log Reference Manual, 2022; Nikon N-Log Specification, 2018; Panasonic V-Log
Reference Manual, 2014; RED Log3G10 and Log3G12, 2017; SMPTE 240M, ST 428-1; Sony S-Log3 Technical Summary, 2014;
Thomson Grass Valley, Viper Filmstream; Xiaomi Mi-Log, 2024; NEMA PS3.14 (DICOM); Adobe RGB (1998).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from lichen.operations.tone.curves import Curve
from lichen.operations.tone.piecewise import SMALLEST, Piece, Piecewise, inverted

GAP = 1e-7
"""Between a piece's end and the next one's start: more than this is a gap in the signal."""
MEETING = 1e-8
"""Pieces that miss each other by less than this meet: they do so to the digits printed."""


@dataclass(frozen=True)
class Definition:
    """A curve and its inverse."""

    pieces: tuple[Piece, ...]
    centre: tuple[float, float] | None = None
    signals: tuple[float, ...] | None = None
    decode: tuple[Piece, ...] | None = None

    def curve(self, encode: bool) -> Piecewise:
        if encode:
            return Piecewise(self.pieces, self.centre)
        back = (self.centre[1], self.centre[0]) if self.centre else None
        return Piecewise(self.decode or self._inverse(), back)

    def undone(self, encode: bool) -> bool:
        """Whether the other direction takes every result back to what it came from."""
        if self.decode is not None or any(piece.body == "constant" for piece in self.pieces):
            return False
        jumps = [by for _, by in Piecewise(self.pieces).jumps]
        meet = all(abs(by) < MEETING for by in jumps)
        return meet or (encode and self.signals is None and all(by > -MEETING for by in jumps))

    def _inverse(self) -> tuple[Piece, ...]:
        """Inverted, with the gaps filled unless the publisher says where formulas change."""
        made = list(inverted(self.pieces, self.signals))
        if self.signals is None:
            for at in range(len(self.pieces) - 1, 0, -1):
                start = self.pieces[at].start
                above = float(self.pieces[at].value(start))
                if above - made[at].start > GAP:  # the generalised inverse: it stays monotone and continuous
                    filled = Piece("constant", drop=start, start=made[at].start)
                    made[at : at + 1] = [filled, replace(made[at], start=above)]
        return tuple(made)


def after(x: float) -> float:
    """The start of a piece where x itself belongs to the one below."""
    return math.nextafter(x, math.inf)


def line(slope: float, added: float = 0.0, start: float = -math.inf) -> Piece:
    return Piece("line", slope, added, start=start)


def log(outer: float, inner: float, lift: float, drop: float, *, base: float = 10.0, start: float = -math.inf) -> Piece:
    """outer log_base(inner x + lift) + drop"""
    return Piece("log", inner, lift, outer / math.log(base), drop, start=start)


def power(exponent: float, outer: float = 1.0, drop: float = 0.0, *, inner: float = 1.0, lift: float = 0.0,
          start: float = -math.inf) -> Piece:  # fmt: skip
    """outer (inner x + lift)^exponent + drop"""
    return Piece("power", inner, lift, outer, drop, exponent, start)


def constant(value: float, start: float = -math.inf) -> Piece:
    return Piece("constant", drop=value, start=start)


def pure(piece: Piece) -> Definition:
    """A curve that ends at light 0 in minus infinity: light below the smallest normal float is held to it."""
    least = constant(float(piece.value(SMALLEST)))
    return Definition((least, replace(piece, start=SMALLEST)), decode=(piece.inverse(-math.inf),))


def offset_log(piece: Piece) -> Definition:
    """A logarithm with an offset: below signal 0 its tangent there."""
    foot = float(piece.inverse(-math.inf).value(0.0))
    slope = piece.slope(foot)
    return Definition((line(slope, -slope * foot), replace(piece, start=foot)), signals=(0.0,))


def film(black: float, white: float, codes: float) -> Definition:
    """Printing density: (white + codes log10(x (1 - b) + b)) / 1023, with b the light of the black code."""
    b = 10 ** ((black - white) / codes)
    return offset_log(log(codes / 1023, 1 - b, b, white / 1023))


def legal(piece: Piece) -> Piece:
    """The signal in the narrow range of 10 bits, over 1023."""
    return replace(piece, outer=piece.outer * 876 / 1023, drop=piece.drop * 876 / 1023 + 64 / 1023)


def reflecting(piece: Piece, by: float = 1 / 0.9) -> Piece:
    """The curve of light that is `by` times as much: publishers who state exposure divide reflection by 0.9."""
    return replace(piece, inner=piece.inner * by, start=piece.start / by)


def canon(outer: float, inner: float, middle: float, narrow: bool) -> Definition:
    piece = reflecting(log(outer, inner, 1.0, 0.0))
    if not narrow:
        return Definition((piece,), centre=(0.0, middle))
    return Definition((replace(piece, outer=piece.outer * 876 / 1023),), centre=(0.0, middle * 876 / 1023 + 64 / 1023))


def canon3(outer: float, slope: float, middle: float, upper: float, signal: float, narrow: bool) -> Definition:
    """A line between two logarithms."""
    scale = 876 / 1023 if narrow else 1.0
    bend = (signal - middle) / slope
    pieces = (
        reflecting(line(slope * scale)),
        reflecting(log(outer * scale, 14.98325, 1.0, (upper - middle) * scale, start=after(bend))),
    )
    centre = (0.0, middle * scale + (64 / 1023 if narrow else 0.0))
    return Definition(pieces, centre, signals=(after((signal - middle) * scale),))


def squared(r0: float, rt: float, sigma: float, beta: float, gamma: float, delta: float) -> Definition:
    """A square, then a logarithm; light below the square's foot is held to it."""
    pieces = (power(2.0, sigma, lift=-r0, start=r0), log(gamma, 1.0, beta, delta, base=2, start=rt))
    back = tuple(piece.inverse(start) for piece, start in zip(pieces, (0.0, sigma * (rt - r0) ** 2), strict=True))
    return Definition((constant(0.0), *pieces), decode=(constant(r0), *back))


def television(slope: float, alpha: float, start: float, scale: float = 1.0) -> Definition:
    """A line and a power of 0.45, mirrored."""
    pieces = (line(slope * scale), power(0.45, alpha * scale, (1 - alpha) * scale, start=start))
    return Definition(pieces, centre=(0.0, 0.0))


def mirrored(*pieces: Piece, about: float = 0.0, signals: Sequence[float] | None = None) -> Definition:
    return Definition(pieces, (about, 0.0), tuple(signals) if signals is not None else None)


def _acescc() -> Definition:
    least, knee = (math.log2(2**-16) + 9.72) / 17.52, (9.72 - 15) / 17.52
    toe = log(1 / 17.52, 0.5, 2**-16, 9.72 / 17.52, base=2, start=0.0)
    body = log(1 / 17.52, 1.0, 0.0, 9.72 / 17.52, base=2, start=2**-15)
    top = constant(65504.0, (math.log2(65504) + 9.72) / 17.52)
    return Definition((constant(least), toe, body), decode=(toe.inverse(-math.inf), body.inverse(knee), top))


def _logc4() -> Definition:
    a, b, c = (2**18 - 16) / 117.45, (1023 - 95) / 1023, 95 / 1023
    s = 7 * math.log(2) * 2 ** (7 - 14 * c / b) / (a * b)
    t = (2 ** (14 * (-c / b) + 6) - 64) / a
    return Definition((line(1 / s, -t / s), log(b / 14, a, 64.0, c - 6 * b / 14, base=2, start=t)), signals=(0.0,))


def _tlog() -> Definition:
    w, g, o = 128.0, 16.0, 0.075
    b = 1 / (0.7107 + 1.2359 * math.log(w * g))
    gs = g / (1 - o)
    c = b / gs
    a = 1 - b * math.log(w + c)
    s = (1 - o) / (1 - (a + b * math.log(c)))
    return Definition((line(gs * s, o), log(b * s, 1.0, c, 1 + (a - 1) * s, base=math.e, start=0.0)), signals=(o,))


def _slog(by: float) -> Definition:
    pieces = (line(5.0, 0.030001222851889303), log(0.432699, 1.0, 0.037584, 0.646596, start=0.0))
    under = replace(pieces[0], outer=876 / 1023, drop=64 / 1023)
    return Definition((reflecting(under, by), reflecting(legal(pieces[1]), by)))


def _erimm() -> Definition:
    least, most = 0.001, 316.2
    span = math.log(most) - math.log(least)
    bend = math.e * least
    body = log(1 / span, 1.0, 0.0, -math.log(least) / span, base=math.e, start=after(bend))
    return mirrored(line(1 / span / bend), body)


def _bt1361() -> Definition:
    below = power(0.45, -1.099 / 4, 0.099 / 4, inner=-4.0)
    return Definition((below, line(4.5, start=after(-0.0045)), power(0.45, 1.099, -0.099, start=0.018)))


LOGC3: Mapping[int, tuple[float, ...]] = {
    160: (0.005561, 5.555556, 0.080216, 0.269036, 0.381991, 5.842037, 0.092778),
    200: (0.006208, 5.555556, 0.076621, 0.266007, 0.382478, 5.776265, 0.092782),
    250: (0.006871, 5.555556, 0.072941, 0.262978, 0.382966, 5.710494, 0.092786),
    320: (0.007622, 5.555556, 0.068768, 0.259627, 0.383508, 5.637732, 0.092791),
    400: (0.008318, 5.555556, 0.064901, 0.256598, 0.383999, 5.571960, 0.092795),
    500: (0.009031, 5.555556, 0.060939, 0.253569, 0.384493, 5.506188, 0.092800),
    640: (0.009840, 5.555556, 0.056443, 0.250219, 0.385040, 5.433426, 0.092805),
    800: (0.010591, 5.555556, 0.052272, 0.247190, 0.385537, 5.367655, 0.092809),
    1000: (0.011361, 5.555556, 0.047996, 0.244161, 0.386036, 5.301883, 0.092814),
    1280: (0.012235, 5.555556, 0.043137, 0.240810, 0.386590, 5.229121, 0.092819),
    1600: (0.013047, 5.555556, 0.038625, 0.237781, 0.387093, 5.163350, 0.092824),
}
"""cut, a, b, c, d, e, f by exposure index: SUP 3.x, of linear scene exposure"""


def logc3(exposure_index: int) -> Definition:
    cut, a, b, c, d, e, f = LOGC3[exposure_index]
    return Definition((line(e, f), log(c, a, b, d, start=after(cut))))


def st428(white: float) -> Definition:
    """Light in units of `white`, cd/m2."""
    return mirrored(power(1 / 2.6, inner=white / 52.37))


def gsdf(white: float) -> Definition:
    """Light in units of `white`, cd/m2. Held to the standard's domain, 0.05 cd/m2 to JND index 1023."""
    forward, back = Piece("gsdf_signal", white, outer=1 / 1023), Piece("gsdf_light", 1023.0, outer=1 / white)
    lowest, highest = 0.05 / white, float(back.value(1.0))
    return Definition(
        (constant(float(forward.value(lowest))), replace(forward, start=lowest),
         constant(float(forward.value(highest)), highest)),
        decode=(constant(float(back.value(1 / 1023))), replace(back, start=1 / 1023), constant(highest, after(1.0))),
    )  # fmt: skip


B67 = (0.17883277, 0.28466892, 0.55991073)
BRIGHT = 171.2102946929
"""Sony's printed code where S-Log3 leaves its line"""

TABLE: Mapping[Curve, Definition] = {
    Curve.BT2020: television(4.5, 1.09929682680944, 0.018053968510807),
    Curve.BT2020_12: television(4.5, 1.0993, 0.0181),
    Curve.BT1361: _bt1361(),
    Curve.SMPTE_240M: television(4.0, 1.1115, 0.0228),
    Curve.ARIB_B67: mirrored(power(0.5, 0.5), log(B67[0], 1.0, -B67[1], B67[2], base=math.e, start=after(1.0))),
    Curve.H273_LOG: Definition(
        (constant(0.0), log(1 / 2, 1.0, 0.0, 1.0, start=0.01)),
        decode=(constant(0.0), log(1 / 2, 1.0, 0.0, 1.0).inverse(0.0)),
    ),
    Curve.H273_LOG_SQRT: Definition(
        (constant(0.0), log(1 / 2.5, 1.0, 0.0, 1.0, start=math.sqrt(10) / 1000)),
        decode=(constant(0.0), log(1 / 2.5, 1.0, 0.0, 1.0).inverse(0.0)),
    ),
    Curve.ADOBE_RGB: mirrored(power(256 / 563)),
    Curve.ROMM: mirrored(line(16.0), power(1 / 1.8, start=16 ** (1.8 / (1 - 1.8)))),
    Curve.RIMM: television(4.5, 1.099, 0.018, 1 / (1.099 * 2**0.45 - 0.099)),
    Curve.ERIMM: _erimm(),
    Curve.ACESCC: _acescc(),
    Curve.ACESCCT: Definition(
        (line(10.5402377416545, 0.0729055341958355),
         log(1 / 17.52, 1.0, 0.0, 9.72 / 17.52, base=2, start=after(0.0078125))),
        signals=(after(0.155251141552511),),
    ),
    Curve.APPLE_LOG: squared(-0.05641088, 0.01, 47.28711236, 0.00964052, 0.08550479, 0.69336945),
    Curve.ARRI_LOGC4: _logc4(),
    Curve.BLACKMAGIC_FILM_5: Definition(
        (line(8.283605932402494, 0.09246575342465753),
         log(0.08692876065491224, 1.0, 0.005494072432257808, 0.5300133392291939, base=math.e, start=0.005)),
    ),
    Curve.CANON_LOG: canon(0.45310179, 10.1596, 0.12512248, narrow=False),
    Curve.CANON_LOG_V1: canon(0.529136, 10.1596, 0.0730597, narrow=True),
    Curve.CANON_LOG2: canon(0.24136077, 87.09937546, 0.092864125, narrow=False),
    Curve.CANON_LOG2_V1: canon(0.281863093, 87.09937546, 0.035388128, narrow=True),
    Curve.CANON_LOG3: canon3(0.36726845, 1.9754798, 0.12512219, 0.12240537, 0.15277891, narrow=False),
    Curve.CANON_LOG3_V1: canon3(0.42889912, 2.3069815, 0.073059361, 0.069886632, 0.105357102, narrow=True),
    Curve.CINEON: film(95, 685, 300),
    Curve.DAVINCI_INTERMEDIATE: Definition(
        (line(10.44426855), log(0.07329248, 1.0, 0.0075, 7 * 0.07329248, base=2, start=after(0.00262409))),
        signals=(after(0.02740668),),
    ),
    Curve.DJI_DLOG: Definition(
        (line(6.025, 0.0929), log(0.256663, 0.9892, 0.0108, 0.584555, start=after(0.0078))),
        decode=(line(6.025, 0.0929).inverse(-math.inf),
                Piece("exp", 3.89616 * math.log(10), -2.27752 * math.log(10), 1 / 0.9892, -0.0108 / 0.9892,
                      start=after(0.14))),
    ),
    Curve.FILMIC_PRO6: pure(Piece("rootlog", outer=0.371, drop=0.371 * 1.69542)),
    Curve.FILMLIGHT_TLOG: _tlog(),
    Curve.FLOG: Definition(
        (line(8.735631, 0.092864), log(0.344676, 0.555556, 0.009468, 0.790453, start=0.00089)),
        signals=(0.100537775223865,),
    ),
    Curve.FLOG2: Definition(
        (line(8.799461, 0.092864), log(0.245281, 5.555556, 0.064829, 0.384316, start=0.000889)),
        signals=(0.100686685370811,),
    ),
    Curve.GOPRO_PROTUNE: offset_log(log(1 / math.log10(113), 112.0, 1.0, 0.0)),
    Curve.LEICA_LLOG: Definition(
        (line(8.0, 0.09), log(0.27, 1.3, 0.0115, 0.6, start=after(0.006))), signals=(after(0.138),)
    ),
    Curve.LOG2: pure(log(1 / 13, 1 / 0.18, 0.0, 0.5, base=2)),
    Curve.MI_LOG: squared(-0.09023729, 0.01974185, 18.10531998, 0.01384578, 0.09271529, 0.6729185),
    Curve.NIKON_NLOG: mirrored(
        power(1 / 3, 650 / 1023),
        log(150 / 1023, 1.0, -0.0075, 619 / 1023, base=math.e, start=0.328 + 0.0075),
        about=-0.0075, signals=(452 / 1023,),
    ),
    Curve.PANALOG: film(64, 681, 444),
    Curve.PLOG: pure(log(0.6 / 0.002 / 1023, 1 / 0.18, 0.0, 445 / 1023)),
    Curve.RED_LOG: film(0, 1023, 511),
    Curve.RED_LOGFILM: film(95, 685, 300),
    Curve.RED_LOG3G10: Definition(
        (line(15.1927, 0.151927), log(0.224282, 155.975327, 2.55975327, 0.0, start=-0.01)), signals=(0.0,)
    ),
    Curve.RED_LOG3G10_V1: mirrored(log(0.222497, 169.379333, 1.0, 0.0)),
    Curve.RED_LOG3G10_V2: mirrored(log(0.224282, 155.975327, 1.0, 0.0), about=-0.01),
    Curve.RED_LOG3G12: mirrored(log(0.184904, 347.189667, 1.0, 0.0)),
    Curve.SLOG: _slog(1 / 0.9),
    Curve.SLOG2: _slog(155 / 219 / 0.9),
    Curve.SLOG3: Definition(
        (line((BRIGHT - 95) / 0.01125 / 1023, 95 / 1023),
         log(261.5 / 1023, 1 / 0.19, 0.01 / 0.19, 420 / 1023, start=0.01125)),
        signals=(BRIGHT / 1023,),
    ),
    Curve.VIPER_LOG: pure(log(500 / 1023, 1.0, 0.0, 1.0)),
    Curve.VLOG: Definition(
        (line(5.6, 0.125), log(0.241514, 1.0, 0.00873, 0.598206, start=0.01)), signals=(0.181,)
    ),
}  # fmt: skip


def definition(curve: Curve, *, white: float, exposure_index: int) -> Definition:
    """A curve's definition. `white` is the light, in cd/m2, that linear 1 stands for."""
    if curve is Curve.ARRI_LOGC3:
        return logc3(exposure_index)
    if curve is Curve.ST428:
        return st428(white)
    return gsdf(white) if curve is Curve.DICOM_GSDF else TABLE[curve]
