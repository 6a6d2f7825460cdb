"""Quantise: few levels, with or without dither.

Truth, for every colour channel, coverage untouched: with v = (x - low) ((levels - 1) / (high - low)), limited to
[0, levels - 1], the level is q = floor(v + threshold) and the result low + q (high - low) / (levels - 1).

* none: the threshold is 1/2.
* bayer: it comes from an ordered matrix of `side`, laid out over the image.
* blue_noise: it comes from a mask without low frequencies, 64 x 64.
* error_diffusion: it is 1/2, and what a pixel lost is handed on to its neighbours to come, row by row from the top
  left, by the weights of `diffusion`. An outer neighbour gets nothing, and its share is lost.

`strength` draws the thresholds towards 1/2, or scales what is handed on. One mask serves all channels: grey stays grey.
NaN stays and hands nothing on; infinities go to the ends.

Everything is decided in float64 in a stated order, by the definition as by the methods: a difference in the last place
would move a sample by a whole level, and after error diffusion all that follow. The only error is the result's rounding
to float32.

Sources: see thresholds.py.
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    WHOLE,
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
from lichen.operations.tone.pointwise import spanned
from lichen.operations.tone.thresholds import REACH, WEIGHTS, bayer, blue_noise

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from lichen.opencl.device import Device


class Dither(StrEnum):
    """How rounding errors are spread."""

    NONE = "none"
    BAYER = "bayer"
    BLUE_NOISE = "blue_noise"
    ERROR_DIFFUSION = "error_diffusion"


class Diffusion(StrEnum):
    """To which neighbours errors go."""

    FLOYD_STEINBERG = "floyd_steinberg"
    JARVIS = "jarvis"
    STUCKI = "stucki"
    ATKINSON = "atkinson"


class Parameters(OperationParameters):
    levels: int = Field(2, ge=2, le=65536)
    """how many values remain, evenly spaced from low to high"""
    low: float = Field(0.0, ge=-1e6, le=1e6)
    """the lowest level"""
    high: float = Field(1.0, ge=-1e6, le=1e6)
    """the highest level; above low"""
    dither: Dither = Dither.BLUE_NOISE
    """none, an ordered matrix, a blue-noise mask, or error diffusion"""
    side: Literal[2, 4, 8, 16] = 8
    """of the ordered matrix, in pixels, for dither=bayer"""
    diffusion: Diffusion = Diffusion.FLOYD_STEINBERG
    """the weights, for dither=error_diffusion"""
    strength: float = Field(1.0, ge=0, le=1)
    """how much of the dither: 0 is none"""

    @property
    def step(self) -> float:
        return (self.high - self.low) / (self.levels - 1)

    @property
    def scale(self) -> float:
        return (self.levels - 1) / (self.high - self.low)

    @property
    def diffused(self) -> bool:
        return self.dither is Dither.ERROR_DIFFUSION


LANES = 16
"""Samples of a vector."""


def mask(p: Parameters) -> Array:
    """The thresholds that are laid out over the image, float64."""
    thresholds = np.full((1, 1), 0.5)
    if p.dither is Dither.BAYER:
        thresholds = bayer(p.side)
    elif p.dither is Dither.BLUE_NOISE:
        thresholds = blue_noise()
    return aligned(0.5 + p.strength * (thresholds - 0.5), np.float64)


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
    """Levels jump: any error may move a sample by one more; after diffusion, any level may become any other."""
    step, image = p.step, facts["image"]
    seen = (1 + image.extent.magnitude) * error if image.alpha is Alpha.STRAIGHT else error
    moved = p.high - p.low if p.diffused else min(step * math.ceil(seen / step + 1), p.high - p.low)
    if image.alpha is Alpha.STRAIGHT:
        moved = moved * image.extent.magnitude + max(abs(p.low), abs(p.high)) * error
    return max(moved, error)


# ------------------------------------------------------------------------------------------------------- hard cases


def _spoilt() -> Mapping[str, Any]:
    pixels = np.full((9, 9, 1), 0.4, np.float32)
    pixels[4, 4], pixels[0, 0], pixels[0, 1] = np.nan, np.inf, -np.inf
    return {"image": pixels}


def _stays(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    if not np.isnan(pixels[4, 4, 0]) or np.count_nonzero(np.isnan(pixels)) != 1:
        return "NaN moved"
    return None if set(np.unique(pixels[np.isfinite(pixels)])) <= {0.0, 1.0} else "not a level"


def _on_levels(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    worst = float(np.abs(pixels - inputs["image"]).max())
    return None if worst < 1e-6 else f"a level moved by {worst}"


def _mean(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    off = abs(float(pixels.mean(dtype=np.float64)) - 0.3)
    return None if off < 4e-3 else f"the mean is off by {off}"


quantise = Operation(
    name="quantise",
    family="tone",
    summary="Rounds to few levels, with ordered, blue-noise or error-diffusion dither.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: _footprint(p),
    implied=lambda p, facts: {} if p.dither is Dither.NONE else "the dither depends on where a pixel lies",
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"levels": 4, "dither": "blue_noise"},
        {"levels": 2, "dither": "error_diffusion"},
        {"levels": 5, "dither": "none"},
        {"levels": 3, "dither": "bayer", "side": 4, "strength": 0.8},
        {"levels": 4, "dither": "error_diffusion", "diffusion": "stucki", "low": 0.1, "high": 0.8},
        {"levels": 2, "dither": "error_diffusion", "diffusion": "atkinson", "strength": 0.9},
        {"levels": 256, "dither": "blue_noise"},
    ),
    hard_cases=(
        HardCase(
            name="one bad pixel under error diffusion",
            why="NaN is handed on, and everything below and to the right turns NaN",
            inputs=_spoilt,
            parameters={"dither": "error_diffusion"},
            holds=_stays,
        ),
        HardCase(
            name="values that lie on levels",
            why="a threshold of exactly 0 or 1 moves them",
            inputs=lambda: {"image": (np.arange(256, dtype=np.float32) / 255).reshape(16, 16, 1)},
            parameters={"levels": 256, "dither": "blue_noise"},
            holds=_on_levels,
        ),
        HardCase(
            name="the mean of a plain ground is kept",
            why="thresholds that are not centred darken or brighten it",
            inputs=lambda: {"image": np.full((128, 128, 1), 0.3, np.float32)},
            parameters={"levels": 2, "dither": "error_diffusion"},
            holds=_mean,
        ),
    ),
)


def _footprint(p: Parameters) -> Footprint:
    return WHOLE if p.diffused and p.strength else POINTWISE


# ------------------------------------------------------------------------------------------------------------ truth


def _scaled(x: Array, p: Parameters) -> Array:
    return np.clip((x.astype(np.float64) - p.low) * p.scale, 0, p.levels - 1)


def _rounded(v: Array, thresholds: Array | float, p: Parameters) -> Array:
    return np.clip(np.floor(v + thresholds), 0, p.levels - 1)


def _placed(q: Array, p: Parameters) -> Array:
    return p.low + q * p.step


def _ordered(x: Array, p: Parameters) -> Array:
    thresholds = mask(p)
    side = len(thresholds)
    laid = np.tile(thresholds, (-(-x.shape[0] // side), -(-x.shape[1] // side)))[: x.shape[0], : x.shape[1], None]
    return np.where(np.isnan(x), x, _placed(_rounded(_scaled(x, p), laid, p), p))


@quantise.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Error diffusion pixel by pixel, as it is defined."""
    image = inputs["image"]
    result = image.pixels.copy()
    x = image.pixels[..., : image.colours]
    if not p.diffused:
        result[..., : image.colours] = _ordered(x, p)
        return result
    scaled = _scaled(x, p)
    errors = np.zeros((image.height + REACH, image.width + 2 * REACH, image.colours))
    taps = [(int(dx), int(dy), float(weight)) for dx, dy, weight in WEIGHTS[p.diffusion]]
    for row in range(image.height):
        for column in range(image.width):
            received = np.zeros(image.colours)
            for dx, dy, weight in taps:
                received += errors[row + REACH + dy, column + REACH + dx] * weight
            v = scaled[row, column] + received
            q = _rounded(v, 0.5, p)
            lost = np.isnan(x[row, column])
            result[row, column, : image.colours] = np.where(lost, x[row, column], _placed(q, p))
            errors[row + REACH, column + REACH] = np.where(lost, 0, (v - q) * p.strength)
    return result


