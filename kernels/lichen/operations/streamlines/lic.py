"""Line integral convolution: a texture smeared along the lines of a vector field.

Truth: sigma is the streamline through a pixel's centre, sigma' = v / |v| (`speed=arc`, s in pixels) or sigma' = v
(`speed=field`, s in units of time in which the vector (1, 0) moves one pixel). The result is

    integral of k(s) T(sigma(s)) ds / integral of k(s) ds      over those s in [-length, length] where the line exists.

Vectors are v = (c - bias) * scale, x to the right and y down, interpolated bilinearly component by component and
normalised afterwards; T is interpolated bilinearly and covers the rectangle of the field, whatever its own size. A line
ends at the border, where v is zero or not finite, and at critical points, which show themselves by a field that
opposes the step just made; truth looks for them every 1/16 px. A pixel without a line keeps its own texture value.
Sums are of differences from that value, so a constant texture comes back bit for bit.

Methods divide `length` into equal steps no longer than the knob `step` and weigh their samples by the trapezoid rule:

* `nearest`: Euler's steps through the vectors of whole pixels, reading whole texels. The floor of both cost and care.
* `euler`, `rk2` (midpoint), `rk4`: Runge-Kutta of order 1, 2 and 4 in the interpolated field; steps that meet the
  border or a critical point are cut there.

Errors. A line beside a saddle goes one way or the other, whatever the step, and noise tells two texels apart
completely. Every method and the truth are weighted means of texture values, so the spread of the texture bounds the
largest error over an image; no smaller figure can be promised, since rough fields over textures with edges come within
5 % of it at any step. What a dearer method buys is the error of all but those lines. `TYPICAL` holds it as found on the
roughest field of the benchmark (RMS over the spread); in smooth flows it is 10 to 100 times smaller and falls with the
square of the step, for `euler` with the step. The midpoint rule is not worse than `rk4` there: the interpolated field
has a kink at every pixel, and its shorter stencil meets fewer of them.

Sources: Cabral and Leedom, Imaging vector fields using line integral convolution, SIGGRAPH 1993; Stalling and Hege,
Fast and resolution independent line integral convolution, SIGGRAPH 1995; Heidrich, Westermann, Seidel and Ertl,
Applications of pixel textures in visualization and realistic image synthesis, I3D 1999, section 3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import partial

import numpy as np
import numpy.typing as npt
from pydantic import Field

from lichen.errors import Flaw
from lichen.hashing import pcg3d, unit
from lichen.image import Alpha, Extent, Image
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import (
    EXACT,
    ROUNDING,
    WHOLE,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
    halo,
)
from lichen.operations.streamlines.hard import HARD_CASES
from lichen.operations.streamlines.launch import Task
from lichen.operations.streamlines.lines import Lines, euler, runge_kutta_2, runge_kutta_4

FARTHEST = 1e9
"""px; farther than any line goes inside an image."""


class Kernel(StrEnum):
    """The weight k(s) along the line."""

    BOX = "box"
    """1"""
    HANN = "hann"
    """(1 + cos(pi s / length)) / 2"""
    COSINE = "cosine"
    """cos(pi s / (2 length))"""


class Speed(StrEnum):
    """What the line is parametrised by."""

    ARC = "arc"
    """its length: the field gives directions alone"""
    FIELD = "field"
    """time: where the field is strong, the texture is smeared far"""


class Parameters(OperationParameters):
    length: float = Field(
        20.0, ge=0, le=1000, description="how far to follow the line each way", json_schema_extra={"unit": "px"}
    )
    kernel: Kernel = Field(Kernel.BOX, description="weights along the line")
    speed: Speed = Field(Speed.ARC, description="line by arc length, or by time (length is then in units of time)")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="v = (c - bias) * scale; 2 for fields stored in [0, 1]")
    bias: float = Field(
        0.0, ge=-1e6, le=1e6, description="the stored value of a zero component; 0.50196 (128 / 255) or 0.5"
    )
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the white noise that stands in for a missing texture")

    def steps(self, step: float) -> int:
        """Equal steps each way, none longer than `step`."""
        return math.ceil(self.length / step)

    def weights(self, count: int) -> npt.NDArray[np.float64]:
        """k at the ends of `count` equal steps, count + 1 values."""
        s = np.arange(count + 1) / max(count, 1)
        if self.kernel is Kernel.HANN:
            return 0.5 + 0.5 * np.cos(np.pi * s)
        if self.kernel is Kernel.COSINE:
            return np.cos(0.5 * np.pi * s)
        return np.ones(count + 1)


# -------------------------------------------------------------------------------------------------- inputs and facts


def noise(height: int, width: int, seed: int) -> Array:
    """White noise, uniform in [0, 1), float32 (height, width, 1); `noise` in lic.cl gives the same bits."""
    return unit(pcg3d(np.arange(width), np.arange(height)[:, None], seed)[0])[:, :, None]


def decode(field: Image, p: Parameters, dtype: npt.DTypeLike) -> Array:
    """The vectors, (height, width, 2); NaN for one that is not finite. The difference is taken in float32, so a
    component stored as the bias is exactly zero."""
    vectors: Array = (field.pixels[:, :, :2].astype(np.float32) - np.float32(p.bias)).astype(dtype) * p.scale
    limit = vectors.dtype.type(_limit(p))
    finite = np.isfinite(vectors).all(axis=2, keepdims=True)
    bounded: Array = np.where(finite, np.clip(vectors, -limit, limit), vectors.dtype.type(np.nan))
    return bounded


def _limit(p: Parameters) -> float:
    """Of a component: where lengths count, far beyond any image and far from overflow."""
    return float(np.finfo(np.float32).max) if p.speed is Speed.ARC else 2.0**40


def texture_of(inputs: Inputs, p: Parameters) -> Array:
    field = inputs["field"]
    return inputs["texture"].pixels if "texture" in inputs else noise(field.height, field.width, p.seed)


def texture_facts(facts: InputFacts) -> Facts:
    field = facts["field"]
    return facts.get("texture", Facts(field.height, field.width, 1, extent=Extent(0.0, 1.0, 0)))


def result_facts(p: Parameters, facts: InputFacts) -> Facts:
    field, texture = facts["field"], texture_facts(facts)
    slack = 1e-5 * texture.extent.magnitude  # of rounding; a mean in exact arithmetic stays inside
    extent = Extent(texture.extent.low - slack, texture.extent.high + slack, texture.extent.nonfinite)
    return Facts(field.height, field.width, texture.channels, texture.space, texture.alpha, extent)


def reach(p: Parameters, facts: InputFacts) -> float:
    """How far a line can go, px."""
    if p.speed is Speed.ARC:
        return p.length
    extent = facts["field"].extent
    fastest = math.sqrt(2) * abs(p.scale) * max(abs(extent.low - p.bias), abs(extent.high - p.bias))
    return p.length * fastest


def footprint(p: Parameters, facts: InputFacts) -> Footprint:
    field, texture = facts["field"], texture_facts(facts)
    far = reach(p, facts)
    if (texture.height, texture.width) != (field.height, field.width) or far > max(field.height, field.width):
        return WHOLE
    return halo(math.ceil(far) + 1)


def implied(p: Parameters, facts: InputFacts) -> Mapping[str, Array] | str:
    """The noise that stands in for a texture. By time, truth follows the fastest vector of the field in its steps."""
    if p.speed is Speed.FIELD:
        return "the steps of truth depend on the fastest vector of the whole field"
    field = facts["field"]
    return {} if "texture" in facts else {"texture": noise(field.height, field.width, p.seed)}


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    result = result_facts(p, facts)
    if max(result.samples, texture_facts(facts).samples) < 2**31:
        return []
    return [Flaw("/inputs/texture", "pixels times channels must stay below 2^31")]


# ------------------------------------------------------------------------------------------------------------- truth

lic = Operation(
    name="lic",
    family="streamlines",
    summary="Line integral convolution: smears a texture, or noise, along the lines of a vector field.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("field", "vectors: x to the right, y down; further channels are not read", (2, 4), picture=False),
        Input("texture", "what is smeared; covers the field's rectangle. White noise by default", required=False),
    ),
    light=Light.STORED,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=footprint,
    result=result_facts,
    implied=implied,
    check=check,
    customary=("rk2", 1.0),
    hard_cases=HARD_CASES,
    examples=(
        {"length": 10},
        {"length": 3.5, "kernel": "hann", "seed": 7},
        {"length": 4, "speed": "field", "scale": 2, "bias": 0.5, "kernel": "cosine"},
    ),
)


@lic.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Classical Runge-Kutta at 1/16 px, trapezoid rule, float64."""
    vectors = decode(inputs["field"], p, np.float64)
    fastest = 1.0 if p.speed is Speed.ARC else float(np.clip(np.nanmax(np.abs(vectors), initial=1.0), 1, 32))
    return lines(inputs, p, 1 / (16 * fastest), vectors).convolve(runge_kutta_4)


