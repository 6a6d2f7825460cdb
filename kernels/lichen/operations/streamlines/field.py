"""Vector fields to begin with: flows that are known in closed form, sampled at pixel centres.

Truth: (x, y) is the pixel's centre seen from the point `centre`, in units of half the shorter side, x to the right and
y down. The vector is `strength` times

    uniform     (1, 0)
    circular    (-y, x): clockwise as seen; anticlockwise for a negative strength
    saddle      (x, -y)
    source      (x, y); a sink for a negative strength
    gyre        (-pi A sin(pi f) cos(pi v), pi A cos(pi f) sin(pi v) f'), A = 0.1, f = a u^2 + (1 - 2 a) u,
                a = 0.25 sin(2 pi time / 10), where u in [0, 2] and v in [0, 1] are the place in the image
    cylinder    (1 - R^2 (x^2 - y^2) / r^4, -2 R^2 x y / r^4) + G / (2 pi r^2) (-y, x): the flow without friction past
                a cylinder of `radius` R with the `circulation` G; zero inside it

turned by `angle`, but for circular and gyre: the picture of the flow is turned, not just its vectors. Vectors are
computed in double precision, so that a pixel lies inside the cylinder alike everywhere, and rounded once. There is no
trade of accuracy here.

Sources: L. M. Milne-Thomson, Theoretical Hydrodynamics, 1968, 6.22 and 7.12 (cylinder); S. C. Shadden, F. Lekien and
J. E. Marsden, Physica D 212, 2005, section 6 (gyre).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Degrees,
    Error,
    Facts,
    HardCase,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)

SOURCE = "streamlines/field.cl"
AMPLITUDE, WOBBLE, PERIOD = 0.1, 0.25, 10.0
"""Of the double gyre, as published."""


class Flow(StrEnum):
    """Which flow."""

    UNIFORM = "uniform"
    CIRCULAR = "circular"
    SADDLE = "saddle"
    SOURCE = "source"
    GYRE = "gyre"
    CYLINDER = "cylinder"


class Parameters(OperationParameters):
    width: int = Field(512, ge=1, le=16384, json_schema_extra={"unit": "px"}, description="of the field")
    height: int = Field(512, ge=1, le=16384, json_schema_extra={"unit": "px"}, description="of the field")
    kind: Flow = Field(Flow.CYLINDER, description="which flow")
    strength: float = Field(1.0, ge=-1e6, le=1e6, description="factor on all vectors; negative turns them round")
    angle: Degrees = Field(0.0, ge=-360, le=360, description="turns the flow, from x towards y")
    centre: tuple[float, float] = Field(
        (0.0, 0.0), description="(x, y) of the flow's centre, in half shorter sides from the middle of the image"
    )
    radius: float = Field(0.3, ge=1e-3, le=10, description="of the cylinder, in half shorter sides")
    circulation: float = Field(0.0, ge=-100, le=100, description="around the cylinder; 4 pi radius stops all before it")
    time: float = Field(0.0, ge=-1e6, le=1e6, description="of the gyre, whose middle sways once in 10 units")

    @property
    def sway(self) -> float:
        """a of the gyre."""
        return WOBBLE * math.sin(2 * math.pi * math.fmod(self.time, PERIOD) / PERIOD)


def centred(p: Parameters) -> tuple[Array, Array]:
    """x (1, width) and y (height, 1) of the pixel centres, in half shorter sides from the flow's centre."""
    short = min(p.width, p.height)
    x = (2 * np.arange(p.width) + 1 - p.width) / short - p.centre[0]
    y = (2 * np.arange(p.height) + 1 - p.height) / short - p.centre[1]
    return x[np.newaxis, :], y[:, np.newaxis]


def sampled(p: Parameters) -> Array:
    """The definition, float64 (height, width, 2)."""
    x, y = centred(p)
    c, s = math.cos(math.radians(p.angle)), math.sin(math.radians(p.angle))
    a, b = c * x + s * y, c * y - s * x
    match p.kind:
        case Flow.UNIFORM:
            u, v = np.ones_like(a), np.zeros_like(a)
        case Flow.CIRCULAR:
            u, v = np.broadcast_arrays(-y, x)
        case Flow.SADDLE:
            u, v = a, -b
        case Flow.SOURCE:
            u, v = a, b
        case Flow.GYRE:
            u, v = _gyre(p)
        case Flow.CYLINDER:
            u, v = _cylinder(a, b, p)
    if p.kind not in (Flow.CIRCULAR, Flow.GYRE):
        u, v = c * u - s * v, s * u + c * v
    return p.strength * np.stack(np.broadcast_arrays(u, v), axis=-1)


def _gyre(p: Parameters) -> tuple[Array, Array]:
    u = ((2 * np.arange(p.width) + 1) / p.width)[np.newaxis, :]
    v = ((2 * np.arange(p.height) + 1) / (2 * p.height))[:, np.newaxis]
    f, slope = p.sway * u * u + (1 - 2 * p.sway) * u, 2 * p.sway * u + (1 - 2 * p.sway)
    size = math.pi * AMPLITUDE
    return -size * np.sin(np.pi * f) * np.cos(np.pi * v), size * np.cos(np.pi * f) * np.sin(np.pi * v) * slope


