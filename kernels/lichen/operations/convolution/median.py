"""Median: the middle value of a square window around every pixel, channel by channel.

Truth: of the `size` x `size` samples of the image, continued by `border`, the one that as many exceed as lie below. A
window that holds a NaN has no middle: its result is NaN.

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
from lichen.memory import Array, aligned, aligned_empty
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
from lichen.operations.convolution.stencil import STAGE, Stencil, apart, banded, continue_image, gathering, laid_out

LINE, MOST_CHANNELS = 2048, 64
"""Floats of a line of sorted columns, and channels, at most."""


class Parameters(OperationParameters):
    size: Literal[1, 3, 5, 7, 9, 11, 13, 15] = Field(
        3, description="rows and columns of the window, odd", json_schema_extra={"unit": "px"}
    )
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")

    @property
    def beyond(self) -> float:
        """`value` as pixels can hold it, so that what is chosen among them is exact."""
        return float(np.float32(self.value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if p.border is not Border.CONSTANT:
        return image
    extent = Extent(min(image.extent.low, p.beyond), max(image.extent.high, p.beyond), image.extent.nonfinite)
    return dataclasses.replace(image, extent=extent)


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


median = Operation(
    name="median",
    family="convolution",
    summary="Middle value of a square window: removes outliers and keeps edges.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data", channels=(1, MOST_CHANNELS)),),
    light=Light.STORED,
    footprint=lambda p, facts: Footprint(p.size // 2, p.size // 2, wraps=p.border is Border.WRAP),
    identity=lambda p, facts: "the window is one pixel" if p.size == 1 else None,
    result=_result,
    examples=(
        {},
        {"size": 5, "border": "reflect101"},
        {"size": 3, "border": "constant", "value": 0.0},
        {"size": 5, "border": "wrap"},
        {"size": 9, "border": "clamp"},
    ),
    hard_cases=(
        HardCase("infinite outliers", "a mean would be NaN; a median does not see them", _salt, {"size": 3}, _calm),
        HardCase(
            "one NaN", "comparing with NaN leaves it, or the number, by chance", _one_nan, {"size": 5}, _nan_in_25
        ),
    ),
    description=__doc__ or "",
)


@median.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    reach = (p.size // 2, p.size // 2)
    around = continue_image(inputs["image"].pixels, reach, reach, p.border, p.beyond)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.median(_windows(around, p.size), axis=-1))


def _windows(around: Array, size: int) -> Array:
    """All windows of the image, (height, width, channels, size^2), a copy."""
    seen = sliding_window_view(around, (size, size), axis=(0, 1))
    return np.array(seen.reshape(*seen.shape[:3], size * size))


def _opencl(kernel: str, device: Device, inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    height, width, channels = image.pixels.shape
    window = Stencil(np.ones((p.size, p.size)), p.size // 2, p.size // 2)
    tile, stride, capacity = laid_out(p.size, p.size, channels)
    down, beside = gathering(image.pixels.shape, window, tile, stride, p.border)
    out, tiles = aligned_empty(image.pixels.shape), -(-width * channels // tile)
    band = banded(height, tiles, p.size)
    size = (np.int32(p.size),) if kernel == "bisect" else ()
    defines = {"SIZE": p.size if kernel == "network" else 0, "STAGE": STAGE, "LINE": LINE}
    with device.session() as session:
        if session.in_step:
            apart(session, "median", image.pixels, out, window, p.border, p.beyond, np.int32(p.size))
            return out
        session.launch(
            "convolution/median.cl", kernel, (tiles, -(-height // band)),
            image.pixels, down, beside, session.write(out), np.int32(height), np.int32(width * channels),
            np.int32(channels), np.int32(stride), np.int32(band), np.int32(tile), np.int32(capacity),
            np.float32(p.beyond), *size, local=(1, 1),
            defines={**defines, "NANS": int(image.extent.nonfinite > 0)},
        )  # fmt: skip
    return out


def _numpy(inputs: Inputs, p: Parameters) -> Array:
    """The middle of every window by selection, some rows at a time."""
    pixels, reach = inputs["image"].pixels, (p.size // 2, p.size // 2)
    around = continue_image(pixels, reach, reach, p.border, p.beyond)
    out = aligned_empty(pixels.shape)
    rows = max(1, (1 << 22) // (pixels[0].size * p.size**2))
    for y in range(0, len(pixels), rows):
        seen = _windows(around[y : y + rows + p.size - 1], p.size)
        bad = np.isnan(seen).any(axis=-1)
        seen.partition(p.size**2 // 2, axis=-1)
        out[y : y + rows] = np.where(bad, np.float32(np.nan), seen[..., p.size**2 // 2])
    return aligned(out)


@median.method(
    "network",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: facts["image"].samples * (16.0 if p.size == 3 else 70.0),
    rates={"opencl": Rate(4e-4, 3.6e-11), "numpy": Rate(2e-4, 1.9e-9)},
    unfit=lambda p, facts: None if p.size in (3, 5) else "networks are laid for windows of 3 and 5",
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
