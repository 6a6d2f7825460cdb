"""Tables of a transfer curve, and how far linear interpolation in them can be off.

Theory. The nodes are floating-point numbers whose trailing bits are zero: every binade (2^e to 2^(e+1)) is divided into
the same power of two of equal cells, so a sample's cell is the leading bits of the sample itself and its place in the
cell the remaining ones. Cells shrink with the sample, as the curves' bends grow towards zero; a vertical start, as a
pure power below 1 has, costs a few more binades and not accuracy everywhere. The toe is no part of the table but
computed.

The bound. On a cell of width h the body is convex or concave, so curve and chord both lie in the triangle between the
chord and the tangents at its ends. With p and q the differences between the chord's slope and the two tangents' its
height is h p q / (p + q), which is h p where q is infinite. It needs no second derivative and holds at a vertical
start. Along a power of the distance alone the bend only grows or only falls, so that of cells of one width one at an
end is the highest, and binades are similar, each as many times higher than the one before: few cells tell it for all.
To it comes the rounding of the stored values and of the interpolation.

A table depends on parameters and size alone, never on a picture, so tiles of one picture agree bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array, aligned
from lichen.operation import ROUNDING
from lichen.operations.tone.curves import Form

MANTISSA = 23
BINADES = 100
"""The most that a table spans."""


@dataclass(frozen=True, eq=False)
class Table:
    """`nodes` has shape (cells + 2, 2), float32: value and rise to the next node.

    Row 0 is the line from zero to the first node, its rise being per unit; then the cells; the last row is `top`.
    """

    nodes: Array
    first: int
    """the bit pattern of the first node"""
    last: int
    """the bit pattern of `top`"""
    shift: int
    """the bits of a sample below its cell's number"""
    bound: float
    """largest distance of the chords to the curve's body for a <= top"""
    rounding: float
    """what rounding value, rise and the step between them adds to it"""
    columns: tuple[Array, Array]
    """the values and the rises of the cells, apart"""


def _heights(form: Form, left: Array, right: Array) -> Array:
    """The triangle's height for the cells from `left` to `right`; 0 where the toe rules the whole cell."""
    chord = (form.upper(right) - form.upper(left)) / (right - left)
    before, after = np.abs(chord - form.slope(left)), np.abs(form.slope(right) - chord)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = np.where(np.isinf(before), after, before * after / (before + after)) * (right - left)
    return np.where((right <= form.knee) | (before + after == 0), 0.0, height)


def points_of(top: float, binades: int, bits: int) -> Array:
    """The nodes, ascending, float64 and exact in float32."""
    steps = np.arange((binades << bits) + 1)
    points: Array = np.ldexp(top * (1 + (steps & ((1 << bits) - 1)) / (1 << bits)), (steps >> bits) - binades)
    return points


@lru_cache(maxsize=16)
def _layouts(size: int) -> list[tuple[int, int]]:
    """Binades and bits of tables of at most `size` cells. Of as many binades finer ones are never worse."""
    return list({min(size >> bits, BINADES): bits for bits in range(size.bit_length())}.items())


@lru_cache(maxsize=256)
def _of_power(form: Form) -> tuple[list[float], list[float]]:
    """By binades how high the first cell is, and by bits the highest of the others, which the last binade has."""
    heights = _heights(form, form.top * LEFT, form.top * RIGHT)
    return heights[: BINADES + 1].tolist(), heights[BINADES + 1 :].reshape(2, -1).max(axis=0).tolist()


_START, _STEP = 2.0 ** -np.arange(BINADES + 1), 0.5 / 2.0 ** np.arange(MANTISSA)
LEFT = np.concatenate([np.zeros(len(_START)), np.full(len(_STEP), 0.5), 1 - _STEP])
RIGHT = np.concatenate([_START, 0.5 + _STEP, np.ones(len(_STEP))])
"""Of all first cells and of the cells at both ends of the last binade, over the top."""


@lru_cache(maxsize=16)
def _probes(size: int) -> tuple[Array, Array, Array]:
    """Of tables of all layouts, in parts of the top, both ends of their first cells and of the cells at the ends of
    their binades; and where in these each begins."""
    left, right = [], []
    for binades, bits in _layouts(size):
        low = 2.0 ** np.arange(-binades, 0)
        step = low / (1 << bits)
        left.append(np.concatenate([np.zeros(1), low, 2 * low - step]))
        right.append(np.concatenate([[2.0**-binades], low + step, 2 * low]))
    begins = np.cumsum([0, *map(len, left[:-1])])
    return np.concatenate(left), np.concatenate(right), begins


@lru_cache(maxsize=256)
def best(form: Form, size: int) -> tuple[int, int, float]:
    """Binades and bits of the table of at most `size` cells that errs least, and how far its chords are off at most.

    A curve with a toe needs the binades down to its knee and no more; the others trade.
    """
    if form.knee > 0:
        binades, bound = math.ceil(math.log2(form.top / form.knee)), 0.0
        bits = (size // binades).bit_length() - 1
    else:
        if form.body == "power" and not form.lift:
            first, others = _of_power(form)
            bound, binades, bits = min([(max(first[far], others[fine]), far, fine) for far, fine in _layouts(size)])
            return binades, bits, bound
        left, right, begins = _probes(size)
        probed = np.maximum.reduceat(_heights(form, form.top * left, form.top * right), begins)
        bound, (binades, bits) = min(zip(probed.tolist(), _layouts(size), strict=True))
    points = points_of(form.top, binades, bits)
    return binades, bits, max(bound, float(_heights(form, points[:-1], points[1:]).max()))


def rounding(form: Form) -> float:
    """Of the values that a table holds, of their rises and of the step between them; none is larger than one end's."""
    return 4 * ROUNDING * float(np.abs(form.upper((form.knee, form.top))).max())


@lru_cache(maxsize=64)
def tabulate(form: Form, size: int) -> Table:
    """The table of at most `size` cells with the smallest error, and its proved bound."""
    binades, bits, bound = best(form, size)
    points = points_of(form.top, binades, bits)
    values, origin = form.upper(points), float(form.magnitude(0))
    nodes = np.zeros((points.size + 1, 2), dtype=np.float32)
    nodes[0] = origin, (values[0] - origin) / points[0]
    nodes[1:, 0] = values
    nodes[1:-1, 1] = np.diff(values)
    first, last = points[[0, -1]].astype(np.float32).view(np.int32)
    nodes = aligned(nodes)
    nodes.flags.writeable = False
    columns = np.ascontiguousarray(nodes[1:, 0]), np.ascontiguousarray(nodes[1:, 1])
    return Table(nodes, int(first), int(last), MANTISSA - bits, bound, rounding(form), columns)
