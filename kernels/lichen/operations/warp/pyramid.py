"""Pyramid: an image halved again and again.

Truth: every level has half the rows and columns of the one before, rounded up. Sample i of a level lies between samples
2 i and 2 i + 1 of the one before and is the weighted mean of those around, along rows and columns, by `kernel`:

* box: [1 1] / 2. Nothing rings, much aliases.
* binomial: [1 3 3 1] / 8.
* kaiser: sinc(x / 2) under a Kaiser window of alpha 4 over 8 samples: the sharpest; it rings by a few hundredths.

An odd side goes on by `border`. The result is level `level`, or with `layout=atlas` all of them: the image itself, and
to its right the others from the largest to the one of `level`, one below the other, the rest of the area 0.

The kernel is part of what is asked for, and every method computes it: float32 throughout (`single`), or each level from
the unrounded one before it (`double`).

Source: Burt and Adelson, The Laplacian pyramid as a compact image code, IEEE Trans. Communications 31, 1983.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache, lru_cache

import numpy as np
from pydantic import Field

from lichen.image import Alpha
from lichen.memory import Array, aligned
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operation import (
    ROUNDING,
    WHOLE,
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
    Rate,
)
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.warp import cases
from lichen.operations.warp.prediction import Size, check_size, result_facts
from lichen.operations.warp.resize import launched
from lichen.operations.warp.separable import Axis


class Halving(StrEnum):
    """The weights of a halving."""

    BOX = "box"
    BINOMIAL = "binomial"
    KAISER = "kaiser"


class Layout(StrEnum):
    """What the result holds."""

    LEVEL = "level"
    ATLAS = "atlas"


class Parameters(OperationParameters):
    kernel: Halving = Field(Halving.BINOMIAL, description="the weights of a halving")
    level: int = Field(1, ge=0, le=15, description="how often the image is halved; no further than to one pixel")
    layout: Layout = Field(Layout.LEVEL, description="that level alone, or all of them beside one another")
    border: Border = Field(Border.CLAMP, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")


@cache
def taps(kernel: Halving) -> Array:
    """Symmetric weights of an even number of samples; their sum is 1."""
    if kernel is Halving.BOX:
        return np.array([0.5, 0.5])
    if kernel is Halving.BINOMIAL:
        binomial: Array = np.array([1, 3, 3, 1]) / 8
        return binomial
    x = np.arange(8) - 3.5
    weights: Array = np.sinc(x / 2) * np.i0(4 * np.sqrt(1 - np.square(x / 4)))
    weights /= weights.sum()
    return weights


@lru_cache(maxsize=64)
def halving(size: int, kernel: Halving, border: Border) -> Axis:
    """From `size` samples to half as many; a single one stays."""
    if size == 1:
        return Axis(np.zeros((1, 1), np.int32), np.ones((1, 1)), np.zeros(1))
    weights = taps(kernel)
    first = 2 * np.arange(-(-size // 2)) - (len(weights) // 2 - 1)
    at = continued(first[:, np.newaxis] + np.arange(len(weights)), size, border)
    inside = np.where(at == OUTSIDE, 0.0, weights)
    constant = np.where(at == OUTSIDE, weights, 0.0).sum(axis=1)
    # What is outside stands for the first sample inside, with weight 0.
    own = np.minimum(2 * np.arange(len(at)), size - 1)[:, np.newaxis]
    return Axis(np.where(at == OUTSIDE, own, at).astype(np.int32), inside, constant)


def sizes(p: Parameters, image: Facts) -> list[Size]:
    """Width and height of every level that is made."""
    made = [(image.width, image.height)]
    for _ in range(p.level):
        if made[-1] == (1, 1):
            break
        width, height = made[-1]
        made.append((-(-width // 2), -(-height // 2)))
    return made


def size_of(p: Parameters, facts: InputFacts) -> Size:
    levels = sizes(p, facts["image"])
    if p.layout is Layout.LEVEL or len(levels) == 1:
        return levels[-1]
    return levels[0][0] + levels[1][0], max(levels[0][1], sum(height for _, height in levels[1:]))


def assembled(levels: list[Array], size: Size) -> Array:
    """The levels in one image."""
    out = np.zeros((size[1], size[0], levels[0].shape[2]), levels[0].dtype)
    height, width, _ = levels[0].shape
    out[:height, :width] = levels[0]
    top = 0
    for level in levels[1:]:
        out[top : top + level.shape[0], width : width + level.shape[1]] = level
        top += level.shape[0]
    return out


def halved(pixels: Array, p: Parameters) -> Array:
    """One level from the one before, in its precision."""
    across, down = (halving(side, p.kernel, p.border) for side in (pixels.shape[1], pixels.shape[0]))
    return across.apply(down.apply(pixels, p.value).swapaxes(0, 1), p.value).swapaxes(0, 1)


def _in_numpy(inputs: Inputs, p: Parameters, pixels: Array) -> Array:
    facts = Facts.sized(inputs["image"])
    levels = [pixels]
    for _ in sizes(p, facts)[1:]:
        levels.append(halved(levels[-1], p))
    return levels[-1] if p.layout is Layout.LEVEL else assembled(levels, size_of(p, {"image": facts}))


def _gain(p: Parameters) -> float:
    return float(np.abs(taps(p.kernel)).sum()) ** 2


def _range(p: Parameters, image: Facts) -> tuple[float, float]:
    low, high = image.extent.low, image.extent.high
    return (min(low, p.value), max(high, p.value)) if p.border is Border.CONSTANT else (low, high)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    atlas = p.layout is Layout.ATLAS
    widened = image if not atlas else Facts(
        image.height, image.width, image.channels, image.space, image.alpha,
        type(image.extent)(min(image.extent.low, 0.0), max(image.extent.high, 0.0), image.extent.nonfinite),
    )  # fmt: skip
    return result_facts(p, {"image": widened}, size_of(p, facts), _gain(p) ** (len(sizes(p, image)) - 1))


def _error(steps: float, p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of every level: the rounded weights, products and sums of both passes, or one rounding at the end."""
    low, high = _range(p, facts["image"])
    levels, taken = len(sizes(p, facts["image"])) - 1, len(taps(p.kernel))
    growth = _gain(p) ** levels
    least = 1.01 * ROUNDING * growth * max(abs(low), abs(high)) * (1 + steps * levels * (2 * taken + 4))
    return Error(least, "bound", least)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    return "there is nothing to halve" if len(sizes(p, image)) == 1 else None


