"""Correlation by the product of spectra, and what becomes of NaN and infinity there.

A transform mixes every sample with every other. Samples that are not finite are therefore taken out before, and where a
tap meets one the result is set to what the sum would be: whether it does is a correlation of where they lie with where
the taps are, whose results are whole numbers and thus known without error.

Large images are cut into squares that overlap by the kernel and stay in cache (overlap-save).

Source: Oppenheim and Schafer, Discrete-Time Signal Processing (1989), 8.7.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned_empty
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.kernels import Matrix
from lichen.operations.convolution.stencil import Stencil
from lichen.processors import each, threads

Places = npt.NDArray[np.int64]

SQUARES = (256, 384, 512, 768, 1024)
"""Sides of transforms that stay in a processor's cache."""
SPILT = 2.5
"""How many times as long a step of a transform takes of which that is not so."""


@dataclass(frozen=True)
class Layout:
    """The transforms of an image: of `sides` rows and columns, one for each tile."""

    sides: tuple[int, int]
    work: float
    """for each channel: samples and the logarithm of their number, which is 1 for 1024 x 1024, as they take in cache"""


@lru_cache(1024)
def layout(height: int, width: int, kernel: tuple[int, int]) -> Layout:
    """The quickest: of the whole image with its surroundings, up to sizes whose factors are 2, 3 and 5, or of squares.
    It does not depend on how many processors there are, so neither does the result."""
    tall, wide = kernel
    whole = _smooth_size(height + tall - 1), _smooth_size(width + wide - 1)
    found = [Layout(whole, SPILT * _steps(whole))]
    for side in SQUARES:
        down, across = side - tall + 1, side - wide + 1
        if min(down, across) > 0:
            tiles = -(-height // down) * -(-width // across)
            found.append(Layout((side, side), 2 * -(-tiles // 2) * _steps((side, side))))
    return min(found, key=lambda laid: laid.work)


def _steps(sides: tuple[int, int]) -> float:
    samples = math.prod(sides)
    return samples * max(math.log2(samples), 1.0) / 20


def correlated_by_transform(
    pixels: Array, whole: Stencil, border: Border, value: float, kind: type[np.floating] = np.float64
) -> Array:
    """float32 (height, width, channels), by transforms in numbers of a `kind`."""
    (tall, wide), (height, width, channels) = whole.taps.shape, pixels.shape
    rows = continued(np.arange(height + tall - 1) - whole.top, height, border)
    columns = continued(np.arange(width + wide - 1) - whole.left, width, border)
    sides = layout(height, width, (tall, wide)).sides
    down, across = sides[0] - tall + 1, sides[1] - wide + 1
    starts = list(itertools.product(range(0, height, down), range(0, width, across)))
    workers = threads() if len(starts) == 1 else 1
    spectrum = np.conj(_spectrum(whole.taps.astype(kind), sides, workers))
    out = aligned_empty(pixels.shape)

    def tile(start: tuple[int, int]) -> None:
        y, x = start
        into = out[y : y + down, x : x + across]
        around = _read(pixels, rows[y : y + sides[0]], columns[x : x + sides[1]], value)
        for channel in range(channels):
            plane = around[..., channel].astype(kind)
            finite = np.isfinite(plane)
            clean = plane if finite.all() else np.where(finite, plane, kind(0))
            product = _spectrum(clean, sides, workers)
            product *= spectrum
            made = _samples(product, sides, into.shape[:2], workers)
            made += whole.bias
            if clean is not plane:
                _set_nonfinite(made, plane, whole.taps, sides, workers)
            into[..., channel] = made

    each(tile, starts)
    return out


def _read(pixels: Array, rows: Places, columns: Places, value: float) -> Array:
    """The samples at these places, of which some may be OUTSIDE; first along an axis where they lie in a row, which
    takes no copy."""
    for axis, at in sorted(enumerate((rows, columns)), key=lambda places: not _in_a_row(places[1])):
        if _in_a_row(at):
            pixels = pixels[at[0] : at[-1] + 1] if axis == 0 else pixels[:, at[0] : at[-1] + 1]
        else:
            pixels = np.take(pixels, np.maximum(at, 0), axis)
            np.moveaxis(pixels, axis, 0)[at == OUTSIDE] = value
    return pixels


def _in_a_row(at: Places) -> bool:
    return at[0] != OUTSIDE and not np.any(np.diff(at) != 1)


def _set_nonfinite(made: Matrix, plane: Matrix, taps: Matrix, sides: tuple[int, int], workers: int) -> None:
    """NaN where a tap meets NaN or both infinities, an infinity where taps meet that of one sign."""

    def meets(where: Array, tapped: Array) -> Array:
        if not (where.any() and tapped.any()):
            return np.zeros(made.shape, bool)
        first, second = (_spectrum(plane.astype(np.float64), sides, workers) for plane in (where, tapped))
        return np.asarray(_samples(first * np.conj(second), sides, made.shape, workers) > 0.5)

    above = meets(plane == np.inf, taps > 0) | meets(plane == -np.inf, taps < 0)
    below = meets(plane == np.inf, taps < 0) | meets(plane == -np.inf, taps > 0)
    made[above], made[below] = np.inf, -np.inf
    made[(above & below) | meets(np.isnan(plane), taps != 0)] = np.nan


def _spectrum(plane: Matrix, sides: tuple[int, int], workers: int) -> Array:
    """Along the rows that are there, and then down, zeros below them. Every line is transformed by itself, so that the
    number of processors changes no bit."""
    from scipy import fft  # slow to load, and only large kernels need it

    rows = fft.rfft(plane, sides[1], axis=1, workers=workers)
    return np.asarray(fft.fft(rows, sides[0], axis=0, overwrite_x=True, workers=workers))


def _samples(spectrum: Array, sides: tuple[int, int], shape: tuple[int, ...], workers: int) -> Matrix:
    """The first rows and columns, so many."""
    from scipy import fft

    rows = fft.ifft(spectrum, sides[0], axis=0, overwrite_x=True, workers=workers)[: shape[0]]
    return np.asarray(fft.irfft(rows, sides[1], axis=1, workers=workers)[:, : shape[1]])


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
