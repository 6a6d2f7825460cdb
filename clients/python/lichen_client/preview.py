"""Arrays as small PNGs for notebooks, without an image library: eight bits, no filters (PNG, third edition, W3C)."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

LARGEST = 1024
"""Pixels of a side; larger pictures are thinned out."""
_KINDS = {1: 0, 2: 4, 3: 2, 4: 6}
"""PNG's colour types by channels."""


def png_of(array: np.ndarray[Any, Any], *, linear: bool = False) -> bytes:
    """`array` of shape (height, width[, channels]), integers of full range or floats from 0 to 1, shown; what lies
    outside is cut off, NaN is black, and of more than four channels the first three are taken. `linear` light is
    encoded as sRGB."""
    import numpy as np

    shown = array if array.ndim == 3 else array[:, :, np.newaxis]
    step = max(1, -(-max(shown.shape[:2]) // LARGEST))
    shown = shown[::step, ::step, : shown.shape[2] if shown.shape[2] <= 4 else 3]
    if shown.dtype.kind in "ub":
        levels = 1 if shown.dtype.kind == "b" else np.iinfo(shown.dtype).max
        values = shown.astype(np.float64) / levels
    else:
        values = np.clip(np.nan_to_num(shown.astype(np.float64), nan=0.0), 0.0, 1.0)
    if linear:
        colours = values[..., : 1 if shown.shape[2] < 3 else 3]
        colours[...] = np.where(colours <= 0.0031308, 12.92 * colours, 1.055 * colours ** (1 / 2.4) - 0.055)
    codes = np.rint(values * 255).astype(np.uint8)
    height, width, channels = codes.shape
    rows = np.zeros((height, 1 + width * channels), np.uint8)
    rows[:, 1:] = codes.reshape(height, -1)
    head = struct.pack(">IIBBBBB", width, height, 8, _KINDS[channels], 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes(), 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