pyramid = Operation(
    name="pyramid",
    family="warp",
    summary="Halves an image again and again, by box, binomial or Kaiser weights: one level, or all of them.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, by: by * max(1.0, _gain(p) ** (len(sizes(p, facts["image"])) - 1)),
    implied=lambda p, facts: "the result has another size than the image",
    identity=_identity,
    check=lambda p, facts: check_size(facts["image"], size_of(p, facts)),
    examples=(
        {"level": 2},
        {"kernel": "kaiser", "level": 3, "layout": "atlas", "border": "reflect"},
        {"kernel": "box", "border": "constant", "value": 0.4},
    ),
    hard_cases=(
        HardCase(
            name="to one pixel",
            why="odd sides at every level, and sides of one",
            inputs=cases.constant,
            parameters={"level": 15, "kernel": "kaiser"},
            holds=cases.stays_constant,
        ),
    ),
)


@pyramid.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _in_numpy(inputs, p, inputs["image"].pixels)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return facts["image"].samples * len(taps(p.kernel)) * 1.5


@pyramid.method(
    "single",
    error=lambda p, knob, facts: _error(1.0, p, knob, facts),
    work=_work,
    rates={"opencl": Rate(6e-4, 4e-10), "numpy": Rate(3e-4, 2e-9)},
)
class Single:
    """Every level from the one before, in float32."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = Facts.sized(inputs["image"])
        levels = [aligned(inputs["image"].pixels)]
        with device.session() as session:
            for _ in sizes(p, image)[1:]:
                levels.append(_halved(device, session, levels[-1], p))
        return levels[-1] if p.layout is Layout.LEVEL else aligned(assembled(levels, size_of(p, {"image": image})))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_in_numpy(inputs, p, inputs["image"].pixels.astype(np.float32, copy=False)))


def _halved(device: Device, session: Session, pixels: Array, p: Parameters) -> Array:
    tall, wide, _ = pixels.shape
    across, down = halving(wide, p.kernel, p.border), halving(tall, p.kernel, p.border)
    return launched(device, session, pixels, across, down, p.value)


@pyramid.method(
    "double",
    error=lambda p, knob, facts: _error(0.0, p, knob, facts),
    work=_work,
    rates={"opencl": Rate(3e-4, 4e-9), "numpy": Rate(3e-4, 4e-9)},
)
class Double:
    """Every level from the unrounded one before, on the processor, rounded once."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Double.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_in_numpy(inputs, p, inputs["image"].pixels.astype(np.float64)), np.float32)
