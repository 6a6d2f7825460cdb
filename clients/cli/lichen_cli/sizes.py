"""Sizes of memory as people write them."""

from __future__ import annotations

import re

from lichen_cli.main import Usage

_UNITS = {"": 1, "k": 1000, "m": 1000**2, "g": 1000**3, "t": 1000**4}
_UNITS |= {f"{unit}i": 1024**power for power, unit in enumerate("kmgt", 1)}


def bytes_of(text: str) -> int:
    """1500000, 512MB, 2GiB, 2G."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([kmgt]?i?)b?", text.strip().lower())
    if found is None or found[2] not in _UNITS or not float(found[1]) > 0:
        raise Usage(f"a size such as 512MB or 2GiB is wanted (got {text!r})")
    return int(float(found[1]) * _UNITS[found[2]])
