"""Sharpen by the unsharp mask.

Truth: with blur the Gaussian of `sigma` (see `gaussian`) and d = image - blur the detail it takes away,

    out = image + amount (d - clamp(d, -threshold, threshold))

so that detail below the threshold, which is mostly noise, is left alone, and what is above it sets in without a step.
`amount` 0 changes nothing, -1 with no threshold is the blur itself. Nothing is clamped: edges overshoot.
Colours are sharpened, coverage is kept. Where pixels are left out (`mask`, `missing`), the blur is the mean of the
others (see `gaussian`); of a pixel whose own sample is undefined the result is undefined.

Methods are those of the blur, `fir` and `dct`; their error arrives multiplied by the amount.

Source: McReynolds and Blythe (1998), 12.2.1, where it is extrapolation away from a blurred image.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array
from lichen.once import latest
from lichen.opencl.device import Device
from lichen.operation import (
    ROUNDING,
    Border,
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
from lichen.operations.convolution.gaussian import Parameters as Blur
from lichen.operations.convolution.gaussian import gaussian
from lichen.operations.convolution.missing import MASK, Missing, check_mask, extent_without, leaves_out
from lichen.operations.convolution.stencil import kept_coverage, reach_of_values


class Parameters(OperationParameters):
    sigma: Pixels = Field(2.0, ge=0, le=1e5, description="standard deviation of the blur that detail is told by")
    amount: float = Field(1.0, ge=-1, le=100, description="how much of the detail is added")
    threshold: float = Field(0.0, ge=0, le=1e6, description="detail up to this is left alone")
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")

    @property
    def blur(self) -> Blur:
        return _blur(self)


@latest
def _blur(p: Parameters) -> Blur:
    return Blur(sigma=p.sigma, border=p.border, value=p.value, missing=p.missing)


def _detail(p: Parameters, facts: InputFacts) -> float:
    """The most that is added: no detail is larger than the range of the values."""
    low, high = reach_of_values(facts["image"], p.border, p.value)
    return abs(p.amount) * max(high - low - p.threshold, 0.0)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    extent, more = facts["image"].extent, _detail(p, facts)
    extent = Extent(extent.low - more, extent.high + more, extent.nonfinite)
    return dataclasses.replace(facts["image"], extent=extent_without(facts, extent))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    if image.extent.nonfinite or leaves_out(p.missing, facts):
        return None  # infinite detail is NaN, and so is none at all, however little of it is added
    if p.amount == 0 or p.sigma == 0:
        return "no detail is added"
    low, high = reach_of_values(image, p.border, p.value)
    return "no detail exceeds the threshold" if high - low < p.threshold else None


def _error(method: str) -> Callable[[Parameters, float, InputFacts], Error]:
    blurred = gaussian.methods[method].error

    def error(p: Parameters, tail: float, facts: InputFacts) -> Error:
        arriving, amount = blurred(p.blur, tail, facts), abs(p.amount)
        low, high = reach_of_values(facts["image"], p.border, p.value)
        whole = (1 + amount) * max(abs(low), abs(high)) + amount * (high - low + p.threshold)
        own = 4 * ROUNDING * whole
        return Error(amount * arriving.value + own, arriving.kind, amount * arriving.rounding + own)

    return error


def _work(method: str) -> Callable[[Parameters, float, InputFacts], float]:
    return lambda p, tail, facts: gaussian.methods[method].work(p.blur, tail, facts) + 40.0 * facts["image"].samples


def _unfit(method: str) -> Callable[[Parameters, InputFacts], str | None]:
    return lambda p, facts: gaussian.methods[method].unfit(p.blur, facts)


def _rates(method: str) -> dict[str, Rate]:
    return {backend: Rate(rate.start + 2e-4, rate.step) for backend, rate in gaussian.methods[method].rates.items()}


# ------------------------------------------------------------------------------------------------------ hard cases


def _speckled() -> dict[str, Array]:
    noise = np.random.default_rng(2).uniform(-0.01, 0.01, (20, 40, 1)).astype(np.float32)
    noise[:, 20:] += 1
    return {"image": noise}


def _noise_is_left(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    far = np.r_[0:8, 32:40]
    if not np.array_equal(pixels[:, far], inputs["image"][:, far]):
        return "noise below the threshold was changed"
    return None if pixels.max() > 1.1 else "the edge was not sharpened"


def _one_nan() -> dict[str, Array]:
    pixels = np.full((33, 35, 1), 0.5, np.float32)
    pixels[16, 17] = np.nan
    return {"image": pixels}


def _contained(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    outside = np.ones(pixels.shape, bool)
    outside[10:23, 11:24] = False
    if np.isnan(pixels[outside]).any():
        return "NaN left the footprint"
    return None if np.isnan(pixels[16, 17]) else "NaN turned into a colour"


def _only_its_own(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    spoilt = np.argwhere(np.isnan(pixels[..., 0])).tolist()
    return None if spoilt == [[16, 17]] else f"{len(spoilt)} pixels are NaN, not the one that was"


sharpen = Operation(
    name="sharpen",
    family="convolution",
    summary="Unsharp mask: adds the detail that a Gaussian blur takes away, above a threshold.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), MASK),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: gaussian.footprint(p.blur, facts),
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: (1 + 2 * abs(p.amount)) * error,
    check=lambda p, facts: check_mask(facts),
    examples=(
        {},
        {"sigma": 4.0, "amount": 2.5, "threshold": 0.1, "border": "wrap"},
        {"sigma": 1.0, "amount": -1, "border": "constant", "value": 0.5},
        {"sigma": 25.0, "amount": 0.7},
        {"sigma": 3.0, "amount": 1.5, "missing": "inside"},
    ),
    hard_cases=(
        HardCase("noise below the threshold", "a hard threshold tears holes, none makes noise louder", _speckled,
                 {"sigma": 1.5, "amount": 2, "threshold": 0.05}, _noise_is_left),
        HardCase("one NaN that is skipped", "0 x NaN is NaN", _one_nan, {"sigma": 1.0, "missing": "skip"},
                 _only_its_own),
        HardCase("one NaN", "clamp(NaN) is a number", _one_nan, {"sigma": 1.0, "threshold": 0.1}, _contained),
    ),
    description=__doc__ or "",
)  # fmt: skip


@sharpen.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    detail = image.pixels - gaussian.evaluate_truth(inputs, p.blur)
    return kept_coverage(image, image.pixels + p.amount * (detail - np.clip(detail, -p.threshold, p.threshold)))


def _opencl(method: str, device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
    image = inputs["image"]
    out = gaussian.methods[method].implementation.opencl(device, inputs, p.blur, tail)
    with device.session() as session:
        session.launch(
            "convolution/sharpen.cl", "sharpen", (-(-out.size // 16),),
            image.pixels, session.readwrite(out), np.int32(out.size), np.float32(p.amount), np.float32(p.threshold),
        )  # fmt: skip
    return kept_coverage(image, out)


def _numpy(method: str, inputs: Inputs, p: Parameters, tail: float) -> Array:
    image = inputs["image"]
    out = gaussian.methods[method].implementation.numpy(inputs, p.blur, tail)
    np.subtract(image.pixels, out, out=out)
    if p.threshold:
        out -= np.clip(out, np.float32(-p.threshold), np.float32(p.threshold))
    out *= np.float32(p.amount)
    out += image.pixels
    return kept_coverage(image, out)


@sharpen.method(
    "fir",
    scratch=2.1,
    knob=gaussian.methods["fir"].knob,
    error=_error("fir"),
    orderly=True,
    work=_work("fir"),
    rates=_rates("fir"),
    unfit=_unfit("fir"),
)
class Fir:
    """Detail told by a blur of two passes, its kernel cut where little weight is left."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        return _opencl("fir", device, inputs, p, tail)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        return _numpy("fir", inputs, p, tail)


@sharpen.method(
    "dct",
    scratch=5.6,
    knob=gaussian.methods["dct"].knob,
    error=_error("dct"),
    orderly=True,
    work=_work("dct"),
    lightest=_work("dct"),
    rates=_rates("dct"),
    unfit=_unfit("dct"),
)
class Dct:
    """Detail told by a blur of few low frequencies; cheaper the wider it is."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        return _opencl("dct", device, inputs, p, tail)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        return _numpy("dct", inputs, p, tail)
