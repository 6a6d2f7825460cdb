"""The functions that pieces of transfer curves are made of, in float64, and what float32 makes of them.

`own` is the error of K's float32 evaluation, in units of K, for an argument that is exact: what the logarithm, the
exponential and the power of both backends are off by, from the measured figures in numeric.clh and NumPy's (4 ULP at
most), and the roundings on the way.

* gsdf_signal, gsdf_light: DICOM PS3.14, JND index of luminance and back: a polynomial in log10 L, and 10 to a quotient
  of polynomials in ln j. Both cancel by a factor of 200, so they are taken in double precision of a float32 logarithm.
* rootlog, rootlog_inverse: sqrt t + k ln t, k = 0.28257, and back. With s = sqrt t that is s + 2 k ln s = z; in
  u = ln s, e^u + 2 k u = z is convex, so Newton's steps from above the solution fall towards it and none passes it.

Sources: NEMA PS3.14, Grayscale Standard Display Function, section 7; FiLMiC Inc., FiLMiC Pro 6 log, 2017.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array
from lichen.operation import ROUNDING

Function = Callable[[Array, float], Array]


@dataclass(frozen=True, slots=True)
class Body:
    """K, its derivative, its own error in float32, its inverse's name, and its cost in powers. K takes its argument and
    an exponent, which all but the power leave alone."""

    value: Function
    slope: Function
    own: Function
    inverse: str
    cost: float


JND_OF_LUMINANCE = (
    71.498068, 94.593053, 41.912053, 9.8247004, 0.28175407, -1.1878455, -0.18014349, 0.14710899, -0.017046845,
)  # fmt: skip
"""of log10 L, lowest order first"""
LUMINANCE_OF_JND = (
    (-1.3011877, 0.080242636, 0.13646699, -0.025468404, 0.0013635334),
    (1.0, -0.025840191, -0.10320229, 0.02874562, -0.0031978977, 0.00012992634),
)
"""of ln j, lowest order first: above and below the fraction bar"""
ROOTLOG = 0.28257
STEPS = 8
"""Newton's, after which float64 has converged for every z."""


def polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    """Of two coefficients or more, lowest order first."""
    y = coefficients[-1] * x + coefficients[-2]
    for each in coefficients[-3::-1]:
        y = y * x + each
    return y


@lru_cache
def derivative(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(order * each for order, each in enumerate(coefficients) if order)


def _gsdf_exponent(t: Array) -> Array:
    j = np.log(t)
    return polynomial(LUMINANCE_OF_JND[0], j) / polynomial(LUMINANCE_OF_JND[1], j)


def _gsdf_bend(t: Array) -> Array:
    """The exponent's derivative in ln j."""
    j = np.log(t)
    above, below = LUMINANCE_OF_JND
    p, q = polynomial(above, j), polynomial(below, j)
    made: Array = (polynomial(derivative(above), j) * q - p * polynomial(derivative(below), j)) / (q * q)
    return made


def _gsdf_own(t: Array, _: float) -> Array:
    exponent = _gsdf_exponent(t)
    made: Array = ROUNDING * 10**exponent * (5 + LN10 * 3 * (np.abs(exponent) + np.abs(np.log(t) * _gsdf_bend(t))))
    return made


def solved(z: Array, steps: int = STEPS) -> Array:
    """u of e^u + 2 k u = z, in the precision of z."""
    k = z.dtype.type(2 * ROOTLOG)
    one = z.dtype.type(1)
    u = np.where(z > 1, np.log(np.maximum(z, one)), np.minimum(z / k, (z - one) / (one + k)))
    for _ in range(steps):
        power = np.exp(u)
        u = u - (power + k * u - z) / (power + k)
    return np.where(np.isinf(z), z, u).astype(z.dtype, copy=False)


def _rootlog_own(z: Array, _: float) -> Array:
    u = solved(z)
    root = np.exp(u)
    off = 4 * (np.abs(z) + 2 * ROOTLOG * np.abs(u) + root) / (root + 2 * ROOTLOG)
    made: Array = ROUNDING * root * root * (2 * off + 4 * np.abs(u) + 4)
    return made


def _steep(t: Array, e: float) -> Array:
    made: Array = e * np.power(np.maximum(t, 0), e - 1)
    return made


LN10 = float(np.log(10))

BODIES: dict[str, Body] = {
    "line": Body(lambda t, e: t, lambda t, e: np.ones_like(t), lambda t, e: np.zeros_like(t), "line", 0.1),
    "constant": Body(lambda t, e: t, lambda t, e: np.zeros_like(t), lambda t, e: np.zeros_like(t), "constant", 0.1),
    "log": Body(
        lambda t, e: np.log(np.maximum(t, 0)),
        lambda t, e: 1 / np.maximum(t, 0),
        lambda t, e: ROUNDING * 3 * np.abs(np.log(t)),
        "exp", 0.8,
    ),
    "exp": Body(
        lambda t, e: np.exp(t),
        lambda t, e: np.exp(t),
        lambda t, e: ROUNDING * np.exp(t) * (5 + 3 * np.abs(t)),
        "log", 0.8,
    ),
    "power": Body(
        lambda t, e: np.power(np.maximum(t, 0), e),
        _steep,
        lambda t, e: ROUNDING * np.power(np.maximum(t, 0), e) * (8 + 3 * e + e * np.abs(np.log(np.maximum(t, 1e-300)))),
        "power", 1.0,
    ),
    "gsdf_signal": Body(
        lambda t, e: polynomial(JND_OF_LUMINANCE, np.log10(t)),
        lambda t, e: polynomial(derivative(JND_OF_LUMINANCE), np.log10(t)) / (t * LN10),
        lambda t, e: ROUNDING * (
            3 * np.abs(np.log10(t) * polynomial(derivative(JND_OF_LUMINANCE), np.log10(t)))
            + 2 * np.abs(polynomial(JND_OF_LUMINANCE, np.log10(t)))
        ),
        "gsdf_light", 4.0,
    ),
    "gsdf_light": Body(
        lambda t, e: 10 ** _gsdf_exponent(t),
        lambda t, e: 10 ** _gsdf_exponent(t) * LN10 * _gsdf_bend(t) / t,
        _gsdf_own,
        "gsdf_signal", 4.0,
    ),
    "rootlog": Body(
        lambda t, e: np.sqrt(t) + ROOTLOG * np.log(t),
        lambda t, e: 0.5 / np.sqrt(t) + ROOTLOG / t,
        lambda t, e: ROUNDING * (2 * np.sqrt(t) + 4 * ROOTLOG * np.abs(np.log(t))),
        "rootlog_inverse", 1.2,
    ),
    "rootlog_inverse": Body(
        lambda t, e: np.exp(2 * solved(t)),
        lambda t, e: 2 * np.exp(2 * solved(t)) / (np.exp(solved(t)) + 2 * ROOTLOG),
        _rootlog_own,
        "rootlog", 8.0,
    ),
}  # fmt: skip
"""By the name that the kernel's functions bear too."""
