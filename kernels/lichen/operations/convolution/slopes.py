"""The masks that `derivative` takes slopes by, and the planes whose slopes they are.

A mask of three samples a side gives the slope of the plane that fits them best, by the weights of `under`. Where some
are left out, `fits` has the taps of the plane through the others, for every set of them: found beforehand and in
float64, so that a set has a slope or none alike wherever it is computed.
"""

from __future__ import annotations

from enum import StrEnum
from functools import lru_cache

import numpy as np

from lichen.memory import Array
from lichen.operation import Border
from lichen.operations.convolution.gaussian_weights import fir_radius, half_kernel
from lichen.operations.convolution.stencil import Stencil, continue_image


class Mask(StrEnum):
    """How the difference is smoothed across."""

    SOBEL = "sobel"
    SCHARR = "scharr"
    PREWITT = "prewitt"
    CENTRAL = "central"
    GAUSSIAN = "gaussian"


_ACROSS = {Mask.SOBEL: (1, 2, 1), Mask.SCHARR: (3, 10, 3), Mask.PREWITT: (1, 1, 1), Mask.CENTRAL: (0, 1, 0)}


@lru_cache(maxsize=64)
def masks(mask: Mask, sigma: float) -> tuple[Stencil, Stencil]:
    """The correlation masks of the slopes along x and along y, per pixel."""
    if mask is Mask.GAUSSIAN:
        half = half_kernel(sigma)[: fir_radius(sigma, 1e-8)[0] + 1]
        across = np.concatenate([half[:0:-1], half])
        at = np.arange(len(across)) - len(half) + 1
        slope = at * across
        slope, across = slope / (slope @ at), across / across.sum()
    else:
        across = np.array(_ACROSS[mask], np.float64) / sum(_ACROSS[mask])
        slope = np.array([-0.5, 0.0, 0.5])
    taps, middle = np.outer(across, slope), len(slope) // 2
    return Stencil(taps, middle, middle), Stencil(taps.T, middle, middle)


def under(mask: Mask) -> Array:
    """The weights of the nine samples of which a mask takes the slopes of a plane, (3, 3)."""
    if mask is Mask.CENTRAL:
        return np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.float64)
    return np.outer(_ACROSS[mask], _ACROSS[mask]).astype(np.float64)


@lru_cache(maxsize=8)
def fits(mask: Mask) -> Array:
    """The taps of the slopes along x and along y, for each set of samples that take part: (2, 512, 9), of which sample
    3 y + x has the bit 2^(3 y + x). NaN where the samples lie on a line."""
    weights = under(mask).ravel()
    y, x = np.mgrid[-1:2, -1:2].reshape(2, 9)
    plane = np.stack([np.ones(9), x, y], 1)
    taps = np.zeros((2, 512, 9))
    for which in range(512):
        part = np.flatnonzero((which >> np.arange(9) & 1) * weights)
        if np.linalg.matrix_rank(plane[part]) < 3:
            taps[:, which] = np.nan
            continue
        root = np.sqrt(weights[part])[:, None]
        solved = np.linalg.pinv(root * plane[part])[1:] * root.T
        taps[:, which, part] = np.where(np.abs(solved) < 1e-12, 0.0, solved)
    return taps


def _patterns(pixels: Array, border: Border, value: float) -> tuple[Array, Array]:
    """The nine samples under each pixel's mask, 0 where they are NaN, and the sum of the bits of the others."""
    around = continue_image(pixels, (1, 1), (1, 1), border, value)
    height, width, _ = pixels.shape
    seen = np.stack([around[i : i + height, j : j + width] for i in range(3) for j in range(3)])
    there = ~np.isnan(seen)
    return np.where(there, seen, 0), np.tensordot(1 << np.arange(9), there, 1)


def fitted(pixels: Array, taps: Array, border: Border, value: float) -> Array:
    """The slope of the plane that fits the samples that are numbers, in the precision of the pixels."""
    seen, which = _patterns(pixels, border, value)
    out = np.zeros_like(pixels)
    with np.errstate(invalid="ignore", over="ignore"):
        for sample, weights in zip(seen, taps.T.astype(pixels.dtype), strict=True):
            weight = weights[which]
            out += np.where(weight == 0, 0, weight * sample)
    return out
