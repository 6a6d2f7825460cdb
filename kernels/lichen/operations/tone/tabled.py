"""Tables of transfer curves that are made of pieces.

Nodes lie as in tables.py: floats whose trailing bits are zero, of the distance from the centre where a curve is
mirrored, and of the sample itself where it is not. The table starts with the piece after the last line or constant;
what lies below stays as it is, since a line costs less than a lookup. Samples above the top are computed, and so are
those below zero that no line holds.

The bound. Where one piece fills a cell, that of tables.py: the triangle between the chord and the tangents. Where
pieces meet inside a cell, curve and chord both leave the polygon through the meeting places: the curve by the triangles
of its parts, the chord by what it misses those places by, on both sides of a jump. To it come the roundings of node,
rise and step, and of the distance where the centre is not 0: two, which the curve's slope carries over.

Where it pays. A lookup costs what a power of few bits costs. So curves that hold a power, DICOM's polynomials or an
equation to solve have a table; those of lines, logarithms and exponentials, as nearly all of cameras are, have none: on
two cores with AVX2, 12 million samples of ACEScct took 11 to 20 ms computed and 27 looked up.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Image
from lichen.memory import Array, aligned
from lichen.operation import ROUNDING
from lichen.operations.tone.evaluate import ceiling32
from lichen.operations.tone.piecewise import Piece, Piecewise, computed_error
from lichen.operations.tone.pointwise import blockwise, launch_flat
from lichen.operations.tone.shapes import definitions, distance, finished, pieces32, written
from lichen.operations.tone.tables import BINADES, MANTISSA, Table, points_of

if TYPE_CHECKING:
    from lichen.opencl.device import Device

F = np.float32
DEAR = ("power", "gsdf_signal", "gsdf_light", "rootlog_inverse")
"""Bodies that cost more than a lookup."""
FLAT = ("line", "constant")
FEWEST = 256
"""Cells of a table."""


def pays(curve: Piecewise) -> bool:
    """Whether a table of the curve saves anything."""
    return any(piece.body in DEAR for piece in curve.pieces)


@dataclass(frozen=True, eq=False)
class Tabled:
    """A table of a curve's pieces from number `below` on, from `knee` to `top`: distances where it has a centre."""

    curve: Piecewise
    table: Table
    below: int
    knee: float
    top: float

    @property
    def lower(self) -> Piecewise:
        """The lines and constants below the table; without pieces where what lies there is no such thing."""
        pieces = self.curve.pieces[: self.below]
        flat = all(each.body in FLAT for each in pieces) and self.curve.pieces[self.below].start >= 0
        return Piecewise(pieces if flat else (), self.curve.centre, self.curve.held)

    def error(self, low: float, high: float) -> tuple[float, float, bool]:
        """The largest error for samples in [low, high], how much of it is rounding, and whether all of it is proved."""
        centre, at = self.curve.centre or (0.0, 0.0), self.curve
        if at.held == "input":
            low, high = max(low, 0.0), max(high, 0.0)
        ends = low - centre[0], high - centre[0]
        far = max(map(abs, ends)) if at.centre else ends[1]
        near = ends[0] if not at.centre else 0.0 if ends[0] <= 0 <= ends[1] else min(map(abs, ends))
        rounding = self.table.rounding + 3 * ROUNDING * abs(centre[1]) + (at.jump if centre[0] else 0.0)
        bound = self.table.bound + rounding
        if far > self.top or (near < self.knee and not self.lower.pieces):
            computed = computed_error(at, low, high)
            return max(bound, computed), max(rounding, computed), False
        if near < self.knee:
            foot = max(low, centre[0] - self.knee) if at.centre else low
            lines = computed_error(self.lower, foot, max(foot, min(high, centre[0] + self.knee)))
            return max(bound, lines), max(rounding, lines), True
        return bound, rounding, True


def _begins(curve: Piecewise) -> int:
    """The first piece that the table holds: the one after the last line or constant that another kind follows."""
    bodies = [piece.body in FLAT for piece in curve.pieces]
    changes = [at + 1 for at, (flat, following) in enumerate(itertools.pairwise(bodies)) if flat and not following]
    return changes[-1] if changes else 0


# ------------------------------------------------------------------------------------------------------------- bound


def _slope(piece: Piece, x: Array) -> Array:
    """Signed; infinite where the piece is vertical."""
    if piece.body == "constant":
        return np.zeros_like(x)
    with np.errstate(all="ignore"):
        rise: Array = piece.outer * piece.inner * piece.kind.slope(piece.argument(x), piece.exponent)
    return np.where(np.isnan(rise), np.inf, rise)


def _height(piece: Piece, left: Array, right: Array) -> Array:
    """How far the piece leaves its chord at most; it is convex or concave."""
    chord = (piece.value(right) - piece.value(left)) / (right - left)
    with np.errstate(all="ignore"):
        before, after = np.abs(chord - _slope(piece, left)), np.abs(_slope(piece, right) - chord)
        height = np.where(np.isinf(before), after, np.where(np.isinf(after), before, before * after / (before + after)))
    made: Array = np.where(before + after > 0, height, 0.0) * (right - left)
    return made