# ----------------------------------------------------------------------------------------------------------- methods

STEP = Knob(
    "step", (2.0, 1.0, 0.5, 0.25), "longest step along the line, px (units of time for speed=field)", 0.125, 8.0
)


def lines(inputs: Inputs, p: Parameters, step: float, vectors: Array) -> Lines:
    return Lines(vectors, texture_of(inputs, p), p.weights(p.steps(step)), p.length, p.speed is Speed.ARC)


def single(inputs: Inputs, p: Parameters, step: float) -> Lines:
    """The lines in the arithmetic of the methods."""
    return lines(inputs, p, step, decode(inputs["field"], p, np.float32))


def task(inputs: Inputs, p: Parameters, step: float) -> Task:
    count, arc = p.steps(step), p.speed is Speed.ARC
    return Task(
        inputs["field"].pixels,
        inputs["texture"].pixels if "texture" in inputs else None,
        p.seed,
        p.scale,
        p.bias,
        _limit(p),
        p.weights(count).astype(np.float32),
        p.length / max(count, 1),
        arc,
        p.length + 1 if arc else FARTHEST,
    )


def work(samples: int, p: Parameters, step: float, facts: InputFacts) -> float:
    """Samples taken: `samples` of the field and one per channel of the texture, at every step of every pixel."""
    return facts["field"].pixels * (2.0 * p.steps(step) + 1) * (samples + texture_facts(facts).channels)


