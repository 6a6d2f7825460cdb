"""JPEG: 8 bits, grey or colour, no alpha.

Reading walks the markers for size, orientation, profile and kind of coding. The decoder runs strictly: whatever it
would only warn about (a missing end, a damaged segment) is an error here, for half a picture is none. Four-colour files
are refused, since their colours mean nothing without converting their profile; so are 12-bit, lossless,
hierarchical and arithmetic-coded files.

An opaque alpha channel is dropped in writing; any other is refused, since only a composition over a background
that the caller chooses would give the picture he expects. From quality 90 on, colour is stored at full resolution.

Large pictures are written in bands, on all processors at once: each is coded as a picture of its own with the same
tables, and restart markers join them, at which a decoder begins anew. It finds the same samples as in one piece. Bands
have a size of their own, whatever the number of threads, so the same image gives the same bytes on every machine.

Sources: ITU-T T.81, annexes B and E.1.4; ICC.1:2022, annex B.4; EXIF 2.32.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

import numpy as np
import simplejpeg

from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files import icc, ifd
from lichen.files.format import Allocate, Format, Header, few, take, unpack
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array
from lichen.processors import each

QUALITY = 90
_ICC = b"ICC_PROFILE\0"
_EXIF = b"Exif\0\0"
_SEGMENT = 65_519
"""Bytes of profile that fit one segment beside its name and numbers."""
_FRAMES = {0xC0, 0xC1, 0xC2}
_OTHER_FRAMES = {0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF}
_BAND = 256
"""Rows of a band: a multiple of what a block of any sampling has."""
_INTERVAL = 0xFFFF
"""Blocks between restarts at most."""
_SCANS = 200
"""More scans than this make a small file slow on purpose."""
_AFTER_SCAN = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]", re.DOTALL)
"""What ends entropy-coded data: any marker but a stuffed zero or a restart. Of several bytes of 0xff it begins at the
last: a first byte that comes once is looked for ten times as fast as one that may come again."""


def _segments(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Marker and body of every segment up to the end of the image, over all scans."""
    start = 2
    while True:
        if take(data, start, 2, "markers")[0] != 0xFF:
            raise UnreadableImage(f"The JPEG file has no marker at byte {start}.")
        marker = data[start + 1]
        if marker == 0xFF:  # padding
            start += 1
            continue
        start += 2
        if marker == 0xD9:
            return
        if 0xD0 <= marker <= 0xD7 or marker == 0x01:
            continue
        size = unpack(">H", data, start, "segments")[0]
        body = take(data, start, max(size, 2), "segments")[2:]
        yield marker, body
        start += max(size, 2)
        if marker == 0xDA:
            end = _AFTER_SCAN.search(data, start)
            if end is None:
                raise UnreadableImage("The JPEG file ends inside its image data.")
            start = end.end() - 2


def read_header(data: memoryview) -> Header:
    orientation, profile = 1, {}
    for marker, body in few(_segments(data), "segments"):
        if marker in _OTHER_FRAMES:
            raise UnsupportedFormat("Only baseline and progressive JPEG with Huffman coding are supported.")
        if marker == 0xE1 and bytes(body[:6]) == _EXIF:
            orientation = ifd.orientation(body)
        elif marker == 0xE2 and bytes(body[:12]) == _ICC and len(body) > 14:
            profile[body[12]] = bytes(body[14:])
        elif marker in _FRAMES:
            return _header(body, orientation, b"".join(profile[i] for i in sorted(profile)) or None)
    raise UnreadableImage("The JPEG file holds no frame.")


def _header(frame: memoryview, orientation: int, profile: bytes | None) -> Header:
    precision, height, width, count = unpack(">BHHB", frame, 0, "frame header")
    if precision != 8:
        raise UnsupportedFormat(f"JPEG of {precision} bits is not supported; 8 bits are.")
    if count not in (1, 3):
        raise UnsupportedFormat(f"JPEG of {count} components is not supported; grey and three colours are.")
    if 0 in (width, height):
        raise UnreadableImage(f"The JPEG header claims {width}x{height} pixels.")
    factors = [take(frame, 6, 3 * count, "frame header")[3 * i + 1] for i in range(count)]
    unit = 8 * max(f >> 4 for f in factors) * 8 * max(f & 15 for f in factors)
    if not unit:
        raise UnreadableImage("The JPEG sampling factors are not valid.")
    blocks = width * height // unit
    space, metadata = icc.read(profile, count, Space.SRGB)
    if orientation >= 5:
        width, height = height, width
    return Header(
        "jpeg", width, height, count, Storage.UINT8, space, orientation=orientation, metadata=metadata, details=blocks
    )


