"""Range and non-finite count of an array on the device: `lichen.image.measure_extent` at the speed of memory."""

from __future__ import annotations

import numpy as np

from lichen.image import Extent, Image, measure_extent
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device

_BLOCK = 1 << 14
"""Values per work-item: 64 KiB, so that even a small image has work for every thread."""
_WORTH = 1 << 21
"""Values; below it the launch costs more than NumPy takes."""


def extent(device: Device, array: Array) -> Extent:
    """Smallest and largest finite value and the count of NaN and infinities, for an array of any shape.

    The same numbers as `measure_extent`, always; float32 in C order is measured on the device, anything else by NumPy.
    """
    if array.dtype != np.float32 or not array.flags.c_contiguous or array.size < _WORTH:
        return measure_extent(array)
    blocks = -(-array.size // _BLOCK)
    parts = aligned_empty((blocks, 3))
    with device.session() as session:
        size = (np.uint64(array.size), np.int32(_BLOCK))
        session.launch("extent.cl", "extent", (blocks,), array, *size, session.write(parts), local=(1,))
    low, high, nonfinite = float(parts[:, 0].min()), float(parts[:, 1].max()), int(parts[:, 2].sum(dtype=np.float64))
    return Extent(low, high, nonfinite) if low <= high else Extent(0.0, 0.0, nonfinite)


def measured(image: Image, device: Device | None) -> Image:
    """`image` with its extent known, which a device finds sooner."""
    if device is not None and "extent" not in vars(image):
        vars(image)["extent"] = extent(device, image.pixels)
    return image
