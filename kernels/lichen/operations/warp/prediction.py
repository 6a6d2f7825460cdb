"""What warps predict from facts alone: the range of a result, and how far a filter can be from truth.

Two results that lie within a known distance from the middle of the samples' range are no further apart than both
distances together, and no image holds a filter to less: that is the bound. The typical error is what filters differ in,
RMS over the range, as found on the corpus.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.once import latest
from lichen.operation import ROUNDING, Error, Facts, InputFacts, Knob
from lichen.operations.warp import kernels
from lichen.operations.warp.shears import line_kernel

LARGEST = 16384
"""Pixels along a side of a result."""
Size = tuple[int, int]
"""Width and height."""

GAINS: Mapping[str, float] = {
    "nearest": 1.0,
    "bilinear": 1.0,
    "bicubic": kernels.CATMULL_ROM.gain**2,
    "mitchell": kernels.MITCHELL.gain**2,
    "bspline": kernels.cardinal_gain() ** 2,
    "lanczos2": kernels.LANCZOS2.gain**2,
    "lanczos3": kernels.LANCZOS3.gain**2,
    "mip": 1.0,
    "supersampled": kernels.LANCZOS3.gain**2,
    "ewa": kernels.LANCZOS3.gain**2,
}
"""How far beyond the middle of the samples' range a result can lie, over half that range."""
TRUTH_GAIN = GAINS["lanczos3"]
MOST_GAIN = max(GAINS.values())
TYPICAL: Mapping[str, tuple[float, float]] = {
    "nearest": (0.047, 0.105),
    "bilinear": (0.020, 0.075),
    "bicubic": (0.009, 0.091),
    "mitchell": (0.016, 0.078),
    "bspline": (0.0023, 0.096),
    "lanczos2": (0.009, 0.091),
    "lanczos3": (0.0, 0.099),
    "mip": (0.020, 0.023),
}
"""RMS error over the range of the image, the median over the corpus: of a turn, and of a scale by 0.3 x 0.45."""


def typical(method: str, knob: float, *, shrinks: bool) -> float:
    """What is usually left. Of supersampling by 2, 4 and 8 points 0.064, 0.020 and 0.004; of ellipses by 1, 2 and 4
    samples 0.011, 3e-7 and 1e-8 for that scale, and 6e-4, 3e-5 and 2e-8 for a plane to the horizon."""
    if method == "supersampled":
        return 0.25 / knob**2 if shrinks else 0.0
    if method == "ewa":
        return 0.005 / knob**8 if shrinks else 0.0
    return TYPICAL[method][shrinks]


class Bordered(Protocol):
    """Parameters that say what lies beyond the image."""

    @property
    def value(self) -> float: ...


@latest
def value_range(facts: Facts, p: Bordered) -> tuple[float, float]:
    """Lowest and highest value that takes part; the background always may."""
    return min(facts.extent.low, p.value), max(facts.extent.high, p.value)


def result_facts(p: Bordered, facts: InputFacts, size: Size, gain: float = MOST_GAIN) -> Facts:
    image = facts["image"]
    low, high = value_range(image, p)
    slack = (gain - 1) * (high - low) / 2 + 1e-5 * max(abs(low), abs(high))
    extent = Extent(low - slack, high + slack, image.extent.nonfinite)
    width, height = size
    return Facts(height, width, image.channels, image.space, image.alpha, extent)


def rounding(image: Facts, p: Bordered, gain: float, *, area: bool) -> float:
    """Of the fraction, the weights and their sums; an ellipse's is as long as the image at most, in steps of four."""
    low, high = value_range(image, p)
    steps = 64 + (2 * (image.width + image.height) if area else 0)
    return steps * ROUNDING * gain * max(abs(low), abs(high))


AREA = ("mip", "supersampled", "ewa")


def error_of(method: str, p: Bordered, knob: float, facts: InputFacts, *, shrinks: bool) -> Error:
    image = facts["image"]
    low, high = value_range(image, p)
    spread, gain = high - low, GAINS[method]
    least = rounding(image, p, max(gain, 1.0), area=method in AREA and shrinks)
    if method in ("lanczos3", "supersampled", "ewa") and not shrinks:
        return Error(least, "bound", least)
    # What both interpolate alike does not count, and two means are no further apart than the spread.
    apart = spread if method in ("supersampled", "ewa") else spread * (gain + TRUTH_GAIN) / 2
    return Error(apart + least, "bound", least, spread * typical(method, knob, shrinks=shrinks) + least)


def least_of(method: str, p: Bordered, knob: float, facts: InputFacts, *, shrinks: bool) -> float:
    """As `error_of`, at least and usually, rounding aside."""
    low, high = value_range(facts["image"], p)
    exact = method in ("lanczos3", "supersampled", "ewa") and not shrinks
    return 0.0 if exact else (high - low) * typical(method, knob, shrinks=shrinks)


def shears_error(p: Bordered, size: float, facts: InputFacts) -> Error:
    """Of three passes by a kernel of that radius; a result rounded once from float64."""
    image = facts["image"]
    low, high = value_range(image, p)
    gain = line_kernel(round(size)).gain ** 4
    least = 16 * ROUNDING * gain * max(abs(low), abs(high))
    return Error((high - low) * (gain + TRUTH_GAIN) / 2 + least, "bound", least, (high - low) * 0.02 + least)


def check_size(image: Facts, size: Size) -> list[Flaw]:
    if size[0] * size[1] * image.channels < 2**31 and image.samples < 2**31:
        return []
    return [Flaw("/parameters/width", "pixels times channels must stay below 2^31")]


SAMPLES = Knob("samples", (1.0, 2.0, 4.0), "samples of the pyramid's level along half the shorter axis", 1.0, 8.0)
POINTS = Knob("points", (2.0, 4.0, 8.0), "samples along each axis of an ellipse", 2.0, 16.0)


def reach_of(samples: float) -> float:
    """The radius at which an ellipse of so many samples is cut; truth cuts at 3."""
    return min(2 + math.log2(samples) / 2, 3.0)


def most_of(samples: float) -> float:
    """The largest product of an ellipse's half axes on the level it is taken from, so that it holds no more than
    448 samples^4 of it: what is longer is taken from a coarser one."""
    return 448 * samples**4 / (math.pi * reach_of(samples) ** 2)
