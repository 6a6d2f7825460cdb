"""How many samples the ellipses of a projective map hold, foretold at a few places.

Most ellipses of a picture to the horizon hold few samples, and those next to the line thousands: what `ewa` takes there
is many times what it takes of a picture seen from above, and the more samples it is asked for, the more. So ellipses
are counted as they would be taken, where the map shrinks alike everywhere in the middle alone. Numbers of Python: a
place takes a few microseconds, and most maps are asked at one. Nothing is done about what cancels in thin ellipses:
steps are counted, not pixels.
"""

from __future__ import annotations

import math
from functools import lru_cache

from lichen.operations.warp.maps import Projective
from lichen.operations.warp.prediction import Size, most_of, reach_of
from lichen.operations.warp.reference import THIN
from lichen.part import Rectangle

ASKED = 8
"""Columns and rows of places, where one is not enough."""
ALIKE = 1.5
"""How far the greatest distance from the eye is from the least, at most, where one is."""
LINE = 18.0
"""Steps that a line of an ellipse takes beside its samples, where a sample takes one."""


@lru_cache(maxsize=256)
def steps(view: Projective, source: Size, result: Rectangle, samples: float) -> float:
    """Of a pixel of that rectangle of the result, on average; `source` is the whole one's size."""
    left, top, width, height = result
    ends = [_distance(view, u, v) for u in (left, left + width) for v in (top, top + height)]
    asked = 1 if 0 < max(ends) <= ALIKE * min(ends) else ASKED
    shares = [(i + 0.5) / asked for i in range(asked)]
    each = (_at(view, left + width * i, top + height * j, source, samples) for i in shares for j in shares)
    return sum(each) / asked**2


def _distance(view: Projective, u: float, v: float) -> float:
    g, h, i = view.matrix[6:]
    return g * u + h * v + i


def _at(view: Projective, u: float, v: float, source: Size, samples: float) -> float:
    """Of the ellipse of one place: none where nothing is summed up."""
    a, b, c, d, e, f, g, h, _ = view.matrix
    w = _distance(view, u, v)
    if w <= 0:
        return 0.0
    x, y = (a * u + b * v + c) / w, (d * u + e * v + f) / w
    xu, yu, xv, yv = (a - x * g) / w, (d - y * g) / w, (b - x * h) / w, (e - y * h) / w
    # Half the sums of what turns with the map and of what turns against it: their sum and difference are the half axes.
    along, against = math.hypot(xu + yv, yu - xv) / 2, math.hypot(xu - yv, yu + xv) / 2
    long, short = along + against, max(abs(along - against), 1.0)
    if not 1 < long < math.inf:
        return 0.0
    upright = 0.5 - (xu * xu + xv * xv - yu * yu - yv * yv) / (8 * along * against) if along * against else 0.5
    big, small = long * long, short * short
    wide, tall = math.sqrt(big + upright * (small - big)), math.sqrt(small + upright * (big - small))
    if not (wide <= source[0] and tall <= source[1]):
        return 0.0
    # The level and what it has averaged already, as `level_of` and `at_level` have it.
    reach, most = reach_of(samples), most_of(samples)
    least = 2 * max(math.sqrt(long * short / most), THIN * long / most)
    level = math.floor(math.log2(max(short / samples, least, 1.0)))
    share = 0.25**level
    done = (1 - share) / 3
    major, minor = max(big * share - done, 1.0), max(small * share - done, 1.0)
    lines = 2 * reach * math.sqrt(minor + upright * (major - minor)) + 1
    return math.pi * reach**2 * math.sqrt(major * minor) + LINE * lines
