"""Strokes of a round pen with soft edges: how lines and marks get into a picture.

A stroke goes straight from one point to another, or stays at one. Its coverage of a pixel is radius + 1/2 - d, within
[0, 1], where d is the distance of the pixel's centre from it: the soft edge is one pixel wide. A pixel holds the
largest of coverage times value over all strokes, in each channel, so no order of drawing shows.

Points are kept as the pixel they lie in and the rest, so that rounding does not grow with the image: the coverage in
single precision is off by less than 1e-6 for each pixel of the pen's radius and the stroke's length.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device

SOURCE = "streamlines/strokes.cl"
LONGEST = 16.0
"""px; longer strokes are cut into parts, so that no work-item draws far more than another."""


@dataclass(frozen=True, eq=False)
class Strokes:
    """float64: `start` and `end` (n, 2) in pixels, y down, centres of pixels at +0.5; `radius` (n,) in pixels; `values`
    (n, channels), not negative."""

    start: Array
    end: Array
    radius: Array
    values: Array

    def parts(self) -> Strokes:
        """The same in strokes no longer than `LONGEST`."""
        apart = self.end - self.start
        pieces = np.maximum(np.ceil(np.abs(apart).max(axis=1, initial=0.0) / LONGEST), 1).astype(int)
        which = np.repeat(np.arange(len(pieces)), pieces)
        first = np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        low, high = first / pieces[which], (first + 1) / pieces[which]
        start, apart = self.start[which], apart[which]
        ends = (start + low[:, None] * apart, start + high[:, None] * apart)
        return Strokes(*ends, self.radius[which], self.values[which])

    def cells(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
        """The pixels that the strokes start in, (n, 2), and from their centres: the start, the way, the radius."""
        cell = np.floor(self.start)
        rest = self.start - cell - 0.5
        shape = np.concatenate([rest, self.end - self.start, self.radius[:, None]], axis=1)
        return aligned(cell.astype(np.int32), np.int32), aligned(shape, np.float32)


def drawn_opencl(device: Device, strokes: Strokes, height: int, width: int) -> Array:
    """float32 (height, width, channels)."""
    strokes = strokes.parts()
    channels = strokes.values.shape[1]
    result = aligned_empty((height, width, channels))
    result[...] = 0
    if not len(strokes.start):
        return result
    cells, shapes = strokes.cells()
    with device.session() as session:
        session.launch(
            SOURCE,
            "draw",
            (len(cells),),
            cells,
            shapes,
            aligned(strokes.values, np.float32),
            session.readwrite(result.view(np.int32)),
            np.int32(len(cells)),
            np.int32(width),
            np.int32(height),
            np.int32(channels),
        )
    return result


def drawn_numpy(strokes: Strokes, height: int, width: int) -> Array:
    """The same in NumPy: all strokes at once, one pixel of each after the other."""
    strokes = strokes.parts()
    channels = strokes.values.shape[1]
    result = np.zeros((height * width, channels), np.float32)
    cells, shapes = strokes.cells()
    values = strokes.values.astype(np.float32)
    x, y, dx, dy, radius = shapes.T
    square = dx * dx + dy * dy
    reach = int(np.ceil((radius + np.abs(dx) + np.abs(dy)).max(initial=0.0))) + 1
    with np.errstate(divide="ignore", invalid="ignore"):
        for j in range(-reach, reach + 1):
            for i in range(-reach, reach + 1):
                ax, ay = np.float32(i) - x, np.float32(j) - y
                along = np.clip(np.where(square > 0, (ax * dx + ay * dy) / square, 0), 0, 1).astype(np.float32)
                inside = radius + np.float32(0.5) - np.hypot(ax - along * dx, ay - along * dy)
                column, row = cells[:, 0] + i, cells[:, 1] + j
                hit = (inside > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
                cover = np.minimum(inside[hit], 1)[:, None] * values[hit]
                np.maximum.at(result, row[hit].astype(np.int64) * width + column[hit], cover)
    return aligned(result.reshape(height, width, channels), np.float32)


def drawn_exactly(strokes: Strokes, height: int, width: int) -> Array:
    """The definition in float64: the distance of every pixel from every stroke that may reach it."""
    result = np.zeros((height, width, strokes.values.shape[1]))
    y, x = np.mgrid[:height, :width] + 0.5
    for start, end, radius, value in _each(strokes):
        low = np.floor(np.minimum(start, end) - radius - 1).astype(int)
        high = np.ceil(np.maximum(start, end) + radius + 1).astype(int)
        part = (slice(max(low[1], 0), max(high[1], 0)), slice(max(low[0], 0), max(high[0], 0)))
        apart = np.stack([x[part] - start[0], y[part] - start[1]], axis=-1)
        way = end - start
        square = float(way @ way)
        along = np.clip(apart @ way / square, 0, 1) if square > 0 else np.zeros(apart.shape[:2])
        off = apart - along[..., None] * way
        cover = np.clip(radius + 0.5 - np.hypot(off[..., 0], off[..., 1]), 0, 1)
        result[part] = np.maximum(result[part], cover[..., None] * value)
    return result


def _each(strokes: Strokes) -> Iterator[tuple[Array, Array, float, Array]]:
    yield from zip(strokes.start, strokes.end, strokes.radius.tolist(), strokes.values, strict=True)


def rounding(radius: float, length: float) -> float:
    """Of the coverage: of products of places within the pen and the stroke, in single precision."""
    return 1e-6 * (2 + radius + min(length, 2 * LONGEST))