def _bound(held: Piecewise, left: Array, right: Array, knee: float) -> float:
    """Over the cells from `left` to `right`, whose ends are nodes; what lies below `knee` does not count."""
    start = held(left)
    chord = (held(right) - start) / (right - left)
    starts = [knee, *(piece.start for piece in held.pieces[1:]), math.inf]
    worst = 0.0
    for piece, begin, end in zip(held.pieces, starts, starts[1:], strict=False):
        met = (left < end) & (right > begin)
        cell, rise = left[met], chord[met]
        low, high = np.maximum(cell, begin), np.minimum(right[met], end)
        missed = [np.abs(piece.value(x) - (start[met] + rise * (x - cell))) for x in (low, high)]
        worst = max(worst, float((_height(piece, low, high) + np.maximum(*missed)).max(initial=0.0)))
    return worst


# ------------------------------------------------------------------------------------------------------------- table


def _layout(held: Piecewise, knee: float, top: float, size: int) -> tuple[int, int]:
    """How many binades and how many bits per binade: those down to the knee, or, from zero, what errs least at the ends
    of binades."""
    if knee > 0:
        binades = math.ceil(math.log2(top / knee))
        return binades, (size // binades).bit_length() - 1

    def probed(choice: tuple[int, int]) -> float:
        low = top * 2.0 ** np.arange(-choice[0], 0)
        step = low / (1 << choice[1])
        left = np.concatenate([np.zeros(1), low, 2 * low - step])
        return _bound(held, left, np.concatenate([low[:1], low + step, 2 * low]), 0.0)

    choices = {(min(size >> bits, BINADES), bits) for bits in range(size.bit_length())}
    return min(choices, key=lambda choice: (probed(choice), choice))


@lru_cache(maxsize=64)
def tabled(curve: Piecewise, reach: float, size: int) -> Tabled:
    """The table of at most `size` cells of a curve, for samples up to `reach`. Where pieces miss each other, one with
    more cells may be worse."""
    below = _begins(curve)
    held = Piecewise(curve.pieces[below:])
    knee = max(held.pieces[0].start, 0.0) if below else 0.0
    away = reach - (curve.centre[0] if curve.centre else 0.0)
    top = 2.0 ** math.ceil(math.log2(max(away, 2 * knee)))
    points = points_of(top, *(layout := _layout(held, knee, top, size)))
    values, origin = held(points), float(held(0.0)) if not knee else 0.0
    bound = _bound(held, points[:-1], points[1:], knee)
    nodes = np.zeros((points.size + 1, 2), F)
    if not knee:
        bound = max(bound, _bound(held, np.zeros(1), points[:1], 0.0))
        nodes[0] = origin, (values[0] - origin) / points[0]
    nodes[1:, 0] = values
    nodes[1:-1, 1] = np.diff(values)
    rounding = 4 * ROUNDING * float(np.abs([*values, origin]).max())
    if curve.centre and curve.centre[0]:
        seen = points[1:]
        steep = max(float(np.abs(_slope(piece, seen[seen >= piece.start]) * seen[seen >= piece.start]).max(initial=0.0))
                    for piece in held.pieces)  # fmt: skip
        rounding += 2 * ROUNDING * steep
    first, last = points[[0, -1]].astype(F).view(np.int32)
    nodes = aligned(nodes)
    nodes.flags.writeable = False
    columns = np.ascontiguousarray(nodes[1:, 0]), np.ascontiguousarray(nodes[1:, 1])
    table = Table(nodes, int(first), int(last), MANTISSA - layout[1], bound, rounding, columns)
    made, fewer = Tabled(curve, table, below, knee, top), size // 4
    if fewer < FEWEST or (smaller := tabled(curve, reach, fewer)).table.bound >= bound:
        return made
    return smaller


# ---------------------------------------------------------------------------------------------------------- backends


def opencl(device: Device, image: Image, made: Tabled) -> Array:
    """piecewise.cl's kernel `table`."""
    curve, table = made.curve, made.table
    numbers, calls = written(curve, 0)
    defines: dict[str, int | float | str] = {
        **definitions(curve, calls), "LOWER": written(made.lower, 0)[1], "FLAT": int(bool(made.lower.pieces)),
    }  # fmt: skip
    return launch_flat(
        device, "tone/piecewise.cl", "table", image, aligned(np.array(numbers, F)), table.nodes,
        np.int32(table.first), np.int32(table.last), np.int32(table.shift), ceiling32(made.knee), defines=defines,
    )  # fmt: skip


def numpy(image: Image, made: Tabled) -> Array:
    return blockwise(image, lambda x: _block(x, made))


def _block(x: Array, made: Tabled) -> Array:
    """Looked up, then mended: lines below the table, and what is computed."""
    curve = made.curve
    away, a = distance(curve, x)
    y = _looked_up(a, made.table)
    low, rest = a < ceiling32(made.knee), ~(a <= F(made.top))
    if made.lower.pieces:
        if low.any():
            np.copyto(y, pieces32(made.lower.pieces, a), where=low)
    else:
        rest |= low
    if rest.any():
        y[rest] = pieces32(curve.pieces, a[rest])
    return finished(curve, away, y)


def _looked_up(a: Array, table: Table) -> Array:
    """What lies above the top, and NaN, gives anything."""
    bits = np.ascontiguousarray(a).view(np.int32) - np.int32(table.first)
    part = (bits & np.int32((1 << table.shift) - 1)).astype(F)
    part *= F(2.0**-table.shift)
    index = (bits >> np.int32(table.shift)).astype(np.intp)
    values, rises = table.columns
    part *= rises.take(index, mode="clip")
    part += values.take(index, mode="clip")
    under = a < np.int32(table.first).view(F)  # the difference of bits wraps around where the sample is -0.0
    if under.any():
        np.copyto(part, table.nodes[0, 0] + a * table.nodes[0, 1], where=under)
    return part
