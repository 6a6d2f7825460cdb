"""Tone curves as rational functions: y = x (a x + b) / (x (c x + d) + e) for light x >= 0.

All coefficients but the ACES fit's are positive or zero, so nothing cancels and every evaluation is accurate relative
to its result. Hable's curve is printed as a difference, h(x) = (x (A x + C B) + D E) / (x (A x + B) + D F) - E / F;
brought to one fraction its constant terms vanish and x can be taken out.

Sources: E. Reinhard et al., Photographic Tone Reproduction for Digital Images, SIGGRAPH 2002, equations 3 and 4;
J. Hable, Filmic Tonemapping Operators, 2010; K. Narkowicz, ACES Filmic Tone Mapping Curve, 2016; S. Hill, a fit of the
ACES reference and output transforms (BakingLab), 2016.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from lichen.memory import Array


class Operator(StrEnum):
    """How scene light becomes display light."""

    EXPOSURE = "exposure"
    """the factor alone"""
    REINHARD = "reinhard"
    """x / (1 + x)"""
    REINHARD_EXTENDED = "reinhard_extended"
    """x (1 + x / white^2) / (1 + x), which is 1 at white"""
    HABLE = "hable"
    """the filmic curve of Uncharted 2, which is 1 at white"""
    ACES_NARKOWICZ = "aces_narkowicz"
    """a fit per channel"""
    ACES_HILL = "aces_hill"
    """a fit in a space of its own, between two matrices"""


@dataclass(frozen=True)
class Rational:
    """y = x (a x + b) / (x (c x + d) + e)."""

    a: float
    b: float
    c: float
    d: float
    e: float

    @property
    def degree(self) -> int:
        return 2 if self.c else 1 if self.d else 0

    def __call__(self, x: Array) -> Array:
        """For x >= 0, infinity included; the same steps in any precision."""
        if self.degree == 0:
            return x
        a, b, c, d, e = (x.dtype.type(v) for v in (self.a, self.b, self.c, self.d, self.e))
        with np.errstate(all="ignore"):
            r = 1 / x
            above = r * b + a if self.c else x * a + b if self.a else b
            below = r * (r * e + d) + c if self.c else r * e + d
            value: Array = np.where(x > 1, above / below, x * (x * a + b) / (x * (x * c + d) + e))
        return value

    def gain(self, x: Array) -> Array:
        """y / x, without a division by x."""
        if self.degree == 0:
            return np.where(np.isnan(x), x, x.dtype.type(1))
        a, b, c, d, e = (x.dtype.type(v) for v in (self.a, self.b, self.c, self.d, self.e))
        with np.errstate(all="ignore"):
            r = 1 / x
            above = r * (r * b + a) if self.c else r * b + a
            below = r * (r * e + d) + c if self.c else r * e + d
            value: Array = np.where(x > 1, above / below, (x * a + b) / (x * (x * c + d) + e))
        return value

    @property
    def most_gain(self) -> float:
        """An upper bound of y / x: of a x / (d x) and b / e apart, as all terms are positive."""
        return (self.a / self.d if self.d else 0.0) + self.b / self.e


def hable(white: float) -> Rational:
    a, b, c, d, e, f = 0.15, 0.50, 0.10, 0.20, 0.02, 0.30
    curve = Rational(a * (1 - e / f), b * (c - e / f), a, b, d * f)
    at_white = float(curve(np.array(white)))
    return Rational(curve.a / at_white, curve.b / at_white, curve.c, curve.d, curve.e)


@lru_cache(maxsize=64)
def rational(operator: Operator, white: float) -> Rational:
    """The curve of every operator but the fit between matrices."""
    if operator == Operator.REINHARD:
        return Rational(0.0, 1.0, 0.0, 1.0, 1.0)
    if operator == Operator.REINHARD_EXTENDED:
        return Rational(1 / white**2, 1.0, 0.0, 1.0, 1.0)
    if operator == Operator.HABLE:
        return hable(white)
    if operator == Operator.ACES_NARKOWICZ:
        return Rational(2.51, 0.03, 2.43, 0.59, 0.14)
    return Rational(0.0, 1.0, 0.0, 0.0, 1.0)


HILL = (0.0245786, -0.000090537, 0.983729, 0.4329510, 0.238081)
"""p, q, c, d, e of (x^2 + p x + q) / (c x^2 + d x + e)"""
HILL_INTO = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
"""from scene-linear BT.709 to the space of the fit"""
HILL_OUT_OF = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])


def hill(x: Array) -> Array:
    """The fit's curve, for x >= 0."""
    p, q, c, d, e = (x.dtype.type(v) for v in HILL)
    with np.errstate(all="ignore"):
        r = 1 / x
        far = (r * (r * q + p) + 1) / (r * (r * e + d) + c)
        value: Array = np.where(x > 1, far, (x * (x + p) + q) / (x * (x * c + d) + e))
    return value


@lru_cache(maxsize=64)
def steepest(operator: Operator, white: float) -> tuple[float, float]:
    """Upper bounds of |y'| and of |(y / x)'|, from differences over steps of half a percent, and a margin."""
    x = np.concatenate([[0.0], np.geomspace(1e-6, 1e8, 6400)])
    curve = hill if operator == Operator.ACES_HILL else rational(operator, white)
    slopes = [np.abs(np.diff(values) / np.diff(x)).max() for values in (curve(x), rational(operator, white).gain(x))]
    return 1.02 * float(slopes[0]), 1.02 * float(slopes[1])
