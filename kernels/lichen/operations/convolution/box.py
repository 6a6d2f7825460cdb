"""Box mean: the mean of a rectangle around every pixel.

Truth: the mean of `width` x `height` samples of the image, continued by `border`. Where pixels are left out (`mask`,
`missing`), the mean of those that are not.

Methods:

* `running` adds every sample three times an axis, whatever the size: windows are joined from the end of one block and
  the beginning of the next, so that nothing is ever subtracted. A sum of n terms of one sign is right to n roundings of
  itself: it does not drift, turns no negative, and forgets a NaN that left the window.
* `table` takes four corners of a summed-area table. Its sums run over the whole image, and the corners cancel: the
  error it can make is that of the largest sum over the area of the window, whatever the window holds. `bits` is the
  table's precision: in float32 it is what many programs have, and turns light negative.
* `centred` does so in float32 less the mean of the image, which keeps the sums of noise small, but no worst case.

Sources: van Herk 1992 (see `windows`); Crow, Summed-area tables for texture mapping, SIGGRAPH 1984; Hensley et al.,
Fast summed-area table generation and its applications, Eurographics 2005, for taking off the mean.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned
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
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.convolution.missing import (
    MASK,
    Missing,
    check_mask,
    extent_without,
    leaves_out,
    renormalised,
    renormalised_error,
    renormalised_opencl,
)
from lichen.operations.convolution.stencil import continue_image, reach_of_values
from lichen.operations.convolution.windows import Combine, Window, windows_numpy, windows_opencl, windows_plain

MOST = 4095


class Parameters(OperationParameters):
    width: int = Field(5, ge=1, le=MOST, description="columns of the window", json_schema_extra={"unit": "px"})
    height: int = Field(5, ge=1, le=MOST, description="rows of the window", json_schema_extra={"unit": "px"})
    anchor: tuple[int, int] | None = Field(
        None, description="column and row of the window that lies over the output pixel; its middle if left out"
    )
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")

    @property
    def window(self) -> Window:
        return Window.of(self.width, self.height, self.anchor)


def check_anchor(anchor: tuple[int, int] | None, width: int, height: int) -> list[Flaw]:
    if anchor is None or (0 <= anchor[0] < width and 0 <= anchor[1] < height):
        return []
    return [Flaw("/parameters/anchor", f"must lie within {width} columns and {height} rows")]


def _magnitude(p: Parameters, facts: InputFacts) -> float:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    return max(abs(low), abs(high))


def running_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of each axis: the rounded 1 / n, the product and n additions."""
    magnitude = _magnitude(p, facts)
    rounding = 1.01 * (p.width + p.height + 6) * ROUNDING * magnitude
    if leaves_out(p.missing, facts):
        return renormalised_error(rounding, magnitude)
    return Error(rounding, "bound", rounding)


def running_work(p: Parameters, knob: float, facts: InputFacts) -> float:
    image = facts["image"]
    once = image.samples + 0.5 * image.channels * (image.width * p.height + image.height * p.width)
    return 2 * once if leaves_out(p.missing, facts) else once


def _table_error(p: Parameters, unit: float, summed: float, facts: InputFacts) -> Error:
    """Additions along both axes round sums over the whole image, of values up to `summed`; four meet in one result."""
    image, magnitude = facts["image"], _magnitude(p, facts)
    rows, columns, area = image.height + p.height, image.width + p.width, p.width * p.height
    rounding = 2 * ROUNDING * magnitude + 2.0**-50 * (rows + columns) * magnitude
    largest = 4.1 * (rows + columns + 3) * unit * rows * columns * summed / area
    typical = 2 * unit * (rows * columns * (rows + columns)) ** 0.5 * summed / area
    return Error(largest + rounding, "bound", rounding, min(largest, typical) + rounding)


def table_error(p: Parameters, bits: float, facts: InputFacts) -> Error:
    """Sums of the image as it is; in float32 they are rounded by as much as they hold, noise or not."""
    stated = _table_error(p, ROUNDING if bits < 53 else 2.0**-53, _magnitude(p, facts), facts)
    return dataclasses.replace(stated, typical=None) if bits < 53 else stated


def centred_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    return _table_error(p, ROUNDING, high - low, facts)


def table_work(p: Parameters, bits: float, facts: InputFacts) -> float:
    image = facts["image"]
    return image.channels * (image.height + p.height) * (image.width + p.width) * (2 if bits >= 53 else 1)


