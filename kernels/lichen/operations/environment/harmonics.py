"""Real spherical harmonics of any degree, and what a cosine makes of them.

With x right, y up and z towards the viewer, and no sign of Condon and Shortley,

    Y_00 = 0.282095,  Y_1,-1 = 0.488603 y,  Y_10 = 0.488603 z,  Y_11 = 0.488603 x, ...

in the order l^2 + l + m. sin^m(theta) cos(m phi) and sin^m(theta) sin(m phi) are polynomials of x and y, so no pole has
an angle that is none, and no factorial overflows: normalised Legendre functions come by recurrence,

    p_mm = sqrt((2m + 1) / (2m)) p_(m-1)(m-1)
    p_lm = a (z p_(l-1)m - b p_(l-2)m),  a^2 = (4 l^2 - 1) / (l^2 - m^2),  b^2 = ((l-1)^2 - m^2) / (4 (l-1)^2 - 1)

Convolved with max(cos, 0) / pi, what degree l holds is multiplied by `cosine(l)`: 1, 2/3, 1/4, 0, -1/24, 0, 1/64 ...

Sources: R. Ramamoorthi and P. Hanrahan, An efficient representation for irradiance environment maps, SIGGRAPH 2001;
P.-P. Sloan, Efficient spherical harmonic evaluation, JCGT 2, 2013.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.memory import Array


def basis(d: Array, bands: int) -> Array:
    """All functions below degree `bands` in the directions d (..., 3): (..., bands^2), float64."""
    x, y, z = (d[..., axis].astype(np.float64) for axis in range(3))
    made = np.empty((*x.shape, bands * bands))
    c, s, first = np.ones_like(x), np.zeros_like(x), math.sqrt(1 / (4 * math.pi))
    for m in range(bands):
        if m:
            c, s, first = x * c - y * s, x * s + y * c, first * math.sqrt((2 * m + 1) / (2 * m))
        norm = math.sqrt(2) if m else 1.0
        before, p = np.zeros_like(x), np.full_like(x, first)
        for degree in range(m, bands):
            if degree > m:
                a = math.sqrt((4 * degree**2 - 1) / (degree**2 - m**2))
                b = math.sqrt(((degree - 1) ** 2 - m**2) / (4 * (degree - 1) ** 2 - 1)) if degree > 1 else 0.0
                before, p = p, a * (z * p - b * before)
            made[..., degree * degree + degree + m] = norm * p * c
            if m:
                made[..., degree * degree + degree - m] = norm * p * s
    return made


def cosine(degree: int) -> float:
    """What max(cos, 0) / pi multiplies this degree by."""
    if degree == 0:
        return 1.0
    if degree == 1:
        return 2 / 3
    if degree % 2:
        return 0.0
    half = degree // 2
    sign = 1.0 if half % 2 else -1.0
    return float(2 * sign / ((degree + 2) * (degree - 1)) * math.comb(degree, half) / 2**degree)


def by_degree(factors: list[float]) -> Array:
    """One factor for every function of each degree."""
    return np.repeat(factors, [2 * degree + 1 for degree in range(len(factors))])
