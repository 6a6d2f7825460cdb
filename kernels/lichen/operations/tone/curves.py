"""Transfer curves in the form in which they are computed.

Every curve, in both directions, is one odd function with a shift:

    a = |x + shift|,  y = toe(a) below the knee, else max(body(a), floor),  result = sign(x + shift) y + offset

where the toe is linear, a root or a square and the body is a power, the PQ quotient, an exponential or a logarithm. A
`Form` holds the numbers of one such function; its methods evaluate it in float64 for tables, ranges and bounds. The
definitions as the standards print them are the truth in `transfer.py`; the forms equal them as real functions and
differ in how they round. The rules behind the rewriting:

* PQ. Since c1 = c3 - c2 + 1, both differences in the quotient start from the same q = 1 - c1 = c2 - c3 = 21/128. With
  w = expm1(ln N / m2) the light is ((q + w) / (q - c3 w))^(1/m1): nothing cancels at the bright end. Encoding takes
  p = Y^m1 and ln N = 2 m2 atanh(s) with s = q (p - 1) / ((2 - q) + (2 c3 + q) p), so the exponent 78.84 amplifies the
  rounding of a small number and not that of a number near 1.
* HLG. Since b = 1 - 4a and c = 1/2 - a ln 4a, the upper branch is 1/2 + a ln t with t = 1 + (12 E - 1) / 4a: both
  branches meet in 1/2 by construction, and the inverse subtracts 1/2, which is exact.
* BT.709. The printed constants leave a gap of 2.5e-4 in the signal at the knee. No light gives a signal inside the
  gap, so decoding takes it to the knee itself (the generalised inverse): `floor`. It stays monotone and continuous.

Sources: IEC 61966-2-1:1999; ITU-R BT.709-6; ITU-R BT.1886 Annex 1; SMPTE ST 2084:2014; ITU-R BT.2100-2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import numpy as np
import numpy.typing as npt

from lichen.memory import Array


class Curve(StrEnum):
    """A transfer function. The first six are computed by forms of their own; the rest are pieces, `definitions.py`."""

    SRGB = "srgb"
    """IEC 61966-2-1"""
    GAMMA = "gamma"
    """a pure power"""
    BT709 = "bt709"
    """the camera curve of ITU-R BT.709-6 and its inverse; BT.601 and 10-bit BT.2020 print the same"""
    BT1886 = "bt1886"
    """the reference display of ITU-R BT.1886 and its inverse"""
    PQ = "pq"
    """SMPTE ST 2084, ITU-R BT.2100"""
    HLG = "hlg"
    """the camera curve of hybrid log-gamma, ITU-R BT.2100, and its inverse, without the display's system gamma"""
    BT2020 = "bt2020"
    BT2020_12 = "bt2020_12"
    BT1361 = "bt1361"
    SMPTE_240M = "smpte_240m"
    ARIB_B67 = "arib_b67"
    H273_LOG = "h273_log"
    H273_LOG_SQRT = "h273_log_sqrt"
    ST428 = "st428"
    DICOM_GSDF = "dicom_gsdf"
    ADOBE_RGB = "adobe_rgb"
    ROMM = "romm"
    RIMM = "rimm"
    ERIMM = "erimm"
    ACESCC = "acescc"
    ACESCCT = "acescct"
    APPLE_LOG = "apple_log"
    ARRI_LOGC3 = "arri_logc3"
    ARRI_LOGC4 = "arri_logc4"
    BLACKMAGIC_FILM_5 = "blackmagic_film_5"
    CANON_LOG = "canon_log"
    CANON_LOG_V1 = "canon_log_v1"
    CANON_LOG2 = "canon_log2"
    CANON_LOG2_V1 = "canon_log2_v1"
    CANON_LOG3 = "canon_log3"
    CANON_LOG3_V1 = "canon_log3_v1"
    CINEON = "cineon"
    DAVINCI_INTERMEDIATE = "davinci_intermediate"
    DJI_DLOG = "dji_dlog"
    FILMIC_PRO6 = "filmic_pro6"
    FILMLIGHT_TLOG = "filmlight_tlog"
    FLOG = "flog"
    FLOG2 = "flog2"
    GOPRO_PROTUNE = "gopro_protune"
    LEICA_LLOG = "leica_llog"
    LOG2 = "log2"
    MI_LOG = "mi_log"
    NIKON_NLOG = "nikon_nlog"
    PANALOG = "panalog"
    PLOG = "plog"
    RED_LOG = "red_log"
    RED_LOGFILM = "red_logfilm"
    RED_LOG3G10 = "red_log3g10"
    RED_LOG3G10_V1 = "red_log3g10_v1"
    RED_LOG3G10_V2 = "red_log3g10_v2"
    RED_LOG3G12 = "red_log3g12"
    SLOG = "slog"
    SLOG2 = "slog2"
    SLOG3 = "slog3"
    VIPER_LOG = "viper_log"
    VLOG = "vlog"


