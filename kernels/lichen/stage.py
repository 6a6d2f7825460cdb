"""Pointwise methods as steps of a kernel that carries out a chain of them: see `lichen.planning.fuse`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Stage:
    """A pointwise method as a step of a kernel that carries out a chain of them.

    `source` is a header below `operations/` that defines `void OWN(stage)(float16 *v, global const float *k)`, which
    changes sixteen pixels in place: a vector for each of CHANNELS channels, of which COLOURS are no coverage. It does
    the method's own arithmetic, bit for bit. `defines` hold while it is included; `numbers`, float32, arrive in `k`.
    Where the operation takes two pictures, it is `void OWN(stage)(float16 *v, const float16 *w, global const float *k)`
    and changes those of the first picture.
    """

    source: str
    defines: Mapping[str, int | float | str] = field(default_factory=dict)
    numbers: tuple[float, ...] = ()


def no_stage(parameters: Any, facts: Any) -> Stage | None:
    """Of methods that are no step of a chain."""
    return None
