"""How far a result lies from truth, in numbers that cannot hide anything.

Differences are taken over all samples, borders included. Where either side is NaN or infinite there is no difference
to take: such samples are counted apart, as mismatches unless both sides hold the same. Colour of straight images
counts as it shows, each side multiplied by its own coverage: under none it has no visible value, and a picture is as
far from another as their associated forms are.

* `difference`: largest, p99.9 and RMS, in output units; `regions` takes them apart at the border.
* `steps`: between the numbers a storage holds: code values of integers, neighbours of floats.
* `ulps`: in units in the last place of float32, before any storage.
* `psnr`: the mean square against a peak that the caller states; never a figure by itself.

What a viewer sees is in `accuracy.colour`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lichen.files.samples import to_storage
from lichen.image import Alpha, Storage
from lichen.memory import Array
from lichen.operation import Footprint

SUBNORMAL = -125
"""Exponent, as `frexp` counts, from which downwards the units of float32 no longer shrink."""


BLOCK = 1 << 15
"""Samples whose differences are taken at once, so that they stay in cache."""
SHARE = 0.999
"""Of the samples that do not exceed `p999`."""


class Totals(NamedTuple):
    """Figures of absolute differences, in output units."""

    largest: float
    p999: float
    rms: float
    mean: float
    mismatched: int


@dataclass(frozen=True, slots=True)
class Difference:
    """Absolute differences in output units."""

    largest: float
    p999: float
    """exceeded by one sample in a thousand"""
    rms: float
    mismatched: int
    """samples that are non-finite on one side, or differently so on both"""
    sampled: float = 1.0
    """the share of the pixels that were compared"""


class Regions(NamedTuple):
    """Differences where the border has a part in the result, and where it has none; None for an empty region."""

    border: Difference | None
    inside: Difference | None


@dataclass(frozen=True, slots=True)
class Steps:
    """Differences counted in numbers that a storage can hold."""

    largest: int
    differing: float
    """the share of the samples that are not stored alike"""
    mismatched: int


def difference(pixels: Array, truth: Array, alpha: Alpha = Alpha.NONE) -> Difference:
    """Compare two arrays of one shape (height, width, channels). `alpha` says what their last channel is.

    >>> import numpy as np
    >>> difference(np.ones((2, 2, 1)), np.zeros((2, 2, 1))).largest
    1.0
    """
    found = totals(pixels, truth, alpha)
    return Difference(found.largest, found.p999, found.rms, found.mismatched)


def totals(pixels: Array, truth: Array, alpha: Alpha = Alpha.NONE) -> Totals:
    """The figures of all samples in one pass over blocks that stay in cache.

    Of the largest thousandth only what exceeds a bound from a sample of the pixels is kept; where that was too high,
    all differences are taken again.
    """
    if pixels.shape != truth.shape:
        raise ValueError(f"shapes differ: {pixels.shape} and {truth.shape}")
    made, exact = (each.reshape(-1, each.shape[-1]) for each in (pixels, truth))
    bound = high_bound(made, exact, alpha)
    mismatched = count = 0
    largest = total = squares = 0.0
    high: list[Array] = []
    for start in range(0, len(made), step := max(1, BLOCK // made.shape[1])):
        apart, unlike = deviations(made[start : start + step], exact[start : start + step], alpha)
        taken, added = _taken(apart)
        mismatched += unlike
        count += taken.size
        largest = max(largest, float(taken.max(initial=0.0)))
        total += added
        squares += float(np.einsum("i,i", taken, taken))
        high.append(taken[taken > bound])
    if not count:
        return Totals(0.0, 0.0, 0.0, 0.0, mismatched)
    kept = np.concatenate(high)
    p999 = quantile(kept, count, bound, count - kept.size if bound == 0.0 else 0)
    if p999 is None:
        p999 = whole_quantile(made, exact, alpha)
    return Totals(largest, p999, math.sqrt(squares / count), total / count, mismatched)


def _taken(apart: Array) -> tuple[Array, float]:
    """The differences that there are, flat, and their sum: one that is unknown makes no number of it."""
    flat = apart.reshape(-1)
    total = float(flat.sum())
    if math.isnan(total):
        flat = flat[~np.isnan(flat)]
        total = float(flat.sum())
    return flat, total


def high_bound(made: Array, exact: Array, alpha: Alpha) -> float:
    """What about three differences in a thousand exceed, by a sample of the pixels (count, channels): more than the one
    that `SHARE` needs, even if whole pixels differ, and few to rank. Less than any where there are few pixels."""
    if made.size < 8 * BLOCK:
        return -1.0
    stride = made.size // BLOCK
    # Put together first: a difference of few strided channels takes a loop of its own for each pixel.
    first, second = (np.ascontiguousarray(each[::stride]) for each in (made, exact))
    taken, _ = _taken(deviations(first, second, alpha)[0])
    if not taken.size:
        return -1.0
    place = int(0.997 * taken.size)
    return float(np.partition(taken, place)[place])


def quantile(high: Array, count: int, bound: float, equal: int) -> float | None:
    """The `SHARE` quantile of `count` differences of which `high` are those above the bound, and `equal` are the bound;
    None if it is not among them."""
    place = (count - 1) * SHARE
    low, part = int(place), place - int(place)
    least = count - high.size
    if low < least - equal:
        return None
    below, above = (each - least for each in (low, min(low + 1, count - 1)))
    if above < 0:
        return bound
    ranked = np.partition(high, max(below, 0))  # about one place: about two it takes twice as long
    first = float(ranked[below]) if below >= 0 else bound
    second = float(ranked[below + 1 :].min()) if above > below else first
    return first + (second - first) * part


def whole_quantile(made: Array, exact: Array, alpha: Alpha) -> float:
    """The same of all differences at once."""
    return float(np.quantile(_taken(deviations(made, exact, alpha)[0])[0], SHARE))


def deviations(pixels: Array, truth: Array, alpha: Alpha = Alpha.NONE) -> tuple[Array, int]:
    """Absolute differences of all samples, float64, NaN where either side is not finite; and how many mismatch."""
    if pixels.shape != truth.shape:
        raise ValueError(f"shapes differ: {pixels.shape} and {truth.shape}")
    with np.errstate(all="ignore"):
        shown, exact = (visible(each, alpha) if alpha is Alpha.STRAIGHT else each for each in (pixels, truth))
        apart = np.subtract(shown, exact, dtype=np.float64)
        np.abs(apart, out=apart)
        if np.isfinite(apart.sum()):  # then so are both sides
            return apart, 0
    finite = np.isfinite(shown) & np.isfinite(exact)
    same = (shown == exact) | (np.isnan(shown) & np.isnan(exact))
    apart[~finite] = np.nan
    return apart, int(np.count_nonzero(~finite & ~same))


def visible(pixels: Array, alpha: Alpha) -> Array:
    """float64, with colour of a straight image multiplied by its coverage."""
    doubled = pixels.astype(np.float64)
    if alpha is Alpha.STRAIGHT:
        doubled[..., :-1] *= doubled[..., -1:]
    return doubled


def regions(pixels: Array, truth: Array, footprint: Footprint, alpha: Alpha = Alpha.NONE) -> Regions:
    """The difference in the outer ring, as wide as the footprint, and inside it.

    >>> import numpy as np
    >>> wrong = np.pad(np.zeros((4, 4, 1)), ((1, 1), (1, 1), (0, 0)), constant_values=2.0)
    >>> border, inside = regions(wrong, np.zeros((6, 6, 1)), Footprint(1, 1))
    >>> border.largest, inside.largest
    (2.0, 0.0)
    """
    height, width = pixels.shape[:2]
    rows, columns = (
        size if reach is None else reach for reach, size in zip(footprint.sides, (height, width), strict=True)
    )
    ring = np.ones((height, width), bool)
    ring[rows : max(height - rows, rows), columns : max(width - columns, columns)] = False

    def within(mask: Array) -> Difference | None:
        # One row of pixels is an image like any other to the figures.
        return difference(pixels[mask][np.newaxis], truth[mask][np.newaxis], alpha) if mask.any() else None

    return Regions(within(ring), within(~ring))


def steps(pixels: Array, truth: Array, storage: Storage) -> Steps:
    """How many numbers of `storage` lie between result and truth once both are stored: code values of integers.

    >>> import numpy as np
    >>> steps(np.full((1, 1, 1), 0.5), np.full((1, 1, 1), 0.51), Storage.UINT8).largest
    2
    """
    unlike = ~np.isfinite(pixels) | ~np.isfinite(truth)
    same = (pixels == truth) | (np.isnan(pixels) & np.isnan(truth))
    with np.errstate(all="ignore"):
        made, exact = (_ranked(to_storage(np.ascontiguousarray(each), storage)[0]) for each in (pixels, truth))
        apart = np.where(made > exact, made - exact, exact - made)
    apart[unlike] = 0
    return Steps(int(apart.max(initial=0)), float(np.mean(apart != 0)), int(np.count_nonzero(unlike & ~same)))


def _ranked(samples: Array) -> Array:
    """Samples as integers in their order; neighbours among floats are one apart."""
    if samples.dtype.kind != "f":
        return samples.astype(np.int64)
    bits = samples.view(f"i{samples.dtype.itemsize}").astype(np.int64)
    lowest = np.int64(-(2 ** (8 * samples.dtype.itemsize - 1)))
    ranked: Array = np.where(bits < 0, lowest - bits, bits)
    return ranked


def ulps(pixels: Array, truth: Array) -> float:
    """The largest difference in units in the last place of truth as float32, over finite samples.

    Zero and subnormal truths count in the spacing of subnormals. Meant for pointwise results: a sum over pixels is
    small by cancellation somewhere, and there no float32 evaluation has few ULP. Raises ValueError where the shapes
    differ.

    >>> import numpy as np
    >>> ulps(np.ones((1, 1, 1)), np.full((1, 1, 1), 1 + 2.0**-23))
    1.0
    """
    return float(np.nanmax(units_apart(pixels, truth), initial=0.0))


def units_apart(pixels: Array, truth: Array) -> Array:
    """The difference of every sample, in units in the last place of truth as float32: float64, in the shape of both;
    NaN where either side is not finite. Raises ValueError where the shapes differ.

    >>> import numpy as np
    >>> units_apart(np.array([1.0, 2.0, np.nan]), np.array([1 + 2.0**-23, 2.0, 0.0]))
    array([ 1.,  0., nan])
    """
    exact = truth.astype(np.float64)
    exponent = np.where(exact == 0, SUBNORMAL, np.frexp(exact)[1])
    unit = np.ldexp(1.0, np.maximum(exponent, SUBNORMAL) - 24)
    apart: Array = deviations(pixels, truth)[0] / unit
    return apart


def psnr(pixels: Array, truth: Array, peak: float, alpha: Alpha = Alpha.NONE) -> float:
    """Peak signal-to-noise ratio in dB for the stated `peak`; infinite for equal images, NaN where samples mismatch."""
    return psnr_of(totals(pixels, truth, alpha), peak)


def psnr_of(found: Totals | Difference, peak: float) -> float:
    """The same of differences that are known."""
    if found.mismatched:
        return math.nan
    return 20 * math.log10(peak / found.rms) if found.rms else math.inf
