"""Stereo view: what an eye beside the camera sees, from the camera's picture and its depths.

Truth. A pixel moves to the right by half its disparity (`disparity`) for the left eye, and to the left for the right
one, by no more than `largest`. Neighbours q and q + 1 of a row, which come to lie at a and b, cover what lies between
them, a <= x < b, with colours and disparities linear between theirs; where they move apart by more than `tear`, they
are not of one surface, and each covers half a pixel on its own side. A pixel shows the nearest of all pairs that cover
it. The first and the last pixel of a row go on beyond its ends. What nothing covers was hidden from the camera: it
shows the farther of what lies to its left and to its right. Where a depth has no disparity, a pixel covers nothing.

Methods: `search` tries all pairs that may cover a pixel. `iterated` follows every pixel back, x <- column - shift(x),
as many steps as the knob says: right where surfaces are smooth, undecided where one hides another.

The findings count what was hidden.

Sources: L. McMillan and G. Bishop, Plenoptic modeling, SIGGRAPH 1995; McReynolds et al., Programming with OpenGL:
advanced rendering, SIGGRAPH course 1997, section 4.1.
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    Error,
    Facts,
    Footprint,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    Pixels,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX, same_size
from lichen.operations.lens.disparity import Parameters as Eyes
from lichen.operations.lens.disparity import apart
from lichen.operations.lens.eyes import GONE, filled, iterated, searched

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lichen.opencl.device import Device


class Eye(StrEnum):
    """Which one."""

    LEFT = "left"
    RIGHT = "right"


class Parameters(Eyes):
    eye: Eye = Field(Eye.LEFT, description="the left or the right one")
    largest: Pixels = Field(32.0, ge=0, le=512, description="no pixel moves farther")
    tear: Pixels = Field(1.0, ge=0, le=512, description="neighbours that move apart by more are of two surfaces")

    @property
    def reach(self) -> int:
        """How far away a pair may come from."""
        return math.ceil(self.largest) + 1


def _moves(inputs: Inputs, p: Parameters) -> tuple[Array, Array]:
    """Shifts to the right and disparities of all pixels, float64."""
    found = apart(inputs["depth"].pixels[..., 0], p, inputs["depth"].height, 2 * p.largest)
    return found * (0.5 if p.eye is Eye.LEFT else -0.5), found


def _search_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Places are doubles; a weight, its complement, two products and their sum are rounded."""
    value = min(4 * ROUNDING * facts["image"].extent.magnitude, FLOAT_MAX)
    return Error(value, "bound", value)


