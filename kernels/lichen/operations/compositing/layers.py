"""What the operations on two pictures share: sizes that must agree, coverage, a picture put somewhere on another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned
from lichen.operation import Facts, InputFacts

FLOAT_MAX = float(np.finfo(np.float32).max)
BLOCK = 1 << 15
"""Pixels that a NumPy body works on at once, so that its steps stay in cache."""


def colours(facts: Facts) -> int:
    """Channels that are not coverage."""
    return facts.channels - (facts.alpha is not Alpha.NONE)


def shape(facts: Facts) -> str:
    return f"{facts.width}x{facts.height}"


def same_size(facts: InputFacts, *names: str) -> list[Flaw]:
    """A flaw for each of the inputs there are that is not as large as the first of them."""
    there = [(name, facts[name]) for name in names if name in facts]
    first, model = there[0]
    return [
        Flaw(f"/inputs/{name}", f"is {shape(each)}; {first} is {shape(model)}")
        for name, each in there[1:]
        if (each.height, each.width) != (model.height, model.width)
    ]


def split(image: Image, dtype: type[np.floating] | None = None) -> tuple[Array, Array]:
    """Colour, and coverage of one channel: ones where the picture has none."""
    pixels = image.pixels if dtype is None else image.pixels.astype(dtype, copy=False)
    if image.alpha is Alpha.NONE:
        return pixels, np.ones((1, 1, 1), pixels.dtype)
    return pixels[..., :-1], pixels[..., -1:]


def placed(pixels: Array, height: int, width: int, x: int, y: int) -> Array:
    """A canvas of zeros with the pixels on it, their first row and column at y and x; what lies outside is cut off."""
    canvas = np.zeros((height, width, pixels.shape[2]), pixels.dtype)
    rows = slice(max(y, 0), min(y + pixels.shape[0], height))
    columns = slice(max(x, 0), min(x + pixels.shape[1], width))
    if rows.start < rows.stop and columns.start < columns.stop:
        canvas[rows, columns] = pixels[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
    return aligned(canvas, pixels.dtype)


def row_blocks(height: int, width: int) -> Iterator[slice]:
    """Rows in turn, as many as stay in cache."""
    rows = max(1, BLOCK // width)
    for top in range(0, height, rows):
        yield slice(top, min(top + rows, height))
