"""Correlation by the product of spectra, and what becomes of NaN and infinity there.

A transform mixes every sample with every other. Samples that are not finite are therefore taken out before, and where a
tap meets one the result is set to what the sum would be: whether it does is a correlation of where they lie with where
the taps are, whose results are whole numbers and thus known without error.

Source: Oppenheim and Schafer, Discrete-Time Signal Processing (1989), 8.7.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.operation import Border
from lichen.operations.convolution.kernels import Matrix
from lichen.operations.convolution.stencil import Stencil, continue_image
from lichen.processors import threads


def correlated_by_transform(
    pixels: Array, whole: Stencil, border: Border, value: float, kind: type[np.floating] = np.float64
) -> Array:
    """float32 (height, width, channels), by transforms in numbers of a `kind`."""
    (tall, wide), (height, width, channels) = whole.taps.shape, pixels.shape
    rows, columns = (whole.top, tall - 1 - whole.top), (whole.left, wide - 1 - whole.left)
    around = continue_image(pixels, rows, columns, border, value)
    sides = transform_sides(height, width, (tall, wide))
    spectrum = np.conj(_spectrum(whole.taps.astype(kind), sides))
    out = aligned_empty(pixels.shape)
    for channel in range(channels):
        plane = around[..., channel].astype(kind)
        finite = np.isfinite(plane)
        clean = plane if finite.all() else np.where(finite, plane, 0.0)
        product = _spectrum(clean, sides)
        product *= spectrum
        made = _samples(product, sides, (height, width))
        made += whole.bias
        if clean is not plane:
            _set_nonfinite(made, plane, whole.taps, sides)
        out[..., channel] = made
    return out


def _set_nonfinite(made: Matrix, plane: Matrix, taps: Matrix, sides: tuple[int, int]) -> None:
    """NaN where a tap meets NaN or both infinities, an infinity where taps meet that of one sign."""

    def meets(where: Array, tapped: Array) -> Array:
        if not (where.any() and tapped.any()):
            return np.zeros(made.shape, bool)
        product = _spectrum(where.astype(np.float64), sides) * np.conj(_spectrum(tapped.astype(np.float64), sides))
        return np.asarray(_samples(product, sides, made.shape) > 0.5)

    above = meets(plane == np.inf, taps > 0) | meets(plane == -np.inf, taps < 0)
    below = meets(plane == np.inf, taps < 0) | meets(plane == -np.inf, taps > 0)
    made[above], made[below] = np.inf, -np.inf
    made[(above & below) | meets(np.isnan(plane), taps != 0)] = np.nan


def _spectrum(plane: Matrix, sides: tuple[int, int]) -> Array:
    """Along the rows that are there, and then down, zeros below them. Every line is transformed by itself, so that the
    number of processors changes no bit."""
    from scipy import fft  # slow to load, and only large kernels need it

    rows = fft.rfft(plane, sides[1], axis=1, workers=threads())
    return np.asarray(fft.fft(rows, sides[0], axis=0, overwrite_x=True, workers=threads()))


def _samples(spectrum: Array, sides: tuple[int, int], shape: tuple[int, ...]) -> Matrix:
    """The first rows and columns, so many."""
    from scipy import fft

    rows = fft.ifft(spectrum, sides[0], axis=0, overwrite_x=True, workers=threads())[: shape[0]]
    return np.asarray(fft.irfft(rows, sides[1], axis=1, workers=threads())[:, : shape[1]])


def transform_sides(height: int, width: int, kernel: tuple[int, ...]) -> tuple[int, int]:
    """Rows and columns of the transform: image and kernel, up to sizes whose factors are 2, 3 and 5."""
    tall, wide = kernel
    return _smooth_size(height + tall - 1), _smooth_size(width + wide - 1)


@lru_cache(1024)
def _smooth_size(least: int) -> int:
    """The smallest number >= `least` without prime factors beyond 5."""
    while True:
        rest = least
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return least
        least += 1
