"""Interpolation kernels: what a sample is worth at a distance from it.

All have finite support, are even, and are used with their weights divided by their sum, so a constant stays one.
The sum of the magnitudes of the weights, at the worst place between two samples, is the kernel's `gain`: no result
lies further from the middle of the samples' range than that many times half their spread.

Sources: Keys, Cubic convolution interpolation for digital image processing, IEEE ASSP 29, 1981; Mitchell and
Netravali, Reconstruction filters in computer graphics, SIGGRAPH 1988; Duchon, Lanczos filtering in one and two
dimensions, J. Applied Meteorology 18, 1979; Unser, Splines: a perfect fit, IEEE Signal Processing Magazine 16, 1999.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lichen.memory import Array

Doubles = Array
"""Of float64."""


@dataclass(frozen=True)
class Kernel:
    """k(x) for |x| < `radius`; `code` is its number in the device's sources. `interpolates`: k(0) = 1, and 0 at every
    other integer, so that samples come back as they were."""

    name: str
    radius: float
    value: Callable[[Doubles], Doubles]
    code: int
    interpolates: bool = True

    @property
    def taps(self) -> int:
        """How many samples lie within its support, at most."""
        return max(1, round(2 * self.radius))

    def offsets(self) -> npt.NDArray[np.int64]:
        """Of the samples it takes, from the one before the place."""
        return np.arange(self.taps) - (self.taps // 2 - 1)

    def weights(self, fraction: Array) -> Doubles:
        """Normalised weights of the samples at `offsets`, in a first axis, for places `fraction` past a sample."""
        f = np.asarray(fraction, np.float64)
        distances = f - self.offsets().reshape(-1, *(1,) * f.ndim)
        weights = self.value(distances)
        made: Doubles = weights / weights.sum(axis=0)
        return made

    @cached_property
    def gain(self) -> float:
        """The largest sum of magnitudes of the weights, over 4096 places between two samples."""
        fractions = np.arange(4096) / 4096
        return float(np.abs(self.weights(fractions)).sum(axis=0).max())


def _nearest(x: Doubles) -> Doubles:
    return np.where((x >= -0.5) & (x < 0.5), 1.0, 0.0)


def _triangle(x: Doubles) -> Doubles:
    made: Doubles = np.maximum(1 - np.abs(x), 0)
    return made


def cubic(b: float, c: float) -> Callable[[Doubles], Doubles]:
    """The two-parameter family of Mitchell and Netravali."""

    def value(x: Doubles) -> Doubles:
        a = np.abs(x)
        near = ((12 - 9 * b - 6 * c) * a + (-18 + 12 * b + 6 * c)) * a * a + (6 - 2 * b)
        far = (((-b - 6 * c) * a + (6 * b + 30 * c)) * a + (-12 * b - 48 * c)) * a + (8 * b + 24 * c)
        made: Doubles = np.where(a < 1, near, np.where(a < 2, far, 0)) / 6
        return made

    return value


def lanczos(n: int) -> Callable[[Doubles], Doubles]:
    """The sinc, windowed by the main lobe of one n times as wide. Exactly 0 at the integers but 0."""

    def value(x: Doubles) -> Doubles:
        whole = x == np.rint(x)
        made = np.where(np.abs(x) < n, np.sinc(x) * np.sinc(x / n), 0)
        kept: Doubles = np.where(whole, np.where(x == 0, 1.0, 0.0), made)
        return kept

    return value


NEAREST = Kernel("nearest", 0.5, _nearest, 0)
BILINEAR = Kernel("bilinear", 1, _triangle, 1)
CATMULL_ROM = Kernel("bicubic", 2, cubic(0, 0.5), 0)
MITCHELL = Kernel("mitchell", 2, cubic(1 / 3, 1 / 3), 1, interpolates=False)
BSPLINE = Kernel("bspline", 2, cubic(1, 0), 2, interpolates=False)
LANCZOS2 = Kernel("lanczos2", 2, lanczos(2), 3)
LANCZOS3 = Kernel("lanczos3", 3, lanczos(3), 0)

POLE = 3**0.5 - 2
"""Of the recursion that makes a cubic B-spline go through its samples."""
TAIL = 16
"""Samples after which the recursion's response, |POLE|^n, is lost in float32."""


def prefilter() -> Doubles:
    """The impulse response of the inverse of [1 4 1] / 6, to `TAIL` samples each way; its sum is 1."""
    response = POLE ** np.abs(np.arange(-TAIL, TAIL + 1, dtype=np.float64))
    made: Doubles = response / response.sum()
    return made


def cardinal_gain() -> float:
    """The gain of the interpolating cubic spline: prefilter and B-spline together."""
    fractions = np.arange(1024) / 1024
    spread = np.stack([np.convolve(column, prefilter()) for column in BSPLINE.weights(fractions).T])
    return float(np.abs(spread).sum(axis=1).max())
