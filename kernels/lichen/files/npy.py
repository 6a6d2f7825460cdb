"""NPY: any array of one plain number type, bit for bit.

The header is a Python literal; it is parsed as one, never evaluated, and only the three keys of the format with a
number type and two or three dimensions pass. The file must end where its shape says. Pickled objects and records are
refused by their type. Arrays are written with three dimensions, little-endian, rows first; several pictures as one
array of four dimensions, which is for programs: it is not read back as an image.

Source: NumPy enhancement proposal 1, versions 1.0 to 3.0.
"""

from __future__ import annotations

import ast
import struct
from dataclasses import dataclass

import numpy as np

from lichen.errors import UnreadableImage, UnsupportedFormat
from lichen.files.format import Data, Format, Header, take, unpack
from lichen.image import Image, Space, Storage
from lichen.memory import Array, joined

SIGNATURE = b"\x93NUMPY"
_LONGEST = 10_000
_STORAGES = {
    "b1": Storage.UINT8,
    "u1": Storage.UINT8,
    "u2": Storage.UINT16,
    "f2": Storage.FLOAT16,
    "f4": Storage.FLOAT32,
    "f8": Storage.FLOAT64,
}


@dataclass(frozen=True, slots=True)
class _Layout:
    kind: str
    columns_first: bool
    start: int


def read_header(data: memoryview) -> Header:
    version = take(data, 6, 2, "NPY header")[0]
    if version not in (1, 2, 3):
        raise UnreadableImage(f"NPY version {version} is not known.")
    width = 2 if version == 1 else 4
    size = unpack("<H" if version == 1 else "<I", data, 8, "NPY header")[0]
    if size > _LONGEST:
        raise UnreadableImage(f"The NPY header claims {size} bytes, at most {_LONGEST} make sense.")
    text = bytes(take(data, 8 + width, size, "NPY header"))
    try:
        claims = ast.literal_eval(text.decode("latin-1" if version < 3 else "utf-8").strip())
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        raise UnreadableImage("The NPY header is not a literal.") from None
    if not isinstance(claims, dict) or claims.keys() != {"descr", "fortran_order", "shape"}:
        raise UnreadableImage("The NPY header must hold descr, fortran_order and shape, and nothing else.")
    descr, order, shape = claims["descr"], claims["fortran_order"], claims["shape"]
    whole = isinstance(shape, tuple) and all(type(side) is int and side >= 0 for side in shape)
    if not whole or not isinstance(order, bool):
        raise UnreadableImage("The NPY shape or order is not valid.")
    if not isinstance(descr, str) or descr[:1] not in "<>|=" or descr[1:] not in _STORAGES:
        raise UnsupportedFormat(f"NPY arrays of {str(descr)[:40]} are not images; known: {', '.join(_STORAGES)}.")
    if len(shape) not in (2, 3) or 0 in shape:
        raise UnreadableImage(f"An image has shape (height, width) or (height, width, channels), not {shape!s:.60}.")
    rows, columns, channels = (*shape, 1)[:3]
    layout = _Layout(descr, order, 8 + width + size)
    return Header("npy", columns, rows, channels, _STORAGES[descr[1:]], Space.DATA, details=layout)


def read_samples(data: memoryview, header: Header) -> Array:
    layout: _Layout = header.details
    kind = np.dtype(layout.kind)
    shape = (header.height, header.width, header.channels)
    expected = header.height * header.width * header.channels * kind.itemsize
    present = len(data) - layout.start
    if present != expected:
        raise UnreadableImage(f"The NPY shape {shape} takes {expected} bytes, but {present} follow the header.")
    flat = np.frombuffer(data, kind, offset=layout.start)
    if kind.kind == "b":
        flat = flat.view(np.uint8).astype(bool).view(np.uint8) * np.uint8(255)
    samples = flat.reshape(shape, order="F" if layout.columns_first else "C")
    return samples.astype(samples.dtype.newbyteorder("="), copy=False)


def write(samples: Array, image: Image, quality: int | None) -> Data:
    kind = samples.dtype.newbyteorder("<")
    shape = samples.shape if image.pages == 1 else (image.pages, image.height // image.pages, *samples.shape[1:])
    text = f"{{'descr': '{kind.str}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(10 + len(text) + 1) % 64) + b"\n"
    plain = np.ascontiguousarray(samples, kind)
    return joined([SIGNATURE, b"\x01\x00", struct.pack("<H", len(text)), text, plain.data])


npy = Format(
    name="npy",
    media_types=("application/x-npy", "application/npy", "application/x-numpy"),
    extensions=(".npy",),
    storages=tuple(Storage),
    largest_side=(1 << 63) - 1,
    lossy=False,
    recognises=lambda head: head.startswith(SIGNATURE),
    natural_space=lambda storage: Space.DATA,
    unfit=lambda image: None,
    association=None,
    read_header=read_header,
    read_samples=read_samples,
    write=write,
    paged=True,
)
