"""Gaussians whose axes are turned: the kernel, how much of it is needed, and how few products make it up.

With u along the first axis, `angle` from x towards y, and v across, the kernel is exp(-u^2 / 2 sx^2 - v^2 / 2 sy^2) at
integer x and y, normalised to sum to 1 over all of them. It is no product of a column and a row, but nearly a sum of a
few: of the correlation r between x and y, the k-th counts (r / (1 + sqrt(1 - r^2)))^k, by Mehler's formula.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.image import Image
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import ROUNDING, Border, Error, Facts
from lichen.operations.convolution import lowrank
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.gaussian_weights import BARELY, NORMAL
from lichen.operations.convolution.kernels import Matrix, separated
from lichen.operations.convolution.passes import folded
from lichen.operations.convolution.stencil import Stencil, correlate_numpy, correlate_opencl
from lichen.operations.convolution.transform import Layout, correlated_by_transform, layout

MOVED = 60.0
"""Multiply-adds that take as long as moving a sample through two passes."""
FEW = 260e3
"""Samples by which two passes over an image take longer than in proportion: a small one keeps few work-items busy."""
SPECTRAL, SINGLE = 1e-9, 24
"""Weight that is cut off where spectra are multiplied; bits of float32."""
NARROWEST, WIDEST = 0.5, 50.0
"""px: a narrower one falls between the pixels, whatever it is divided by; a wider one takes too long to take apart."""


@dataclass(frozen=True)
class Turned:
    """Standard deviations along two axes, the first `angle` degrees from x towards y."""

    along: float
    across: float
    angle: float

    @property
    def deviations(self) -> tuple[float, float]:
        """Along y and along x: of the sums over rows and over columns."""
        c, s = math.cos(math.radians(self.angle)), math.sin(math.radians(self.angle))
        return math.hypot(s * self.along, c * self.across), math.hypot(c * self.along, s * self.across)

    @property
    def correlation(self) -> float:
        """Of x and y, how large."""
        down, across = self.deviations
        double = math.sin(math.radians(2 * self.angle)) * (self.along - self.across) * (self.along + self.across)
        return min(abs(double) / (2 * down * across), 1.0)

    @property
    def radii(self) -> tuple[int, int]:
        """Rows and columns either way beyond which nothing matters even in float64."""
        reach = math.sqrt(-2 * math.log(BARELY))
        down, beside = self.deviations
        return math.ceil(reach * down) + 1, math.ceil(reach * beside) + 1


@lru_cache(maxsize=8)
def kernel(turned: Turned) -> Matrix:
    rows, columns = turned.radii
    y, x = np.arange(-rows, rows + 1)[:, None], np.arange(-columns, columns + 1)[None, :]
    c, s = math.cos(math.radians(turned.angle)), math.sin(math.radians(turned.angle))
    weights = np.exp(-0.5 * (((c * x + s * y) / turned.along) ** 2 + ((c * y - s * x) / turned.across) ** 2))
    made: Matrix = weights / math.fsum(weights.sum(axis=1))
    return made


@lru_cache(maxsize=8)
def _outside(turned: Turned) -> list[Matrix]:
    """The weight beyond radius 0, 1, 2 ... down and across."""
    sums = [kernel(turned).sum(axis=axis)[half:] for axis, half in zip((1, 0), turned.radii, strict=True)]
    return [np.append(2 * np.cumsum(each[::-1])[::-1], 0.0)[1:] for each in sums]


@lru_cache(maxsize=32)
def cut(turned: Turned, tail: float) -> tuple[Matrix, float]:
    """The middle of the kernel with at most `tail` of its weight outside, normalised, and the weight left outside."""
    whole, middle = kernel(turned), []
    for half, outside in zip(turned.radii, _outside(turned), strict=True):
        radius = int(np.argmax(outside <= tail / 2))
        middle.append(slice(half - radius, half + radius + 1))
    inner = whole[tuple(middle)]
    inside = math.fsum(inner.sum(axis=1))
    return inner / inside, max(1 - inside, 0.0)


@lru_cache(maxsize=32)
def taken_apart(turned: Turned, tail: float) -> tuple[list[tuple[Matrix, Matrix]], Matrix]:
    """The cut kernel as columns times rows, and what of it they leave: at most `tail`."""
    return separated(cut(turned, tail)[0], tail)


def blurred(pixels: Array, turned: Turned, border: Border, value: float) -> Array:
    """The definition, float64: row for row of the kernel, each a product with the matrix of its border."""
    whole = kernel(turned)
    height, width, _ = pixels.shape
    out = np.zeros(pixels.shape)
    for row, weights in enumerate(whole):
        matrix, constant = folded(weights, width, border)
        at = continued(np.arange(height) + row - len(whole) // 2, height, border)
        lines = pixels[np.maximum(at, 0)]
        lines[at == OUTSIDE] = value
        out += np.einsum("ij,yjc->yic", matrix, lines, optimize=True) + value * constant[None, :, None]
    return out


def stencil(turned: Turned, tail: float) -> Stencil:
    taps = cut(turned, tail)[0]
    return Stencil(taps, taps.shape[0] // 2, taps.shape[1] // 2)


# ------------------------------------------------------------------------------------------ sums of columns times rows


def error(turned: Turned, tail: float, wide: float, magnitude: float) -> Error:
    """Without the kernel, which it would take long to take apart: at most `tail` of its weight is cut off, and of what
    remains its products leave at most `tail`."""
    tall, across = sides(turned, tail)
    weight = math.sqrt(tall * across) * _nuclear(turned) / (1 - tail)
    rounding = lowrank.rounding_of(tall + across, min(tall, across), weight * magnitude)
    return Error(tail * (wide + magnitude) + rounding, "bound", rounding)


def sides(turned: Turned, tail: float) -> tuple[int, int]:
    """Rows and columns of the cut kernel, at most: its sums along rows and columns are those of a Gaussian but for a
    share of 2 e^(-2 pi^2 s^2) of them, s being the deviation along the other, which is no less than `NARROWEST`."""
    reach = NORMAL.inv_cdf(1 - tail / (4 * 1.02))
    tall, across = (2 * math.ceil(max(reach, 1.0) * each - 0.5) + 1 for each in turned.deviations)
    return tall, across


def _nuclear(turned: Turned) -> float:
    """What the kernel's singular values sum to at most. But for its factors of x and of y alone it is e^(d x y), the
    sum of (d x y)^k / k!: products, each of two l2 norms, which sum to no more than the root of both norms' squares
    together, by Cauchy and Schwarz. Its own sum, which it is divided by, is at least the integral, by Poisson."""
    down, beside = (each * math.sqrt(math.pi * (1 + turned.correlation)) + 1 for each in turned.deviations)
    return math.sqrt(down * beside) / (2 * math.pi * turned.along * turned.across)


def work(turned: Turned, tail: float, image: Facts) -> float:
    """Multiply-adds, beside what it takes to move samples through two passes: of about as many products as Mehler's
    formula has."""
    r = turned.correlation
    share = max(r / (1 + math.sqrt(1 - r * r)), 1e-9)
    tall, across = sides(turned, tail)
    terms = min(math.floor(math.log(tail) / math.log(share)) + 1, tall, across)
    return (image.samples + FEW) * terms * (tall + across + MOVED)


def summed_opencl(device: Device, image: Image, turned: Turned, tail: float, border: Border, value: float) -> Array:
    if image.extent.nonfinite:  # which products would spread
        return correlate_opencl(device, image, stencil(turned, tail), border, value)
    return lowrank.summed_opencl(device, image.pixels, _passes(turned, tail, value), border, value)


def summed_numpy(image: Image, turned: Turned, tail: float, border: Border, value: float) -> Array:
    if image.extent.nonfinite:
        return correlate_numpy(image, stencil(turned, tail), border, value)
    return lowrank.summed_numpy(image.pixels, _passes(turned, tail, value), border, value)


def _passes(turned: Turned, tail: float, value: float) -> lowrank.Passes:
    whole = stencil(turned, tail)
    return lowrank.passes(taken_apart(turned, tail)[0], whole.top, whole.left, 0.0, value)


# ------------------------------------------------------------------------------------------------ products of spectra


def spectral_error(bits: float, laid: Layout, wide: float, magnitude: float) -> Error:
    """The weight that is cut off, and rounding: of transforms in float32 the worst that was seen, with a margin of two;
    of those in doubles that of the result."""
    rounding = ROUNDING * (1.0 + 1e-6 if bits > SINGLE else math.log2(math.prod(laid.sides))) * magnitude
    return Error(SPECTRAL * wide + rounding, "estimate", rounding)


def spectral_work(bits: float, laid: Layout, channels: int) -> float:
    return channels * laid.work * (1.0 if bits > SINGLE else 0.6)


def spectral_layout(deviations: tuple[float, float], image: Facts) -> Layout:
    """About that of the transforms, without the kernel."""
    tall, wide = (2 * math.ceil(NORMAL.inv_cdf(1 - SPECTRAL / 4) * each) + 1 for each in deviations)
    return layout(image.height, image.width, (tall, wide))


def by_spectra(image: Image, turned: Turned, bits: float, border: Border, value: float) -> Array:
    kind = np.float64 if bits > SINGLE else np.float32
    return correlated_by_transform(image.pixels, stencil(turned, SPECTRAL), border, value, kind)
