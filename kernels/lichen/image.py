"""The one value that flows: pixels with what they mean.

An `Image` is a C-ordered float array of shape (height, width, channels) together with its colour space, what its last
channel says about coverage, the storage it came from and free metadata. y runs down and pixel centres lie at +0.5.
Integers are decoded to [0, 1]; values outside that interval are kept; nothing is clamped until an integer encoder must.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from lichen.errors import Flaw, InvalidRequest
from lichen.memory import Array, aligned, aligned_empty


class Space(StrEnum):
    """What the numbers in the colour channels mean."""

    SRGB = "srgb"
    """display-referred: BT.709 primaries, the sRGB transfer function"""
    LINEAR = "linear"
    """scene-linear light, BT.709 primaries"""
    DATA = "data"
    """not light, or unknown: vector fields, depth, plain arrays. Never converted behind the caller's back."""


class Alpha(StrEnum):
    """What the last channel is."""

    NONE = "none"
    """colour or data like the others"""
    STRAIGHT = "straight"
    """coverage; the colour is not multiplied by it (PNG, TIFF type 2)"""
    ASSOCIATED = "associated"
    """coverage; the colour is multiplied by it (EXR, TIFF type 1)"""


class Storage(StrEnum):
    """How samples were stored, or shall be."""

    UINT8 = "uint8"
    UINT16 = "uint16"
    FLOAT16 = "float16"
    FLOAT32 = "float32"
    FLOAT64 = "float64"

    @property
    def integer(self) -> bool:
        return self in (Storage.UINT8, Storage.UINT16)

    @property
    def levels(self) -> int:
        """The largest code of an integer storage."""
        return {Storage.UINT8: 255, Storage.UINT16: 65535}[self]


@dataclass(frozen=True, slots=True)
class Extent:
    """Smallest and largest finite value (0 and 0 where there is none), and how many values are NaN or infinite."""

    low: float
    high: float
    nonfinite: int

    @property
    def magnitude(self) -> float:
        return max(abs(self.low), abs(self.high))

    @property
    def spread(self) -> float:
        return self.high - self.low


@dataclass(frozen=True, eq=False)
class Image:
    """Pixels with their meaning. Treat `pixels` as read-only: images share them.

    `pixels` has shape (height, width, channels) and is float32, or float64 where the precision is asked for.
    """

    pixels: Array
    space: Space = Space.DATA
    alpha: Alpha = Alpha.NONE
    storage: Storage = Storage.FLOAT32
    metadata: Mapping[str, Any] = field(default_factory=dict)
    pages: int = 1
    """how many pictures of equal height lie one below the other: the frames of an animation, the slices of a volume"""

    @property
    def height(self) -> int:
        return int(self.pixels.shape[0])

    @property
    def width(self) -> int:
        return int(self.pixels.shape[1])

    @property
    def channels(self) -> int:
        return int(self.pixels.shape[2])

    @property
    def colours(self) -> int:
        """How many channels, from the first, are not coverage."""
        return self.channels - (self.alpha is not Alpha.NONE)

    @cached_property
    def extent(self) -> Extent:
        """Range and count of non-finite values over all channels; one pass over the pixels, kept."""
        return measure_extent(self.pixels)

    def replace(self, **changes: Any) -> Image:
        """A copy with some fields changed; a changed `pixels` is measured again."""
        made = self._changed(changes)
        return made if "pixels" in changes else self._knowing(made)

    def _changed(self, changes: Mapping[str, Any]) -> Image:
        return dataclasses.replace(self, **changes)

    def _knowing(self, made: Image) -> Image:
        """`made` has the same pixels: their range need not be found again."""
        if "extent" in vars(self):
            vars(made)["extent"] = self.extent
        return made

    def __repr__(self) -> str:
        return (
            f"Image({self.width}x{self.height}, {self.channels} channels, {self.pixels.dtype}, "
            f"space={self.space}, alpha={self.alpha}, storage={self.storage})"
        )


@dataclass(frozen=True, eq=False)
class Codes:
    """The samples of a picture as integers, and what makes floats of them."""

    samples: Array
    """(height, width, channels)"""
    widen: Callable[[Array], Array]
    table: Array | None = None
    """the float of each code; None where that is the code over the largest one"""
    moved: tuple[int, int] = (0, 0)
    """how many were clipped and how many were not finite of the floats that they were made of, if they were"""

    @property
    def floats(self) -> Array:
        return self.widen(self.samples)

    @property
    def numbers(self) -> Array:
        """What each code of 8 bits means."""
        return np.arange(256, dtype=np.float32) / np.float32(255) if self.table is None else self.table


