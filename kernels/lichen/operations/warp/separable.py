"""Resizing along one axis: which samples each sample of the result takes, with which weights.

Output sample i lies at input coordinate (i + 1/2) n / m, with n samples in and m out: both images cover the same
rectangle. The kernel k is stretched to the wider of the two grids, so that it averages what shrinks:

    w[j] = k((j + 1/2 - (i + 1/2) n / m) / max(n / m, 1)), divided by the sum over j.

What lies beyond the image is folded onto the samples that the border repeats, or, for a constant border, onto one
weight for its value. Weights are exact to float64, and so few samples have any that a table of them is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned
from lichen.once import once
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.warp.kernels import Doubles, Kernel

MOST = 1 << 22
"""Weights worked on at once."""
SLOTS = 8, 32, 64
GROUPS = 128, 64, 32, 16
Whole = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Axis:
    """Sample i of the result is the sum over k of weights[i, k] x in[index[i, k]], plus constant[i] x value."""

    index: npt.NDArray[np.int32]
    weights: Doubles
    constant: Doubles

    @once
    def gain(self) -> float:
        """The largest sum of magnitudes."""
        return float((np.abs(self.weights).sum(axis=1) + np.abs(self.constant)).max())

    @property
    def taps(self) -> int:
        return int(self.index.shape[1])

    def read(self, first: int, count: int) -> tuple[int, int]:
        """The first sample that some of the result take, and the one after the last."""
        some = slice(first, first + count)
        taken = self.index[some][self.weights[some] != 0]
        return (int(taken.min()), int(taken.max()) + 1) if taken.size else (0, 1)

    def part(self, first: int, count: int, start: int, length: int) -> Axis:
        """Of so many samples of the result from the first on, from so many of the source."""
        some = slice(first, first + count)
        index = np.clip(self.index[some] - np.int32(start), 0, length - 1)
        return Axis(index, self.weights[some], self.constant[some])

    @cached_property
    def reach(self) -> tuple[Whole, Whole]:
        """Of each sample of the result: the first of the source that it takes, and the one after the last."""
        return self.index.min(axis=1), self.index.max(axis=1) + np.int32(1)

    def slots(self) -> int | None:
        """How many samples, a power of two, hold those of any one of the result if they are kept in order; None where
        there are too many, or they are not in order, as where a periodic border takes some from both ends."""
        low, high = self.reach
        ordered = (np.diff(low) >= 0).all() and (np.diff(high) >= 0).all()
        return next((count for count in SLOTS if int((high - low).max()) <= count), None) if ordered else None

    def spans(self, most: int) -> tuple[int, Whole] | None:
        """How many neighbours of the result take `most` samples of the source together at most, and for each such group
        the first of these and the one after the last; None where even the fewest take more."""
        low, high = self.reach
        for count in GROUPS:
            starts = np.arange(0, len(low), count)
            found = np.stack([np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)], axis=-1)
            if int((found[:, 1] - found[:, 0]).max()) <= most:
                return count, found
        return None

    def apply(self, pixels: Array, value: float) -> Array:
        """Along the first axis."""
        shape = (-1, *(1,) * (pixels.ndim - 1))
        out = np.zeros((len(self.index), *pixels.shape[1:]), pixels.dtype)
        for k in range(self.taps):
            out += self.weights[:, k].reshape(shape).astype(pixels.dtype) * pixels[self.index[:, k]]
        if self.constant.any():
            out += (self.constant * value).reshape(shape).astype(pixels.dtype)
        return out


@lru_cache(maxsize=64)
def ring(across: Axis, down: Axis, most: int) -> tuple[int, Whole, int, Whole] | None:
    """How many rows hold what any row of the result takes, and which those are; how many columns of the result take
    `most` of the source at most, and what each group of these takes. None where either is too much."""
    slots, found = down.slots(), across.spans(most)
    if slots is None or found is None:
        return None
    wide, spans = found
    return slots, aligned(np.stack(down.reach, axis=-1), np.int32), wide, aligned(spans, np.int32)


@lru_cache(maxsize=64)
def axis(before: int, after: int, kernel: Kernel, border: Border) -> Axis:
    """From `before` samples to `after`."""
    step = before / after
    stretch = max(step, 1.0)
    reach = kernel.radius * stretch
    taps = min(int(np.ceil(2 * reach)) + 1, before + 1)
    parts = []
    rows = max(1, MOST // int(np.ceil(2 * reach) + 2))
    for first in range(0, after, rows):
        parts.append(_rows(np.arange(first, min(first + rows, after)), before, after, kernel, border))
    width = max(part[0].shape[1] for part in parts)
    index = np.concatenate([np.pad(part[0], ((0, 0), (0, width - part[0].shape[1])), mode="edge") for part in parts])
    weights = np.concatenate([np.pad(part[1], ((0, 0), (0, width - part[1].shape[1]))) for part in parts])
    assert width <= taps
    return Axis(index.astype(np.int32), weights, np.concatenate([part[2] for part in parts]))


def _rows(
    which: npt.NDArray[np.int64], before: int, after: int, kernel: Kernel, border: Border
) -> tuple[npt.NDArray[np.int64], Doubles, Doubles]:
    """Index, weights and the constant's weight of some samples of the result."""
    step = before / after
    stretch = max(step, 1.0)
    place = (which + 0.5) * step - 0.5
    # A place that is a sample's, but for its rounding, is that sample's.
    near = np.rint(place)
    place = np.where(np.abs(place - near) < 1e-12 * before, near, place)
    far = kernel.radius * stretch
    first = np.floor(place - far).astype(np.int64)
    columns = first[:, np.newaxis] + np.arange(int(np.ceil(2 * far)) + 2)
    weights = kernel.value((columns - place[:, np.newaxis]) / stretch)
    weights = weights / weights.sum(axis=1, keepdims=True)
    at = continued(columns, before, border)
    constant = np.where(at == OUTSIDE, weights, 0.0).sum(axis=1)
    weights = np.where(at == OUTSIDE, 0.0, weights)
    inside = (columns[:, 0] >= 0) & (columns[:, -1] < before)
    inner = _compacted(columns[inside], weights[inside])
    outer = _merged(at[~inside], weights[~inside], before)
    return *_together(inside, inner, outer), constant


