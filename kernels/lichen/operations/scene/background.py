"""Background: a colour where there is nothing.

Truth: pixels whose depth, or any coordinate of whose position, is infinite become `colour`, wholly covered where there
is coverage; all others stay as they are. A depth that is no number is no answer either: its pixel is NaN.

There is no trade: every pixel is a copy of one or of the other, and exact but for the colour's rounding to float32.

Source: McReynolds and Blythe, Advanced Graphics Programming Using OpenGL, 2005, section 11.5, on clearing by depth.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.layers import colours, same_size

if TYPE_CHECKING:
    from lichen.opencl.device import Device

Amount = Annotated[float, Field(ge=-1e6, le=1e6)]


class Parameters(OperationParameters):
    colour: Amount | Annotated[tuple[Amount, ...], Field(min_length=1, max_length=64)] = 0.0
    """the light where there is nothing; one number, or one for each colour channel"""

    def light(self, count: int) -> tuple[float, ...]:
        return self.colour if isinstance(self.colour, tuple) else (self.colour,) * count


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws, count = same_size(facts, "image", "depth"), colours(facts["image"])
    if isinstance(p.colour, tuple) and len(p.colour) != count:
        flaws.append(Flaw("/parameters/colour", f"has {len(p.colour)} numbers for {count} colour channel(s)"))
    return flaws


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    error = ROUNDING * max(abs(each) for each in p.light(1))
    return Error(error, "bound", error)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    error, light = _error(p, 0.0, facts).value, p.light(1)
    low, high = min(image.extent.low, min(light) - error), max(image.extent.high, max(light) + error)
    if image.alpha is not Alpha.NONE:
        high = max(high, 1.0)
    spoilt = any(each.extent.nonfinite for each in facts.values())
    return dataclasses.replace(image, extent=Extent(low, high, image.samples if spoilt else 0))


def _sky() -> Mapping[str, Any]:
    depth = np.array([[[1, 2, -3], [np.inf, 0, 0], [0, 0, -np.inf], [np.nan, np.inf, 0]]], np.float32)
    return {"image": np.full((1, 4, 1), np.nan, np.float32) * [[[0], [1], [1], [1]]], "depth": depth}


def _holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = [np.nan, 0.25, 0.25, np.nan]
    got = pixels.reshape(-1)
    return None if np.array_equal(got, expected, equal_nan=True) else f"expected {expected}, got {got.tolist()}"


background = Operation(
    name="background",
    family="scene",
    summary="Puts a colour where there is nothing: where depth is infinite.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture"),
        Input("depth", "how far away each pixel is, or, of three channels, where", (1, 3), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: None if facts["depth"].extent.nonfinite else "there is something everywhere",
    result=_result,
    check=_check,
    examples=({"colour": 0.5}, {"colour": [0.2, 0.4, 0.9]}),
    hard_cases=(
        HardCase(
            name="infinite in one coordinate, and no number",
            why="what is no number is not infinite, and 0 times what stood there is NaN",
            inputs=_sky,
            parameters={"colour": 0.25},
            holds=_holds,
        ),
    ),
)


def _shown(inputs: Inputs, p: Parameters) -> Array:
    """The definition, in the precision of the picture."""
    image = inputs["image"]
    depth = inputs["depth"].pixels
    depth = depth if depth.shape[2] == 3 else depth[..., :1]
    made = image.pixels.copy()
    made[np.isinf(depth).any(axis=2)] = [*p.light(image.colours), *[1.0] * (image.alpha is not Alpha.NONE)]
    made[np.isnan(depth).any(axis=2)] = np.nan
    return made


@background.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _shown(inputs, p)


@background.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: float(facts["image"].samples),
    rates={"opencl": Rate(2e-4, 6e-10), "numpy": Rate(1e-4, 4e-9)},
)
class Exact:
    """A choice for each pixel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, depth = inputs["image"], inputs["depth"]
        out = aligned_empty(image.pixels.shape)
        light = np.array([*p.light(image.colours), *[1.0] * (image.alpha is not Alpha.NONE)], np.float32)
        pixels = image.height * image.width
        with device.session() as session:
            session.launch(
                "scene/background.cl", "background", (-(-pixels // 64),),
                aligned(image.pixels), aligned(depth.pixels), session.write(out), aligned(light),
                np.int32(depth.channels), np.uint64(pixels),
                defines={"CHANNELS": image.channels},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_shown(inputs, p))
