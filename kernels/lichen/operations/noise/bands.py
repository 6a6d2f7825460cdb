"""Tables of coefficients of wavelet noise: random numbers without what a lattice twice as coarse could hold.

Random signs R stand at every cell. Along an axis, D takes them to the lattice of twice the spacing and U takes that
back: U is the refinement of the quadratic B-spline, (1, 3, 3, 1) / 4, and D the filter with which U D is the nearest
spline of the coarse lattice, as 32 numbers. What is left, R - U D R with U D along all axes, holds no more of low
frequencies than the cut of the filter lets through, and its spline no more of high ones than a spline does: a band.

U D sees every other cell with other eyes, so the variance of one such table goes from a third to four thirds of its
mean. A table is therefore the sum of one for each place of the coarse lattice, from signs of their own, over the root
of their number.

Tables repeat: `SIDE` cells along each axis, or a whole part of the picture's period.

All is done in doubles, sum by sum in one order, so every machine makes the same bits of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from lichen.hashing import keyed
from lichen.memory import Array
from lichen.operations.noise.octaves import Key, chained

HALF = (
    0.000334, -0.001528, 0.000410, 0.003545, -0.000938, -0.008233, 0.002172, 0.019120,
    -0.005040, -0.044412, 0.011655, 0.103311, -0.025936, -0.243780, 0.033979, 0.655340,
)  # fmt: skip
DOWN = (*HALF, *reversed(HALF))
"""D: of cells -16 to 15 from twice the coarse one's number (Cook and DeRose, appendix)."""
UP = (0.25, 0.75, 0.75, 0.25)
"""U: what a coarse cell gives to cells -2 to 1 from twice its number."""
SIDE = 128
"""Cells after which a table repeats where the picture does not say."""
VARIANCE = (0.55, 0.409307)
"""Means over a place along one axis: of the squares of the spline's weights, and of those through U D."""
SPREAD = 1.5057
"""The sum of the magnitudes of what U D takes a cell from."""


def side(period: int, free: int) -> int:
    """Of the table along an axis: `free` where it does not repeat by itself, else the largest even part of the period
    that is no more than half as much again."""
    return max(each for each in range(2, free * 3 // 2 + 1, 2) if period % each == 0) if period else free


def weights(t: float) -> tuple[float, float, float]:
    """Of the quadratic B-spline: of the cell before, its own and the next, at a fraction t of a cell."""
    return (1 - t) * (1 - t) / 2, 0.5 + t * (1 - t), t * t / 2


Layers = tuple[tuple[Key, tuple[float, ...], tuple[float, ...]], ...]
"""Planes of signs: the key of each, and for every place of the coarse lattice along z and w the weights with which it
counts, plainly and through U D."""


def along(cells: int, t: float, parity: int) -> dict[int, tuple[float, float]]:
    """Along z: what cells count at a place, plainly and through U D; the coarse lattice lies at `parity`."""
    found: dict[int, list[float]] = {}
    for offset, weight in zip((-1, 0, 1), weights(t), strict=True):
        cell = cells + offset
        found.setdefault(cell, [0.0, 0.0])[0] += weight
        for up, share in enumerate(UP, start=-2):
            if (cell - parity - up) % 2 == 0:
                for down, part in enumerate(DOWN, start=-16):
                    at = cell - up + down
                    found.setdefault(at, [0.0, 0.0])[1] += weight * share * part
    return {cell: (one, two) for cell, (one, two) in sorted(found.items())}


@lru_cache(maxsize=96)
def table(layers: Layers, rows: int, columns: int) -> Array:
    """Coefficients of cells, (rows, columns), of variance 1 of the signs; doubles."""
    count = len(layers[0][1])
    made = np.zeros((rows, columns))
    plain, low = (np.zeros((4 * count, rows, columns)) for _ in range(2))
    for key, own, coarse in layers:
        words = keyed(np.arange(columns), *_column(chained(key, np.arange(rows))))
        for bit in range(4 * count):
            signs = 1.0 - 2.0 * ((words >> np.uint32(bit)) & np.uint32(1))
            plain[bit] += own[bit // 4] * signs
            low[bit] += coarse[bit // 4] * signs
    for bit, (down, across) in zip(range(4 * count), list(product((0, 1), repeat=2)) * count, strict=True):
        made += plain[bit] - _coarse(_coarse(low[bit], 0, down), 1, across)
    made /= math.sqrt(4 * count)
    made.flags.writeable = False
    return made


def _column(key: Sequence[Array]) -> tuple[Array, Array]:
    return key[0][:, None], key[1][:, None]


def _coarse(values: Array, axis: int, parity: int) -> Array:
    """U D along an axis of a table that repeats; the coarse lattice lies at `parity`."""
    turned = np.moveaxis(values, axis, 0)
    size = len(turned)
    even = np.arange(0, size, 2) + parity
    low = np.zeros((size // 2, *turned.shape[1:]))
    for offset, weight in enumerate(DOWN, start=-16):
        low += weight * turned[(even + offset) % size]
    out = np.zeros_like(turned)
    for offset, weight in enumerate(UP, start=-2):
        out[(even + offset) % size] += weight * low
    return np.moveaxis(out, 0, axis)