# ---------------------------------------------------------------------------------------------------------- methods


@quantise.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (len(WEIGHTS[p.diffusion]) if p.diffused else 1.0),
    rates={"opencl": Rate(3e-4, 2e-9), "numpy": Rate(1e-3, 1.2e-8)},
)
class Exact:
    """The definition in doubles. Error diffusion runs channel beside channel with OpenCL; in NumPy the pixels of a
    slanted line, which do not depend on each other, go together."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        image = inputs["image"]
        pixels = aligned(image.pixels)
        out = aligned_empty(pixels.shape)
        numbers = aligned(np.array([p.low, p.step, p.levels - 1, p.scale, p.strength]), np.float64)
        size = (np.int32(image.width), np.int32(image.height))
        coverage = image.channels if image.alpha is not Alpha.NONE else 0
        defines = {"CHANNELS": image.channels, "COLOURS": image.colours, "COVERAGE": coverage}
        with device.session() as session:
            if p.diffused:
                errors = aligned_empty((image.channels, 3, image.width + 4), np.float64)
                errors[...] = 0
                taps = aligned(WEIGHTS[p.diffusion], np.float64)
                session.launch(
                    "tone/quantise.cl", "diffused", (image.channels,),
                    pixels, session.write(out), session.readwrite(errors), taps, np.int32(len(taps)), numbers, *size,
                    local=(1,), defines=defines,
                )  # fmt: skip
            else:
                thresholds = _laid_out(mask(p), image.channels)
                row = image.width * image.channels
                session.launch(
                    "tone/quantise.cl", "ordered", (-(-row // LANES), image.height),
                    pixels, session.write(out), thresholds, np.int32(len(thresholds)), numbers, np.int32(row), size[1],
                    defines=defines,
                )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned_empty(image.pixels.shape)
        x = image.pixels[..., : image.colours]
        out[..., image.colours :] = image.pixels[..., image.colours :]
        out[..., : image.colours] = _slanted(image, p) if p.diffused else _ordered(x, p)
        return out


def _laid_out(thresholds: Array, channels: int) -> Array:
    """The thresholds of every sample of a row, and the first ones again, so that sixteen begin anywhere."""
    period = channels * len(thresholds)
    return aligned(thresholds[:, np.arange(period + LANES) % period // channels], np.float64)


def _slanted(image: Image, p: Parameters) -> Array:
    """Pixels with the same x + 3 y depend on earlier ones only, as no weight reaches farther than two columns."""
    x = image.pixels[..., : image.colours]
    scaled, missing = _scaled(x, p), np.isnan(x)
    errors = np.zeros((image.height + REACH, image.width + 2 * REACH, image.colours))
    levels = np.empty(x.shape)
    slant = REACH + 1
    for line in range(image.width + slant * (image.height - 1)):
        first = max(0, -(-(line - image.width + 1) // slant))
        rows = np.arange(first, min(image.height - 1, line // slant) + 1)
        columns = line - slant * rows
        received = np.zeros((len(rows), image.colours))
        for dx, dy, weight in WEIGHTS[p.diffusion]:
            received += errors[rows + REACH + int(dy), columns + REACH + int(dx)] * weight
        v = scaled[rows, columns] + received
        q = _rounded(v, 0.5, p)
        levels[rows, columns] = q
        errors[rows + REACH, columns + REACH] = np.where(missing[rows, columns], 0, (v - q) * p.strength)
    return np.where(missing, x, _placed(levels, p))
