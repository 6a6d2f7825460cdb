"""Turning by three shears, each a shift of whole lines.

Of a turn x = c u - s v, y = s u + c v the matrix is X Y X with X = [[1, -tan(a / 2)], [0, 1]] and
Y = [[1, 0], [sin a, 1]].
Canvases in between are as large as what the passes after them read, around a common middle.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from lichen.operation import Border
from lichen.operations.warp.kernels import Doubles, Kernel, lanczos
from lichen.operations.warp.reference import Source


@lru_cache(maxsize=16)
def line_kernel(size: int) -> Kernel:
    """The Lanczos kernel of that radius."""
    return Kernel(f"lanczos{size}", size, lanczos(size), 0)


def turned_by_shears(source: Source, angle: float, width: int, height: int, size: int) -> Doubles:
    """The image turned by `angle` degrees to the left about its middle, float64 (height, width, channels)."""
    quarters = round(angle / 90)
    rest = math.radians(angle - 90 * quarters)
    pixels = np.rot90(source.pixels, quarters % 4)
    along, down = -math.tan(rest / 2), math.sin(rest)
    wide = width + 2 * math.ceil(abs(along) * height / 2 + 1)
    tall = height + 2 * math.ceil(abs(down) * wide / 2 + 1)
    kernel = line_kernel(size)
    first = _sheared(Source(pixels, source.border, source.value), wide, tall, along, kernel)
    # What lies beyond a canvas is read by no pixel of the result, but by kernels at its edge.
    held = Border.CONSTANT if source.border is Border.CONSTANT else Border.CLAMP
    turned = Source(first.swapaxes(0, 1), held, source.value)
    second = _sheared(turned, height, wide, down, kernel).swapaxes(0, 1)
    return _sheared(Source(second, held, source.value), width, height, along, kernel)


def _sheared(source: Source, width: int, height: int, shear: float, kernel: Kernel) -> Doubles:
    """out(x, y) = source(x + shear y, y) about the middles of both."""
    tall, wide, channels = source.pixels.shape
    rows = np.arange(height) + 0.5 - height / 2
    # Rows of both lie on one grid or half a sample apart, which is a shift of every column by half a sample.
    down = rows + tall / 2 - 0.5
    across = shear * rows + (wide - width) / 2
    out = np.zeros((height, width, channels))
    whole = np.floor(down)
    for weights, offset in _taps(kernel, down - whole):
        lines = (whole + offset).astype(np.int64)
        cells = np.floor(across)
        for beside, step in _taps(kernel, across - cells):
            weight = (weights * beside)[:, np.newaxis, np.newaxis]
            if not weight.any():
                continue
            columns = (cells + step).astype(np.int64)[:, np.newaxis] + np.arange(width)
            found = source.fetch(np.broadcast_to(lines[:, np.newaxis], columns.shape), columns)
            out += weight * np.where(weight == 0, 0.0, found)
    return out


def _taps(kernel: Kernel, fraction: Doubles) -> list[tuple[Doubles, int]]:
    return list(zip(kernel.weights(fraction), (int(each) for each in kernel.offsets()), strict=True))
