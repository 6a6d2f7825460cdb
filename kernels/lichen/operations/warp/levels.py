"""What methods make of the source before they sample it: a pyramid of box means, or a spline's coefficients."""

from __future__ import annotations

import numpy as np

from lichen.memory import Array
from lichen.operation import Border
from lichen.operations.warp.kernels import TAIL, prefilter
from lichen.operations.warp.reference import Closed, Source


def sizes(height: int, width: int) -> list[tuple[int, int]]:
    """Heights and widths of all levels, down to one sample."""
    made = [(height, width)]
    while max(made[-1]) > 1:
        made.append(tuple(-(-side // 2) for side in made[-1]))  # type: ignore[arg-type]
    return made


def pyramid(source: Source) -> list[Array]:
    """The source and its halvings, each the means of 2 x 2 samples of the one before; odd sides go on by the border."""
    made = [source.pixels]
    while max(made[-1].shape[:2]) > 1:
        last = made[-1]
        odd = last.shape[0] % 2, last.shape[1] % 2
        around = Source(last, source.border, source.value).extended((0, odd[0]), (0, odd[1]))
        quarter = last.dtype.type(0.25)
        pairs = (around[0::2, 0::2] + around[0::2, 1::2]) + (around[1::2, 0::2] + around[1::2, 1::2])
        made.append(pairs * quarter)
    return made


def spline(source: Source) -> tuple[Source, int]:
    """Coefficients of the cubic B-spline through the samples, and how many were put around them on each side.

    The recursion's response is cut after `TAIL` samples, where it is 7e-10: a NaN spoils no more than those around it.
    Periodic borders need no more than the image; the others are filtered with what lies beyond them.
    """
    import cv2  # slow to load, and no device needs it

    around = TAIL if source.border in (Border.CONSTANT, Border.CLAMP, Closed.RING) else 0
    far = around + TAIL
    wide = source.extended((far, far), (far, far)).astype(np.float32)
    taps = prefilter()
    channels = []
    for channel in range(wide.shape[2]):  # OpenCV takes four at once at most, and any number one by one
        plane = np.ascontiguousarray(wide[..., channel])
        channels.append(cv2.sepFilter2D(plane, -1, taps, taps, borderType=cv2.BORDER_REPLICATE))
    done = np.stack(channels, axis=-1)[TAIL : wide.shape[0] - TAIL, TAIL : wide.shape[1] - TAIL]
    border = Border.CLAMP if source.border is Closed.RING else source.border
    return Source(np.ascontiguousarray(done), border, source.value), around
