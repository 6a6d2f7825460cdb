"""What a file format is, what a header tells, and which limits hold before a decoder sees the bytes.

A format is one module with three functions, always in the same order:

* `read_header(data) -> Header` parses the header itself, in plain Python, and trusts nothing: every offset is checked.
  Formats of data are the exception: a library reads them, and who does not trust the bytes lets a process do so that
  may die of it.
* `read_samples(data, header) -> Array` gives the samples as stored, shape (rows, columns, channels), not yet upright;
  formats that can place them are told where (`Format.samples`).
* `write(samples, image, quality) -> bytes` writes samples that already have the storage of the file; several pictures
  where the image has `pages`.

The facade in `lichen.files` does what is common to all: recognising, limits, turning upright, scaling, quantising.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lichen.errors import Flaw, InvalidRequest, TooLarge, UnreadableImage, UnsupportedFormat
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, aligned_empty

MOST_PAGES = 1001
"""Pictures in one file are counted no further: to find them takes time, however few bytes they are."""
MOST_PARTS = 5000
"""Chunks, segments and attributes of a header; more make a small file slow on purpose."""

Data = bytes | bytearray | memoryview


Allocate = Callable[[tuple[int, ...], npt.DTypeLike], Array]
"""An uninitialised array of a shape and a type."""
_Part = TypeVar("_Part")


@dataclass(frozen=True, slots=True)
class Limits:
    """The largest image that is decoded. `bytes` counts the decoded samples in memory, at four bytes or more each."""

    pixels: int = 100_000_000
    side: int = 65_536
    channels: int = 64
    bytes: int = 1 << 31
    pages: int = 1000


@dataclass(frozen=True)
class Header:
    """What the first bytes of a file say. Width and height are those of the upright picture."""

    format: str
    width: int
    height: int
    channels: int
    storage: Storage
    space: Space
    alpha: Alpha = Alpha.NONE
    pages: int = 1
    """pictures in the file, of which only the first is decoded; counted to `MOST_PAGES`"""
    orientation: int = 1
    """how the stored rows lie, as EXIF counts it; 5 to 8 swap width and height"""
    metadata: Mapping[str, Any] = field(default_factory=dict)
    details: Any = None
    """what the format's own reader needs later"""

    @property
    def decoded_bytes(self) -> int:
        """Memory of the decoded image."""
        return self.width * self.height * self.channels * (8 if self.storage is Storage.FLOAT64 else 4)

    @property
    def stored_shape(self) -> tuple[int, int, int]:
        rows, columns = (self.height, self.width) if self.orientation < 5 else (self.width, self.height)
        return rows, columns, self.channels

    def check(self, limits: Limits) -> None:
        """Raises `TooLarge` naming every limit that is crossed; its `limit` and `actual` are those of the first."""
        claims = (
            ("width", "px", self.width, limits.side),
            ("height", "px", self.height, limits.side),
            ("pixels", "px", self.width * self.height, limits.pixels),
            ("channels", "", self.channels, limits.channels),
            ("bytes", "bytes decoded", self.decoded_bytes, limits.bytes),
            ("pages", "pictures", self.pages, limits.pages),
        )
        crossed = [claim for claim in claims if claim[2] > claim[3]]
        if crossed:
            raise TooLarge(
                f"The {self.format} header claims {self.width}x{self.height} with {self.channels} channels"
                f"{f', and {self.pages} pictures' * (self.pages > limits.pages)}.",
                [Flaw(f"/image/{name}", f"{actual} {unit}, at most {limit}") for name, unit, actual, limit in crossed],
                limit=crossed[0][3],
                actual=crossed[0][2],
            )


@dataclass(frozen=True, slots=True)
class Encoded:
    """A file in memory, and what the integers of its storage could not hold."""

    data: Data
    media_type: str
    clipped: int = 0
    """finite samples that lay outside the storage's range and were moved to its end"""
    nonfinite: int = 0
    """NaN (written as 0) and infinite samples (written as the end of the range) in an integer storage"""


