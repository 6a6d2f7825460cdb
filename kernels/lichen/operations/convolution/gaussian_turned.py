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

from lichen.memory import Array
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.gaussian_weights import BARELY
from lichen.operations.convolution.kernels import Matrix, separated
from lichen.operations.convolution.passes import folded

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
