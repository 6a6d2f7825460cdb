"""Stored samples to floats and back, and rows turned upright.

Decoding divides by the largest code, correctly rounded. Encoding multiplies by it, rounds half to even and moves what
lies outside to the end of the range; every sample so moved is counted, and so is every NaN (written as 0) and every
infinity. A finite value too large for a smaller float becomes that float's largest, never an infinity.
"""

from __future__ import annotations

import numpy as np

from lichen.image import Extent, Storage
from lichen.memory import Array, aligned, aligned_empty

_BLOCK = 1 << 16
"""Samples handled at a time, so that all passes over them stay in cache."""
_LOOK = 1 << 20
"""Samples whose range is found at a time."""
_SHIFT = np.float32(3 << 22)


def to_floats(samples: Array) -> Array:
    """Integers to float32 in [0, 1]; float16 and float32 to float32; float64 unchanged. Aligned, C order."""
    if samples.dtype.kind != "u":
        return aligned(samples, np.float64 if samples.dtype.itemsize == 8 else np.float32)
    pixels = aligned_empty(samples.shape, np.float32)
    source, target = samples.reshape(-1), pixels.reshape(-1)
    largest = np.float32(np.iinfo(samples.dtype).max)
    for start in range(0, source.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        np.divide(source[block], largest, out=target[block], dtype=np.float32)
    return pixels


def extent_of(samples: Array) -> Extent | None:
    """The range of what `to_floats` makes of integers, found on these, which are a quarter or half as many bytes; None
    of floats. Where both ends of what they can be have been met, nobody need look further."""
    if samples.dtype.kind != "u":
        return None
    flat, largest = samples.reshape(-1), int(np.iinfo(samples.dtype).max)
    low, high = largest, 0
    for start in range(0, flat.size, _LOOK):
        block = flat[start : start + _LOOK]
        low, high = min(low, int(block.min())), max(high, int(block.max()))
        if (low, high) == (0, largest):
            break
    darkest, brightest = (float(np.float32(each) / np.float32(largest)) for each in (low, high))
    return Extent(darkest, brightest, 0)


def to_storage(pixels: Array, storage: Storage) -> tuple[Array, int, int]:
    """Samples of `storage`, how many finite ones were clipped, and how many non-finite ones were replaced."""
    kind = np.dtype(storage.value)
    if pixels.dtype == kind:
        return np.ascontiguousarray(pixels), 0, 0
    samples = np.empty(pixels.shape, kind)
    source, target = pixels.reshape(-1), samples.reshape(-1)
    convert = _integers if storage.integer else _floats
    scratch = np.empty(min(_BLOCK, source.size), source.dtype)  # one for all: fresh memory costs more than the sums
    clipped = nonfinite = 0
    for start in range(0, source.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        more_clipped, more_nonfinite = convert(source[block], target[block], scratch)
        clipped += more_clipped
        nonfinite += more_nonfinite
    return samples, clipped, nonfinite


def _integers(source: Array, target: Array, scratch: Array) -> tuple[int, int]:
    levels, scaled = np.iinfo(target.dtype).max, scratch[: source.size]
    with np.errstate(over="ignore"):  # what overflows is clipped below
        np.multiply(source, source.dtype.type(levels), out=scaled)
    if scaled.dtype == np.float32 and _fit(scaled, target, levels):
        return 0, 0
    with np.errstate(over="ignore"):
        np.multiply(source, source.dtype.type(levels), out=scaled)
    np.rint(scaled, out=scaled)
    low, high = scaled.min(), scaled.max()
    clipped = nonfinite = 0
    if not (low >= 0 and high <= levels):  # also where they are NaN
        nonfinite = int(np.count_nonzero(~np.isfinite(source)))
        outside = int(np.count_nonzero((scaled < 0) | (scaled > levels)))
        clipped = outside - int(np.count_nonzero(np.isinf(source)))
        np.nan_to_num(scaled, copy=False, nan=0.0, posinf=levels, neginf=0.0)
        np.clip(scaled, 0, levels, out=scaled)
    target[...] = scaled
    return clipped, nonfinite


def _fit(scaled: Array, target: Array, levels: int) -> bool:
    """Whether all samples lie in the range, as nearly always; then they are written. In fewer passes than rounding and
    casting take: beside `_SHIFT` no fraction has room, so adding it rounds half to even and leaves the code in the
    lowest bits. `scaled` is lost."""
    scaled += _SHIFT
    fits = bool(scaled.min() >= _SHIFT and scaled.max() <= _SHIFT + levels)  # false where there is a NaN
    if fits:
        np.copyto(target, scaled.view(np.uint32), casting="unsafe")
    return fits


def _floats(source: Array, target: Array, scratch: Array) -> tuple[int, int]:
    if target.dtype.itemsize > source.dtype.itemsize:
        target[...] = source
        return 0, 0
    largest = np.finfo(target.dtype).max
    if max(source.max(), -source.min()) <= largest:  # false where there is a NaN
        target[...] = source
        return 0, 0
    with np.errstate(over="ignore"):
        target[...] = source
    overflowed = np.isinf(target) & np.isfinite(source)
    target[overflowed] = np.copysign(largest, source[overflowed])
    return int(np.count_nonzero(overflowed)), 0


def upright(samples: Array, orientation: int) -> Array:
    """Stored rows as the picture is meant to be seen; `orientation` as in EXIF and TIFF tag 274.

    1 as stored, 2 mirrored left to right, 3 turned by 180 degrees, 4 mirrored top to bottom, 5 transposed, 6 turned
    clockwise, 7 transposed across the other diagonal, 8 turned anticlockwise.
    """
    if orientation >= 5:
        samples = samples.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        samples = samples[::-1]
    if orientation in (2, 3, 6, 7):
        samples = samples[:, ::-1]
    return samples
