"""Chains of colour steps, as colour transform files hold them: matrices, curves, tables of one and of three dimensions.

A step computes three planes in the precision it is given, so one text is the definition in float64 and NumPy's method
in float32; chain.cl holds the same for devices, all steps in one pass. Beside its values every step tells the interval
of each channel, and how far its results are from those of inputs that differ by a given amount, roundings included.

* `Matrix`: y = M x + b. A factor of zero takes no part, so it carries no NaN.
* `Curves`: one curve of pieces (piecewise.py) for each channel: ranges, exponents, logarithms, slopes and offsets.
* `Table1`: linear interpolation between equally spaced entries, held to the ends.
* `HalfTable`: the same between entries that are a half-precision number apart, one for each such number.
* `Table3`: trilinear or tetrahedral interpolation, held to the domain; NaN in one channel is NaN in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import ROUNDING
from lichen.operations.tone.lattice import looked_up
from lichen.operations.tone.piecewise import Piecewise
from lichen.operations.tone.shapes import computed, written

if TYPE_CHECKING:
    from lichen.opencl.device import Device

Planes = list[Array]
Interval = tuple[float, float]
Triple = tuple[float, float, float]
FLOAT_MAX = float(np.finfo(np.float32).max)
FAR = 1e30
"""Ends of intervals: beyond it float32 may overflow on the way."""
BLOCK = 1 << 13
"""Pixels of a block of NumPy's work: its planes stay in cache."""


def _size(interval: Interval) -> float:
    return max(abs(interval[0]), abs(interval[1]))


@dataclass(frozen=True)
class Matrix:
    """Rows of factors, and what each row adds."""

    rows: tuple[tuple[float, ...], ...]
    added: tuple[float, ...]

    def run(self, planes: Planes) -> Planes:
        kind = planes[0].dtype.type
        made = []
        for row, more in zip(self.rows, self.added, strict=True):
            total = np.full_like(planes[0], more)
            for factor, plane in zip(row, planes, strict=True):
                if factor:
                    total += kind(factor) * plane
            made.append(total)
        return made

    def walk(self, given: Sequence[Interval], doubts: Sequence[float]) -> tuple[list[Interval], list[float]]:
        intervals, errors = [], []
        for row, more in zip(self.rows, self.added, strict=True):
            ends = [sorted((m * low, m * high)) for m, (low, high) in zip(row, given, strict=True)]
            intervals.append((sum(e[0] for e in ends) + more, sum(e[1] for e in ends) + more))
            terms = sum(abs(m) * _size(x) for m, x in zip(row, given, strict=True)) + abs(more)
            errors.append(sum(abs(m) * d for m, d in zip(row, doubts, strict=True)) + 9 * ROUNDING * terms)
        return intervals, errors

    def written(self, at: int) -> tuple[list[float], str]:
        numbers = [value for row, more in zip(self.rows, self.added, strict=True) for value in (*row, more)]
        return numbers, f"matrix(v, k + {at});"


@dataclass(frozen=True)
class Curves:
    """One curve for each channel."""

    curves: tuple[Piecewise, Piecewise, Piecewise]

    def run(self, planes: Planes) -> Planes:
        wide = planes[0].dtype == np.float64
        return [curve(x) if wide else computed(curve, x) for curve, x in zip(self.curves, planes, strict=True)]

    def walk(self, given: Sequence[Interval], doubts: Sequence[float]) -> tuple[list[Interval], list[float]]:
        told: dict[tuple[Piecewise, Interval, float], tuple[Interval, float]] = {}  # channels are often alike
        asked = list(zip(self.curves, given, doubts, strict=True))
        for each in asked:
            if each not in told:
                curve, (low, high), by = each
                carried = curve.modulus(low, high, by) if by else 0.0
                told[each] = curve.span(low, high), carried + curve.error(low - by, high + by)
        return [told[each][0] for each in asked], [told[each][1] for each in asked]

    def written(self, at: int) -> tuple[list[float], str]:
        numbers: list[float] = []
        calls = []
        for channel, curve in enumerate(self.curves):
            here = at + len(numbers)
            own, pieces = written(curve, here)
            numbers += own
            calls.append(f"CURVE({channel}, {here}, {int(curve.centre is not None)}, {pieces})")
        return numbers, " ".join(calls)