TYPICAL: Mapping[str, tuple[float, ...]] = {
    "nearest": (0.150, 0.129, 0.127, 0.127),
    "euler": (0.125, 0.111, 0.085, 0.063),
    "rk2": (0.124, 0.092, 0.063, 0.042),
    "rk4": (0.119, 0.099, 0.072, 0.048),
}
"""RMS error over the spread of the texture at the steps of `STEP`, on white noise along a field of white noise."""


def error(method: str, p: Parameters, step: float, facts: InputFacts) -> Error:
    """The spread of the texture and the rounding of the sums; and the RMS error that the method typically leaves."""
    field, texture = facts["field"], texture_facts(facts)
    spread = texture.extent.spread
    if spread == 0 or (p.length == 0 and (field.height, field.width) == (texture.height, texture.width)):
        return EXACT
    rounding = (p.steps(STEP.low) + 8) * ROUNDING * (spread + texture.extent.magnitude)
    typical = float(np.interp(step, STEP.values[::-1], TYPICAL[method][::-1]))
    return Error(spread + rounding, "bound", rounding, spread * typical)


SAMPLING = {"opencl": Rate(5e-4, 1.4e-9), "numpy": Rate(1e-3, 1.0e-7)}
WALKING = {"opencl": Rate(5e-4, 1.1e-9), "numpy": Rate(1e-3, 1.1e-7)}
"""Seconds per sample on 2 cores."""


@lic.method("nearest", error=partial(error, "nearest"), work=partial(work, 0), rates=WALKING, knob=STEP)
class Nearest:
    """Euler's steps through the vectors of whole pixels, reading whole texels."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return task(inputs, parameters, knob).walk(device)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return single(inputs, parameters, knob).walk()


@lic.method("euler", error=partial(error, "euler"), work=partial(work, 1), rates=SAMPLING, knob=STEP)
class Euler:
    """Euler's steps in the interpolated field: lines drift outwards in every bend, by half a step per radian."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return task(inputs, parameters, knob).follow(device, order=1)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return single(inputs, parameters, knob).convolve(euler)


@lic.method("rk2", error=partial(error, "rk2"), work=partial(work, 2), rates=SAMPLING, knob=STEP)
class RungeKutta2:
    """The midpoint rule in the interpolated field: two vectors a step, second order."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return task(inputs, parameters, knob).follow(device, order=2)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return single(inputs, parameters, knob).convolve(runge_kutta_2)


@lic.method("rk4", error=partial(error, "rk4"), work=partial(work, 4), rates=SAMPLING, knob=STEP)
class RungeKutta4:
    """The classical Runge-Kutta rule in the interpolated field: four vectors a step, fourth order."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return task(inputs, parameters, knob).follow(device, order=4)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return single(inputs, parameters, knob).convolve(runge_kutta_4)
