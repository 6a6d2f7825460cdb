"""Horizons of a relief: how steeply it rises, as seen from a pixel in some directions.

From a pixel of height h, over the pixels at offsets (i, j) that lie nearest to the points at 1, 2, 3 ... px in
direction k, the horizon is the largest slope (h' - h) / sqrt(i^2 + j^2), and no less than a floor. Heights are in
pixels. Every offset is a pixel, with its own true distance, so nothing is interpolated, and kernels read whole rows.

Where depths are given, the slope is that of perspective about the pixel itself: (z - z') / (k z sqrt(i^2 + j^2)), where
k is the size of a pixel at depth 1. A depth that is infinite, or not above 0, is nothing: it hides nothing, and nothing
hides it.

`spacing` takes only every so many pixels of a direction: less work, and peaks between them are not seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lichen.image import Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Border
from lichen.operations.convolution.stencil import continue_image

if TYPE_CHECKING:
    from lichen.opencl.device import Device

Integers = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Ring:
    """Directions around a pixel, and how far to look in them."""

    directions: int
    radius: float
    spacing: float
    scale: float
    """px; of the value 1, or of a slope between depths"""
    depth: bool
    border: Border
    value: float

    @property
    def reach(self) -> int:
        return math.ceil(self.radius)

    def turn(self, k: int) -> tuple[float, float]:
        """Cosine and sine of direction k, from x towards y upwards; those along the axes exactly."""
        angle = 2 * math.pi * k / self.directions
        made = math.cos(angle), math.sin(angle)
        return tuple(0.0 if abs(each) < 1e-12 else each for each in made)  # type: ignore[return-value]

    def offsets(self) -> list[tuple[Integers, Integers]]:
        """Of each direction: columns to the right and rows down, without the pixel itself."""
        return [_offsets(*self.turn(k), self.radius, self.spacing) for k in range(self.directions)]


@lru_cache(maxsize=512)
def _offsets(cosine: float, sine: float, radius: float, spacing: float) -> tuple[Integers, Integers]:
    far = np.arange(1.0, math.floor(radius / spacing) + 1) * spacing
    if far.size == 0:
        far = np.array([min(spacing, radius)])
    ways = far[:, None] * np.array([cosine, -sine])
    places = (np.sign(ways) * np.floor(np.abs(ways) + 0.5 + 1e-9)).astype(np.int32)  # halves away from the pixel
    kept = [tuple(place) for place in dict.fromkeys(map(tuple, places.tolist())) if any(place)]
    made = np.array(kept or [(round(cosine), -round(sine))], np.int32)
    return made[:, 0], made[:, 1]


def framed(image: Image, ring: Ring) -> Array:
    """Heights with what lies around them, as far as the ring reaches."""
    reach = ring.reach
    return continue_image(image.pixels, (reach, reach), (reach, reach), ring.border, ring.value)[..., 0]


def slopes(image: Image, ring: Ring, k: int, floor: Array | float) -> Array:
    """The horizon in direction k, in the precision of the image: shape (height, width)."""
    around, reach = framed(image, ring), ring.reach
    height, width = image.height, image.width
    here = image.pixels[..., 0]
    kind = here.dtype.type
    made = np.broadcast_to(np.asarray(floor, here.dtype), here.shape).copy()
    for i, j in zip(*ring.offsets()[k], strict=True):
        there = around[reach + j : reach + j + height, reach + i : reach + i + width]
        over = kind(ring.scale / math.hypot(i, j))
        if ring.depth:
            slope = (here - there) / here * over
            slope = np.where((there > 0) & (there < np.inf) | np.isnan(there), slope, kind(-np.inf))
        else:
            slope = (there - here) * over
        made = np.maximum(made, slope)
    if ring.depth:
        made = np.where((here <= 0) | (here == np.inf), np.asarray(floor, here.dtype), made)
    return made


def launch(
    device: Device, kernel: str, image: Image, ring: Ring, normal: Image | None, channels: int, last: float
) -> Array:
    """The kernel of horizons.cl over the whole picture; `last` is its own number."""
    around = aligned(framed(image, ring))
    out = aligned_empty((image.height, image.width, channels))
    offsets, starts, numbers = [], [0], []
    for columns, rows in ring.offsets():
        far = np.hypot(columns.astype(float), rows.astype(float))
        offsets.append(np.stack([rows * around.shape[1] + columns, columns], axis=-1))
        numbers.append(ring.scale / far)
        starts.append(starts[-1] + len(far))
    turns = np.array([ring.turn(k) for k in range(ring.directions)])
    with device.session() as session:
        session.launch(
            "relief/horizons.cl", kernel, (-(-image.width // 16), image.height),
            around, aligned(np.concatenate(offsets), np.int32), aligned(np.concatenate(numbers)),
            aligned(np.array(starts), np.int32), aligned(turns), None if normal is None else aligned(normal.pixels),
            session.write(out), np.int32(image.width), np.int32(around.shape[1]), np.int32(ring.reach),
            np.int32(ring.directions), np.int32(ring.depth), np.float32(last), local=(1, 1),
        )  # fmt: skip
    return out
