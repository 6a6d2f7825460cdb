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

All of these are slopes of the plane that fits the samples under the mask best, in least squares weighted by s along
both axes (for central, by 1 on a cross). Where pixels are left out (`valid`, `missing`), they are the slopes of the
plane that fits the others best: what is left of a ramp has the slope of the whole. Where the others lie on a line there
are none. With nine samples under a mask there are 512 fits, all known beforehand. A Gaussian's mask would have too many
and leaves nothing out; blur first, by `gaussian`, and take the slopes of that.

A direction turns round where the slope vanishes, so no error can be promised for it there: it is stated as half a turn,
and a small change of a picture is said to change it by as much.

Colours are differentiated, coverage is kept. Sources: McReynolds and Blythe (1998), 12.3.5; Scharr, Optimale Operatoren
in der digitalen Bildverarbeitung, Heidelberg (2000); Knutsson and Westin, Normalized and differential convolution, CVPR
1993; Haralick and Watson, A facet model for image data, Computer Graphics and Image Processing 15 (1981).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import lru_cache, partial
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
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
from lichen.operations.convolution.missing import (
    WHICH,
    Missing,
    Undefined,
    check_mask,
    chooses,
    chosen,
    extent_chosen,
    leaves_out,
)
from lichen.operations.convolution.slopes import Mask, fits, fitted, masks, under
from lichen.operations.convolution.stencil import (
    Stencil,
    apart,
    correlate,
    correlated,
    kept_coverage,
    reach_of_values,
    sum_of_taps,
)


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
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")


VALID = dataclasses.replace(WHICH, name="valid")
"""`mask` is a parameter here."""


def slopes(p: Parameters) -> tuple[Stencil, ...]:
    """The masks that the output needs, scaled."""
    x, y = masks(p.mask, p.sigma)
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
    return tuple(Stencil(_scale(p) * taps, x.top, x.left) for taps in made)


def _scale(p: Parameters) -> float:
    """A direction has none."""
    return 1.0 if p.output is Output.DIRECTION else p.scale


def fitted_slopes(p: Parameters) -> tuple[Array, ...]:
    """The fits that the output needs, scaled, each (512, 9)."""
    return tuple(_scale(p) * each for each in _fits(p.mask, p.output, p.angle))


def _fits(mask: Mask, output: Output, degrees: float) -> tuple[Array, ...]:
    x, y = fits(mask)
    if output in (Output.X, Output.Y):
        return (x if output is Output.X else y,)
    if output is Output.ALONG:
        angle = math.radians(degrees)
        return (math.cos(angle) * x + math.sin(angle) * y,)
    return x, y


@lru_cache(maxsize=256)
def _fitted_gains(mask: Mask, output: Output, degrees: float) -> list[float]:
    """The largest l1 norm of the taps of each."""
    return [float(np.nanmax(np.abs(taps).sum(axis=1))) for taps in _fits(mask, output, degrees)]


Given = TypeVar("Given")


def _named(inputs: Mapping[str, Given]) -> dict[str, Given]:
    """The inputs with the pixels that take part called as elsewhere."""
    return {"mask" if name == VALID.name else name: each for name, each in inputs.items()}


def _gains(p: Parameters, facts: InputFacts) -> list[float]:
    """The largest l1 norm of the taps of each slope."""
    if chooses(p.missing, _named(facts)):
        return [abs(_scale(p)) * gain for gain in _fitted_gains(p.mask, p.output, p.angle)]
    return [mask.weight for mask in slopes(p)]


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
    if chooses(p.missing, _named(facts)):  # taps that sum to 0
        reached = [(-most, most) for gain in _gains(p, facts) for most in (gain * (high - low) / 2 * (1 + 1e-12),)]
    else:
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
    extent = extent_chosen(p.missing, _named(facts), Extent(low, high, image.extent.nonfinite))
    made = dataclasses.replace(image, extent=extent)
    return dataclasses.replace(made, space=Space.DATA) if p.output is Output.DIRECTION else made


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    if p.output is Output.DIRECTION:
        return Error(360.0, "bound", 360.0, 1e-4)
    low, high = reach_of_values(facts["image"], p.border, p.value)
    each = [mask.rounding(max(abs(low), abs(high))) for mask in slopes(p)]
    if chooses(p.missing, _named(facts)):
        each = [1.01 * 12 * ROUNDING * gain * max(abs(low), abs(high)) for gain in _gains(p, facts)]
    # A magnitude changes by no more than its slopes do together; then the root or the sum is rounded.
    last = 4 * ROUNDING * max(abs(bound) for bound in _bounds(p, facts)) if len(each) > 1 else 0.0
    rounding = sum(each) + last
    return Error(rounding, "bound", rounding)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    if p.output is Output.DIRECTION:
        return 360.0
    gains = _gains(p, facts)
    gain = math.hypot(*gains) if p.output is Output.L2 else sum(gains)
    return max(gain, 0.0 if facts["image"].alpha is Alpha.NONE else 1.0) * error


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    if p.mask is not Mask.GAUSSIAN or not leaves_out(p.missing, _named(facts)):
        return check_mask(facts, VALID.name)
    return [Flaw("/parameters/mask", "of a Gaussian leaves no pixels out; blur first, and take the slopes of that")]


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


