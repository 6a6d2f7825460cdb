"""Equalise: every range of values as wide as it is often taken.

Truth: the values from low to high are counted in equal bins; what lies outside is counted at the ends. With C the
cumulative share of the counts, 0 at low and 1 at high and linear inside a bin, the result is low + (high - low) C(x),
so that its own histogram is flat as far as bins allow. `strength` goes part of the way from the value itself, limited
to [low, high]. NaN stays and is not counted, nor are infinities, which go to the ends, nor pixels without coverage;
where nothing is counted nothing changes but for the limits.

All colour channels share one histogram, which keeps grey as it is, or each has its own. Counting is decided in float64
in a stated order, by the definition as by the methods, so that no value falls into another bin: the only error is the
rounding of the result.

Source: R. C. Gonzalez and R. E. Woods, Digital Image Processing, 4th edition, section 3.3.
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    WHOLE,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.tone.pointwise import blockwise, spanned

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lichen.opencl.device import Device

PARTS = 16
"""Histograms that are counted beside each other."""


class Over(StrEnum):
    """What shares a histogram."""

    TOGETHER = "together"
    EACH = "each"


class Parameters(OperationParameters):
    bins: int = Field(256, ge=2, le=65536)
    """how many equal ranges are counted"""
    low: float = Field(0.0, ge=-1e6, le=1e6)
    """where the first bin begins"""
    high: float = Field(1.0, ge=-1e6, le=1e6)
    """where the last bin ends; above low"""
    over: Over = Over.TOGETHER
    """together: all colour channels in one histogram; each: one for every channel"""
    strength: float = Field(1.0, ge=0, le=1)
    """how far from the value itself, limited, to the equalised one"""

    @property
    def scale(self) -> float:
        return self.bins / (self.high - self.low)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    least = 1e-5 * max(abs(p.low), abs(p.high), 1e-6)
    return [] if p.high - p.low >= least else [Flaw("/parameters/high", f"must be above low by {least:g} at least")]


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = 1.01 * ROUNDING * max(abs(p.low), abs(p.high))
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    return dataclasses.replace(image, extent=spanned(image, p.low, p.high, _error(p, 0.0, facts).value))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Any error may move any value to another bin."""
    image = facts["image"]
    moved = p.high - p.low
    if image.alpha is Alpha.STRAIGHT:
        moved = moved * image.extent.magnitude + max(abs(p.low), abs(p.high)) * error
    return max(moved, error)


def _row(*values: float) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.array(values, dtype=np.float32).reshape(1, -1, 1)}


def _plain(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.isfinite(pixels).all() and np.ptp(pixels) == 0 else "a plain ground did not stay plain"


equalise = Operation(
    name="equalise",
    family="tone",
    summary="Equalises the histogram, of all colour channels together or of each.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {},
        {"bins": 1024, "over": "each", "strength": 0.6},
        {"bins": 16, "low": 0.1, "high": 0.7},
        {"bins": 65536, "low": -1, "high": 2, "over": "each"},
    ),
    hard_cases=(
        HardCase(
            name="what is not finite",
            why="NaN as an integer is any bin, and infinities outweigh the picture",
            inputs=_row(np.nan, np.inf, -np.inf, 0.5, 1.0),
            parameters={"bins": 2, "low": 0, "high": 1},
            holds=lambda inputs, pixels: None if np.isnan(pixels[0, 0, 0]) and pixels[0, 1, 0] == 1 else "NaN or inf",
        ),
        HardCase(
            name="plain ground",
            why="the lowest count is subtracted and the range divided by nothing",
            inputs=lambda: {"image": np.full((9, 9, 3), 0.3, np.float32)},
            parameters={},
            holds=_plain,
        ),
        HardCase(
            name="nothing to count",
            why="the counts are divided by their sum, which is 0",
            inputs=lambda: {"image": np.full((3, 3, 1), np.nan, np.float32)},
            parameters={},
            holds=lambda inputs, pixels: None if np.isnan(pixels).all() else "NaN became a value",
        ),
    ),
)


def _place(x: Array, p: Parameters) -> Array:
    return np.clip((x.astype(np.float64) - p.low) * p.scale, 0, p.bins)


def _counts(image: Image, p: Parameters) -> Array:
    """Shape (histograms, bins): how often each bin is taken."""
    colours = image.pixels[..., : image.colours].reshape(-1, image.colours)
    if image.alpha is not Alpha.NONE:
        colours = colours[image.pixels[..., -1].reshape(-1) > 0]
    each = list(colours.T) if p.over is Over.EACH else [colours.reshape(-1)]
    rows = []
    for values in each:
        finite = values[np.isfinite(values)]
        bins = np.minimum(_place(finite, p).astype(np.int64), p.bins - 1)
        rows.append(np.bincount(bins, minlength=p.bins))
    return np.array(rows)


def _cumulative(counts: Array, p: Parameters) -> Array:
    """Shape (histograms, bins + 1): the share of the counts below each edge; that of the bins where there is none."""
    sums = np.concatenate([np.zeros((len(counts), 1)), np.cumsum(counts, axis=1, dtype=np.float64)], axis=1)
    total = sums[:, -1:]
    shares: Array = np.where(total > 0, sums / np.where(total > 0, total, 1), np.arange(p.bins + 1) / p.bins)
    return shares


def _equalised(x: Array, cumulative: Array, p: Parameters) -> Array:
    """float64, for x of shape (..., colours)."""
    place = np.where(np.isnan(x), 0, _place(x, p))
    at = np.minimum(place.astype(np.int64), p.bins - 1)
    which = np.arange(x.shape[-1]) if p.over is Over.EACH else 0
    low, high = cumulative[which, at], cumulative[which, at + 1]
    rank, share = low + (place - at) * (high - low), place / p.bins
    value: Array = p.low + (p.high - p.low) * (share + p.strength * (rank - share))
    value[np.isnan(x)] = np.nan
    return value


@equalise.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    result, x = image.pixels.copy(), image.pixels[..., : image.colours]
    result[..., : image.colours] = _equalised(x, _cumulative(_counts(image, p), p), p)
    return result


@equalise.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(5e-4, 2.5e-9), "numpy": Rate(1e-3, 1.1e-8)},
)
class Exact:
    """Counted in parts that are added up, then looked up, in doubles."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        image = inputs["image"]
        pixels = aligned(image.pixels)
        out, count = aligned_empty(pixels.shape), image.height * image.width
        numbers = aligned(np.array([p.low, p.high, p.scale, p.strength]), np.float64)
        each = p.over is Over.EACH
        defines = {"CHANNELS": image.channels, "COLOURS": image.colours, "EACH": int(each)}
        counts = aligned_empty((PARTS, image.colours if each else 1, p.bins), np.uint32)
        counts[...] = 0
        share = -(-count // PARTS)
        with device.session() as session:
            session.launch(
                "tone/equalise.cl", "count", (PARTS,),
                pixels, session.readwrite(counts), np.int32(p.bins), numbers, np.uint64(share), np.uint64(count),
                local=(1,), defines=defines,
            )  # fmt: skip
        cumulative = aligned(_cumulative(counts.sum(axis=0, dtype=np.uint64), p), np.float64)
        with device.session() as session:
            session.launch(
                "tone/equalise.cl", "apply", (-(-count // 64),),
                pixels, session.write(out), cumulative, np.int32(p.bins), numbers, np.uint64(count),
                defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        cumulative = _cumulative(_counts(image, p), p)
        return blockwise(image, lambda x: _equalised(x, cumulative, p))