WHOLE = (Curve.SRGB, Curve.GAMMA, Curve.BT709, Curve.BT1886, Curve.PQ, Curve.HLG)
"""Curves that have a `Form`."""


class Direction(StrEnum):
    """Which way through the curve."""

    DECODE = "decode"
    """signal to linear light"""
    ENCODE = "encode"
    """linear light to signal"""


PQ_M1 = 2610 / 16384
PQ_M2 = 2523 / 32
PQ_C1 = 3424 / 4096
PQ_C2 = 2413 / 128
PQ_C3 = 2392 / 128
PQ_Q = 1 - PQ_C1
"""equals PQ_C2 - PQ_C3, exactly, also in floating point"""
PQ_PEAK = 10000.0
"""cd/m2 of signal 1"""
PQ_CEILING = 1e10
"""cd/m2 where decoding saturates: six times the sun's disc. The curve itself has a pole at signal 1.9921."""
PQ_LIMIT = (PQ_C2 / PQ_C3) ** PQ_M2
"""the signal of infinite light: the pole"""
PQ_BLACK = PQ_C1**PQ_M2
"""the signal of no light, 7.31e-7; everything below it decodes to 0"""

HLG_A = 0.17883277
HLG_B = 1 - 4 * HLG_A
HLG_C = 0.5 - HLG_A * math.log(4 * HLG_A)

BT1886_GAMMA = 2.4
FLOAT_MAX = float(np.finfo(np.float32).max)


def pq_ceiling_signal() -> float:
    """The signal of `PQ_CEILING`; 1.8396."""
    p = (PQ_CEILING / PQ_PEAK) ** PQ_M1
    return float(((PQ_C1 + PQ_C2 * p) / (1 + PQ_C3 * p)) ** PQ_M2)


