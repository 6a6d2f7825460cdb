"""How much of the light a smooth surface between two transparent media reflects: Fresnel's equations, unpolarised.

`ratio` is the index of the medium behind the surface over that of the medium before it; `c` the cosine of the angle to
the normal, in [0, 1]. With sin t = sin i / ratio,

    perpendicular = (cos i - ratio cos t) / (cos i + ratio cos t)
    parallel      = (ratio cos i - cos t) / (ratio cos i + cos t)
    F = (perpendicular^2 + parallel^2) / 2,    1 where sin t > 1: total internal reflection

The methods use the algebraic form with g^2 = ratio^2 - 1 + c^2,

    F = u^2 / 2 (1 + w^2),  u = (g - c) / (g + c),  w = (c (g + c) - 1) / (c (g - c) + 1)

As the ratio goes to 1 the difference g - c loses all digits, so it is taken as (ratio^2 - 1) / (g + c), which has no
difference at all: u = (ratio - 1)(ratio + 1) / (g + c)^2. At ratio 1 nothing is reflected at any angle; at c = 0
everything is at any other.

Schlick's approximation is f + (1 - f)(1 - c)^5 with f = ((ratio - 1) / (ratio + 1))^2; from within the denser medium,
(1 - cos t)^5.

Sources: Born and Wolf, Principles of optics, section 1.5; Cook and Torrance, A reflectance model for computer graphics,
1982, for the algebraic form; Schlick, An inexpensive BRDF model for physically-based rendering, 1994.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from lichen.memory import Array

EVENLY, TOWARDS = np.linspace(0, 1, 256), np.geomspace(1e-9, 1, 256)
"""Places at which the error of Schlick's approximation is looked for."""
STEEP = float(EVENLY[51])
"""One of them, where it is large as a rule."""


def beyond(c: Array, ratio: Array) -> Array:
    """cos^2 of the angle behind the surface; below 0 there is none."""
    eta = 1 / ratio
    made: Array = 1 - eta * eta * (1 - c * c)
    return made


def reflectance(c: Array, ratio: Array) -> Array:
    """Fresnel's equations as they are defined; float64."""
    with np.errstate(invalid="ignore", divide="ignore"):
        k = beyond(c, ratio)
        t = np.sqrt(np.maximum(k, 0))
        perpendicular = (c - ratio * t) / (c + ratio * t)
        parallel = (ratio * c - t) / (ratio * c + t)
        half = (perpendicular * perpendicular + parallel * parallel) / 2
        return np.where(np.isnan(c), np.nan, np.where(ratio == 1, 0.0, np.where(k < 0, 1.0, half)))


def algebraic(c: Array, ratio: Array) -> Array:
    """The form of the methods; of the precision of its arguments."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a = (ratio - 1) * (ratio + 1)
        g = np.sqrt(np.maximum(a + c * c, 0))
        total = g + c
        u = a / (total * total)
        w = (c * total - 1) / (c * (a / total) + 1)
        made = u * u * (1 + w * w) / 2
        return np.where(np.isnan(c), np.nan, np.where(ratio == 1, 0.0, np.where(beyond(c, ratio) < 0, 1.0, made)))


def schlick(c: Array, ratio: Array) -> Array:
    """Schlick's approximation; of the precision of its arguments."""
    with np.errstate(invalid="ignore"):
        f = ((ratio - 1) / (ratio + 1)) ** 2
        k = beyond(c, ratio)
        far = 1 - np.where(ratio < 1, np.sqrt(np.maximum(k, 0)), c)
        squared = far * far
        made = f + (1 - f) * (squared * squared * far)
        return np.where(np.isnan(c), np.nan, np.where(ratio == 1, 0.0, np.where(k < 0, 1.0, made)))


@lru_cache(maxsize=256)
def schlick_error(ratio: float) -> float:
    """The largest error of Schlick's approximation, seen from either side: that at cosines spaced evenly, towards 0 and
    towards that beyond which nothing is seen; and a twentieth more for what lies between them."""
    if ratio == 1:
        return 0.0
    inner = min(ratio, 1 / ratio)
    end = math.sqrt(1 - inner * inner)
    c = np.concatenate([EVENLY, TOWARDS, end + (1 - end) * TOWARDS])
    sides = np.asarray(ratio), np.asarray(1 / ratio)
    found = [np.abs(reflectance(c, each) - schlick(c, each)).max() for each in sides]
    return min(1.05 * float(max(found)), 1.0)


def schlick_least(ratio: float) -> float:
    """What that error is at least: as it is at one place, from the thinner medium; in numbers of Python, since NumPy
    takes ten times as long for one."""
    if ratio == 1:
        return 0.0
    c, ratio = STEEP, max(ratio, 1 / ratio)
    t = math.sqrt(1 - (1 - c * c) / (ratio * ratio))
    perpendicular, parallel = (c - ratio * t) / (c + ratio * t), (ratio * c - t) / (ratio * c + t)
    f = ((ratio - 1) / (ratio + 1)) ** 2
    return abs((perpendicular**2 + parallel**2) / 2 - f - (1 - f) * (1 - c) ** 5)
