"""Emboss: a relief lit from one side, by a single difference.

Truth: with the point `distance` px away from p towards the lamp, which stands at the azimuth `angle` (0 to the right,
90 above),

    result = bias + strength (h(p) - h(p + towards the lamp))

h linear between pixels. Slopes that face the lamp are bright, those that turn away dark, and planes `bias`. To first
order in the slope this is the diffuse shading of the relief, without the work of finding normals or their lengths;
steep slopes leave [0, 1], and are kept as they are. Every colour is taken as heights of its own, coverage is kept.

It is a stencil of five taps at most, so the only method does all of it to rounding: there is no trade.

Sources: J. Schlag, Fast embossing effects on raster image data, Graphics Gems IV, 1994; T. McReynolds et al., Advanced
graphics programming techniques using OpenGL, SIGGRAPH course 1998, section 8.3.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array
from lichen.operation import (
    Border,
    Degrees,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Pixels,
    Rate,
)
from lichen.operations.convolution.stencil import (
    Stencil,
    correlate_numpy,
    correlate_opencl,
    kept_coverage,
    reach_of_values,
    sum_of_taps,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    angle: Degrees = Field(135.0, ge=-360, le=360)
    """where the lamp stands: 0 to the right, 90 above"""
    distance: Pixels = Field(1.0, ge=0, le=32)
    """how far off the difference is taken; much more than a detail's size shows it twice"""
    strength: float = Field(1.0, ge=-1e4, le=1e4)
    """factor on the difference; negative presses the relief in"""
    bias: float = Field(0.5, ge=-1e4, le=1e4)
    """the value of planes"""
    border: Border = Border.CLAMP
    """how heights continue beyond the edges"""
    value: float = Field(0.0, ge=-1e6, le=1e6)
    """height beyond a constant border"""


def _exactly(value: float) -> float:
    """A whole number that trigonometry has missed by rounding."""
    return float(round(value)) if abs(value - round(value)) < 1e-12 else value


def stencil(p: Parameters) -> Stencil:
    """The pixel itself, and less of the four around the other point."""
    right = _exactly(p.distance * math.cos(math.radians(p.angle)))
    down = _exactly(-p.distance * math.sin(math.radians(p.angle)))
    left, top = math.floor(right), math.floor(down)
    reach = max(abs(left), abs(left + 1), abs(top), abs(top + 1))
    taps = np.zeros((2 * reach + 1, 2 * reach + 1))
    for i, across in ((0, 1 - (right - left)), (1, right - left)):
        for j, below in ((0, 1 - (down - top)), (1, down - top)):
            taps[reach + top + j, reach + left + i] -= p.strength * across * below
    taps[reach, reach] += p.strength
    return Stencil(taps, reach, reach, p.bias)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    rounding = stencil(p).rounding(max(abs(low), abs(high)))
    return Error(rounding, "bound", rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    slack = _error(p, 0.0, facts).value
    low, high = stencil(p).range(*reach_of_values(image, p.border, p.value))
    if image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    extent = Extent(low - slack, high + slack, image.extent.nonfinite)
    return dataclasses.replace(image, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    return max(stencil(p).weight, 0.0 if facts["image"].alpha is Alpha.NONE else 1.0) * error


def _pyramid() -> Mapping[str, Any]:
    y, x = np.mgrid[0:9, 0:9]
    return {"image": (4 - np.maximum(abs(x - 4), abs(y - 4)))[..., None].astype(np.float32) / 8}


def _lit_from_above(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    sides = [float(pixels[at][0]) for at in ((2, 4), (6, 4), (4, 2), (4, 6), (0, 0))]
    return None if np.allclose(sides, [0.625, 0.375, 0.5, 0.5, 0.5]) else f"{sides}"


emboss = Operation(
    name="emboss",
    family="relief",
    summary="Shades a picture as a relief that is lit from one side, by a single difference.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "heights; every colour is a relief of its own"),),
    light=Light.STORED,
    footprint=lambda p, facts: stencil(p).footprint(p.border),
    result=_result,
    propagate=_propagate,
    examples=(
        {},
        {"angle": 30, "distance": 2.5, "strength": 3, "border": "wrap"},
        {"angle": -90, "strength": -2, "bias": 0, "border": "constant", "value": 0.5},
    ),
    hard_cases=(
        HardCase(
            "a pyramid lit from above",
            "light from above comes out as from below where y runs down",
            _pyramid,
            {"angle": 90},
            _lit_from_above,
        ),
        HardCase(
            "no distance at all",
            "the two points are one",
            lambda: {"image": np.array([[0.1, np.inf, 3], [0, 1, 2]], np.float32)[..., None]},
            {"distance": 0, "bias": 0.25},
            lambda inputs, pixels: None if np.all(pixels[1] == 0.25) else f"{pixels.tolist()}",
        ),
    ),
)


@emboss.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    with np.errstate(invalid="ignore"):
        return kept_coverage(image, sum_of_taps(image.pixels, stencil(p), p.border, p.value))


@emboss.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (stencil(p).count + 25.0),
    rates={"opencl": Rate(5e-4, 2e-11), "numpy": Rate(2e-4, 1.2e-10)},
)
class Direct:
    """One multiply-add for each of the five taps."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        return kept_coverage(image, correlate_opencl(device, image, stencil(p), p.border, p.value))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        return kept_coverage(image, correlate_numpy(image, stencil(p), p.border, p.value))
