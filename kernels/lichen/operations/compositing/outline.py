"""Outline: the silhouette of what a mask or a depth shows, or a halo around it.

Truth: h is the first channel, or its negative where smaller values are in front (`front`: a mask has larger, most
depths smaller). With D the pixels whose centres lie within `width` of a pixel's own, those beyond the edge counting as
the nearest there are, a pixel is 1, else 0,

    side = inside     where h - min over D of h > jump: what is in front, at its rim (the silhouette)
    side = outside    where max over D of h - h > jump: what is behind, beside it (the halo)
    side = both       where either holds

A mask's jump is anything below 1. A depth's is how far behind something must lie to be something else; a surface seen
at a grazing angle is not, if its depth changes by less over `width` pixels. The edge of the image draws no line, single
pixels and holes keep theirs, and diagonals are as thick as other edges, which counting displaced copies gives none of.
NaN takes part in no comparison, and stays. Differences are taken in doubles, so rounding decides nothing.

Sources: McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, sections 15.2 and 15.3;
T. Saito and T. Takahashi, Comprehensible rendering of 3-D shapes, SIGGRAPH 1990.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
    halo,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Front(StrEnum):
    """Which values are in front."""

    LARGER = "larger"
    SMALLER = "smaller"


class Side(StrEnum):
    """Which side of an edge is drawn."""

    INSIDE = "inside"
    OUTSIDE = "outside"
    BOTH = "both"


class Parameters(OperationParameters):
    width: float = Field(1.0, ge=1, le=32, json_schema_extra={"unit": "px"})
    """how far from an edge pixels are drawn"""
    jump: float = Field(0.5, ge=0, le=1e30)
    """differences above it are edges"""
    front: Front = Front.LARGER
    """larger values are in front, as in a mask, or smaller ones, as in most depths"""
    side: Side = Side.INSIDE
    """inside: the silhouette; outside: a halo; or both"""

    @property
    def rows(self) -> list[int]:
        """How far each row of the disc reaches, from -reach to reach."""
        reach = math.floor(self.width)
        return [math.isqrt(math.floor(self.width**2 - dy * dy)) for dy in range(-reach, reach + 1)]

    @property
    def halves(self) -> Array:
        """The same as an array, int32."""
        return aligned(np.array(self.rows), np.int32)

    @property
    def sign(self) -> int:
        return 1 if self.front is Front.LARGER else -1


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    extent = Extent(0.0, 1.0, image.pixels if image.extent.nonfinite else 0)
    return Facts(image.height, image.width, 1, Space.DATA, Alpha.NONE, extent)


def _shapes() -> Mapping[str, Any]:
    mask = np.zeros((7, 9, 1), np.float32)
    mask[0:3, 0:3] = 1
    mask[5, 6] = 1
    return {"image": mask}


def _rims(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = np.zeros((7, 9))
    expected[2, :3] = expected[:3, 2] = expected[5, 6] = 1
    return None if np.array_equal(pixels[..., 0], expected) else f"got {pixels[..., 0].tolist()}"


outline = Operation(
    name="outline",
    family="compositing",
    summary="Draws silhouettes and halos from a mask or a depth.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a mask or a depth: its first channel, as it is stored"),),
    light=Light.STORED,
    footprint=lambda p, facts: halo(math.floor(p.width)),
    result=_result,
    propagate=lambda p, facts, error: 1.0 if error else 0.0,
    examples=(
        {},
        {"width": 3.5, "side": "outside", "jump": 0.3},
        {"width": 2, "front": "smaller", "jump": 0.1, "side": "both"},
    ),
    hard_cases=(
        HardCase(
            name="a shape at the edge of the image, and a single pixel",
            why="counting displaced copies draws along the frame and loses single pixels",
            inputs=_shapes,
            parameters={},
            holds=_rims,
        ),
    ),
)


def _drawn(inputs: Inputs, p: Parameters) -> Array:
    """The definition: one displaced copy after the other."""
    h = inputs["image"].pixels[..., 0].astype(np.float64) * p.sign
    rows, columns = h.shape
    low, high = np.full(h.shape, np.inf), np.full(h.shape, -np.inf)
    reach = len(p.rows) // 2
    wider = np.pad(h, reach, mode="edge")
    for dy, half in enumerate(p.rows):
        for dx in range(reach - half, reach + half + 1):
            moved = wider[dy : dy + rows, dx : dx + columns]
            np.fmin(low, moved, out=low)
            np.fmax(high, moved, out=high)
    with np.errstate(invalid="ignore"):
        front, behind = h - low > p.jump, high - h > p.jump
    drawn = {Side.INSIDE: front, Side.OUTSIDE: behind}.get(p.side, front | behind)
    return np.where(np.isnan(h), np.nan, drawn.astype(np.float64))[..., np.newaxis]


@outline.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _drawn(inputs, p)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Pixels of the disc that are compared; what is done once for each pixel takes as long as six of them."""
    return facts["image"].pixels * (6.0 + sum(2 * half + 1 for half in p.rows))


@outline.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=_work,
    rates={"opencl": Rate(3e-4, 1e-9), "numpy": Rate(2e-4, 1e-8)},
)
class Exact:
    """Every pixel of the disc compared; on a device without double precision, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        image = inputs["image"]
        out = aligned_empty((image.height, image.width, 1))
        with device.session() as session:
            session.launch(
                "compositing/outline.cl", "outline", (-(-image.width // 64), image.height),
                aligned(image.pixels), session.write(out), p.halves, np.int32(len(p.halves) // 2),
                np.int32(image.width), np.int32(image.height), np.int32(image.channels), np.float64(p.jump),
                local=(1, 16), defines={"SIDE": list(Side).index(p.side), "SIGN": p.sign},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_drawn(inputs, p).astype(np.float32))
