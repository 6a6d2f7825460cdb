"""Interpolation in a table of three dimensions: the definition, in any precision.

Source: J. Kasson et al., Performing color space conversions with three-dimensional linear interpolation, J. Electronic
Imaging 4(3), 1995.
"""

from __future__ import annotations

import numpy as np

from lichen.memory import Array

Triple = tuple[float, float, float]


def looked_up(x: Array, table: Array, domain: tuple[Triple, Triple], *, tetrahedral: bool) -> Array:
    """x of shape (..., 3), table (n, n, n, 3), axes blue, green, red. Places are held to the domain; NaN in one channel
    is NaN in all."""
    size = len(table)
    table = table.reshape(-1, 3).astype(x.dtype, copy=False)
    low, high = (np.array(edge, dtype=x.dtype) for edge in domain)
    scale = ((size - 1) / (np.array(domain[1]) - np.array(domain[0]))).astype(x.dtype)
    place = (np.clip(x, low, high) - low) * scale
    cell = np.minimum(np.nan_to_num(place).astype(np.int32), size - 2)
    part = place - cell.astype(x.dtype)
    axes = np.array([1, size, size * size], np.int32)
    base = cell @ axes
    if not tetrahedral:
        return _trilinear(table, base, part, axes)
    order = np.argsort(-part, axis=-1, kind="stable")
    sizes = np.take_along_axis(part, order, -1)
    steps = np.cumsum(axes[order], axis=-1)
    value: Array = table[base] * (1 - sizes[..., :1])
    value += table[base + steps[..., 0]] * (sizes[..., 0:1] - sizes[..., 1:2])
    value += table[base + steps[..., 1]] * (sizes[..., 1:2] - sizes[..., 2:3])
    value += table[base + steps[..., 2]] * sizes[..., 2:3]
    value[np.isnan(x).any(axis=-1)] = np.nan
    return value


def _trilinear(table: Array, base: Array, part: Array, axes: Array) -> Array:
    """A NaN in the place makes all three NaN by itself: every corner has every part in its weight."""
    r, g, b = part[..., 0:1], part[..., 1:2], part[..., 2:3]
    value = np.zeros_like(part)
    for corner in range(8):
        on = [(corner >> axis) & 1 for axis in range(3)]
        weight = (r if on[0] else 1 - r) * (g if on[1] else 1 - g) * (b if on[2] else 1 - b)
        value += table[base + int(np.dot(on, axes))] * weight
    return value
