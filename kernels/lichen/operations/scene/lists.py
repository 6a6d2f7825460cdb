"""Lists of what is left out where: how an operation that can skip reads its input `tiles`.

A picture of lists has a pixel for every tile, a square of `TILE` px counted from the upper left corner, and a channel
for every effect. More than 0 leaves the effect out in the tile. What the picture does not hold, tiles or channels, is
not left out, and neither is NaN.
"""

from __future__ import annotations

import numpy as np

from lichen.memory import Array
from lichen.operation import Input, Inputs

TILE = 32
"""px; of rows that kernels take in pieces of 16 and 64."""


def listing(what: str) -> Input:
    """The input of an operation that can skip."""
    text = f"what is left out in squares of {TILE} px: {what} where the channel `effect` is more than 0; of any size"
    return Input("tiles", text, (1, None), required=False, picture=False)


def tiles_of(height: int, width: int) -> tuple[int, int]:
    """Rows and columns of tiles."""
    return -(-height // TILE), -(-width // TILE)


def left_out(inputs: Inputs, first: int, count: int, height: int, width: int) -> Array | None:
    """Which of `count` effects from `first` on are left out, by tile: bool (rows, columns, count); None: nothing is."""
    if "tiles" not in inputs:
        return None
    down, across = tiles_of(height, width)
    given = inputs["tiles"].pixels[:down, :across, first : first + count] > 0
    made = np.zeros((down, across, count), bool)
    made[: given.shape[0], : given.shape[1], : given.shape[2]] = given
    return made if made.any() else None


def passed(made: Array, below: Array | None, inputs: Inputs, effect: int) -> Array:
    """What an effect made, but in the tiles in which it is left out what lies below it, or 0."""
    height, width, _ = made.shape
    out = left_out(inputs, effect, 1, height, width)
    if out is None:
        return made
    under = made.dtype.type(0) if below is None else below.astype(made.dtype, copy=False)
    return np.asarray(np.where(by_pixel(out, height, width), under, made))


def by_pixel(out: Array, height: int, width: int) -> Array:
    """What holds of tiles, of their pixels."""
    wide: Array = out.repeat(TILE, axis=0)[:height].repeat(TILE, axis=1)[:, :width]
    return wide