class StoredImage(Image):
    """An image of codes, which become floats where they are asked for. Of 8 bits those are four times as many bytes,
    and whoever only stores it again needs none."""

    def __init__(self, codes: Codes, **known: Any) -> None:
        """`known` holds the other fields of an image."""
        super().__init__(codes.samples, **known)
        del vars(self)["pixels"]
        vars(self)["codes"] = codes

    codes: Codes

    @cached_property
    def pixels(self) -> Array:
        return self.codes.floats

    @property
    def widened(self) -> bool:
        """Whether somebody has asked for floats, which it keeps."""
        return "pixels" in vars(self)

    def again(self) -> Image:
        """The same, whose floats go when it does."""
        return self._knowing(StoredImage(self.codes, **{name: getattr(self, name) for name in FIELDS}))

    def floats(self) -> Image:
        """Its floats and what they mean, and no codes."""
        return self.replace()

    @property
    def coded(self) -> tuple[Array, Array]:
        """Codes of 8 bits and what each of them means, for kernels that look it up."""
        return self.codes.samples, aligned(self.codes.numbers)

    @property
    def height(self) -> int:
        return int(self.codes.samples.shape[0])

    @property
    def width(self) -> int:
        return int(self.codes.samples.shape[1])

    @property
    def channels(self) -> int:
        return int(self.codes.samples.shape[2])

    def _changed(self, changes: Mapping[str, Any]) -> Image:
        same = {name: getattr(self, name) for name in ("pixels", *FIELDS) if name not in changes}
        return Image(**same, **changes)


FIELDS = ("space", "alpha", "storage", "metadata", "pages")
"""Of an image, beside its pixels."""


def as_image(value: Image | npt.ArrayLike, *, pointer: str = "/inputs/image") -> Image:
    """An `Image` from an array of shape (height, width) or (height, width, channels); an `Image` passes unchanged.

    Integers (uint8, uint16) become [0, 1] and bool becomes 0 or 1; float16 and float32 become float32; float64 stays.
    An array says nothing of colour: its space is DATA and it has no alpha. Raises `InvalidRequest`.
    """
    if isinstance(value, Image):
        return value
    array = np.asarray(value)
    if array.ndim == 2:
        array = array[:, :, np.newaxis]
    if array.ndim != 3 or 0 in array.shape:
        raise InvalidRequest(
            "An image is an array of shape (height, width) or (height, width, channels) without empty sides.",
            [Flaw(pointer, f"has shape {np.shape(value)}")],
        )
    kind = array.dtype.newbyteorder("=").name
    if kind in ("uint8", "uint16"):
        storage = Storage(kind)
        pixels = aligned_empty(array.shape, np.float32)
        np.divide(array, np.float32(storage.levels), out=pixels, dtype=np.float32)
    elif kind in ("bool", "float16", "float32"):
        storage = Storage.UINT8 if kind == "bool" else Storage(kind)
        pixels = aligned(array, np.float32)
    elif kind == "float64":
        storage, pixels = Storage.FLOAT64, aligned(array, np.float64)
    else:
        raise InvalidRequest(
            "Samples must be bool, uint8, uint16, float16, float32 or float64.", [Flaw(pointer, f"has dtype {kind}")]
        )
    return Image(pixels, storage=storage)


def measure_extent(pixels: Array) -> Extent:
    """Range and non-finite count of an array, in blocks that stay in cache."""
    low, high, nonfinite = np.inf, -np.inf, 0
    flat = pixels.reshape(-1)
    for start in range(0, flat.size, 1 << 18):
        block = flat[start : start + (1 << 18)]
        smallest, largest = float(block.min()), float(block.max())
        if not (np.isfinite(smallest) and np.isfinite(largest)):
            finite = block[np.isfinite(block)]
            nonfinite += block.size - finite.size
            if not finite.size:
                continue
            smallest, largest = float(finite.min()), float(finite.max())
        low, high = min(low, smallest), max(high, largest)
    return Extent(low, high, nonfinite) if low <= high else Extent(0.0, 0.0, nonfinite)


def repaired(image: Image) -> Image:
    """Each non-finite value replaced by the mean of the finite ones among its eight neighbours, 0 if there is none."""
    pixels = image.pixels
    finite = np.isfinite(pixels)
    clean = np.where(finite, pixels, 0).astype(np.float64)
    window = ((1, 1), (1, 1), (0, 0))
    total = sliding_window_view(np.pad(clean, window), (3, 3), (0, 1)).sum(axis=(-2, -1))
    count = sliding_window_view(np.pad(finite, window), (3, 3), (0, 1)).sum(axis=(-2, -1))
    mean = np.divide(total, count, out=np.zeros_like(total), where=count > 0)
    return image.replace(pixels=aligned(np.where(finite, pixels, mean), pixels.dtype))
