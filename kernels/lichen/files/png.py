"""PNG: 8 or 16 bits, grey or colour, straight alpha.

Reading walks the chunks: lengths and checksums are verified, metadata is taken here, and the decoder is given a file of
the critical chunks alone, so a compressed text or profile never reaches it. Colour follows the order of the
standard: cICP, then iCCP, then sRGB, then gAMA.

Writing filters each row by its left neighbour and deflates bands in parallel. A linear picture is tagged with gamma 1
and the primaries of BT.709, an sRGB one with its profile or the sRGB chunk; data carries no colour chunk.

Source: Portable Network Graphics, third edition (W3C, 2025).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.errors import UnreadableImage
from lichen.files import deflate, icc, ifd, memory_file
from lichen.files.format import Data, Format, Header, few, picture_channels, take, unpack
from lichen.image import Alpha, Image, Space, Storage
from lichen.memory import Array, joined
from lichen.processors import each

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_SAMPLES = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_CHROMATICITIES = (31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
"""cHRM of BT.709: white, red, green, blue as x and y times 100000."""
_BAND = 1 << 20
"""Bytes of filtered rows deflated together."""
_DEFLATE_RATIO = 1032
"""Deflate never shrinks by more."""


@dataclass(frozen=True, slots=True)
class _Chunk:
    name: bytes
    body: memoryview
    whole: memoryview
    """length, name, body and checksum"""


def _chunks(data: memoryview) -> Iterator[_Chunk]:
    start = len(SIGNATURE)
    while True:
        size, name = unpack(">I4s", data, start, "chunks")
        whole = take(data, start, size + 12, f"{name.decode('latin-1')!r} chunk")
        yield _Chunk(name, whole[8 : 8 + size], whole)
        if name == b"IEND":
            return
        start += size + 12


def read_header(data: memoryview) -> Header:
    fixed: tuple[int, ...] = ()
    found: dict[bytes, bytes] = {}
    for chunk in few(_chunks(data), "chunks"):
        if not fixed:
            if chunk.name != b"IHDR" or len(chunk.body) != 13:
                raise UnreadableImage("The PNG file does not begin with its header.")
            fixed = struct.unpack(">IIBBBBB", chunk.body)
        elif chunk.name == b"IDAT":
            break
        elif chunk.name in (b"tRNS", b"cICP", b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"eXIf"):
            found[chunk.name] = bytes(chunk.body)
    width, height, depth, kind, compression, filtering, interlace = fixed
    if depth not in _DEPTHS.get(kind, ()) or compression or filtering or interlace > 1 or 0 in (width, height):
        raise UnreadableImage(f"The PNG header is not valid: {width}x{height}, depth {depth}, colour type {kind}.")
    colours = 1 if kind in (0, 4) else 3
    alpha = Alpha.STRAIGHT if kind in (4, 6) or b"tRNS" in found else Alpha.NONE
    space, metadata = _colour(found, colours)
    orientation = ifd.orientation(found.get(b"eXIf", b""))
    if orientation >= 5:
        width, height = height, width
    return Header(
        "png",
        width,
        height,
        colours + (alpha is not Alpha.NONE),
        Storage.UINT16 if depth == 16 else Storage.UINT8,
        space,
        alpha,
        orientation=orientation,
        metadata=metadata,
        details=_SAMPLES[kind] * depth,
    )


def _colour(found: Mapping[bytes, bytes], colours: int) -> tuple[Space, dict[str, Any]]:
    code = found.get(b"cICP", b"")
    if len(code) == 4:
        known = {(1, 13): Space.SRGB, (1, 8): Space.LINEAR}.get((code[0], code[1]))
        if known and code[3] == 1:
            return known, {}
        return Space.SRGB, {"colour_note": f"The coding-independent code points {tuple(code)} were not applied."}
    if b"iCCP" in found:
        return icc.read(_profile(found[b"iCCP"]), colours, Space.SRGB)
    gamma = found.get(b"gAMA", b"")
    if b"sRGB" in found or len(gamma) != 4:
        return Space.SRGB, {}
    value = struct.unpack(">I", gamma)[0]
    chroma = found.get(b"cHRM", b"")
    other = len(chroma) == 32 and max(
        abs(a - b) for a, b in zip(struct.unpack(">8I", chroma), _CHROMATICITIES, strict=True)
    ) > 200  # fmt: skip
    known = Space.LINEAR if abs(value - 100_000) <= 10 else Space.SRGB
    if other or (known is Space.SRGB and abs(value - 45_455) > 200):
        return known, {"colour_note": f"Gamma {value / 1e5:g} or its primaries are not sRGB's and were not applied."}
    return known, {}


def _profile(body: bytes) -> bytes:
    name, _, packed = body.partition(b"\0")
    if not 1 <= len(name) <= 79 or packed[:1] != b"\0":
        raise UnreadableImage("The PNG colour profile chunk is not valid.")
    return deflate.inflate(packed[1:], icc.LARGEST, "PNG colour profile")


def read_samples(data: memoryview, header: Header) -> Array:
    kept: list[bytes | memoryview] = [SIGNATURE]
    packed = 0
    for chunk in _chunks(data):
        if deflate.checksum(chunk.whole[4:-4]) != struct.unpack(">I", chunk.whole[-4:])[0]:
            raise UnreadableImage(f"The PNG chunk {chunk.name.decode('latin-1')!r} is damaged: wrong checksum.")
        if chunk.name in (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"):
            kept.append(chunk.whole)
            packed += len(chunk.body) if chunk.name == b"IDAT" else 0
    rows, columns, _ = header.stored_shape
    if packed * _DEFLATE_RATIO < rows * columns * header.details // 8:
        raise UnreadableImage(f"{packed} bytes of PNG image data cannot hold {columns}x{rows} pixels.")
    return memory_file.read("png", kept, header.storage.value)[0]


def write(samples: Array, image: Image, quality: int | None) -> Data:
    rows, columns, channels = samples.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    fixed = struct.pack(">IIBBBBB", columns, rows, 8 * samples.itemsize, kind, 0, 0, 0)
    parts = [SIGNATURE, _chunk(b"IHDR", fixed), *_colour_chunks(image)]
    per_band = max(1, _BAND // (columns * channels * samples.itemsize + 1))
    starts = list(range(0, rows, per_band))

    def pack(start: int) -> tuple[bytes, bytes]:
        filtered = _filtered(samples[start : start + per_band])
        return deflate.band(filtered, last=start == starts[-1]), filtered

    sum_so_far, bands = 1, []
    for group in range(0, len(starts), 64):  # so that no more than a few filtered bands are held
        for packed, filtered in each(pack, starts[group : group + 64]):
            sum_so_far = deflate.adler(filtered, sum_so_far)
            bands.append(packed)
    bands[0] = b"\x78\x01" + bands[0]
    bands[-1] += struct.pack(">I", sum_so_far)
    return joined([*parts, *(piece for band in bands for piece in _pieces(b"IDAT", band)), _chunk(b"IEND", b"")])


def _filtered(samples: Array) -> bytes:
    """Rows as PNG filter 1 leaves them: each byte less the same byte of the pixel to its left."""
    rows, columns, channels = samples.shape
    pixel = channels * samples.itemsize
    stored = samples.astype(samples.dtype.newbyteorder(">"), order="C").view(np.uint8).reshape(rows, columns * pixel)
    filtered = np.empty((rows, 1 + columns * pixel), np.uint8)
    filtered[:, 0] = 1
    filtered[:, 1 : 1 + pixel] = stored[:, :pixel]
    np.subtract(stored[:, pixel:], stored[:, :-pixel], out=filtered[:, 1 + pixel :])
    return filtered.tobytes()


def _pieces(name: bytes, body: bytes) -> tuple[bytes, bytes, bytes]:
    """Of a chunk."""
    told = struct.pack(">I", deflate.checksum(body, deflate.checksum(name)))
    return struct.pack(">I", len(body)) + name, body, told


def _chunk(name: bytes, body: bytes) -> bytes:
    return b"".join(_pieces(name, body))


def _colour_chunks(image: Image) -> list[bytes]:
    if image.space is Space.DATA:
        return []
    if image.space is Space.LINEAR:
        primaries = struct.pack(">8I", *_CHROMATICITIES)
        return [_chunk(b"gAMA", struct.pack(">I", 100_000)), _chunk(b"cHRM", primaries)]
    profile = icc.to_write(image, Space.SRGB, image.colours)
    if profile:
        return [_chunk(b"iCCP", b"ICC profile\0\0" + deflate.compress(profile))]
    return [_chunk(b"sRGB", b"\0")]


png = Format(
    name="png",
    media_types=("image/png", "image/x-png"),
    extensions=(".png",),
    storages=(Storage.UINT8, Storage.UINT16),
    largest_side=(1 << 31) - 1,
    lossy=False,
    recognises=lambda head: head.startswith(SIGNATURE),
    natural_space=lambda storage: Space.SRGB,
    unfit=picture_channels("png", grey_alpha=True),
    association=Alpha.STRAIGHT,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
)