@dataclass(frozen=True, eq=False)
class _Domain:
    """A table with entries from `low` to `high`."""

    table: Array
    low: Triple = (0.0, 0.0, 0.0)
    high: Triple = (1.0, 1.0, 1.0)

    @property
    def scales(self) -> list[float]:
        size = self.table.shape[-1] if self.table.ndim == 2 else len(self.table)
        return [(size - 1) / (b - a) for a, b in zip(self.low, self.high, strict=True)]

    def off(self, channel: int) -> float:
        """Roundings of a place, in cells, for an error of one rounding in everything it is made of."""
        size = max(abs(self.low[channel]), abs(self.high[channel])) * self.scales[channel]
        return ROUNDING * (3 * size + 2 * (self.high[channel] - self.low[channel]) * self.scales[channel])

    @property
    def ends(self) -> list[float]:
        return [*self.low, *self.high, *self.scales]


@dataclass(frozen=True, eq=False)
class Table1(_Domain):
    """`table` of shape (3, n)."""

    def run(self, planes: Planes) -> Planes:
        made = []
        for c, x in enumerate(planes):
            kind = x.dtype.type
            own = self.table[c].astype(x.dtype)
            place = (np.clip(x, kind(self.low[c]), kind(self.high[c])) - kind(self.low[c])) * kind(self.scales[c])
            cell = np.minimum(np.nan_to_num(place).astype(np.int32), own.size - 2)
            part = place - cell.astype(x.dtype)
            made.append(own[cell] + (own[cell + 1] - own[cell]) * part)
        return made

    @cached_property
    def _steepest(self) -> list[float]:
        return [float(np.abs(np.diff(own)).max()) for own in self.table]

    def walk(self, given: Sequence[Interval], doubts: Sequence[float]) -> tuple[list[Interval], list[float]]:
        errors = [
            steep * (min(by * self.scales[c], self.table.shape[1]) + self.off(c))
            + 5 * ROUNDING * np.abs(self.table[c]).max()
            for c, (steep, by) in enumerate(zip(self._steepest, doubts, strict=True))
        ]
        return [(float(own.min()), float(own.max())) for own in self.table], list(map(float, errors))

    def written(self, at: int) -> tuple[list[float], str]:
        return [*self.ends, *self.table.reshape(-1).tolist()], f"table1(v, k + {at}, {self.table.shape[1]});"


HALVES = 0x7C00
"""Finite halves of one sign; as bits they count from 0."""
LARGEST_HALF = 65504.0


@dataclass(frozen=True, eq=False)
class HalfTable:
    """`table` of shape (3, 2, HALVES): entries of the halves from 0 and from -0 on, each towards its infinity.

    The place of a number among the halves is exact in float32: it is its leading bits, so nothing but the interpolation
    rounds. What lies beyond the largest half is held to it.
    """

    table: Array

    def run(self, planes: Planes) -> Planes:
        made = []
        for own, x in zip(self.table, planes, strict=True):
            a = np.minimum(np.abs(x), x.dtype.type(LARGEST_HALF))
            binade = np.where(a >= 2.0**-14, np.frexp(np.nan_to_num(a))[1] - 1, -14)
            place = np.ldexp(a, 10 - binade)
            cell = np.minimum(np.nan_to_num(place).astype(np.int32) + (binade + 14) * 1024, HALVES - 2)
            part = place - (cell - (binade + 14) * 1024).astype(x.dtype)
            entries, below = own.astype(x.dtype), (x < 0).astype(np.int32)
            low, high = entries[below, cell], entries[below, cell + 1]
            made.append(low + (high - low) * part)
        return made

    @cached_property
    def _walked(self) -> tuple[Array, list[Array]]:
        """The halves in ascending order, and how much each channel's entries have varied up to them."""
        halves = np.arange(HALVES, dtype=np.uint16).view(np.float16).astype(np.float64)
        halves = np.concatenate([-halves[:0:-1], [-1e-30], halves])
        paths = [np.concatenate([own[1][::-1], own[0]]) for own in self.table]
        return halves, [np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path)))]) for path in paths]

    def _swing(self, channel: int, by: float) -> float:
        """The most that the entries vary within a distance: the variation's steepest stretch starts or ends at one."""
        if not by:
            return 0.0
        halves, varied = self._walked[0], self._walked[1][channel]
        starts = [(np.interp(halves + by, halves, varied) - varied).max()]
        return float(max(*starts, (varied - np.interp(halves - by, halves, varied)).max()))

    def walk(self, given: Sequence[Interval], doubts: Sequence[float]) -> tuple[list[Interval], list[float]]:
        errors = [
            self._swing(c, by) + 5 * ROUNDING * float(np.abs(own).max())
            for c, (own, by) in enumerate(zip(self.table, doubts, strict=True))
        ]
        return [(float(own.min()), float(own.max())) for own in self.table], errors

    def written(self, at: int) -> tuple[list[float], str]:
        return self.table.reshape(-1).tolist(), f"half_table(v, k + {at});"


