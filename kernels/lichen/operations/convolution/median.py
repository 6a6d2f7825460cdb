"""Median: the middle value of a square window around every pixel, channel by channel.

Truth: of the `size` x `size` samples of the image, continued by `border`, the one that as many exceed as lie below. A
window that holds a NaN has no middle: its result is NaN. Where pixels are left out (`mask`, `missing`), it is the
middle of the others, the lower of two, so that it is always one of the samples.

Both methods are exact. The median of numbers goes through any rising function of them, so it asks for no light.

* `network` compares and exchanges along fixed wires, for windows of 3 and 5.
* `bisect` finds the bits of the median from the highest down by counting; its time grows with the window's area.

Sources: Paeth, Median finding on a 3x3 grid, Graphics Gems (1990), for dropping extremes; Knuth, The Art of Computer
Programming 3, 5.3.4, for the sorting networks.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import Field

from lichen.image import Extent
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    EXACT,
    Border,
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
from lichen.operations.convolution.missing import (
    WHICH,
    Choice,
    Missing,
    Undefined,
    check_mask,
    chooses,
    chosen,
    extent_chosen,
)
from lichen.operations.convolution.stencil import STAGE, Stencil, apart, banded, continue_image, gathering, laid_out
from lichen.operations.convolution.windows import Window, reached

LINE, MOST_CHANNELS = 2048, 64
"""Floats of a line of sorted columns, and channels, at most."""


class Parameters(OperationParameters):
    size: Literal[1, 3, 5, 7, 9, 11, 13, 15] = Field(
        3, description="rows and columns of the window, odd", json_schema_extra={"unit": "px"}
    )
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")

    @property
    def beyond(self) -> float:
        """`value` as pixels can hold it, so that what is chosen among them is exact."""
        return float(np.float32(self.value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    extent = image.extent
    if p.border is Border.CONSTANT:
        extent = Extent(min(extent.low, p.beyond), max(extent.high, p.beyond), extent.nonfinite)
    return dataclasses.replace(image, extent=extent_chosen(p.missing, facts, extent))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return "the window is one pixel" if p.size == 1 and not chooses(p.missing, facts) else None


def _salt() -> dict[str, Array]:
    pixels = np.full((24, 30, 1), 0.5, np.float32)
    pixels[::4, ::4], pixels[2::4, 2::4] = np.inf, -np.inf
    return {"image": pixels}


def _calm(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.array_equal(pixels, np.full_like(pixels, 0.5)) else "outliers are left"


def _one_nan() -> dict[str, Array]:
    pixels = np.random.default_rng(1).random((20, 21, 1)).astype(np.float32)
    pixels[10, 11] = np.nan
    return {"image": pixels}


def _nan_in_25(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    spoilt = np.argwhere(np.isnan(pixels[..., 0]))
    around = [[y, x] for y in range(8, 13) for x in range(9, 14)]
    return None if spoilt.tolist() == around else f"{len(spoilt)} pixels are NaN, not the 25 around it"


def _torn() -> dict[str, Array]:
    """A step of which two samples in three are undefined, some with a sign that would make them the smallest."""
    random = np.random.default_rng(7)
    step = np.where(np.arange(30) < 15, np.float32(1), np.float32(2)) * np.ones((24, 1), np.float32)
    undefined = random.choice(np.array([np.nan, np.copysign(np.nan, -1), np.inf, -np.inf], np.float32), step.shape)
    return {"image": np.where(random.random(step.shape) < 2 / 3, undefined, step)[..., None]}


def _step_is_left(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    far = np.r_[0:12, 18:30]
    expected = np.where(far < 15, 1, 2)[None, :, None]
    return None if (pixels[:, far] == expected).all() else "what is left of a step is no step"


median = Operation(
    name="median",
    family="convolution",
    summary="Middle value of a square window: removes outliers and keeps edges.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data", channels=(1, MOST_CHANNELS)), WHICH),
    light=Light.STORED,
    footprint=lambda p, facts: Footprint(p.size // 2, p.size // 2, wraps=p.border is Border.WRAP),
    identity=_identity,
    result=_result,
    check=lambda p, facts: check_mask(facts),
    examples=(
        {},
        {"size": 5, "border": "reflect101"},
        {"size": 3, "border": "constant", "value": 0.0},
        {"size": 5, "border": "wrap"},
        {"size": 9, "border": "clamp"},
        {"size": 5, "missing": "inside"},
    ),
    hard_cases=(
        HardCase("infinite outliers", "a mean would be NaN; a median does not see them", _salt, {"size": 3}, _calm),
        HardCase(
            "torn step",
            "the number of samples that are left differs; NaN has a sign",
            _torn,
            {"size": 7, "missing": "skip"},
            _step_is_left,
        ),
        HardCase(
            "one NaN", "comparing with NaN leaves it, or the number, by chance", _one_nan, {"size": 5}, _nan_in_25
        ),
    ),
    description=__doc__ or "",
)


def _chosen(inputs: Inputs, p: Parameters, choose: Choice) -> Array:
    window = Window.of(p.size, p.size, None)
    return chosen(inputs, p.missing, p.border, p.beyond, choose, lambda bad: reached(bad, window, p.border))


def _windows(around: Array, size: int) -> Array:
    """All windows of an image continued, (height, width, channels, size^2), a copy."""
    seen = sliding_window_view(around, (size, size), axis=(0, 1))
    return np.array(seen.reshape(*seen.shape[:3], size * size))


@median.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    def choose(pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
        reach = (p.size // 2, p.size // 2)
        seen = np.sort(_windows(continue_image(pixels, reach, reach, border, value), p.size))  # NaN comes last
        numbers = np.count_nonzero(~np.isnan(seen), axis=-1, keepdims=True)
        if undefined is not Undefined.SKIP:
            numbers[numbers < p.size**2] = 0
        middle = np.take_along_axis(seen, np.maximum(numbers - 1, 0) // 2, -1)
        return np.asarray(np.where(numbers > 0, middle, np.nan)[..., 0])

    return _chosen(inputs, p, choose)


def _opencl(kernel: str, device: Device, inputs: Inputs, p: Parameters) -> Array:
    window = Stencil(np.ones((p.size, p.size)), p.size // 2, p.size // 2)
    size = (np.int32(p.size),) if kernel == "bisect" else ()
    defines = {"SIZE": p.size if kernel == "network" else 0, "STAGE": STAGE, "LINE": LINE}

    def choose(pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
        height, width, channels = pixels.shape
        tile, stride, capacity = laid_out(p.size, p.size, channels)
        down, beside = gathering(pixels.shape, window, tile, stride, border)
        out, tiles = aligned_empty(pixels.shape), -(-width * channels // tile)
        band = banded(height, tiles, p.size)
        with device.session() as session:
            if session.in_step:
                skip = np.int32(undefined is Undefined.SKIP)
                apart(session, "median", pixels, out, window, border, value, np.int32(p.size), skip)
                return out
            session.launch(
                "convolution/median.cl", kernel, (tiles, -(-height // band)),
                pixels, down, beside, session.write(out), np.int32(height), np.int32(width * channels),
                np.int32(channels), np.int32(stride), np.int32(band), np.int32(tile), np.int32(capacity),
                np.float32(value), *size, local=(1, 1), defines={**defines, "NANS": int(undefined)},
            )  # fmt: skip
        return out

    return _chosen(inputs, p, choose)


def _numpy(inputs: Inputs, p: Parameters) -> Array:
    """The middle of every window by selection, some rows at a time."""

    def choose(pixels: Array, border: Border, value: float, undefined: Undefined) -> Array:
        reach = (p.size // 2, p.size // 2)
        around = continue_image(pixels, reach, reach, border, value)
        out = aligned_empty(pixels.shape)
        rows = max(1, (1 << 22) // (pixels[0].size * p.size**2))
        for y in range(0, len(pixels), rows):
            seen = _windows(around[y : y + rows + p.size - 1], p.size)
            bad = np.isnan(seen).sum(axis=-1)
            if undefined is Undefined.SKIP:
                seen.sort(axis=-1)
                at = np.maximum(p.size**2 - 1 - bad, 0) // 2
                out[y : y + rows] = np.take_along_axis(seen, at[..., None], -1)[..., 0]
            else:
                seen.partition(p.size**2 // 2, axis=-1)
                out[y : y + rows] = np.where(bad, np.float32(np.nan), seen[..., p.size**2 // 2])
        return out

    return _chosen(inputs, p, choose)


def _network_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if chooses(p.missing, facts):
        return "pixels are left out, and of how many samples the middle is wanted differs from window to window"
    return None if p.size in (3, 5) else "networks are laid for windows of 3 and 5"


@median.method(
    "network",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: facts["image"].samples * (16.0 if p.size == 3 else 70.0),
    rates={"opencl": Rate(4e-4, 3.6e-11), "numpy": Rate(2e-4, 1.9e-9)},
    unfit=_network_unfit,
)
class Network:
    """Fixed exchanges: columns sorted once for all windows that share them, then extremes dropped."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _opencl("network", device, inputs, p)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _numpy(inputs, p)


@median.method(
    "bisect",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: facts["image"].samples * float(p.size**2),
    rates={"opencl": Rate(4e-4, 1.1e-9), "numpy": Rate(2e-4, 5e-9)},
)
class Bisect:
    """The bits of the median from the highest down, each by counting the samples below."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _opencl("bisect", device, inputs, p)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _numpy(inputs, p)
