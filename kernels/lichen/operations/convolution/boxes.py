"""Three running means in a row, which come near a Gaussian: the central limit theorem at its shortest.

Of whole pixels, the three have odd widths n or n + 2, so many of each that their variance comes nearest to sigma^2. An
extended box has a part of one more pixel at either end, which gives exactly that variance at any sigma.

A running mean adds what enters its window and subtracts what leaves it. Either is rounded, and the errors of a line add
up: that is stated with the rest, and it is small beside what three boxes are wrong by.

Sources: Wells, Efficient synthesis of Gaussian filters by cascaded uniform filters, IEEE PAMI 8 (1986); Gwosdek,
Grewenig, Bruhn and Weickert, Theoretical foundations of Gaussian convolution by extended box filtering, SSVM 2011.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import ROUNDING, Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.gaussian_weights import half_kernel
from lichen.operations.convolution.recursive import LANES, both_passes


@dataclass(frozen=True)
class Boxes:
    """Means of 2 r + 1 samples for each of three radii r, with `part` of one more at either end."""

    radii: tuple[int, int, int]
    part: float

    @property
    def reach(self) -> int:
        return sum(self.radii) + 3

    def kernel(self) -> npt.NDArray[np.float64]:
        whole = np.ones(1)
        for radius in self.radii:
            single = np.ones(2 * radius + 3)
            single[[0, -1]] = self.part
            whole = np.convolve(whole, single / single.sum())
        return whole

    def rounding(self, size: int) -> float:
        """Of one pass over lines of `size` samples of magnitude 1: all steps of all sums, at most."""
        return (
            1.01
            * ROUNDING
            * sum(
                (2 * radius + 3) / (2 * radius + 1 + 2 * self.part) * (size + 2 * self.reach + 2 * radius + 1) + 6
                for radius in self.radii
            )
        )


@lru_cache(maxsize=256)
def boxes(sigma: float, extended: bool) -> Boxes:
    variance = sigma * sigma / 3
    ideal = math.sqrt(12 * variance + 1)
    if extended:
        radius = max(math.floor((ideal - 1) / 2), 0)
        part = (2 * radius + 1) * (variance - radius * (radius + 1) / 3) / (2 * ((radius + 1) ** 2 - variance))
        return Boxes((radius,) * 3, min(max(part, 0.0), 1.0))
    low = max(math.floor((ideal - 1) / 2), 0)
    n = 2 * low + 1
    narrow = min(max(round((3 * sigma * sigma * 4 - 3 * n * n - 12 * n - 9) / (-4 * n - 4)), 0), 3)
    radii = tuple(low if k < narrow else low + 1 for k in range(3))
    return Boxes((radii[0], radii[1], radii[2]), 0.0)


@lru_cache(maxsize=256)
def boxes_distance(made: Boxes, sigma: float) -> float:
    """Half the l1 norm of the three boxes less the Gaussian."""
    half, kernel = half_kernel(sigma), made.kernel()
    count = max(len(half), made.reach + 1)
    apart = np.zeros(count)
    apart[: len(half)] -= half
    apart[: made.reach + 1] += kernel[made.reach :]
    return float(np.abs(apart[0]) / 2 + np.abs(apart[1:]).sum())


def boxes_opencl(device: Device, pixels: Array, down: Boxes, across: Boxes, border: Border, value: float) -> Array:
    """`pixels` (height, width, channels) through the three boxes of either axis."""
    out = aligned_empty(pixels.shape)
    with device.session() as session:
        passes = tuple(zip((down, across), both_passes(session, pixels, out), strict=True))
        lines = session.scratch((max(each.items * LANES * (each.size + 2 * made.reach) for made, each in passes),))
        sums = session.scratch((max(each.floats for _, each in passes),))
        for made, each in passes:
            around = np.arange(-made.reach, each.size + made.reach)
            sources = continued(around, each.size, border).astype(np.int32)
            session.launch(
                "convolution/lines.cl", "boxes", (each.items,),
                each.source, aligned(sources, np.int32), aligned(np.array(made.radii, np.int32), np.int32),
                session.readwrite(lines), session.readwrite(sums), session.readwrite(each.target),
                *each.numbers, np.int32(len(sources)), np.float32(made.part), np.float32(value), local=(1,),
            )  # fmt: skip
    return out


def boxes_numpy(pixels: Array, down: Boxes, across: Boxes, border: Border, value: float) -> Array:
    """The same with OpenCV's running means: an extended box is a mean of two boxes."""
    import cv2  # slow to load, and no device needs it

    for axis, made in ((0, down), (1, across)):
        lines = np.moveaxis(pixels, axis, 0)
        size, reach = len(lines), made.reach
        at = continued(np.arange(-reach, size + reach), size, border)
        around = lines.reshape(size, -1)[np.maximum(at, 0)]
        around[at == OUTSIDE] = value
        for radius in made.radii:
            inner, outer = 2 * radius + 1, 2 * radius + 3
            share = outer * made.part / (inner + 2 * made.part)
            narrow = cv2.blur(around, (1, inner), borderType=cv2.BORDER_REPLICATE).reshape(around.shape)
            if share:
                wide = cv2.blur(around, (1, outer), borderType=cv2.BORDER_REPLICATE).reshape(around.shape)
                narrow = np.float32(1 - share) * narrow + np.float32(share) * wide
            around = narrow
        pixels = np.moveaxis(around[reach : reach + size].reshape(lines.shape), 0, axis)
    return aligned(pixels)
