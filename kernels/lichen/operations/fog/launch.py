"""Fog on a device, and its tables.

The kernel's doubles, by their places: 0 to 3 nothing, 4 density, 5 and 6 the end and the slope of linear fog, or in 6 a
table's entries for a unit of distance, 7 falloffs up to the base, or how far a table of layers reaches, 8 one over the
falloff, 9 to 11 the eye, 12 to 14 upward, 15 to 17 ahead, 18 to 20 the terms of a window's depth, 21 to 24 of both
sides the integral of all layers and the density beyond them, 25 the optical depth of a level ray without an end.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Alpha
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Inputs
from lichen.operations.fog.parameters import Background, Distance, Kind, Parameters
from lichen.operations.scene.view import DepthKind, pointed, rays, window_terms

if TYPE_CHECKING:
    from lichen.opencl.device import Device
    from lichen.opencl.session import Held

SPAN = 64
"""Pixels of a work-item, where it is not a whole row as on a CPU."""
DEEPEST = 14.0
"""Optical depth where a table of what comes through ends: 8.3e-7 is left."""


def reach_of(p: Parameters) -> float:
    """How far a table goes: a distance, or a difference of height."""
    if p.kind is Kind.LAYERED:
        return p.column.reach
    if p.density == 0:
        return 0.0
    return (DEEPEST if p.kind is Kind.EXPONENTIAL else math.sqrt(DEEPEST)) / p.density


def table_of(p: Parameters, entries: int) -> Array:
    """float32: what comes through at even distances up to `reach_of`, or mean densities at even rises, then falls."""
    at = np.linspace(0.0, 1.0, entries) * reach_of(p)
    if p.kind is Kind.LAYERED:
        return np.concatenate([p.column.mean(at), p.column.mean(-at)]).astype(np.float32)
    depth = p.density * at
    return np.exp(-(depth if p.kind is Kind.EXPONENTIAL else depth * depth)).astype(np.float32)


def numbers(p: Parameters, entries: int) -> Array:
    """The kernel's doubles."""
    made = np.zeros(26)
    made[4] = p.density
    made[8:18] = 1 / p.falloff, *p.eye, *p.upward, *p.ahead
    if p.depth_kind in (DepthKind.WINDOW, DepthKind.REVERSED):
        scale, (a, b) = window_terms(p)
        made[18:21] = scale, a, b
    if p.kind is Kind.LINEAR:
        made[5:7] = p.end, 1 / (p.end - p.start)
    elif p.kind is Kind.HEIGHT:
        made[7], made[21] = p.lift, p.density * math.exp(p.lift) * p.falloff
    elif p.kind is Kind.LAYERED:
        column = p.column
        (beyond_above, whole_above), (beyond_below, whole_below) = column.ends(0), column.ends(1)
        made[21:25] = whole_above, beyond_above, whole_below, beyond_below
        made[25] = np.inf if column.above[0, 2] > 0 else 0.0
        if entries:
            reach = made[7] = column.reach
            ends = column.mean(np.array([reach, -reach])) * reach
            made[21], made[23] = ends
    if entries:
        reach = reach_of(p)
        made[6] = (entries - 1) / reach if reach else 0.0
    return made


def _padded(x: Array) -> Array:
    """With 15 more of the last, so that sixteen may be read anywhere."""
    return np.append(x, np.full(15, x[-1]))


def _summed(side: Array) -> Array:
    """Segments of a column with the integral up to where each begins, in place of how wide it is."""
    made = side.copy()
    _, w, s, m = side[:-1].T
    made[:, 1] = np.concatenate([[0.0], np.cumsum(w * (s + m * w / 2))])
    return made


def _planes(segments: Array) -> Array:
    """Segments (count, 4) as four planes of so many, of eight at least, which a device picks from at once."""
    return np.pad(segments, ((0, max(8 - len(segments), 0)), (0, 0))).T


@lru_cache(maxsize=64)
def _constants(
    device: Device, p: Parameters, height: int, width: int, colours: int, entries: int, pointed_at: bool
) -> tuple[tuple[Held | None, ...], int, int]:
    """Numbers, colour, layers or table, x and y, and segments above and below; None for what is not read. Kept, since
    frames ask for the same."""
    sides = [_summed(each) for each in p.column.sides] if p.kind is Kind.LAYERED else [np.zeros((0, 4))] * 2
    layers = table_of(p, entries) if entries else _planes(np.concatenate(sides))
    x, y = rays(p, height, width)
    keep = device.constant
    made = (
        keep(numbers(p, entries), np.float64), keep(np.array(p.light(colours))),
        keep(layers) if entries or p.kind is Kind.LAYERED else None,
        *((None, None) if pointed_at else (keep(_padded(x.ravel()), np.float64), keep(y.ravel(), np.float64))),
    )  # fmt: skip
    return made, len(sides[0]), len(sides[1])


def _axis(up: tuple[float, float, float]) -> int:
    """The axis that heights are counted along, 3 where it is none."""
    along = [axis for axis in range(3) if up[axis]]
    return along[0] if len(along) == 1 else 3


def launched(device: Device, inputs: Inputs, p: Parameters, entries: int = 0) -> Array:
    """The picture through fog; `entries` of a table, or 0 for the formulas."""
    image = inputs["image"]
    height, width = image.height, image.width
    where = inputs["depth"]
    points = pointed(where)
    out, span = aligned_empty(image.pixels.shape), width if device.is_cpu else SPAN
    constants, above, below = _constants(device, p, height, width, image.colours, entries, points)
    defines: dict[str, int | float | str] = {
        "CHANNELS": image.channels, "COVERAGE": int(image.alpha is not Alpha.NONE), "TABLE": int(entries > 0),
        "KIND": list(Kind).index(p.kind), "POSITION": int(points),
        "AXIS": _axis(p.up) if points and p.by_height else 3,
        "DEPTH_KIND": 0 if points else min(list(DepthKind).index(p.depth_kind), 2),
        "PLANAR": int(p.distance is Distance.PLANAR), "KEEP": int(p.background is Background.KEEP),
        "SHINES": int("emissive" in inputs),
    }  # fmt: skip
    with device.session() as session:
        session.launch(
            "fog/fog.cl", "fog", (height * -(-width // span),),
            aligned(image.pixels), aligned(where.pixels if points else where.pixels[..., :1]),
            aligned(inputs["emissive"].pixels) if "emissive" in inputs else None, session.write(out), *constants,
            *(np.int32(each) for each in (above, below, entries, span, width, height)),
            local=(1,), defines=defines,
        )  # fmt: skip
    return out
