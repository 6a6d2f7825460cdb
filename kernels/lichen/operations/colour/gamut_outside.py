"""What lies outside a gamut, by gamut_outside.cl: the figures and the report of gamut.py, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.memory import Array, aligned, aligned_empty

if TYPE_CHECKING:
    from lichen.image import Image
    from lichen.opencl.device import Device

FEWEST = 1 << 14
"""Pixels from which on it is quicker than NumPy."""
SHARE = 1 << 13
"""Pixels of a work-item."""


def told(counts: Sequence[float], pixels: int, farthest: float) -> Mapping[str, Any]:
    """The findings: how many of the pixels are outside by each channel and by any, and the largest distance, below 0
    where none is known."""
    *by_channel, by_any = (float(count) / pixels for count in counts)
    return {"outside": by_any, "outside_by_channel": by_channel, "distance": farthest if farthest >= 0 else None}


def worthwhile(device: Device, image: Image) -> bool:
    """Whether the kernel can take it, and is quicker."""
    return device.has_fp64 and image.pixels.dtype == np.float32 and image.height * image.width >= FEWEST


def outside(
    device: Device, image: Image, there: Array | None, peak: float | None, *, shown: bool
) -> tuple[Array | None, Mapping[str, Any]]:
    """Of float32 pixels that a matrix, float64 (3, 3), takes `there`, or that are of the gamut's primaries: the report,
    float32 (height, width, 1), if it is to be `shown`, 1 where a pixel is outside, else 0; and the findings."""
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
    return out, told(parts[:, :4].sum(axis=0), pixels, float(parts[:, 4].max()))
