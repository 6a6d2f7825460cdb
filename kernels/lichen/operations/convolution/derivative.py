"""First derivatives of an image, by masks: one axis, any direction, or magnitude and direction of the gradient.

Truth: with the smoothing s and the difference d = (-1, 0, 1) / 2, the slope along x is the correlation with d along
rows and s along columns, and the slope along y the other way round; per pixel, so a ramp of 1 a pixel has the slope 1.

    prewitt   s = (1, 1, 1) / 3             sobel   s = (1, 2, 1) / 4
    scharr    s = (3, 10, 3) / 16           central s = 1

`gaussian` correlates with the derivative of a sampled Gaussian of `sigma`, scaled so that a ramp keeps its slope, and
with the Gaussian itself across; both end where less than 1e-8 of their weight is left.

`output`: `x`, `y`; `along`, the slope in the direction `angle`, cos(angle) x + sin(angle) y, which on the diagonals is
not quite what a mask with its rim turned gives (`convolve` has those by name); `l2`, the magnitude sqrt(x^2 + y^2),
computed without overflow; `l1`, |x| + |y|, up to sqrt(2) more; `direction`, atan2(y, x) in degrees within (-180, 180],
0 where there is no slope.

A direction turns round where the slope vanishes, so no error can be promised for it there: it is stated as half a turn,
and a small change of a picture is said to change it by as much.

Colours are differentiated, coverage is kept. Source: McReynolds and Blythe (1998), 12.3.5; Scharr, Optimale Operatoren
in der digitalen Bildverarbeitung, Heidelberg (2000).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    ROUNDING,
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
from lichen.operations.convolution.gaussian_weights import fir_radius, half_kernel
from lichen.operations.convolution.stencil import (
    Stencil,
    correlate,
    correlated,
    kept_coverage,
    reach_of_values,
    sum_of_taps,
)


class Mask(StrEnum):
    """How the difference is smoothed across."""

    SOBEL = "sobel"
    SCHARR = "scharr"
    PREWITT = "prewitt"
    CENTRAL = "central"
    GAUSSIAN = "gaussian"


class Output(StrEnum):
    """What is made of the two slopes."""

    X = "x"
    Y = "y"
    ALONG = "along"
    L2 = "l2"
    L1 = "l1"
    DIRECTION = "direction"


class Parameters(OperationParameters):
    mask: Mask = Field(Mask.SOBEL, description="how the difference is smoothed across")
    sigma: Pixels = Field(1.0, ge=0.3, le=10, description="standard deviation of the mask gaussian")
    output: Output = Field(Output.L2, description="what is made of the two slopes")
    angle: Degrees = Field(0.0, ge=-360, le=360, description="of the output along, from x towards y")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="factor on the slopes; no part in a direction")
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")


_ACROSS = {Mask.SOBEL: (1, 2, 1), Mask.SCHARR: (3, 10, 3), Mask.PREWITT: (1, 1, 1), Mask.CENTRAL: (0, 1, 0)}


@lru_cache(maxsize=64)
def masks(mask: Mask, sigma: float) -> tuple[Stencil, Stencil]:
    """The correlation masks of the slopes along x and along y, per pixel."""
    if mask is Mask.GAUSSIAN:
        half = half_kernel(sigma)[: fir_radius(sigma, 1e-8)[0] + 1]
        across = np.concatenate([half[:0:-1], half])
        at = np.arange(len(across)) - len(half) + 1
        slope = at * across
        slope, across = slope / (slope @ at), across / across.sum()
    else:
        across = np.array(_ACROSS[mask], np.float64) / sum(_ACROSS[mask])
        slope = np.array([-0.5, 0.0, 0.5])
    taps, middle = np.outer(across, slope), len(slope) // 2
    return Stencil(taps, middle, middle), Stencil(taps.T, middle, middle)


def slopes(p: Parameters) -> tuple[Stencil, ...]:
    """The masks that the output needs, scaled."""
    x, y = masks(p.mask, p.sigma)
    scale = 1.0 if p.output is Output.DIRECTION else p.scale
    if p.output is Output.X:
        made = [x.taps]
    elif p.output is Output.Y:
        made = [y.taps]
    elif p.output is Output.ALONG:
        angle = math.radians(p.angle)
        mixed = math.cos(angle) * x.taps + math.sin(angle) * y.taps
        made = [np.where(np.abs(mixed) < 1e-15, 0.0, mixed)]
    else:
        made = [x.taps, y.taps]
    return tuple(Stencil(scale * taps, x.top, x.left) for taps in made)


def combined(output: Output, x: Array, y: Array) -> Array:
    """Magnitude or direction of slopes, in their precision."""
    if output is Output.L2:
        return np.asarray(np.hypot(x, y))
    if output is Output.L1:
        return np.asarray(np.abs(x) + np.abs(y))
    # -0 is 0 here: a slope that vanishes has no side, and straight left is 180 degrees whatever the sign of y.
    return np.asarray(np.degrees(np.arctan2(y + y.dtype.type(0), x + x.dtype.type(0))))


# ------------------------------------------------------------------------------------------------------ predictions


def _bounds(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Smallest and largest value of what is computed."""
    if p.output is Output.DIRECTION:
        return -180.0, 180.0
    low, high = reach_of_values(facts["image"], p.border, p.value)
    reached = [mask.range(low, high) for mask in slopes(p)]
    if len(reached) == 1:
        return reached[0]
    largest = [max(abs(a), abs(b)) for a, b in reached]
    return 0.0, math.hypot(*largest) if p.output is Output.L2 else sum(largest)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    low, high = _bounds(p, facts)
    if image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    made = dataclasses.replace(image, extent=Extent(low, high, image.extent.nonfinite))
    return dataclasses.replace(made, space=Space.DATA) if p.output is Output.DIRECTION else made


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    if p.output is Output.DIRECTION:
        return Error(360.0, "bound", 360.0, 1e-4)
    low, high = reach_of_values(facts["image"], p.border, p.value)
    each = [mask.rounding(max(abs(low), abs(high))) for mask in slopes(p)]
    # A magnitude changes by no more than its slopes do together; then the root or the sum is rounded.
    last = 4 * ROUNDING * max(abs(bound) for bound in _bounds(p, facts)) if len(each) > 1 else 0.0
    rounding = sum(each) + last
    return Error(rounding, "bound", rounding)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    if p.output is Output.DIRECTION:
        return 360.0
    gains = [mask.weight for mask in slopes(p)]
    gain = math.hypot(*gains) if p.output is Output.L2 else sum(gains)
    return max(gain, 0.0 if facts["image"].alpha is Alpha.NONE else 1.0) * error


