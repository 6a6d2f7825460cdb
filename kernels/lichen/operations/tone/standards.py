"""The six transfer functions of `curves.py` as their standards print them, with the symbols they use, in float64.

Sources: IEC 61966-2-1:1999; ITU-R BT.709-6; ITU-R BT.1886 Annex 1; SMPTE ST 2084:2014; ITU-R BT.2100-2.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.memory import Array
from lichen.operations.tone.curves import Curve

Gamma = float | tuple[float, ...]


def _srgb(x: Array, decode: bool, gamma: Gamma, white: float) -> Array:
    if decode:
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def _gamma(x: Array, decode: bool, gamma: Gamma, white: float) -> Array:
    exponents = np.array(gamma)
    return np.power(x, exponents if decode else 1 / exponents)


def _bt709(x: Array, decode: bool, gamma: Gamma, white: float) -> Array:
    if decode:
        return np.where(x <= 0.081, x / 4.5, np.maximum(((x + 0.099) / 1.099) ** (1 / 0.45), 0.018))
    return np.where(x < 0.018, 4.5 * x, 1.099 * x**0.45 - 0.099)


def _pq(x: Array, decode: bool, gamma: Gamma, white: float) -> Array:
    m1, m2 = 2610 / 16384, 2523 / 4096 * 128
    c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    if decode:
        root = x ** (1 / m2)
        pole = c2 - c3 * root
        y = np.where(pole <= 0, np.inf, (np.maximum(root - c1, 0) / pole) ** (1 / m1))
        light: Array = np.where(np.isinf(x), x, np.minimum(10000 * y, 1e10) / white)
        return light
    power = (x * white / 10000) ** m1
    return np.power(np.where(np.isinf(x), c2 / c3, (c1 + c2 * power) / (1 + c3 * power)), m2)


def _hlg(x: Array, decode: bool, gamma: Gamma, white: float) -> Array:
    a = 0.17883277
    b, c = 1 - 4 * a, 0.5 - a * math.log(4 * a)
    if decode:
        return np.where(x <= 1 / 2, x**2 / 3, (np.exp((x - c) / a) + b) / 12)
    return np.where(x <= 1 / 12, np.sqrt(3 * x), a * np.log(12 * x - b) + c)


STANDARDS = {Curve.SRGB: _srgb, Curve.GAMMA: _gamma, Curve.BT709: _bt709, Curve.PQ: _pq, Curve.HLG: _hlg}
"""For x >= 0; whoever calls puts the sign back."""


def bt1886(x: Array, decode: bool, white: float, black: float, clamped: bool) -> Array:
    """L = a max(V + b, 0)^2.4, whose power is continued oddly where negative values are mirrored."""
    gamma = 2.4
    span = white ** (1 / gamma) - black ** (1 / gamma)
    a, b = span**gamma, black ** (1 / gamma) / span
    base = x + b if decode else x * white / a
    if clamped:
        base = np.maximum(base, 0)
    power = np.sign(base) * np.power(np.abs(base), gamma if decode else 1 / gamma)
    result: Array = power * a / white if decode else power - b
    return result
