"""What `convolve` is told, and what its methods are predicted to cost and to be wrong by.

Channels may have kernels of their own; everything here is then said of each channel by itself (`singles`), and the
worst or the sum of it of the whole.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.once import latest
from lichen.operation import (
    ROUNDING,
    Border,
    Degrees,
    Error,
    Facts,
    Footprint,
    InputFacts,
    OperationParameters,
    Pixels,
)
from lichen.operations.convolution import lowrank
from lichen.operations.convolution.kernels import Matrix, Named, named, separated
from lichen.operations.convolution.missing import (
    Missing,
    check_mask,
    extent_without,
    leaves_out,
    renormalised_error,
)
from lichen.operations.convolution.stencil import Stencil, reach_of_values
from lichen.operations.convolution.transform import layout

LARGEST, LARGEST_DIRECT = 511, 63
Row = Annotated[tuple[float, ...], Field(min_length=1, max_length=LARGEST)]
Kernel = Annotated[tuple[Row, ...], Field(min_length=1, max_length=LARGEST)]
APART = 1e12
"""Weights of a kernel that leaves pixels out differ by this factor at most: the least of them must not vanish."""


class Mode(StrEnum):
    """Which way the kernel lies on the image."""

    CONVOLUTION = "convolution"
    """turned by 180 degrees: the image of a point is the kernel as it is written"""
    CORRELATION = "correlation"
    """as it is written: the kernel is a mask"""


class Parameters(OperationParameters):
    kernel: Kernel | None = Field(None, description="rows of weights, all of one length; overrides `name`")
    kernels: Annotated[tuple[Kernel, ...], Field(min_length=1, max_length=64)] | None = Field(
        None, description="a kernel for each channel; overrides `kernel` and `name`"
    )
    name: Named = Field(Named.SMOOTH, description="a kernel by name, where none is given")
    size: int = Field(3, ge=1, le=63, description="rows and columns of the named kernels box and smooth")
    radius: Pixels = Field(5.0, gt=0, le=255, description="of the named kernel disc")
    length: Pixels = Field(15.0, gt=0, le=500, description="of the named kernel line")
    angle: Degrees = Field(0.0, ge=-360, le=360, description="of the named kernel line, from x towards y")
    mode: Mode = Field(Mode.CONVOLUTION, description="which way a given kernel lies on the image")
    anchor: tuple[int, int] | None = Field(
        None, description="column and row of the kernel that lies over the output pixel; its middle if left out"
    )
    normalise: bool = Field(False, description="divide the kernel by its sum")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="factor on the kernel")
    bias: float = Field(0.0, ge=-1e6, le=1e6, description="added to every result")
    coverage: Literal["convolved", "kept"] = Field("convolved", description="what becomes of alpha")
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Field(Missing.SPREAD, description="what becomes of samples that are NaN or infinite")


# ------------------------------------------------------------------------------------------------------ predictions


@latest
def singles(p: Parameters, facts: InputFacts) -> list[tuple[Parameters, InputFacts]]:
    """The channels that have a kernel of their own, as operations on one channel; or the operation as it is."""
    if p.kernels is None:
        return [(p, facts)]
    single = dataclasses.replace(facts["image"], channels=1, alpha=Alpha.NONE)
    known = {**facts, "image": single}
    return [(p.model_copy(update={"kernel": kernel, "kernels": None}), known) for kernel in p.kernels]


def given(p: Parameters) -> Matrix:
    """The kernel as it is written, or the mask of that name."""
    if p.kernel is None:
        return named(p.name, p.size, p.radius, p.length, p.angle)
    return np.array(p.kernel, np.float64)


def mean_stencil(p: Parameters) -> tuple[Stencil, float]:
    """The kernel as one that sums to 1 and has no bias, and what it summed to once scaled."""
    alone = stencil(p.model_copy(update={"scale": 1.0, "normalise": True, "bias": 0.0}))
    return alone, p.scale * (1.0 if p.normalise else math.fsum(given(p).ravel()))


@latest
def stencil(p: Parameters) -> Stencil:
    """The kernel as a correlation, scaled."""
    taps = given(p)
    left, top = p.anchor or (taps.shape[1] // 2, taps.shape[0] // 2)
    if p.kernel is not None and p.mode is Mode.CONVOLUTION:
        taps, top, left = taps[::-1, ::-1], taps.shape[0] - 1 - top, taps.shape[1] - 1 - left
    total = math.fsum(taps.ravel())
    taps = taps * (p.scale / total if p.normalise and total else p.scale)
    return Stencil(taps, top, left, p.bias)


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws, count = check_mask(facts), facts["image"].channels
    if p.kernels is not None and len(p.kernels) != count:
        return [*flaws, Flaw("/parameters/kernels", f"has {len(p.kernels)} kernels for {count} channels")]
    for number, (single, known) in enumerate(singles(p, facts)):
        pointer = "/parameters/kernel" if p.kernels is None else f"/parameters/kernels/{number}"
        flaws += _check_kernel(single, pointer, leaves_out(p.missing, known))
    return flaws


def _check_kernel(p: Parameters, pointer: str, renormalised: bool) -> list[Flaw]:
    flaws = []
    if p.kernel is not None and len({len(row) for row in p.kernel}) > 1:
        return [Flaw(pointer, "has rows of different lengths")]
    taps = given(p)
    if p.anchor is not None:
        column, row = p.anchor
        if not (0 <= column < taps.shape[1] and 0 <= row < taps.shape[0]):
            inside = f"must lie within {taps.shape[1]} columns and {taps.shape[0]} rows"
            flaws.append(Flaw("/parameters/anchor", inside))
    if p.normalise and abs(math.fsum(taps.ravel())) <= 1e-9 * np.abs(taps).sum():
        flaws.append(Flaw("/parameters/normalise", "the kernel sums to 0; nothing makes it sum to 1"))
    if np.abs(taps).max() > 1e9:
        flaws.append(Flaw(pointer, "has weights beyond 1e9"))
    if renormalised and (taps.min() < 0 or not taps.any()):
        flaws.append(Flaw(pointer, "must have weights above 0 and none below where pixels are left out"))
    elif renormalised and taps[taps > 0].min() * APART < taps.max():
        flaws.append(Flaw(pointer, f"has weights that are more than {APART:g} times as large as others"))
    return flaws


def _magnitude(p: Parameters, facts: InputFacts) -> float:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    return max(abs(low), abs(high))


def result(p: Parameters, facts: InputFacts) -> Facts:
    image, (low, high) = facts["image"], reach_of_values(facts["image"], p.border, p.value)
    ranges = [stencil(single).range(low, high) for single, _ in singles(p, facts)]
    low, high = min(each[0] for each in ranges), max(each[1] for each in ranges)
    if p.coverage == "kept" and image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    return dataclasses.replace(image, extent=extent_without(facts, Extent(low, high, image.extent.nonfinite)))


def footprint(p: Parameters, facts: InputFacts) -> Footprint:
    each = [stencil(single).footprint(p.border) for single, _ in singles(p, facts)]
    rows, columns = max(one.rows or 0 for one in each), max(one.columns or 0 for one in each)
    return Footprint(rows, columns, wraps=p.border is Border.WRAP)


def propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    gain = max(stencil(single).weight for single, _ in singles(p, facts))
    return max(gain, float(p.coverage == "kept")) * error


def identity(p: Parameters, facts: InputFacts) -> str | None:
    alike = all(_is_one(stencil(single)) for single, _ in singles(p, facts))
    return "the kernel is a single 1 at its anchor" if alike and not leaves_out(p.missing, facts) else None


def _is_one(made: Stencil) -> bool:
    rows, columns = made.taps.shape
    if made.count != 1 or made.bias or not (0 <= made.top < rows and 0 <= made.left < columns):
        return False
    return float(made.taps[made.top, made.left]) == 1


Stated = Callable[[Parameters, float, InputFacts], Error]
Counted = Callable[[Parameters, float, InputFacts], float]
Refused = Callable[[Parameters, InputFacts], str | None]


def worst(error: Stated) -> Stated:
    """The largest error of any channel."""
    return lambda p, knob, facts: max((error(*_known(one, knob)) for one in singles(p, facts)), key=lambda e: e.value)


def total(work: Counted) -> Counted:
    return lambda p, knob, facts: sum(work(*_known(one, knob)) for one in singles(p, facts))


def none_of(unfit: Refused) -> Refused:
    """The first reason why a channel cannot be taken."""
    return lambda p, facts: next((reason for one in singles(p, facts) if (reason := unfit(*one))), None)


def _known(one: tuple[Parameters, InputFacts], knob: float) -> tuple[Parameters, float, InputFacts]:
    return one[0], knob, one[1]


def _size(p: Parameters) -> str:
    taps = stencil(p).taps
    return f"the kernel has {taps.shape[1]} x {taps.shape[0]} taps"


def _large(p: Parameters) -> bool:
    return bool(max(stencil(p).taps.shape) > LARGEST_DIRECT)


def direct_unfit(p: Parameters, facts: InputFacts) -> str | None:
    return f"{_size(p)}; beyond {LARGEST_DIRECT} a side it takes too long" if _large(p) else None


def direct_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    magnitude = _magnitude(p, facts)
    if leaves_out(p.missing, facts):
        mean, weight = mean_stencil(p)
        plain = renormalised_error(mean.rounding(magnitude), magnitude).value
        rounding = 1.01 * abs(weight) * plain + 3 * ROUNDING * (abs(weight) * magnitude + abs(p.bias))
    else:
        rounding = stencil(p).rounding(magnitude)
    return Error(rounding, "bound", rounding)


def direct_work(p: Parameters, knob: float, facts: InputFacts) -> float:
    once = facts["image"].samples * (stencil(p).count + 25.0)
    return 2 * once + 40.0 * facts["image"].samples if leaves_out(p.missing, facts) else once


def separable_error(p: Parameters, tolerance: float, facts: InputFacts) -> Error:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    terms, left = separated(stencil(p).taps, tolerance)
    rounding = lowrank.rounding(terms, max(abs(low), abs(high)), p.bias)
    return Error(lowrank.dropped(left, low, high) + rounding, "bound", rounding)


def separable_lightest(p: Parameters, tolerance: float, facts: InputFacts) -> float:
    """Of one column and row, if there is anything to multiply by, which takes no decomposition to tell."""
    taps = stencil(p).taps
    return facts["image"].samples * (sum(taps.shape) + 60.0) if taps.any() and tolerance < 1 else 0.0


def separable_work(p: Parameters, tolerance: float, facts: InputFacts) -> float:
    taps = stencil(p).taps
    return facts["image"].samples * len(separated(taps, tolerance)[0]) * (sum(taps.shape) + 60.0)


def separable_unfit(p: Parameters, facts: InputFacts) -> str | None:
    taps = stencil(p).taps
    if leaves_out(p.missing, facts):
        return _LEFT_OUT
    if _large(p):
        return f"{_size(p)}; beyond {LARGEST_DIRECT} a side it takes too long"
    if min(taps.shape) == 1:
        return "the kernel is a single row or column"
    if not facts["image"].extent.nonfinite:
        return None
    if not taps.all() or len(separated(taps, 0.0)[0]) > 1:
        return "sums of products would spread NaN and infinity to taps that are zero, or cancel them"
    return None


def fft_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The last rounding to float32; that of the transforms in doubles as the worst seen, with a margin of ten."""
    whole = stencil(p).weight * _magnitude(p, facts)
    rounding = (ROUNDING + 1e-14) * (whole + abs(p.bias))
    return Error(rounding, "estimate", rounding)


def fft_work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Of the transforms; what is not finite has some of its own, each kind."""
    image, (tall, wide) = facts["image"], stencil(p).taps.shape
    steps = layout(image.height, image.width, (tall, wide)).work
    return image.channels * steps * (5.0 if image.extent.nonfinite else 1.0)


def fft_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if leaves_out(p.missing, facts):
        return _LEFT_OUT
    if facts["image"].extent.nonfinite and not _large(p):
        return "a transform would spread NaN and infinity over the whole image"
    return None


_LEFT_OUT = "pixels are left out; which ones have a value must not depend on how the kernel is approximated"
