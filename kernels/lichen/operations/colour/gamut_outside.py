"""What lies outside a gamut, by gamut_outside.cl: the figures and the report of gamut.py, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lichen.memory import Array, aligned, aligned_empty

if TYPE_CHECKING:
    from lichen.image import Image
    from lichen.opencl.device import Device

FEWEST = 1 << 14
"""Pixels from which on it is quicker than NumPy."""
SHARE = 1 << 13
"""Pixels of a work-item."""


@dataclass(frozen=True, slots=True)
class Outside:
    """What was found."""

    by_channel: tuple[int, int, int]
    """pixels that are outside by red, green and blue"""
    by_any: int
    distance: float
    """the largest, below 0 where none is known"""
    shown: Array | None
    """float32 (height, width, 1): 1 where a pixel is outside, else 0"""


def worthwhile(device: Device, image: Image) -> bool:
    """Whether the kernel can take it, and is quicker."""
    return device.has_fp64 and image.pixels.dtype == np.float32 and image.height * image.width >= FEWEST


def outside(device: Device, image: Image, there: Array | None, peak: float | None, *, shown: bool) -> Outside:
    """Of float32 pixels that a matrix, float64 (3, 3), takes `there`, or that are of the gamut's primaries."""
    pixels = image.height * image.width
    numbers = np.array([*(np.eye(3) if there is None else there).reshape(-1), peak or 0.0])
    parts = aligned_empty((-(-pixels // SHARE), 5), np.float64)
    out = aligned_empty((image.height, image.width, 1)) if shown else None
    defines: dict[str, int | float | str] = {
        "IN": image.channels, "TURNED": int(there is not None), "PEAKED": int(peak is not None), "SHOWN": int(shown),
    }  # fmt: skip
    with device.session() as session:
        session.launch(
            "colour/gamut_outside.cl", "outside", (len(parts),),
            aligned(image.pixels), None if out is None else session.write(out), session.write(parts),
            aligned(numbers, np.float64), np.int32(pixels), np.int32(SHARE),
            local=(1,), defines=defines,
        )  # fmt: skip
    red, green, blue, by_any = (int(count) for count in parts[:, :4].sum(axis=0))
    return Outside((red, green, blue), by_any, float(parts[:, 4].max()), out)