@dataclass(frozen=True, slots=True)
class Form:
    """One curve in one direction, as computed; see the module's rules. Applies to any float64 array."""

    body: Literal["power", "pq_decode", "pq_encode", "exponential", "logarithm"]
    toe: Literal["linear", "root", "square"] = "linear"
    toe_scale: float = 0.0
    """the toe is toe_scale times a, its root or its square"""
    knee: float = 0.0
    """the toe holds for a < knee"""
    floor: float = -math.inf
    inner: float = 1.0
    """a power's base, or a logarithm's argument, is inner a + lift"""
    lift: float = 0.0
    exponent: float = 1.0
    outer: float = 1.0
    """a power, and the light of the PQ quotient, is multiplied by this; then drop is added"""
    drop: float = 0.0
    shift: float = 0.0
    offset: float = 0.0
    convex: bool = True
    """the slope never falls as a grows; otherwise it never rises"""
    jump: float = 0.0
    """how far the two branches miss each other at the knee or at zero"""
    top: float = 1.0
    """the largest `a` of a nominal picture, a power of two"""

    def magnitude(self, distance: npt.ArrayLike) -> Array:
        """y for distances a >= 0, float64."""
        a = np.asarray(distance, dtype=np.float64)
        with np.errstate(all="ignore"):
            return np.where(a < self.knee, self._toe(a), np.maximum(self.upper(a), self.floor))

    def value(self, x: float) -> float:
        """The result for a scalar, negative values mirrored."""
        size = float(self.magnitude(abs(x + self.shift)))
        return math.copysign(size, x + self.shift if x + self.shift else 1.0) + self.offset

    def _toe(self, a: Array) -> Array:
        if self.toe == "linear":
            return self.toe_scale * a
        return self.toe_scale * (np.sqrt(a) if self.toe == "root" else a * a)

    def upper(self, distance: npt.ArrayLike) -> Array:
        """The body alone, also below the knee where it is defined."""
        a: Array = np.asarray(distance, dtype=np.float64)
        with np.errstate(all="ignore"):
            if self.body == "power":
                return self.outer * np.maximum(self.inner * a + self.lift, 0) ** self.exponent + self.drop
            if self.body == "exponential":
                return self.outer * np.exp((a - 0.5) * self.exponent) + self.drop
            if self.body == "logarithm":
                return self.outer * np.log(np.maximum(self.inner * a + self.lift, 0)) + self.drop
            if self.body == "pq_encode":
                p = (a * self.inner) ** PQ_M1
                u = np.where(p < np.inf, PQ_Q * (p - 1) / (1 + PQ_C3 * p), PQ_Q / PQ_C3)
                return np.exp(PQ_M2 * np.log1p(np.where(np.isnan(a), a, u)))
            w = np.expm1(np.log(np.minimum(a, pq_ceiling_signal())) / PQ_M2)
            light = self.outer * (np.maximum(PQ_Q + w, 0) / (PQ_Q - PQ_C3 * w)) ** (1 / PQ_M1)
            return np.where(np.isinf(a), a, light)

    def slope(self, distance: npt.ArrayLike) -> Array:
        """The derivative of the body at a >= 0; infinite where the curve is vertical."""
        a: Array = np.asarray(distance, dtype=np.float64)
        with np.errstate(all="ignore"):
            if self.body == "power":
                base = np.maximum(self.inner * a + self.lift, 0)
                return self.outer * self.inner * self.exponent * base ** (self.exponent - 1)
            if self.body == "exponential":
                return self.outer * self.exponent * np.exp((a - 0.5) * self.exponent)
            if self.body == "logarithm":
                return self.outer * self.inner / np.maximum(self.inner * a + self.lift, 0)
            if self.body == "pq_encode":
                p = (a * self.inner) ** PQ_M1
                bend = PQ_M2 * PQ_M1 * p * (PQ_C2 - PQ_C1 * PQ_C3) / ((1 + PQ_C3 * p) * (PQ_C1 + PQ_C2 * p))
                return np.where(a > 0, self.upper(a) * bend / a, np.inf)
            w = np.expm1(np.log(np.minimum(a, pq_ceiling_signal())) / PQ_M2)
            bend = (w + 1) * (1 / np.maximum(PQ_Q + w, 0) + PQ_C3 / (PQ_Q - PQ_C3 * w)) / (PQ_M1 * PQ_M2)
            return np.where(w > -PQ_Q, self.upper(a) * bend / a, 0.0)

    @property
    def reach(self) -> float:
        """The distance from which on float32 cannot hold what an exponential makes of it; powers grow less steep."""
        if self.body != "exponential":
            return math.inf
        return 0.5 + math.log(FLOAT_MAX / self.outer) / self.exponent

    def steepness(self, a: float) -> float:
        """How much larger the relative rounding of y is than that of what it is computed from, at a >= knee.

        It is the condition number, at least 1; for encoding PQ, which ends in an exponential, twice the exponent; for
        decoding it, whose root is nearly 1 everywhere, that of the quotient and of what the root lies away from 1.
        """
        y, rise = float(self.upper(a)), float(self.slope(a))
        if self.body == "pq_encode":
            return 1 + 2 * abs(math.log(y)) if y > 0 else 1.0
        condition = max(1.0, a * rise / y) if 0 < y < math.inf and math.isfinite(rise) else 1.0
        if self.body == "pq_decode" and 0 < y < math.inf:
            w = math.expm1(math.log(min(a, pq_ceiling_signal())) / PQ_M2)
            return max(condition, (1 + abs(w) / (PQ_Q + w) + PQ_C3 * abs(w) / (PQ_Q - PQ_C3 * w)) / PQ_M1)
        return condition

    def modulus(self, low: float, high: float, change: float) -> float:
        """The largest change of the result when x in [low, high] changes by at most `change`, negatives mirrored."""
        low, high = low + self.shift, high + self.shift
        far = max(abs(low), abs(high)) + change
        near = max(low - change, -high - change, 0.0)
        jump = self.jump if near <= self.knee <= far else 0.0
        if self.convex:
            toe = self.toe_scale * (1.0 if self.toe == "linear" else 2 * min(far, self.knee))
            steepest = min(far, pq_ceiling_signal()) if self.body == "pq_decode" else far  # beyond it PQ is flat
            return change * max(toe, float(self.slope(steepest)) if far >= self.knee else 0.0) + jump
        # Concave on both sides of zero, so the steepest stretch lies symmetrically around it.
        times, begin, end = (1, near, near + change) if near > 0 else (2, 0.0, change / 2)
        below, above = self.magnitude((begin, end)).tolist()
        return float(times * (above - below) + jump)