Taken = tuple[npt.NDArray[np.int64], Doubles]
"""Samples and their weights."""


def _together(inside: npt.NDArray[np.bool_], inner: Taken, outer: Taken) -> Taken:
    """Rows of both, in their places, as wide as the wider."""
    width = max(each.shape[1] for each, _ in (inner, outer) if len(each))
    index, weights = np.empty((len(inside), width), np.int64), np.zeros((len(inside), width))
    for which, (at, own) in ((inside, inner), (~inside, outer)):
        index[which] = at[:, :1]
        index[which, : at.shape[1]], weights[which, : at.shape[1]] = at, own
    return index, weights


def _compacted(columns: npt.NDArray[np.int64], weights: Doubles) -> Taken:
    """As `_merged`, of rows that take no sample twice: much quicker, and nearly all rows are such."""
    order = np.argsort(weights == 0, axis=1, kind="stable")
    weights = np.take_along_axis(weights, order, axis=1)
    width = max(int(np.count_nonzero(weights, axis=1).max(initial=0)), 1)
    weights, columns = weights[:, :width], np.take_along_axis(columns, order[:, :width], axis=1)
    return np.where(weights == 0, columns[:, :1], columns), weights


def _merged(at: npt.NDArray[np.int64], weights: Doubles, before: int) -> tuple[npt.NDArray[np.int64], Doubles]:
    """Weights of one sample added up, those of 0 left out, rows filled up with weight 0 of a sample they have."""
    count = len(at)
    keys = (np.arange(count)[:, np.newaxis] * before + np.where(weights == 0, 0, at)).reshape(-1)
    keep = weights.reshape(-1) != 0
    found, where = np.unique(keys[keep], return_inverse=True)
    summed = np.bincount(where, weights.reshape(-1)[keep], minlength=len(found))
    rows, samples = found // before, found % before
    starts = np.searchsorted(rows, np.arange(count + 1))
    lengths = np.diff(starts)
    width = max(int(lengths.max(initial=0)), 1)
    slots = np.arange(width)
    inside = slots < lengths[:, np.newaxis]
    taken = np.where(
        inside, starts[:-1, np.newaxis] + slots, np.minimum(starts[:-1], max(len(found) - 1, 0))[:, np.newaxis]
    )
    if not len(found):
        return np.zeros((count, 1), np.int64), np.zeros((count, 1))
    index = np.where(lengths[:, np.newaxis] > 0, samples[taken], 0)
    return index, np.where(inside, summed[taken], 0.0)
