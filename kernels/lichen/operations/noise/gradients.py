"""Gradients that hashes stand for: the NumPy twin of gradient.clh.

Eight directions 22.5 + 45 k degrees in two dimensions, none of them an axis; the twelve edges of a cube in three
(Perlin 2002); the 32 edges of a hypercube, (0, 1, 1, 1) with all signs and places, in four."""

from __future__ import annotations

import math

import numpy as np

from lichen.hashing import Words
from lichen.memory import Array
from lichen.operations.noise.basis import Slice

PART = math.sqrt(2) - 1
"""The tangent of 22.5 degrees."""
LENGTH = {2: math.hypot(1, PART), 3: math.sqrt(2), 4: math.sqrt(3)}
"""Of a gradient, by the number of dimensions."""
ONES = {2: math.sqrt(2), 3: 2.0, 4: 3.0}
"""The sum of the magnitudes of its components."""


def _signed(value: Array, h: Words, bit: int) -> Array:
    """`value`, or its negative where the bit is set."""
    return np.where((h >> np.uint32(bit)) & np.uint32(1), -value, value)


def gradient(h: Words, x: Array, y: Array, part: Slice, dimensions: int) -> tuple[Array, Array, Array]:
    """The product of the gradient with the way from its point, and its components along x and y."""
    one, zero = x.dtype.type(1), x.dtype.type(0)
    if dimensions == 2:
        steep = (h >> np.uint32(2)) & np.uint32(1)
        short = x.dtype.type(PART)
        along_x = _signed(np.where(steep, short, one), h, 0)
        along_y = _signed(np.where(steep, one, short), h, 1)
        return along_x * x + along_y * y, along_x, along_y
    none = ((h >> np.uint32(16)) * np.uint32(3)) >> np.uint32(16) if dimensions == 3 else h >> np.uint32(30)
    along_x = _signed(np.where(none == 0, zero, one), h, 0)
    along_y = _signed(np.where(none == 1, zero, one), h, 1)
    total = along_x * x + along_y * y
    for axis, away in enumerate((part.z, part.w)[: dimensions - 2], start=2):
        total += _signed(np.where(none == axis, zero, x.dtype.type(away)), h, axis)
    return total, along_x, along_y