def _ramp() -> dict[str, Array]:
    y, x = np.mgrid[0:9, 0:11].astype(np.float32)
    return {"image": (0.25 * x - 0.125 * y)[..., None]}


def _inside(expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        apart = float(np.abs(pixels[2:-2, 2:-2] - expected).max())
        return None if apart <= 1e-5 else f"off by {apart:.3g} from {expected:g}"

    return holds


def _flat_has_no_direction(inputs: object, pixels: Array) -> str | None:
    return None if np.array_equal(pixels, np.zeros_like(pixels)) else "a flat image has a direction"


def _huge() -> dict[str, Array]:
    return {"image": np.where(np.arange(12) < 6, 0, 1e30).astype(np.float32)[None, :, None].repeat(5, 0)}


derivative = Operation(
    name="derivative",
    family="convolution",
    summary="Slope of an image along an axis or angle, or magnitude and direction of its gradient.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: masks(p.mask, p.sigma)[0].footprint(p.border),
    result=_result,
    propagate=_propagate,
    examples=(
        {},
        {"mask": "scharr", "output": "x", "border": "reflect101"},
        {"mask": "gaussian", "sigma": 1.7, "output": "l1", "border": "wrap"},
        {"mask": "prewitt", "output": "along", "angle": 45, "scale": 3, "border": "constant", "value": 0.5},
        {"mask": "central", "output": "direction", "border": "clamp"},
        {"mask": "sobel", "output": "y", "scale": -8},
    ),
    hard_cases=(
        HardCase(
            "ramp",
            "masks that are not divided by their weight make slopes of 8 from 1",
            _ramp,
            {"output": "l2"},
            _inside(math.hypot(0.25, 0.125)),
        ),
        HardCase(
            "ramp through a Gaussian",
            "a cut derivative loses slope unless it is scaled",
            _ramp,
            {"mask": "gaussian", "sigma": 0.5, "output": "x"},
            _inside(0.25),
        ),
        HardCase(
            "no slope",
            "y / x is 0 / 0; -0 has a side",
            lambda: {"image": np.full((5, 5, 1), -0.0, np.float32)},
            {"output": "direction"},
            _flat_has_no_direction,
        ),
        HardCase(
            "huge step",
            "x * x overflows at 2e19",
            _huge,
            {"output": "l2"},
            lambda inputs, pixels: None if np.isfinite(pixels).all() else "a magnitude overflowed",
        ),
    ),
    description=__doc__ or "",
)


@derivative.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    made = [sum_of_taps(image.pixels, mask, p.border, p.value) for mask in slopes(p)]
    return kept_coverage(image, made[0] if len(made) == 1 else combined(p.output, *made))


@derivative.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * sum(mask.count + 25.0 for mask in slopes(p)),
    rates={"opencl": Rate(5e-4, 2e-11), "numpy": Rate(2e-4, 1.2e-10)},
)
class Direct:
    """One multiply-add for every tap of the masks that is not zero, then magnitude or direction."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        made = [aligned_empty(image.pixels.shape) for _ in slopes(p)]
        with device.session() as session:
            for out, mask in zip(made, slopes(p), strict=True):
                correlate(session, image.pixels, out, mask, p.border, p.value)
            if len(made) == 2:
                session.launch(
                    "convolution/derivative.cl", p.output.value, (-(-image.pixels.size // 16),),
                    session.readwrite(made[0]), made[1], np.int32(image.pixels.size),
                )  # fmt: skip
        return kept_coverage(image, made[0])

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image: Image = inputs["image"]
        made = [correlated(image.pixels, mask, p.border, p.value) for mask in slopes(p)]
        return kept_coverage(image, aligned(made[0] if len(made) == 1 else combined(p.output, *made)))
