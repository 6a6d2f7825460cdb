"""What a part of a projective warp's result shows of the source, with all that any of the methods reads around it.

A projective map takes a rectangle that lies before its plane at infinity to a quadrilateral, whose corners are those of
the rectangle; the footprints in it are bounded by its corners, too:

    |dx/du| = |a - x g| / w <= max(|a - x0 g|, |a - x1 g|) / min w,

and so on for the other three. Around the quadrilateral are read: the longest half axis three times over, four samples
of the pyramid's coarsest level that a pixel may take, and what filters and the spline's recursion reach. The part
begins and ends on that level's grid, so that its pyramid is a part of the whole one.

Where rows or columns are continued by repeating them, and the part reaches beyond the edge, all of them are kept.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.operation import Border
from lichen.operations.warp.kernels import TAIL
from lichen.operations.warp.maps import Map, Projective, Windowed
from lichen.part import Rectangle, Size, widened

TAPS = 4
"""Samples that the widest kernel reaches, and one for rounding."""


def part_shown(map_: Projective, border: Border, source: Size, wanted: Rectangle) -> Rectangle | None:
    """The rectangle of a source of that size that a rectangle of the result is made of; None where there is none but
    the whole."""
    seen = _quadrilateral(map_, wanted)
    if seen is None:
        return None
    (low_x, high_x, low_y, high_y), axis = seen
    if not axis <= min(source):
        return None
    level = max(1, math.ceil(math.log2(max(axis, 1.0))) + 1)
    around = TAIL + TAPS + math.ceil(3 * axis) + (4 << level)
    left, top = math.floor(low_x), math.floor(low_y)
    middle = left, top, math.ceil(high_x) - left, math.ceil(high_y) - top
    part = widened(middle, (around, around), source, 1 << level)
    if border not in (Border.CONSTANT, Border.CLAMP):
        inside_x = left >= around and left + middle[2] + around <= source[0]
        inside_y = top >= around and top + middle[3] + around <= source[1]
        x, width = (part[0], part[2]) if inside_x else (0, source[0])
        y, height = (part[1], part[3]) if inside_y else (0, source[1])
        part = x, y, width, height
    return part


def longest(map_: Map, size: Size) -> float:
    """No half axis of a footprint in a result, or in the part of one, of that size is longer; infinite where that is
    not known beforehand."""
    whole, corner = (map_.of, map_.result) if isinstance(map_, Windowed) else (map_, (0, 0))
    seen = _quadrilateral(whole, (*corner, *size)) if isinstance(whole, Projective) else None
    return math.inf if seen is None else seen[1]


def _quadrilateral(map_: Projective, wanted: Rectangle) -> tuple[tuple[float, float, float, float], float] | None:
    """Lowest and highest x and y, and the longest half axis of a footprint; None where it reaches infinity."""
    left, top, width, height = wanted
    corners = np.array([[left, left + width] * 2, [top, top, top + height, top + height], [1.0] * 4])
    x, y, w = map_.array @ corners
    least = float(w.min())
    if not least > 0:
        return None
    with np.errstate(all="ignore"):
        x, y = x / w, y / w
    ends = [float(each) for each in (x.min(), x.max(), y.min(), y.max())]
    if not max(map(abs, ends)) < 2.0**31:
        return None
    a, b, _, d, e, _, g, h, _ = map_.matrix
    across = [max(abs(each - place * by) for place in ends[:2]) for each, by in ((a, g), (b, h))]
    down = [max(abs(each - place * by) for place in ends[2:]) for each, by in ((d, g), (e, h))]
    return (ends[0], ends[1], ends[2], ends[3]), math.hypot(*across, *down) / least
