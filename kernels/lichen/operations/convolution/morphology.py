"""Morphology of numbers with a rectangle: erosion, dilation, and what is made of them.

Truth: with W the rectangle of `width` x `height` pixels laid so that `anchor` is over the output pixel, and the image
continued by `border` before every step,

    erode   the smallest value within W                 open       dilate(erode(image))
    dilate  the largest within W turned by 180 degrees  close      erode(dilate(image))
    gradient  dilate - erode          tophat  image - open          blackhat  close - image

A window that holds a NaN gives NaN. Where pixels are left out (`mask`, `missing`), smallest and largest are those of
the others, and every step leaves out the same, so that an opening still lies nowhere above the image and a closing
nowhere below; a window with none of the others has no value. The numbers are taken as they are stored: smallest and
largest go through any rising function, and the three differences are differences of what is stored. Of these, coverage
is kept.

The one method is exact but for the difference: windows are joined from the end of one block and the beginning of the
next, three comparisons an axis whatever the size (see `windows`).

Sources: Serra, Image Analysis and Mathematical Morphology (1982); van Herk 1992.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import partial
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned
from lichen.opencl.device import Device
from lichen.operation import (
    EXACT,
    ROUNDING,
    Border,
    Error,
    Facts,
    Footprint,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.convolution.box import MOST, check_anchor
from lichen.operations.convolution.missing import (
    WHICH,
    Missing,
    Undefined,
    check_mask,
    chooses,
    chosen,
    extent_chosen,
)
from lichen.operations.convolution.stencil import kept_coverage, reach_of_values
from lichen.operations.convolution.windows import Combine, Window, reached, windows_numpy, windows_opencl, windows_plain


class Step(StrEnum):
    """What is computed."""

    ERODE = "erode"
    DILATE = "dilate"
    OPEN = "open"
    CLOSE = "close"
    GRADIENT = "gradient"
    TOPHAT = "tophat"
    BLACKHAT = "blackhat"


DIFFERENCES = (Step.GRADIENT, Step.TOPHAT, Step.BLACKHAT)
TWICE = (Step.OPEN, Step.CLOSE, Step.TOPHAT, Step.BLACKHAT)


class Parameters(OperationParameters):
    step: Step = Field(Step.DILATE, description="what is computed")
    width: int = Field(3, ge=1, le=MOST, description="columns of the rectangle", json_schema_extra={"unit": "px"})
    height: int = Field(3, ge=1, le=MOST, description="rows of the rectangle", json_schema_extra={"unit": "px"})
    anchor: tuple[int, int] | None = Field(
        None, description="column and row of the rectangle that lies over the output pixel; its middle if left out"
    )
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")

    @property
    def beyond(self) -> float:
        """`value` as pixels can hold it, so that what is chosen among them is exact."""
        return float(np.float32(self.value))

    @property
    def window(self) -> Window:
        return Window.of(self.width, self.height, self.anchor)


Windows = Callable[[Array, Window, Combine, Border, float, Undefined], Array]


def _computed(inputs: Inputs, p: Parameters, windows: Windows) -> Array:
    """The steps in order, given how one of them is done."""
    image = inputs["image"]
    pixels = image.pixels

    def step(pixels: Array, window: Window, combine: Combine) -> Array:
        return chosen(
            inputs, p.missing, p.border, p.beyond,
            lambda pixels, border, value, undefined: windows(pixels, window, combine, border, value, undefined),
            lambda bad: reached(bad, window, p.border), pixels,
        )  # fmt: skip

    def erode(pixels: Array) -> Array:
        return step(pixels, p.window, Combine.SMALLEST)

    def dilate(pixels: Array) -> Array:
        return step(pixels, p.window.turned, Combine.LARGEST)

    match p.step:
        case Step.ERODE:
            return erode(pixels)
        case Step.DILATE:
            return dilate(pixels)
        case Step.OPEN:
            return dilate(erode(pixels))
        case Step.CLOSE:
            return erode(dilate(pixels))
    with np.errstate(invalid="ignore", over="ignore"):
        if p.step is Step.GRADIENT:
            made = dilate(pixels)
            made -= erode(pixels)
        elif p.step is Step.TOPHAT:
            made = dilate(erode(pixels))
            np.subtract(pixels, made, out=made)
        else:
            made = erode(dilate(pixels))
            made -= pixels
    return kept_coverage(image, made)


# ------------------------------------------------------------------------------------------------------ predictions


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, (low, high) = facts["image"], reach_of_values(facts["image"], p.border, p.beyond)
    if p.step in DIFFERENCES:
        # Against a constant border an opening may exceed the image, and a closing fall below it.
        low, high = (0.0 if p.step is Step.GRADIENT else low - high), high - low
        if image.alpha is not Alpha.NONE:
            low, high = min(low, image.extent.low), max(high, image.extent.high)
    extent = Extent(low, high, image.extent.nonfinite)
    return dataclasses.replace(image, extent=extent_chosen(p.missing, facts, extent))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    if p.step not in DIFFERENCES:
        return EXACT
    low, high = reach_of_values(facts["image"], p.border, p.beyond)
    rounding = 1.01 * ROUNDING * (high - low)
    return Error(rounding, "bound", rounding)


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    once = p.window.footprint(p.border)
    return dataclasses.replace(once, rows=p.height - 1, columns=p.width - 1) if p.step in TWICE else once


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    image, times = facts["image"], 2 if p.step in (*TWICE, Step.GRADIENT) else 1
    return times * image.channels * (image.pixels + 0.5 * (image.width * p.height + image.height * p.width))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    single = p.width == p.height == 1 and p.step not in DIFFERENCES and not chooses(p.missing, facts)
    return "the window is one pixel" if single else None


# ------------------------------------------------------------------------------------------------------ hard cases


def _noise() -> dict[str, Array]:
    return {"image": np.random.default_rng(4).random((30, 41, 1), dtype=np.float32)}


def _not_above(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if (pixels <= inputs["image"]).all() else "an opening lies above the image: its window was not turned"


def _one_nan() -> dict[str, Array]:
    pixels = np.full((20, 21, 1), 0.5, np.float32)
    pixels[10, 11] = np.nan
    return {"image": pixels}


def _nan_in_15(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    spoilt = int(np.count_nonzero(np.isnan(pixels)))
    return None if spoilt == 15 else f"{spoilt} pixels are NaN, not 15"


def _torn_noise() -> dict[str, Array]:
    noise = _noise()["image"]
    return {"image": np.where(np.random.default_rng(5).random(noise.shape) < 0.4, np.float32(np.nan), noise)}


def _not_above_what_is_left(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    left = ~np.isnan(inputs["image"])
    above = not (pixels[left] <= inputs["image"][left]).all()
    return "an opening lies above the image: its second step saw what its first made up" if above else None


morphology = Operation(
    name="morphology",
    family="convolution",
    summary="Erosion and dilation by a rectangle, opening, closing, gradient and hats.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), WHICH),
    light=Light.STORED,
    footprint=_footprint,
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: (2 if p.step in DIFFERENCES else 1) * error,
    check=lambda p, facts: check_anchor(p.anchor, p.width, p.height) + check_mask(facts),
    examples=(
        {},
        {"step": "open", "width": 4, "height": 7, "anchor": [0, 2], "border": "reflect101"},
        {"step": "gradient", "width": 5, "height": 1, "border": "clamp"},
        {"step": "close", "width": 12, "height": 9, "border": "wrap"},
        {"step": "tophat", "width": 6, "height": 5, "border": "constant", "value": 0.25},
        {"step": "erode", "width": 2, "height": 60},
        {"step": "blackhat", "width": 3, "height": 4},
        {"step": "open", "width": 5, "height": 4, "missing": "inside"},
    ),
    hard_cases=(
        HardCase("opening by an even window", "unless dilation turns the window, the image shifts", _noise,
                 {"step": "open", "width": 4, "height": 2}, _not_above),
        HardCase("opening of a torn picture", "erosion fills holes, which dilation then hands on", _torn_noise,
                 {"step": "open", "width": 4, "height": 3, "missing": "skip"}, _not_above_what_is_left),
        HardCase("one NaN", "smallest and largest of C and OpenCL leave the number", _one_nan,
                 {"step": "erode", "width": 5, "height": 3}, _nan_in_15),
    ),
    description=__doc__ or "",
)  # fmt: skip


@morphology.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _computed(inputs, p, windows_plain)


@morphology.method(
    "blocks",
    error=_error,
    work=_work,
    rates={"opencl": Rate(5e-4, 2e-9), "numpy": Rate(2e-4, 3e-8)},
)
class Blocks:
    """Windows joined from the end of one block and the beginning of the next, in time that does not grow with them."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _computed(inputs, p, partial(windows_opencl, device))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_computed(inputs, p, windows_numpy))