@dataclass(frozen=True)
class Format:
    """One file format: what it can hold, and its three functions."""

    name: str
    media_types: tuple[str, ...]
    """the first is the one Lichen sends"""
    extensions: tuple[str, ...]
    storages: tuple[Storage, ...]
    """what it can write"""
    largest_side: int
    lossy: bool
    """whether `quality` means anything"""
    recognises: Callable[[bytes], bool]
    """from the first 16 bytes"""
    natural_space: Callable[[Storage], Space]
    """the space of a file that does not name one"""
    unfit: Callable[[Image], str | None]
    """why it cannot hold channels like these, or None"""
    association: Alpha | None
    """the one kind of coverage it can hold; None: any"""
    read_header: Callable[..., Header]
    """of the bytes; and of a selection (text), where the format `selects`"""
    read_samples: Callable[..., Array]
    """of the bytes and their header; and of an `Allocate`, where the format `places` its samples"""
    write: Callable[[Array, Image, int | None], Data]
    paged: bool = False
    """whether it can hold several pictures"""
    places: bool = False
    """whether it decodes into memory that it is given"""
    selects: bool = False
    """whether it is a format of data, of which a part is read: see `lichen.files.selection`. None of them is written"""
    modules: tuple[str, ...] = ()
    """what a format of data is read with, where that is installed"""

    def header(self, data: memoryview, select: str = "") -> Header:
        """The header of the bytes, of the selected part. The selection means nothing to formats of pictures."""
        return self.read_header(data, select) if self.selects else self.read_header(data)

    def samples(self, data: memoryview, header: Header, allocate: Allocate = aligned_empty) -> Array:
        """The samples as stored, in memory of the caller's where the format can place them there."""
        return self.read_samples(data, header, allocate) if self.places else self.read_samples(data, header)

    @property
    def media_type(self) -> str:
        return self.media_types[0]

    def storage_for(self, storage: Storage) -> Storage:
        """The storage an image is written in when none is asked for: its own, else the nearest richer, else poorer."""
        return next(choice for choice in _PREFERENCE[storage] if choice in self.storages)

    def unfit_pages(self, pages: int) -> str | None:
        """Why it cannot hold so many pictures, or None."""
        if pages == 1 or self.paged:
            return None
        return f"{self.name} holds one picture and the result has {pages}; TIFF, WebP and NPY hold them all"

    def check(self, image: Image, storage: Storage, quality: int | None) -> None:
        """Raises `UnsupportedFormat` or `InvalidRequest` where the file could not say what the image is."""
        flaws = []
        if storage not in self.storages:
            flaws.append(Flaw("/storage", f"{self.name} holds {' or '.join(self.storages)}, not {storage}"))
        height = image.height // image.pages
        if max(image.width, height) > self.largest_side:
            flaws.append(Flaw("/image", f"{image.width}x{height} px; {self.name} ends at {self.largest_side} px"))
        if reason := self.unfit_pages(image.pages):
            flaws.append(Flaw("/image", reason))
        if reason := self.unfit(image):
            flaws.append(Flaw("/image/channels", reason))
        if flaws:
            raise UnsupportedFormat(f"The image cannot be written as {self.name}.", flaws)
        if quality is not None and not (self.lossy and 0 <= quality <= 100):
            reason = "is from 0 to 100" if self.lossy else f"means nothing for {self.name}, which loses nothing"
            raise InvalidRequest("The quality is not valid.", [Flaw("/quality", reason)])
        if image.alpha not in (Alpha.NONE, self.association or image.alpha):
            raise InvalidRequest(
                f"{self.name} holds {self.association} alpha only; convert the image before encoding it.",
                [Flaw("/image/alpha", f"is {image.alpha}")],
            )


_PREFERENCE: Mapping[Storage, tuple[Storage, ...]] = {
    Storage.UINT8: (Storage.UINT8, Storage.FLOAT16),
    Storage.UINT16: (Storage.UINT16, Storage.FLOAT32, Storage.UINT8),
    Storage.FLOAT16: (Storage.FLOAT16, Storage.FLOAT32, Storage.UINT16, Storage.UINT8),
    Storage.FLOAT32: (Storage.FLOAT32, Storage.UINT16, Storage.UINT8),
    Storage.FLOAT64: (Storage.FLOAT64, Storage.FLOAT32, Storage.UINT16, Storage.UINT8),
}


def data_format(
    name: str,
    media_types: tuple[str, ...],
    extensions: tuple[str, ...],
    recognises: Callable[[bytes], bool],
    read_header: Callable[[memoryview, str], Header],
    modules: tuple[str, ...],
) -> Format:
    """A format of which parts are read and that is never written. Its headers carry the samples as their details."""

    def write(samples: Array, image: Image, quality: int | None) -> bytes:
        raise UnsupportedFormat(f"{name} is read, not written.")

    return Format(
        name=name,
        media_types=media_types,
        extensions=extensions,
        storages=(),
        largest_side=0,
        lossy=False,
        recognises=recognises,
        natural_space=lambda storage: Space.DATA,
        unfit=lambda image: f"{name} is read, not written",
        association=None,
        read_header=read_header,
        read_samples=lambda data, header: np.asarray(header.details),
        write=write,
        selects=True,
        modules=modules,
    )


def take(data: memoryview, start: int, size: int, what: str) -> memoryview:
    """The bytes [start, start + size), or `UnreadableImage` where the file ends before."""
    if start < 0 or size < 0 or start + size > len(data):
        raise UnreadableImage(f"The file ends after {len(data)} bytes, inside its {what}.")
    return data[start : start + size]


def unpack(layout: str, data: memoryview, start: int, what: str) -> tuple[Any, ...]:
    """`struct.unpack` at an offset, or `UnreadableImage` where the file ends before."""
    return struct.unpack(layout, take(data, start, struct.calcsize(layout), what))


def few(parts: Iterable[_Part], what: str) -> Iterator[_Part]:
    """The parts of a header; raises `TooLarge` where there are more than `MOST_PARTS`."""
    for number, part in enumerate(parts, 1):
        if number > MOST_PARTS:
            detail = f"The header consists of more than {MOST_PARTS} {what}."
            raise TooLarge(detail, [Flaw("/image", detail)], limit=MOST_PARTS, actual=number)
        yield part


def picture_channels(name: str, grey_alpha: bool) -> Callable[[Image], str | None]:
    """For formats of pictures: grey or colour, with or without coverage; plain data fills these channels in order."""

    def unfit(image: Image) -> str | None:
        if image.channels > 4:
            return f"{image.channels} channels; {name} holds at most 4 (EXR, TIFF and NPY hold more)"
        if image.channels == 2 and not grey_alpha:
            return f"2 channels; {name} holds grey, colour, or colour with alpha (PNG, EXR, TIFF and NPY hold 2)"
        if image.space is not Space.DATA and image.channels in (2, 4) and image.alpha is Alpha.NONE:
            return f"{image.channels} channels without alpha; {name} would call the last one alpha"
        if image.channels in (1, 3) and image.alpha is not Alpha.NONE:
            return f"{image.colours} channels and alpha; {name} holds alpha beside grey or three colours only"
        return None

    return unfit