def read_samples(data: memoryview, header: Header, allocate: Allocate) -> Array:
    if len(data) * 8 < header.details:  # each block takes a bit at least
        raise UnreadableImage(f"{len(data)} bytes of JPEG cannot hold {header.width}x{header.height} pixels.")
    scans = sum(marker == 0xDA for marker, _ in _segments(data))
    if scans > _SCANS:
        raise UnreadableImage(f"The JPEG file holds {scans} scans; no more than {_SCANS} make sense.")
    place = allocate(header.stored_shape, np.uint8)
    kind = "GRAY" if header.channels == 1 else "RGB"
    try:
        samples: Array = simplejpeg.decode_jpeg(data, colorspace=kind, strict=True, buffer=place)
    except ValueError as failure:
        raise UnreadableImage(f"The JPEG file is damaged: {failure}.") from None
    if samples.shape != place.shape:
        raise UnreadableImage(f"The JPEG frame holds {samples.shape}, its header claims {place.shape}.")
    return place


def write(samples: Array, image: Image, quality: int | None) -> bytes:
    quality = QUALITY if quality is None else quality
    if image.alpha is not Alpha.NONE:
        samples = np.ascontiguousarray(samples[:, :, :-1])
    kind = "GRAY" if samples.shape[2] == 1 else "RGB"
    plain = _encoded(samples, max(quality, 1), kind, "444" if quality >= 90 else "420")
    profile = icc.to_write(image, Space.SRGB, image.colours)
    if not profile:
        return plain
    first = 4 + struct.unpack(">H", plain[4:6])[0] if plain[2:4] == b"\xff\xe0" else 2  # profiles follow JFIF's segment
    pieces = [profile[i : i + _SEGMENT] for i in range(0, len(profile), _SEGMENT)]
    segments = [
        struct.pack(">HH", 0xFFE2, 16 + len(piece)) + _ICC + bytes([number, len(pieces)]) + piece
        for number, piece in enumerate(pieces, 1)
    ]
    return b"".join([plain[:first], *segments, plain[first:]])


def _encoded(samples: Array, quality: int, kind: str, sampling: str) -> bytes:
    """A whole file, of bands that restart markers join."""
    rows, columns, channels = samples.shape
    unit = 16 if channels == 3 and sampling == "420" else 8
    across = -(-columns // unit)
    deep = min(_BAND, _INTERVAL // across * unit)
    coded = each(
        lambda top: simplejpeg.encode_jpeg(samples[top : top + deep], quality, kind, sampling), range(0, rows, deep)
    )
    whole: bytes = coded[0]
    if len(coded) == 1:
        return whole
    frame, scan, _ = _places(whole)
    height, interval = struct.pack(">H", rows), struct.pack(">HHH", 0xFFDD, 4, deep // unit * across)
    joined = [whole[: frame + 5], height, whole[frame + 7 : scan], interval, whole[scan:-2]]
    for number, band in enumerate(coded[1:]):
        joined += [bytes([0xFF, 0xD0 + number % 8]), band[_places(band)[2] : -2]]
    return b"".join([*joined, whole[-2:]])


def _places(coded: bytes) -> tuple[int, int, int]:
    """Where the frame's header, the scan's header, and the scan's data begin in a file of one scan that was written
    here."""
    at = frame = 2
    while coded[at + 1] != 0xDA:
        if coded[at + 1] in _FRAMES:
            frame = at
        at += 2 + struct.unpack_from(">H", coded, at + 2)[0]
    return frame, at, at + 2 + struct.unpack_from(">H", coded, at + 2)[0]


def _unfit(image: Image) -> str | None:
    if image.colours not in (1, 3):
        return f"{image.colours} channels; jpeg holds grey or three colours (PNG, EXR, TIFF and NPY hold more)"
    if image.alpha is not Alpha.NONE and not bool((image.pixels[:, :, -1] == 1).all()):
        return "alpha; jpeg cannot hold it: put the image over a background first, or ask for PNG or WebP"
    return None


jpeg = Format(
    name="jpeg",
    media_types=("image/jpeg", "image/jpg", "image/pjpeg"),
    extensions=(".jpg", ".jpeg", ".jpe"),
    storages=(Storage.UINT8,),
    largest_side=65_500,
    lossy=True,
    recognises=lambda head: head.startswith(b"\xff\xd8\xff"),
    natural_space=lambda storage: Space.SRGB,
    unfit=_unfit,
    association=None,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
    places=True,
)