def form(curve: Curve, direction: Direction, *, gamma: float, white: float, black: float) -> Form:
    """The form of a curve. `gamma` is the decoding exponent of curve=gamma; `white` and `black` are in cd/m2."""
    decode = direction is Direction.DECODE
    if curve is Curve.GAMMA:
        power = gamma if decode else 1 / gamma
        return Form("power", exponent=power, convex=power >= 1)
    if curve is Curve.SRGB:
        return _srgb_decode() if decode else _srgb_encode()
    if curve is Curve.BT709:
        return _bt709_decode() if decode else _bt709_encode()
    if curve is Curve.BT1886:
        return _bt1886(decode, white, black)
    if curve is Curve.HLG:
        return _hlg_decode() if decode else _hlg_encode()
    if decode:
        return Form("pq_decode", outer=PQ_PEAK / white)
    top = 2.0 ** math.ceil(math.log2(PQ_PEAK / white))
    return Form("pq_encode", inner=white / PQ_PEAK, convex=False, jump=2 * PQ_BLACK, top=top)


# The standards differ in whether the toe holds at the knee itself: sRGB says yes, BT.709 no.


def _srgb_decode() -> Form:
    knee = math.nextafter(0.04045, 1)
    return Form("power", toe_scale=1 / 12.92, knee=knee, inner=1 / 1.055, lift=0.055 / 1.055, exponent=2.4, jump=2.4e-9)


def _srgb_encode() -> Form:
    knee = math.nextafter(0.0031308, 1)
    return Form(
        "power", toe_scale=12.92, knee=knee, exponent=1 / 2.4, outer=1.055, drop=-0.055, convex=False, jump=3e-8
    )


def _bt709_decode() -> Form:
    knee = math.nextafter(0.081, 1)
    return Form(
        "power", toe_scale=1 / 4.5, knee=knee, floor=0.018, inner=1 / 1.099, lift=0.099 / 1.099, exponent=1 / 0.45
    )


def _bt709_encode() -> Form:
    return Form("power", toe_scale=4.5, knee=0.018, exponent=0.45, outer=1.099, drop=-0.099, convex=False, jump=2.5e-4)


def _bt1886(decode: bool, white: float, black: float) -> Form:
    """Light over the white luminance. With n = 1 - (black / white)^(1/2.4) it is (n x + 1 - n)^2.4."""
    foot = (black / white) ** (1 / BT1886_GAMMA)
    span = 1 - foot
    if decode:
        return Form("power", shift=foot / span, exponent=BT1886_GAMMA, inner=span)
    return Form("power", exponent=1 / BT1886_GAMMA, outer=1 / span, offset=-foot / span, convex=False)


def _hlg_decode() -> Form:
    return Form(
        "exponential", toe="square", toe_scale=1 / 3, knee=math.nextafter(0.5, 1),
        exponent=1 / HLG_A, outer=4 * HLG_A / 12, drop=HLG_B / 12,
    )  # fmt: skip


def _hlg_encode() -> Form:
    return Form(
        "logarithm", toe="root", toe_scale=math.sqrt(3), knee=math.nextafter(1 / 12, 1), convex=False,
        inner=3 / HLG_A, lift=1 - 1 / (4 * HLG_A), outer=HLG_A, drop=0.5,
    )  # fmt: skip