def _cylinder(x: Array, y: Array, p: Parameters) -> tuple[Array, Array]:
    square, size = x * x + y * y, p.radius * p.radius
    outside = square >= size
    far = np.where(outside, square, 1.0)
    doublet, swirl = size / (far * far), p.circulation / (2 * math.pi) / far
    u = 1 - doublet * (x * x - y * y) - swirl * y
    v = swirl * x - 2 * doublet * x * y
    return np.where(outside, u, 0.0), np.where(outside, v, 0.0)


# ------------------------------------------------------------------------------------------------------ predictions


def _longest(p: Parameters) -> float:
    """No vector is longer."""
    match p.kind:
        case Flow.UNIFORM:
            longest = 1.0
        case Flow.GYRE:
            longest = math.pi * AMPLITUDE * math.hypot(1.0, 1 + 2 * abs(p.sway))
        case Flow.CYLINDER:
            longest = 2 + abs(p.circulation) / (2 * math.pi * p.radius)
        case _:
            short = min(p.width, p.height)
            longest = math.hypot(p.width / short + abs(p.centre[0]), p.height / short + abs(p.centre[1]))
    return abs(p.strength) * longest


def _result(p: Parameters, facts: InputFacts) -> Facts:
    longest = _longest(p) * (1 + 1e-6)
    return Facts(p.height, p.width, 2, extent=Extent(-longest, longest, 0))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """One rounding, and those of double precision."""
    rounding = ROUNDING * _longest(p) * (1 + 1e-6)
    return Error(rounding, "bound", rounding)


def _centre_rests(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    middle = pixels[pixels.shape[0] // 2, pixels.shape[1] // 2]
    return None if (middle == 0).all() else f"the centre moves by {middle}"


def _nothing_enters(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Around the cylinder of radius 1 in 2 x 2 the flow is along it; inside there is none."""
    size = len(pixels)
    y, x = ((np.mgrid[:size, :size] * 2 + 1 - size) / size).astype(np.float64)
    r = np.hypot(x, y)
    if (pixels[r < 0.5] != 0).any():
        return "there is a flow inside"
    near = (r >= 0.5) & (r < 0.52)
    through = np.abs(pixels[..., 0] * x + pixels[..., 1] * y)[near] / r[near]
    return None if through.max() < 0.1 else f"the wall lets {through.max():.3g} through"


def _finite(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.isfinite(pixels).all() else "not finite"


field = Operation(
    name="field",
    family="streamlines",
    summary="Makes a vector field: uniform, circular, saddle, source, double gyre, or flow past a cylinder.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    implied=lambda p, facts: "the field is sampled over the whole image",
    examples=(
        {"width": 48, "height": 33},
        {"width": 47, "height": 33, "kind": "saddle", "angle": 30, "centre": [0.2, -0.1]},
        {"width": 48, "height": 24, "kind": "gyre", "time": 2.5},
    ),
    hard_cases=(
        HardCase(
            "vortex on a pixel",
            "its centre has no direction",
            dict,
            {"kind": "circular", "width": 25, "height": 9},
            _centre_rests,
        ),
        HardCase(
            "source on a pixel",
            "a centre that rounds away from 0 has one",
            dict,
            {"kind": "source", "width": 9, "height": 9},
            _centre_rests,
        ),
        HardCase(
            "wall of the cylinder",
            "no flow crosses it",
            dict,
            {"kind": "cylinder", "width": 301, "height": 301, "radius": 0.5},
            _nothing_enters,
        ),
        HardCase(
            "centre of the cylinder", "1 / r^4 at r = 0", dict, {"width": 9, "height": 9, "radius": 0.001}, _finite
        ),
        HardCase("one pixel", "sides of one", dict, {"width": 1, "height": 1, "kind": "gyre"}, _finite),
    ),
)


@field.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return sampled(p)


@field.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: float(p.width * p.height),
    rates={"opencl": Rate(2e-4, 4e-9), "numpy": Rate(1e-4, 4e-8)},
)
class Direct:
    """The formulas in double precision, rounded to float32 once."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        p = parameters
        result = aligned_empty((p.height, p.width, 2))
        x, y = (aligned(each.reshape(-1), np.float64) for each in centred(p))
        turn = math.radians(p.angle)
        with device.session() as session:
            session.launch(
                SOURCE,
                "sample_field",
                (p.width, p.height),
                session.write(result),
                x,
                y,
                np.int32(p.width),
                np.int32(p.height),
                *(np.float64(each) for each in (math.cos(turn), math.sin(turn), p.strength)),
                *(np.float64(each) for each in (p.radius * p.radius, p.circulation / (2 * math.pi), p.sway)),
                defines={"FLOW": list(Flow).index(p.kind)},
            )
        return result

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return aligned(sampled(parameters), np.float32)
