"""The .cube text of a three-dimensional colour table, read safely.

Lines are a title, comments (#), `LUT_3D_SIZE n`, `DOMAIN_MIN r g b`, `DOMAIN_MAX r g b`, Resolve's `LUT_3D_INPUT_RANGE
low high`, and n^3 lines of three numbers, red fastest. The size is checked before anything of that size is made, every
number must be finite, and what is wrong is named with its line.

Source: Adobe, Cube LUT Specification 1.0, 2013.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.memory import Array

LARGEST = 65
LONGEST = 16 << 20
"""Characters: 65^3 lines of 58."""

Triple = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Cube:
    """`table` has shape (n, n, n, 3), axes blue, green, red, float64."""

    table: Array
    low: Triple
    high: Triple


def _numbers(words: list[str], count: int, line: int) -> list[float]:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise ValueError(f"line {line} is no number or keyword of a .cube: {' '.join(words)[:40]!r}") from None
    if len(numbers) != count or not all(map(math.isfinite, numbers)) or max(map(abs, numbers)) > 1e9:
        raise ValueError(f"line {line} must hold {count} finite number(s) up to 1e9")
    return numbers


def _triple(words: list[str], line: int) -> Triple:
    first, second, third = _numbers(words, 3, line)
    return first, second, third


@lru_cache(maxsize=8)
def parse(text: str) -> Cube:
    """The table in a .cube text. Raises `ValueError` with the line that is wrong."""
    if len(text) > LONGEST:
        raise ValueError(f"the text has {len(text)} characters, more than {LONGEST}")
    size, low, high = 0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#") or words[0] == "TITLE":
            continue
        if words[0] == "LUT_3D_SIZE":
            size = int(_numbers(words[1:], 1, number)[0])
            if not 2 <= size <= LARGEST:
                raise ValueError(f"line {number}: the size is {size}; it must be 2 to {LARGEST}")
        elif words[0] == "DOMAIN_MIN":
            low = _triple(words[1:], number)
        elif words[0] == "DOMAIN_MAX":
            high = _triple(words[1:], number)
        elif words[0] == "LUT_3D_INPUT_RANGE":
            start, end = _numbers(words[1:], 2, number)
            low, high = (start,) * 3, (end,) * 3
        elif words[0].startswith("LUT_1D"):
            raise ValueError(f"line {number}: a one-dimensional table; use the operation curve")
        else:
            if not size or len(rows) >= size**3:
                raise ValueError(f"line {number}: " + ("more colours than size^3" if size else "no LUT_3D_SIZE before"))
            rows.append(_numbers(words, 3, number))
    if not size or len(rows) != size**3:
        raise ValueError(f"holds {len(rows)} colours; LUT_3D_SIZE {size} needs {size**3}")
    return Cube(np.array(rows).reshape(size, size, size, 3), low, high)


def written(table: Array) -> str:
    """The .cube text of a table of shape (n, n, n, 3), axes blue, green, red."""
    lines = [f"LUT_3D_SIZE {len(table)}", *(" ".join(f"{v:.9g}" for v in row) for row in table.reshape(-1, 3))]
    return "\n".join(lines) + "\n"