@dataclass(frozen=True, eq=False)
class Table3(_Domain):
    """`table` of shape (n, n, n, 3), axes blue, green, red."""

    tetrahedral: bool = False

    def run(self, planes: Planes) -> Planes:
        made = looked_up(np.stack(planes, axis=-1), self.table, (self.low, self.high), tetrahedral=self.tetrahedral)
        return [made[..., c] for c in range(3)]

    @cached_property
    def _steps(self) -> list[float]:
        """The largest difference between neighbours along red, green and blue."""
        return [float(np.abs(np.diff(self.table, axis=2 - axis)).max()) for axis in range(3)]

    def walk(self, given: Sequence[Interval], doubts: Sequence[float]) -> tuple[list[Interval], list[float]]:
        cells = len(self.table)
        by = sum(step * (min(doubts[c] * self.scales[c], cells) + self.off(c)) for c, step in enumerate(self._steps))
        error = by + 12 * ROUNDING * float(np.abs(self.table).max())
        return [(float(self.table.min()), float(self.table.max()))] * 3, [error] * 3

    def written(self, at: int) -> tuple[list[float], str]:
        numbers = [*self.ends, *self.table.reshape(-1).tolist()]
        return numbers, f"table3(v, k + {at}, {len(self.table)}, {int(self.tetrahedral)});"


Step = Matrix | Curves | Table1 | HalfTable | Table3


@dataclass(frozen=True, eq=False)
class Chain:
    """Steps one after the other."""

    steps: tuple[Step, ...]

    def walk(self, low: float, high: float, by: float = 0.0) -> tuple[float, float, float]:
        """The results' range and the largest error, for inputs in [low, high] that are off by `by`."""
        intervals, errors = [(low, high)] * 3, [by] * 3
        for step in self.steps:
            intervals, errors = step.walk(intervals, errors)
            intervals = [(max(a, -FLOAT_MAX), min(b, FLOAT_MAX)) for a, b in intervals]
        worst = max(errors)
        error = worst if worst < FLOAT_MAX else FLOAT_MAX
        return min(a for a, _ in intervals), max(b for _, b in intervals), error

    @cached_property
    def _program(self) -> tuple[Array, str]:
        numbers: list[float] = []
        calls = []
        for step in self.steps:
            own, call = step.written(len(numbers))
            numbers += own
            calls.append(call)
        return aligned(np.array([*numbers, 0.0], np.float32)), " ".join(calls)

    def evaluate(self, image: Image, dtype: type[np.floating]) -> Array:
        """All steps in `dtype`; channels beyond the third pass."""
        out = aligned_empty(image.pixels.shape, dtype)
        flat, made = image.pixels.reshape(-1, image.channels), out.reshape(-1, image.channels)
        with np.errstate(all="ignore"):
            for start in range(0, len(flat), BLOCK):
                block = flat[start : start + BLOCK]
                planes: Planes = [block[:, c].astype(dtype) for c in range(3)]
                for step in self.steps:
                    planes = step.run(planes)
                for c, plane in enumerate(planes):
                    made[start : start + BLOCK, c] = plane
                made[start : start + BLOCK, 3:] = block[:, 3:]
        return out

    def opencl(self, device: Device, image: Image) -> Array:
        source, pixels = aligned(image.pixels), image.height * image.width
        out = aligned_empty(source.shape)
        numbers, calls = self._program
        defines: dict[str, int | float | str] = {
            "IN": image.channels, "OUT": image.channels, "READ": 3, "MADE": 3, "STEPS": calls,
        }  # fmt: skip
        with device.session() as session:
            session.sweep(
                "tone/chain.cl", "chain", -(-pixels // 16),
                source, session.write(out), numbers, np.int32(pixels),
                defines=defines,
            )  # fmt: skip
        return out
