"""The .cube text of colour tables, read safely.

Lines are a title, comments (#), `LUT_3D_SIZE n`, `DOMAIN_MIN r g b`, `DOMAIN_MAX r g b`, Resolve's `LUT_3D_INPUT_RANGE
low high`, and n^3 lines of three numbers, red fastest. Or `LUT_1D_SIZE n` and n lines, one number of each for each
channel; where both sizes stand, as Resolve writes a shaper, the one-dimensional table comes first. Sizes are checked
before anything of that size is made, every number must be finite, and what is wrong is named with its line.

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
    """`table` has shape (n, n, n, 3), axes blue, green, red, or there is none; `shaper` (3, n), or there is none."""

    table: Array | None
    low: Triple
    high: Triple
    shaper: Array | None = None
    shaper_ends: tuple[Triple, Triple] = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


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


SIZES = {"LUT_3D_SIZE": LARGEST, "LUT_1D_SIZE": 1 << 16}
RANGES = {"LUT_3D_INPUT_RANGE": 3, "LUT_1D_INPUT_RANGE": 1}


@lru_cache(maxsize=8)
def parse(text: str) -> Cube:
    """The tables in a .cube text. Raises `ValueError` with the line that is wrong."""
    if len(text) > LONGEST:
        raise ValueError(f"the text has {len(text)} characters, more than {LONGEST}")
    sizes = {"LUT_3D_SIZE": 0, "LUT_1D_SIZE": 0}
    ends: dict[int | str, Triple] = {"low": (0.0, 0.0, 0.0), "high": (1.0, 1.0, 1.0)}
    ranges: dict[int, tuple[Triple, Triple]] = {}
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#") or words[0] == "TITLE":
            continue
        if words[0] in sizes:
            size = sizes[words[0]] = int(_numbers(words[1:], 1, number)[0])
            if not 2 <= size <= SIZES[words[0]]:
                raise ValueError(f"line {number}: the size is {size}; it must be 2 to {SIZES[words[0]]}")
        elif words[0] in ("DOMAIN_MIN", "DOMAIN_MAX"):
            ends["low" if words[0] == "DOMAIN_MIN" else "high"] = _triple(words[1:], number)
        elif words[0] in RANGES:
            start, end = _numbers(words[1:], 2, number)
            ranges[RANGES[words[0]]] = (start,) * 3, (end,) * 3
        else:
            needed = sizes["LUT_3D_SIZE"] ** 3 + sizes["LUT_1D_SIZE"]
            if len(rows) >= needed:
                raise ValueError(
                    f"line {number}: " + ("more colours than the sizes say" if needed else "no size before")
                )
            rows.append(_numbers(words, 3, number))
    return _cube(rows, sizes["LUT_1D_SIZE"], sizes["LUT_3D_SIZE"], (ends["low"], ends["high"]), ranges)


def _cube(
    rows: list[list[float]], line: int, side: int, ends: tuple[Triple, Triple], ranges: dict[int, tuple[Triple, Triple]]
) -> Cube:
    if not rows or len(rows) != line + side**3:
        raise ValueError(f"holds {len(rows)} colours; LUT_1D_SIZE {line} and LUT_3D_SIZE {side} need {line + side**3}")
    numbers = np.array(rows)
    shaper = np.ascontiguousarray(numbers[:line].T) if line else None
    table = numbers[line:].reshape(side, side, side, 3) if side else None
    low, high = ranges.get(3, ((0.0,) * 3, (1.0,) * 3) if line and side else ends)
    return Cube(table, low, high, shaper, ranges.get(1, ends))


def written(table: Array) -> str:
    """The .cube text of a table of shape (n, n, n, 3), axes blue, green, red."""
    lines = [f"LUT_3D_SIZE {len(table)}", *(" ".join(f"{v:.9g}" for v in row) for row in table.reshape(-1, 3))]
    return "\n".join(lines) + "\n"
