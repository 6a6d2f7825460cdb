"""In which numbers values are kept between steps, and what that costs.

A run in a `Precision` stores every input, and what every operation gives, in it: a model of 8-bit frame buffers, of
12-bit pipelines, of half-float textures. Inside an operation the arithmetic stays float32. Fixed point holds [0, 1] in
2^n - 1 equal steps; what lies outside is clipped. Data (vectors, depths, differences: values without colour) are kept
with a bias and a scale instead, as frame buffers hold them, so that the steps divide their own range where that reaches
beyond [0, 1]. float16 saturates at 65504. Rounding is to the nearest, ties to even. NaN and infinity stay what they
are: a store that lost them would turn them into a colour.

The bound. A stored value lies off by half a step, or by as much as was clipped. Storing is monotone, so the range of
stored values is that of the ends, stored. The steps of data are no wider than those of the range that facts tell of. In
a straight picture both colour and coverage are stored, and colour counts multiplied by its coverage
(`accuracy.metrics`): with colours up to m each of both errors arrives m times at most.
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum

import numpy as np

from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import Array, aligned_empty
from lichen.operation import ROUNDING, Facts

HALF_MAX = 65504.0
UNIT = (0.0, 1.0)
"""What fixed point holds of a picture."""
_BLOCK = 1 << 18


class Precision(StrEnum):
    """How values are stored between steps, coarsest first."""

    FIXED8 = "fixed8"
    """[0, 1] in 255 steps"""
    FIXED12 = "fixed12"
    """[0, 1] in 4095 steps"""
    FIXED16 = "fixed16"
    """[0, 1] in 65535 steps"""
    FLOAT16 = "float16"
    """half floats"""
    FLOAT32 = "float32"
    """as computed"""
    FLOAT64 = "float64"
    """nothing but the definition, evaluated in doubles; slow"""

    @property
    def levels(self) -> int | None:
        """Steps in [0, 1] of fixed point; None for floats."""
        return 2 ** int(self[5:]) - 1 if self.startswith("fixed") else None

    @property
    def lossless(self) -> bool:
        """Whether storing changes nothing."""
        return self in (Precision.FLOAT32, Precision.FLOAT64)


PRECISIONS = tuple(Precision)


def span(image: Image | Facts) -> tuple[float, float]:
    """The values between which fixed point divides: [0, 1], or as far as data reach beyond."""
    if image.space is not Space.DATA or image.alpha is not Alpha.NONE:
        return UNIT
    return min(image.extent.low, UNIT[0]), max(image.extent.high, UNIT[1])


def kept(image: Image, precision: Precision) -> Image:
    """The image as it comes back from the store; itself, with what is known of it, where nothing is lost."""
    if precision.lossless:
        return image
    within = UNIT if precision.levels is None else span(image)
    return image.replace(pixels=stored(image.pixels, precision, within))


def stored(pixels: Array, precision: Precision, within: tuple[float, float] = UNIT) -> Array:
    """`pixels` as they come back from the store, of the same dtype; the array itself where nothing is lost. `within` is
    what fixed point divides.

    >>> import numpy as np
    >>> (stored(np.array([0.5, -1.0, 2.0, np.nan]), Precision.FIXED8) * 255).tolist()
    [128.0, 0.0, 255.0, nan]
    >>> stored(np.array([-1.0, 0.001, 1.0]), Precision.FIXED8, (-1.0, 1.0)).round(4).tolist()
    [-1.0, 0.0039, 1.0]
    """
    if precision.lossless:
        return pixels
    result = aligned_empty(pixels.shape, pixels.dtype)
    source, target = pixels.reshape(-1), result.reshape(-1)
    with np.errstate(all="ignore"):
        for start in range(0, source.size, _BLOCK):
            block = source[start : start + _BLOCK]
            rounded = _rounded(block, precision, within)
            target[start : start + _BLOCK] = np.where(np.isfinite(block), rounded, block)
    return result


def _rounded(values: Array, precision: Precision, within: tuple[float, float] = UNIT) -> Array:
    levels = precision.levels
    if levels is None:
        return np.clip(values, -HALF_MAX, HALF_MAX).astype(np.float16)
    low, high = within
    if within == UNIT:
        fixed: Array = np.rint(np.clip(values.astype(np.float64), 0, 1) * levels) / levels
        return fixed
    code = np.rint((np.clip(values.astype(np.float64), low, high) - low) * (levels / (high - low)))
    spread: Array = np.minimum(low + code * ((high - low) / levels), high)
    return spread


def storing_error(extent: Extent, precision: Precision, within: tuple[float, float] = UNIT) -> float:
    """The largest change of any finite value within `extent` by storing it."""
    if precision.lossless:
        return 0.0
    levels = precision.levels
    if levels is None:
        magnitude = min(extent.magnitude, HALF_MAX)
        step = 2.0 ** (max(math.frexp(magnitude)[1], -13) - 11)
        return max(step / 2, extent.magnitude - HALF_MAX)
    # The step's end is rounded to float32 when it is read back.
    low, high = within
    rounding = ROUNDING * max(abs(low), abs(high))
    return max(0.5 * (high - low) / levels + rounding, low - extent.low, extent.high - high)


def visible_storing_error(facts: Facts, precision: Precision, slack: float = 0.0) -> float:
    """`storing_error` as differences of images count, for values that stray from the facts by at most `slack`."""
    extent = Extent(facts.extent.low - slack, facts.extent.high + slack, 0)
    error = storing_error(extent, precision, span(dataclasses.replace(facts, extent=extent)))
    if facts.alpha is not Alpha.STRAIGHT:
        return error
    return max(error, error * (2 * extent.magnitude + error))


def keeping(facts: Facts, precision: Precision) -> Facts:
    """Facts that hold before and after storing."""
    if precision.lossless:
        return facts
    extent, within = facts.extent, span(facts)
    low, high = (float(_rounded(np.array([each]), precision, within)[0]) for each in (extent.low, extent.high))
    wider = Extent(min(extent.low, low), max(extent.high, high), extent.nonfinite)
    return facts if wider == extent else dataclasses.replace(facts, extent=wider)
