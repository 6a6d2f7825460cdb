"""Shadows on a device.

The kernel's doubles, by their places: 0 to 15 the matrix to texels, 16 to 18 the light's eye, 19 to 27 its axes right,
up and back, 28 a texel's width at depth 1, 29 how far it may bend there, 30 and 31 what splits floats and their
spacing, 32 the depth that a slope allows for a texel, 33 to 35 the terms of the map's depth, 36 to 38 the ends and the
step of few bits or the terms of a reversed depth, 39 the depth beyond the edge, 40 a
penumbra's width, 41 the eye's magnitude, 42 the share outside, 43 to 45 the terms of the camera's depth, 46 the
filter's side.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Inputs
from lichen.operations.scene.lists import left_out
from lichen.operations.scene.view import DepthKind, pointed, rays, window_terms
from lichen.operations.shadow.comparing import BEND
from lichen.operations.shadow.parameters import Kind, MapKind, Outside, Parameters
from lichen.operations.shadow.storing import WHOLE, Store, Stored, reversed_terms

if TYPE_CHECKING:
    from lichen.opencl.device import Device
    from lichen.opencl.session import Held

SPAN, SEGMENT = 1024, 128
"""Pixels of a work-item on a CPU, and those of which it asks for all texels before it compares the first."""
STEP = 64
"""Both where work-items step together."""
SAMPLED = 4


@lru_cache(maxsize=64)
def _numbers(device: Device, p: Parameters, height: int, width: int, stored: Stored) -> Held:
    """The kernel's doubles, for a map of this size; kept, since frames of one scene ask for the same."""
    light, made = p.light, np.zeros(47)
    texel = 2 * light.scale / height
    made[:16] = light.to_pixels(height, width).ravel()
    made[16:19], made[19:28], made[28] = p.light_eye, light.axes().ravel(), texel
    made[29], made[32] = BEND * texel, p.slope * texel
    made[33:36] = p.terms
    if stored.floating:
        made[30:32], made[36:39] = (stored.splitter, stored.spacing), reversed_terms(p)
    elif stored.bits and p.light_far is not None:
        near, far, levels = p.light_near, p.light_far, float(2**stored.bits - 1)
        step = (1 / near - 1 / far) / levels if stored.kind is Store.WINDOW else (far - near) / levels
        made[36:39] = near, far, step
    lit = p.outside is Outside.LIT
    made[39] = math.inf if lit else -math.inf
    made[40] = p.source * (height / (2 * light.scale))
    made[41], made[42] = sum(map(abs, p.light_eye)), float(lit)
    if p.depth_kind in (DepthKind.WINDOW, DepthKind.REVERSED):
        scale, (a, b) = window_terms(p)
        made[43:46] = scale, a, b
    made[46] = p.filter
    return device.constant(made, np.float64)


@lru_cache(maxsize=64)
def _rays(device: Device, p: Parameters, height: int, width: int) -> tuple[Held, Held]:
    """x of every column and seven more, y of every row."""
    x, y = rays(p, height, width)
    return device.constant(np.append(x, np.full(7, x[0, -1])), np.float64), device.constant(y, np.float64)


def places(count: int) -> Array:
    """Places in a square around 0, (count, 2): the additive recurrence of the plastic number (M. Roberts, 2018)."""
    plastic = 1.324717957244746
    steps = np.arange(1, count + 1)[:, None] * np.array([1 / plastic, 1 / plastic**2])
    made: Array = np.mod(0.5 + steps, 1.0) - 0.5
    return made


@lru_cache(maxsize=64)
def _places(device: Device, p: Parameters, taps: int) -> Held:
    """What the kernel reads of the filter's places: in texels and float32 where it compares in float32."""
    made = places(taps)
    return device.constant(made * p.filter) if p.map_kind is MapKind.PLANAR else device.constant(made, np.float64)


def launched(device: Device, inputs: Inputs, p: Parameters, stored: Stored = WHOLE, taps: int = 0) -> Array:
    """The share of light, float32 (height, width, 1); with `taps` the mean of so many texels of the filter."""
    where, depths = inputs["depth"], inputs["map"]
    height, width = where.height, where.width
    out = aligned_empty((height, width, 1))
    points = pointed(where)
    x, y = (None, None) if points else _rays(device, p, height, width)
    kind = SAMPLED if taps else 1 + list(Kind).index(p.kind) if p.filter else 0
    defines: dict[str, int | float | str] = {
        "KIND": kind, "POSITION": int(points), "NORMALS": int("normal" in inputs),
        "PARALLEL": int(p.light_extent is not None), "TERMS": int(p.map_kind is not MapKind.PLANAR),
        "BITS": list(Store).index(stored.kind),
    }  # fmt: skip
    span, segment = (SPAN, SEGMENT) if device.is_cpu else (STEP, STEP)
    defines |= {"SPAN": span, "SEGMENT": segment}
    out_of = left_out(inputs, p.effect, 1, height, width)
    receivers = aligned(where.pixels if points else where.pixels[..., :1])
    with device.session() as session:
        session.launch(
            "shadow/shadow.cl", "shadow", (height * -(-width // span),),
            receivers, aligned(inputs["normal"].pixels) if "normal" in inputs else receivers,
            aligned(depths.pixels[..., :1]), session.write(out),
            _numbers(device, p, depths.height, depths.width, stored),
            _places(device, p, taps) if taps else None, x, y,
            np.int32(min(list(DepthKind).index(p.depth_kind), 2)), np.int32(taps or math.ceil(p.filter) + 1),
            np.int32(depths.width), np.int32(depths.height), np.int32(width), np.int32(height),
            None if out_of is None else aligned(out_of, np.uint8),
            local=(1,), defines=defines,
        )  # fmt: skip
    return out
