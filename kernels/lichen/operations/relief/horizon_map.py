"""Horizon map: how high the horizon stands around each pixel of a relief, for shadows of any light.

Truth: channel k holds the elevation of the highest slope in direction k of `directions`, the first to the right, then
counterclockwise, over the pixels up to `radius` (horizons.py), and no less than the plane's: 0. A pixel is in the
shadow of a lamp at azimuth k iff the lamp stands lower. `output`: the slope itself, its sine, or degrees.

Methods: `march` looks at every `spacing`-th pixel of a direction; at 1 it is exact to rounding. Peaks that are narrower
than the spacing may be missed, so nothing less than the whole range can be promised beyond it; a slope has none.

Source: N. Max, Horizon mapping: shadows for bump-mapped surfaces, The Visual Computer 4, 1988.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned
from lichen.operation import (
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.relief.horizons import launch, slopes
from lichen.operations.relief.rings import (
    SPACING,
    RingParameters,
    Source,
    all_are,
    column_is,
    footprint,
    looked_at,
    nan_in_reach,
    nothing,
    slope_rounding,
    spoilt,
    step,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)


class Output(StrEnum):
    """What an elevation is given as."""

    SLOPE = "slope"
    SINE = "sine"
    DEGREES = "degrees"


STEEPEST = {Output.SINE: 1.0, Output.DEGREES: 90.0}


class Parameters(RingParameters):
    output: Output = Output.DEGREES
    """the tangent of the elevation, its sine, or the angle in degrees"""


def _most(p: Parameters, facts: InputFacts) -> float:
    if p.output is not Output.SLOPE:
        return STEEPEST[p.output]
    if p.source is Source.DEPTH:
        return 1.01 / p.pixel_size
    return min(2.01 * p.scale * max(facts["height"].extent.magnitude, abs(p.value)), FLOAT_MAX)


def _error(p: Parameters, spacing: float, facts: InputFacts) -> Error:
    steep = {Output.SLOPE: 1.0, Output.SINE: 1.0, Output.DEGREES: 180 / np.pi}[p.output]
    most = _most(p, facts)
    rounding = min(steep * slope_rounding(p, facts), most) + 6 * ROUNDING * most
    rounding = min(rounding, FLOAT_MAX)
    if spacing <= 1:
        return Error(rounding, "bound", rounding)
    return Error(min(most + rounding, FLOAT_MAX), "bound", rounding, 0.02 * (spacing - 1) * most)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    height = facts["height"]
    most = min(_most(p, facts) * 1.001, FLOAT_MAX)
    spoilt_pixels = height.pixels * p.directions if height.extent.nonfinite or most >= FLOAT_MAX else 0
    return Facts(height.height, height.width, p.directions, Space.DATA, Alpha.NONE, Extent(0.0, most, spoilt_pixels))


horizon_map = Operation(
    name="horizon_map",
    family="relief",
    summary="Finds how high the horizon stands around each pixel of a relief, in several directions.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("height", "heights, or depths, in one channel", (1, 1), picture=False),),
    light=Light.STORED,
    footprint=footprint,
    result=_result,
    propagate=lambda p, facts, error: 0.0,
    examples=(
        {},
        {"directions": 4, "radius": 9, "scale": 15, "output": "sine", "border": "wrap"},
        {"source": "depth", "output": "slope", "radius": 5},
    ),
    hard_cases=(
        HardCase(
            "below a cliff",
            "a wall as high as it is far stands at 45 degrees",
            step,
            {"scale": 3, "directions": 4, "radius": 8},
            column_is(5, 45.0),
        ),
        HardCase("a missing height", "a maximum hides NaN", spoilt, {"radius": 2}, nan_in_reach(2)),
        HardCase(
            "holes in depth",
            "inf - inf is NaN; depths of 0 divide",
            nothing,
            {"source": "depth", "radius": 5, "border": "reflect"},
            all_are(0.0),
        ),
    ),
)


def _found(inputs: Inputs, p: Parameters, spacing: float) -> Array:
    image, ring = inputs["height"], p.ring(spacing)
    with np.errstate(all="ignore"):
        made = np.stack([slopes(image, ring, k, 0.0) for k in range(ring.directions)], axis=-1)
        if p.output is Output.SINE:
            return np.asarray(np.where(made == np.inf, made.dtype.type(1), made / np.hypot(made, 1)))
        return made if p.output is Output.SLOPE else np.asarray(np.degrees(np.arctan(made)))


@horizon_map.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _found(inputs, p, 1.0)


@horizon_map.method(
    "march",
    error=_error,
    work=looked_at,
    rates={"opencl": Rate(5e-4, 2e-10), "numpy": Rate(1e-3, 3e-9)},
    knob=SPACING,
)
class March:
    """The largest slope over every `spacing`-th pixel of each direction."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, spacing: float) -> Array:
        kind = float(list(Output).index(p.output))
        return launch(device, "elevations", inputs["height"], p.ring(spacing), None, p.directions, kind)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, spacing: float) -> Array:
        return aligned(_found(inputs, p, spacing))