def _iterated_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Both show means of the picture's values."""
    extent = facts["image"].extent
    rounding = 4 * ROUNDING * extent.magnitude
    value = min(extent.spread + rounding, FLOAT_MAX)
    return Error(value, "bound", rounding, min(0.1 * extent.spread + rounding, value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    slack = 4 * ROUNDING * image.extent.magnitude
    depth = facts.get("depth", image).extent
    bad = image.extent.nonfinite or depth.nonfinite or depth.low < 0
    low, high = max(image.extent.low - slack, -FLOAT_MAX), min(image.extent.high + slack, FLOAT_MAX)
    return dataclasses.replace(image, extent=Extent(low, high, image.samples if bad else 0))


def _unfit(p: Parameters, facts: InputFacts) -> str | None:
    depth = facts["depth"].extent
    return "a depth without a disparity leads nowhere" if depth.nonfinite or depth.low < 0 else None


def _step() -> Mapping[str, Any]:
    """A near thing of 1 before a ground of 0: at depth 1 it moves by 4 px, at 2 by 2 px."""
    near = (np.arange(32) >= 10) & (np.arange(32) < 20)
    depth = np.where(near, 1.0, 2.0).astype(np.float32)
    return {
        "image": np.repeat(near.astype(np.float32).reshape(1, -1, 1), 8, axis=0),
        "depth": np.repeat(depth.reshape(1, -1, 1), 8, axis=0),
    }


def _moved(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = ((np.arange(32) >= 14) & (np.arange(32) < 24)).astype(np.float32)
    good = (pixels[..., 0] == expected).all()
    return None if good else f"expected the near thing from 14 to 23, got {pixels[0, :, 0].tolist()}"


stereo_view = Operation(
    name="stereo_view",
    family="lens",
    summary="Shows what an eye beside the camera sees, from a picture and its depths.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the camera's picture"),
        Input("depth", "distances along the view", (1, 1), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: Footprint(0, None),
    result=_result,
    implied=lambda p, facts: "a focal length in pixels is a share of the whole height",
    check=lambda p, facts: same_size(facts, "image", "depth"),
    examples=(
        {"baseline": 0.05, "convergence": 0.5, "largest": 8},
        {"baseline": 0.2, "eye": "right", "largest": 5, "tear": 0.5},
    ),
    hard_cases=(
        HardCase(
            name="what is near hides, and what it hid is filled from behind",
            why="a look back finds two surfaces, and beside them none",
            inputs=_step,
            parameters={"baseline": 2.0, "fov": 90},
            holds=_moved,
            methods=("search",),
        ),
        HardCase(
            name="depths of 0, infinity and none",
            why="1 / 0 px, and a NaN that moves its neighbours",
            inputs=lambda: {
                "image": np.full((1, 6, 1), 0.7, np.float32),
                "depth": np.array([0, np.inf, np.nan, -1, 3, np.inf], np.float32).reshape(1, -1, 1),
            },
            parameters={"largest": 2},
            holds=lambda inputs, pixels: None if (pixels == np.float32(0.7)).all() else f"got {pixels.reshape(-1)}",
            methods=("search",),
        ),
        HardCase(
            name="one pixel",
            why="neighbours that are none",
            inputs=lambda: {"image": np.full((1, 1, 1), 0.7, np.float32), "depth": np.ones((1, 1, 1), np.float32)},
            parameters={"baseline": 1e6},
            holds=lambda inputs, pixels: None if (pixels == np.float32(0.7)).all() else f"got {pixels.reshape(-1)}",
        ),
    ),
)


def _found(pixels: Array, shift: Array, near: Array, p: Parameters) -> Array:
    made, seen = searched(pixels, shift, near, p.reach, p.tear)
    return filled(pixels, near, made, seen)


@stereo_view.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    shift, near = _moves(inputs, p)
    return _found(inputs["image"].pixels, shift, near, p)


@stereo_view.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """How many pixels show what was hidden from the camera."""
    shift, near = _moves(inputs, p)
    _, seen = searched(inputs["image"].pixels[..., :1], shift, near, p.reach, p.tear)
    return {"hidden": int(np.count_nonzero(seen == GONE))}


def _work(p: Parameters, facts: InputFacts, each: float) -> float:
    image = facts["image"]
    return image.pixels * (each + image.channels)


@stereo_view.method(
    "search",
    error=_search_error,
    work=lambda p, knob, facts: _work(p, facts, 2.0 * p.reach + 8),
    rates={"opencl": Rate(5e-4, 1.5e-9), "numpy": Rate(1e-3, 3e-8)},
)
class Search:
    """All pairs of neighbours that may cover a pixel, the nearest shown."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Search.numpy(inputs, p, knob)
        image, (shift, near) = inputs["image"], _moves(inputs, p)
        out, seen = aligned_empty(image.pixels.shape), aligned_empty(shift.shape, np.float64)
        defines: dict[str, int | float | str] = {"CHANNELS": image.channels}
        nearness = aligned(near, np.float64)
        with device.session() as session:
            session.launch(
                "lens/stereo_view.cl", "search", (image.width, image.height),
                aligned(image.pixels), aligned(shift, np.float64), nearness, session.readwrite(out),
                session.readwrite(seen), np.float64(p.tear), np.int32(image.width), np.int32(image.height),
                np.int32(p.reach),
                defines=defines,
            )  # fmt: skip
            session.launch(
                "lens/stereo_view.cl", "fill", (image.height,),
                aligned(image.pixels), nearness, session.readwrite(out), session.readwrite(seen),
                np.int32(image.width), np.int32(image.height),
                defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        shift, near = _moves(inputs, p)
        return aligned(_found(inputs["image"].pixels, shift, near, p))


@stereo_view.method(
    "iterated",
    knob=Knob("steps", (1, 2, 4, 8), "looks back from each pixel", 1, 32),
    error=_iterated_error,
    work=lambda p, knob, facts: _work(p, facts, 2.0 * knob + 6),
    rates={"opencl": Rate(5e-4, 1.5e-9), "numpy": Rate(1e-3, 2e-8)},
    unfit=_unfit,
)
class Iterated:
    """Every pixel followed back to where it comes from."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Iterated.numpy(inputs, p, knob)
        image, (shift, _) = inputs["image"], _moves(inputs, p)
        out = aligned_empty(image.pixels.shape)
        with device.session() as session:
            session.launch(
                "lens/stereo_view.cl", "iterated", (image.width, image.height),
                aligned(image.pixels), aligned(shift, np.float64), session.write(out), np.int32(image.width),
                np.int32(image.height), np.int32(round(knob)),
                defines={"CHANNELS": image.channels},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(iterated(inputs["image"].pixels, _moves(inputs, p)[0], round(knob)))