def _torn_ramp() -> dict[str, Array]:
    ramp = _ramp()["image"]
    torn = np.random.default_rng(5).random(ramp.shape) < 0.3
    return {"image": np.where(torn, np.float32(np.nan), ramp)}


def _whole_slope(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    known = pixels[np.isfinite(pixels)]
    if known.size < pixels.size / 2:
        return "most slopes are undefined"
    apart = float(np.abs(known - 0.25).max())
    return None if apart <= 1e-5 else f"off by {apart:.3g} from 0.25"


derivative = Operation(
    name="derivative",
    family="convolution",
    summary="Slope of an image along an axis or angle, or magnitude and direction of its gradient.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), VALID),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    check=_check,
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
        {"mask": "scharr", "missing": "inside"},
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
            "torn ramp",
            "shares of weights that are positive and negative vanish; a quotient by them has no slope",
            _torn_ramp,
            {"output": "x", "missing": "inside"},
            _whole_slope,
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


Slope = Callable[[int, Array, Border, float, Undefined], Array]


def _slopes(inputs: Inputs, p: Parameters, slope: Slope) -> list[Array]:
    """The slopes that the output needs, given how one of them is made."""

    def reach(bad: Array) -> Array:
        return correlated(bad, Stencil(under(p.mask), 1, 1), p.border, 0.0)

    return [
        chosen(_named(inputs), p.missing, p.border, p.value, partial(slope, number), reach)
        for number in range(len(slopes(p)))
    ]


@derivative.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    def slope(number: int, pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
        if undefined is Undefined.SKIP:
            return fitted(pixels, fitted_slopes(p)[number], border, value)
        return sum_of_taps(pixels, slopes(p)[number], border, value)

    made = _slopes(inputs, p, slope)
    return kept_coverage(inputs["image"], made[0] if len(made) == 1 else combined(p.output, *made))


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    left_out = 400.0 if chooses(p.missing, _named(facts)) else 0.0
    return facts["image"].samples * sum(mask.count + 25.0 + left_out for mask in slopes(p))


@derivative.method(
    "direct",
    error=_error,
    work=_work,
    rates={"opencl": Rate(5e-4, 2e-11), "numpy": Rate(2e-4, 1.2e-10)},
)
class Direct:
    """One multiply-add for every tap of the masks that is not zero, then magnitude or direction."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        def slope(number: int, pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
            out = aligned_empty(pixels.shape)
            with device.session() as session:
                if undefined is Undefined.SKIP:
                    taps, mask = aligned(fitted_slopes(p)[number]), Stencil(np.ones((3, 3)), 1, 1)
                    apart(session, "fitted", pixels, out, mask, border, value, taps)
                else:
                    correlate(session, pixels, out, slopes(p)[number], border, value)
            return out

        image, made = inputs["image"], _slopes(inputs, p, slope)
        if len(made) == 2:
            with device.session() as session:
                session.launch(
                    "convolution/derivative.cl", p.output.value, (-(-image.pixels.size // 16),),
                    session.readwrite(made[0]), made[1], np.int32(image.pixels.size),
                )  # fmt: skip
        return kept_coverage(image, made[0])

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        def slope(number: int, pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
            if undefined is Undefined.SKIP:
                return fitted(pixels, fitted_slopes(p)[number], border, value)
            return correlated(pixels, slopes(p)[number], border, value)

        made = _slopes(inputs, p, slope)
        return kept_coverage(inputs["image"], aligned(made[0] if len(made) == 1 else combined(p.output, *made)))