def _table_unfit(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    if leaves_out(p.missing, facts):
        return "pixels are left out; what little is left of a window must not drown in sums over the image"
    if image.extent.nonfinite:
        return "a table would spread NaN and infinity over the image"
    if (image.height + p.height) * (image.width + p.width) * _magnitude(p, facts) > 1e37:
        return "sums over the image would leave the range of float32"
    return None


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    single = p.width == p.height == 1 and not leaves_out(p.missing, facts)
    return "the window is one pixel" if single else None


def _result(p: Parameters, facts: InputFacts) -> Facts:
    """A mean of the input's values and of what lies beyond a constant border."""
    image = facts["image"]
    low, high = reach_of_values(image, p.border, p.value)
    return dataclasses.replace(image, extent=extent_without(facts, Extent(low, high, image.extent.nonfinite)))


def _one_bad() -> dict[str, Array]:
    pixels = np.full((40, 44, 1), 0.5, np.float32)
    pixels[20, 21] = np.nan
    return {"image": pixels}


def _touches_35(inputs: object, pixels: Array) -> str | None:
    spoilt = int(np.count_nonzero(~np.isfinite(pixels)))
    return None if spoilt == 35 else f"{spoilt} pixels are not finite, not 35"


def _after_highlights() -> dict[str, Array]:
    pixels = np.zeros((64, 512, 1), np.float32)
    pixels[:, :40] = 1e7
    pixels[:, 100:] = 1e-3
    return {"image": pixels}


def _no_trace(inputs: object, pixels: Array) -> str | None:
    if pixels.min() < 0:
        return "negative light"
    return None if np.abs(pixels[:, 120:] - 1e-3).max() <= 1e-8 else "a highlight left its trace along the line"


box = Operation(
    name="box",
    family="convolution",
    summary="Mean of a rectangle around every pixel, in time that does not grow with it.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"), MASK),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: p.window.footprint(p.border),
    identity=_identity,
    result=_result,
    check=lambda p, facts: check_anchor(p.anchor, p.width, p.height) + check_mask(facts),
    examples=(
        {"width": 5, "height": 3},
        {"width": 20, "height": 31, "border": "reflect101"},
        {"width": 4, "height": 7, "anchor": [0, 6], "border": "constant", "value": 0.25},
        {"width": 301, "height": 2, "border": "wrap"},
        {"width": 1, "height": 9, "border": "clamp"},
        {"width": 9, "height": 7, "missing": "inside"},
    ),
    hard_cases=(
        HardCase(
            name="one NaN",
            why="a running sum never forgets it: 230 pixels of OpenCV's, 2116 of SciPy's",
            inputs=_one_bad,
            parameters={"width": 7, "height": 5},
            holds=_touches_35,
        ),
        HardCase(
            name="dark after highlights",
            why="what enters a running sum and leaves it again leaves its rounding behind, of either sign",
            inputs=_after_highlights,
            parameters={"width": 9, "height": 3},
            holds=_no_trace,
            methods=("running",),
        ),
    ),
    description=__doc__ or "",
)


@box.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    def mean(pixels: Array, border: Border, value: float) -> Array:
        return windows_plain(pixels, p.window, Combine.MEAN, border, value)

    if leaves_out(p.missing, inputs):
        return renormalised(inputs, p.missing, p.border, p.value, mean)
    return mean(inputs["image"].pixels, p.border, p.value)


@box.method(
    "running",
    scratch=1.1,
    error=running_error,
    work=running_work,
    rates={"opencl": Rate(4e-4, 1.5e-9), "numpy": Rate(2e-4, 3e-8)},
)
class Running:
    """Windows joined from the end of one block and the beginning of the next; nothing is subtracted."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        def mean(pixels: Array, border: Border, value: float) -> Array:
            return windows_opencl(device, pixels, p.window, Combine.MEAN, border, value)

        if leaves_out(p.missing, inputs):
            return renormalised_opencl(device, inputs, p.missing, p.border, p.value, mean)
        return mean(inputs["image"].pixels, p.border, p.value)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        def mean(pixels: Array, border: Border, value: float) -> Array:
            return windows_numpy(pixels, p.window, Combine.MEAN, border, value)

        if leaves_out(p.missing, inputs):
            return renormalised(inputs, p.missing, p.border, p.value, mean)
        return mean(inputs["image"].pixels, p.border, p.value)


def _from_corners(inputs: Inputs, p: Parameters, kind: type[np.floating[Any]], *, centred: bool) -> Array:
    """Means from a table of that precision, of the image or of the image less its mean."""
    at = p.window
    rows, columns = (at.top, at.height - 1 - at.top), (at.left, at.width - 1 - at.left)
    around = continue_image(inputs["image"].pixels, rows, columns, p.border, p.value).astype(kind)
    mean = np.zeros(around.shape[2], kind)
    if centred:
        mean = around.mean(axis=(0, 1), dtype=np.float64).astype(kind)
        around -= mean
    sums = np.zeros((around.shape[0] + 1, around.shape[1] + 1, around.shape[2]), kind)
    np.cumsum(around, axis=0, out=sums[1:, 1:])
    np.cumsum(sums, axis=1, out=sums)
    h, w = at.height, at.width
    total = (sums[h:, w:] - sums[:-h, w:]) - (sums[h:, :-w] - sums[:-h, :-w])
    return aligned(total / kind(h * w) + mean)


@box.method(
    "table",
    scratch=10.2,
    knob=Knob("bits", (24.0, 53.0), "precision of the table: float32 or float64", 24, 53),
    error=table_error,
    work=table_work,
    rates={"opencl": Rate(2e-4, 1.2e-8), "numpy": Rate(2e-4, 1.2e-8)},
    unfit=_table_unfit,
)
class Table:
    """Four corners of a summed-area table, on the processor."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, bits: float) -> Array:
        return Table.numpy(inputs, p, bits)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, bits: float) -> Array:
        return _from_corners(inputs, p, np.float64 if bits >= 53 else np.float32, centred=False)


@box.method(
    "centred",
    scratch=5.2,
    error=centred_error,
    work=lambda p, knob, facts: 1.1 * table_work(p, 24, facts),
    rates={"opencl": Rate(2e-4, 1.2e-8), "numpy": Rate(2e-4, 1.2e-8)},
    unfit=_table_unfit,
)
class Centred:
    """Four corners of a summed-area table of the image less its mean, in float32, on the processor."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Centred.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _from_corners(inputs, p, np.float32, centred=True)
