"""Deproject: depths become the points that they were seen at.

Truth: the pixel of a ray (x, y, -1) and the planar depth z (see `lichen.operations.scene.view`, also for other kinds of
depth) shows the point z (x, y, -1), in the camera's axes: x right, y up, the camera looking along -z. Where there is
nothing, all three are infinite. It is computed in doubles, in one order, and rounded to float32 once; that rounding is
part of the definition, so effects that read the points inherit no error.

Source: E. Lengyel, Mathematics for 3D game programming and computer graphics, 2011, section 5.5.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    POINTWISE,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import row_blocks
from lichen.operations.scene.view import DepthKind, View, farthest, planar, rays, window_terms

if TYPE_CHECKING:
    from lichen.opencl.device import Device

SEGMENT = 64
FLOAT_MAX = float(np.finfo(np.float32).max)


class Parameters(View):
    """The camera's."""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    return p.depth_flaws()


def _result(p: Parameters, facts: InputFacts) -> Facts:
    depth = facts["depth"]
    most = max(
        farthest(p, depth.extent.low, depth.extent.high, depth.height, depth.width),
        farthest(p, -depth.extent.high, -depth.extent.low, depth.height, depth.width) if p.depth_kind in KEPT else 0.0,
    )
    most = min(most * (1 + 1e-6), FLOAT_MAX)
    endless = depth.extent.nonfinite > 0 or p.depth_kind not in KEPT
    return Facts(depth.height, depth.width, 3, extent=Extent(-most, most, 3 * depth.pixels if endless else 0))


KEPT = (DepthKind.PLANAR, DepthKind.EUCLIDEAN)
"""Kinds of which a finite depth is a finite distance."""


def _row(*depths: float) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"depth": np.array(depths, np.float32).reshape(1, -1, 1)}


def _are(*expected: tuple[float, float, float]) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        same = np.allclose(pixels[0], expected, rtol=1e-6, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {pixels[0].tolist()}"

    return holds


deproject = Operation(
    name="deproject",
    family="scene",
    summary="Turns a camera's depths into the points that they were seen at.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("depth", "how far away each pixel is", (1, 1), picture=False),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=lambda p, facts, error: 0.0 if error == 0 else FLOAT_MAX,
    implied=lambda p, facts: "a pixel's ray depends on where the pixel lies",
    check=_check,
    examples=({}, {"depth_kind": "window", "near": 0.5, "far": 30, "fov": 80}, {"depth_kind": "euclidean"}),
    hard_cases=(
        HardCase(
            name="nothing, no number, and the middle column",
            why="inf times a ray's 0 is NaN",
            inputs=_row(math.inf, math.inf, math.nan),
            parameters={},
            holds=_are((math.inf,) * 3, (math.inf,) * 3, (math.nan,) * 3),
        ),
        HardCase(
            name="a window's depth at its far end, which is infinitely far, and beyond",
            why="near / (1 - d) changes its sign",
            inputs=_row(0.5, 1.0, 1.5),
            parameters={"depth_kind": "window", "near": 1, "fov": 90},
            holds=_are((-4, 0, -2), (math.inf,) * 3, (math.inf,) * 3),
        ),
        HardCase(
            name="a reversed depth so small that no float32 holds the distance",
            why="one that is far but not infinite is 0 in the middle of the picture and infinite beside it",
            inputs=_row(0.25, 1e-45, 0.0),
            parameters={"depth_kind": "reversed", "near": 1, "fov": 90},
            holds=_are((-8, 0, -4), (math.inf,) * 3, (math.inf,) * 3),
        ),
    ),
)


def _points(inputs: Inputs, p: Parameters, rows: slice) -> Array:
    """Some rows, float32."""
    depth = inputs["depth"]
    x, y = rays(p, depth.height, depth.width)
    y = y[rows]
    with np.errstate(all="ignore"):
        z = planar(depth.pixels[rows, :, 0].astype(np.float64), p, x, y)
        there = ~np.isinf(z)
        made = [np.where(there, each, np.abs(z)) for each in (x * z, y * z, -z)]
        return np.stack(made, axis=-1).astype(np.float32)


@deproject.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _points(inputs, p, slice(0, inputs["depth"].height)).astype(np.float64)


@deproject.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: float(facts["depth"].pixels),
    rates={"opencl": Rate(2e-4, 2e-9), "numpy": Rate(2e-4, 3e-8)},
)
class Exact:
    """In doubles, rounded once; on a device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        depth = inputs["depth"]
        out = aligned_empty((depth.height, depth.width, 3))
        x, y = rays(p, depth.height, depth.width)
        scale, (a, b) = window_terms(p) if p.depth_kind not in KEPT else (0.0, (0.0, 0.0))
        with device.session() as session:
            session.launch(
                "scene/deproject.cl", "deproject", (depth.height * -(-depth.width // SEGMENT),),
                aligned(depth.pixels), session.write(out), aligned(np.array([scale, a, b]), np.float64),
                aligned(x.ravel(), np.float64), aligned(y.ravel(), np.float64),
                np.int32(min(list(DepthKind).index(p.depth_kind), 2)), np.int32(depth.width), np.int32(depth.height),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        depth = inputs["depth"]
        out = aligned_empty((depth.height, depth.width, 3))
        for rows in row_blocks(depth.height, depth.width):
            out[rows] = _points(inputs, p, rows)
        return out
