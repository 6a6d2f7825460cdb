"""Convolution with any kernel, given as a matrix or by name.

Truth: with k[i, j] the kernel, (a, b) its anchor and f the image continued by `border`,

    convolution   out[y, x] = bias + sum of k[i, j] f[y - i + a, x - j + b]
    correlation   out[y, x] = bias + sum of k[i, j] f[y + i - a, x + j - b]

where k is first divided by its sum if `normalise` is set, and multiplied by `scale`. Kernels by name are masks: they
are laid on the image as they are written, whatever the mode.

Methods:

* `direct` multiplies and adds for every tap that is not zero.
* `separable` writes the kernel as a sum of columns times rows by its singular values, as many as leave at most
  `tolerance` of its l1 norm, each two passes. The taps left out, d, change a result by at most
  |sum d| |m| + sum |d| (range / 2) about the middle m of the input's range, which is proved.
* `fft` multiplies spectra in doubles: for kernels whose size forbids anything else.

Sources: McReynolds and Blythe, Advanced Graphics Programming Techniques Using OpenGL (1998), 12.3; Treitel and Shanks,
The design of multistage separable planar filters, IEEE Trans. Geoscience Electronics 9 (1971).
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    ROUNDING,
    Border,
    Degrees,
    Error,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Pixels,
    Rate,
)
from lichen.operations.convolution.convolve_cases import CASES
from lichen.operations.convolution.kernels import Named, named, separated
from lichen.operations.convolution.stencil import (
    Stencil,
    continue_image,
    correlate,
    correlate_numpy,
    correlate_opencl,
    correlated,
    kept_coverage,
    reach_of_values,
    sum_of_taps,
)

LARGEST, LARGEST_DIRECT = 511, 63
Row = Annotated[tuple[float, ...], Field(min_length=1, max_length=LARGEST)]


class Mode(StrEnum):
    """Which way the kernel lies on the image."""

    CONVOLUTION = "convolution"
    """turned by 180 degrees: the image of a point is the kernel as it is written"""
    CORRELATION = "correlation"
    """as it is written: the kernel is a mask"""


class Parameters(OperationParameters):
    kernel: Annotated[tuple[Row, ...], Field(min_length=1, max_length=LARGEST)] | None = Field(
        None, description="rows of weights, all of one length; overrides `name`"
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


# ------------------------------------------------------------------------------------------------------ predictions


def stencil(p: Parameters) -> Stencil:
    """The kernel as a correlation, scaled."""
    taps = named(p.name, p.size, p.radius, p.length, p.angle) if p.kernel is None else np.array(p.kernel, np.float64)
    left, top = p.anchor or (taps.shape[1] // 2, taps.shape[0] // 2)
    if p.kernel is not None and p.mode is Mode.CONVOLUTION:
        taps, top, left = taps[::-1, ::-1], taps.shape[0] - 1 - top, taps.shape[1] - 1 - left
    total = math.fsum(taps.ravel())
    taps = taps * (p.scale / total if p.normalise and total else p.scale)
    return Stencil(taps, top, left, p.bias)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = []
    taps = np.zeros((1, 1))
    if p.kernel is None:
        taps = named(p.name, p.size, p.radius, p.length, p.angle)
    elif len({len(row) for row in p.kernel}) > 1:
        flaws.append(Flaw("/parameters/kernel", "has rows of different lengths"))
    else:
        taps = np.array(p.kernel, np.float64)
    if not flaws and p.anchor is not None:
        column, row = p.anchor
        if not (0 <= column < taps.shape[1] and 0 <= row < taps.shape[0]):
            inside = f"must lie within {taps.shape[1]} columns and {taps.shape[0]} rows"
            flaws.append(Flaw("/parameters/anchor", inside))
    if not flaws and p.normalise and abs(math.fsum(taps.ravel())) <= 1e-9 * np.abs(taps).sum():
        flaws.append(Flaw("/parameters/normalise", "the kernel sums to 0; nothing makes it sum to 1"))
    if np.abs(taps).max() > 1e9:
        flaws.append(Flaw("/parameters/kernel", "has weights beyond 1e9"))
    return flaws


def _magnitude(p: Parameters, facts: InputFacts) -> float:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    return max(abs(low), abs(high))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    low, high = stencil(p).range(*reach_of_values(image, p.border, p.value))
    if p.coverage == "kept" and image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    return dataclasses.replace(image, extent=Extent(low, high, image.extent.nonfinite))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    made = stencil(p)
    here = 0 <= made.top < made.taps.shape[0] and 0 <= made.left < made.taps.shape[1]
    if here and made.count == 1 and made.taps[made.top, made.left] == 1 and p.bias == 0:
        return "the kernel is a single 1 at its anchor"
    return None


def _too_large(p: Parameters, facts: InputFacts) -> str | None:
    taps = stencil(p).taps
    if max(taps.shape) > LARGEST_DIRECT:
        return (
            f"the kernel has {taps.shape[1]} x {taps.shape[0]} taps; beyond {LARGEST_DIRECT} a side it takes too long"
        )
    return None


def direct_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    rounding = stencil(p).rounding(_magnitude(p, facts))
    return Error(rounding, "bound", rounding)


def separable_error(p: Parameters, tolerance: float, facts: InputFacts) -> Error:
    low, high = reach_of_values(facts["image"], p.border, p.value)
    whole = stencil(p)
    terms, left = separated(whole.taps, tolerance)
    dropped = abs(left.sum()) * abs(high + low) / 2 + np.abs(left).sum() * (high - low) / 2
    weight = sum(float(np.abs(down).sum() * np.abs(across).sum()) for down, across in terms)
    adding = sum(whole.taps.shape) + len(terms) + 6
    rounding = 1.01 * adding * ROUNDING * (weight * max(abs(low), abs(high)) + abs(p.bias))
    return Error(float(dropped + rounding), "bound", rounding)


def fft_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The last rounding to float32; that of the transforms in doubles as the worst seen, with a margin of ten."""
    whole = stencil(p).weight * _magnitude(p, facts)
    rounding = (ROUNDING + 1e-14) * (whole + abs(p.bias))
    return Error(rounding, "estimate", rounding)


def _separable_unfit(p: Parameters, facts: InputFacts) -> str | None:
    taps = stencil(p).taps
    if min(taps.shape) == 1:
        return "the kernel is a single row or column"
    if not facts["image"].extent.nonfinite:
        return None
    if not taps.all() or len(separated(taps, 0.0)[0]) > 1:
        return "sums of products would spread NaN and infinity to taps that are zero, or cancel them"
    return None


def separable_work(p: Parameters, tolerance: float, facts: InputFacts) -> float:
    taps = stencil(p).taps
    return facts["image"].samples * len(separated(taps, tolerance)[0]) * (sum(taps.shape) + 60.0)


# -------------------------------------------------------------------------------------------------------- operation


convolve = Operation(
    name="convolve",
    family="convolution",
    summary="Convolution or correlation with any kernel, given as a matrix or by name.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: stencil(p).footprint(p.border),
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: max(stencil(p).weight, float(p.coverage == "kept")) * error,
    check=_check,
    examples=(
        {"kernel": [[1, 2, 3], [0, -4, 1.5], [2, 0.5, -1]], "scale": 0.25},
        {"name": "disc", "radius": 4.5, "border": "reflect101"},
        {"name": "smooth", "size": 5, "border": "wrap"},
        {"name": "line", "length": 9, "angle": 30, "border": "clamp"},
        {"name": "emboss", "coverage": "kept", "border": "constant", "value": 0.25},
        {"kernel": [[1, 2], [3, 4], [5, 6]], "mode": "correlation", "anchor": [0, 2], "normalise": True, "bias": 0.5},
    ),
    hard_cases=CASES,
    description=__doc__ or "",
)


def _finish(inputs: Inputs, p: Parameters, out: Array) -> Array:
    return kept_coverage(inputs["image"], out) if p.coverage == "kept" else out


@convolve.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _finish(inputs, p, sum_of_taps(inputs["image"].pixels, stencil(p), p.border, p.value))


@convolve.method(
    "direct",
    error=direct_error,
    work=lambda p, knob, facts: facts["image"].samples * (stencil(p).count + 25.0),
    rates={"opencl": Rate(4e-4, 1.4e-11), "numpy": Rate(2e-4, 1.2e-10)},
    unfit=_too_large,
)
class Direct:
    """One multiply-add for every tap that is not zero."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _finish(inputs, p, correlate_opencl(device, inputs["image"], stencil(p), p.border, p.value))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _finish(inputs, p, correlate_numpy(inputs["image"], stencil(p), p.border, p.value))


@convolve.method(
    "separable",
    knob=Knob("tolerance", (0.1, 0.03, 1e-2, 1e-3, 1e-6), "share of the kernel's l1 norm that is left out", 0.0, 0.5),
    error=separable_error,
    work=separable_work,
    rates={"opencl": Rate(6e-4, 1.4e-11), "numpy": Rate(3e-4, 1e-10)},
    unfit=lambda p, facts: _too_large(p, facts) or _separable_unfit(p, facts),
)
class Separable:
    """Two passes for each of the few columns times rows that make up the kernel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tolerance: float) -> Array:
        image = inputs["image"]
        out, between = aligned_empty(image.pixels.shape), aligned_empty(image.pixels.shape)
        with device.session() as session:
            for number, (down, across, value) in enumerate(_passes(p, tolerance)):
                correlate(session, image.pixels, between, down, p.border, p.value)
                correlate(session, between, out, across, p.border, value, add=number > 0)
        return _finish(inputs, p, out)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tolerance: float) -> Array:
        image = inputs["image"]
        out = aligned(np.zeros(image.pixels.shape, np.float32))
        for down, across, value in _passes(p, tolerance):
            between = correlated(image.pixels, down, p.border, p.value)
            out += correlated(between, across, p.border, value)
        return _finish(inputs, p, out)


def _passes(p: Parameters, tolerance: float) -> list[tuple[Stencil, Stencil, float]]:
    """Stencils down and across for each term, and what the constant border has become after the first."""
    whole, bias = stencil(p), p.bias
    passes = []
    for down, across in separated(whole.taps, tolerance)[0]:
        passes.append((Stencil(down, whole.top, 0), Stencil(across, 0, whole.left, bias), p.value * float(down.sum())))
        bias = 0.0
    nothing = Stencil(np.zeros((1, 1)), 0, 0)
    return passes or [(nothing, dataclasses.replace(nothing, bias=bias), 0.0)]


@convolve.method(
    "fft",
    error=fft_error,
    work=lambda p, knob, facts: facts["image"].channels * math.prod(_transform(p, facts["image"])),
    rates={"opencl": Rate(1e-3, 2.6e-8), "numpy": Rate(1e-3, 2.6e-8)},
    unfit=lambda p, facts: (
        "a transform would spread NaN and infinity over the whole image" if facts["image"].extent.nonfinite else None
    ),
)
class Fft:
    """The product of spectra in doubles, on the processor; its time hardly depends on the kernel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Fft.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, whole = inputs["image"], stencil(p)
        (tall, wide), (height, width) = whole.taps.shape, image.pixels.shape[:2]
        rows, columns = (whole.top, tall - 1 - whole.top), (whole.left, wide - 1 - whole.left)
        around = continue_image(image.pixels, rows, columns, p.border, p.value)
        sides = _transform(p, Facts.of(image))
        spectrum = np.conj(np.fft.rfft2(whole.taps, sides))
        out = aligned_empty(image.pixels.shape)
        for channel in range(image.channels):
            product = np.fft.rfft2(around[..., channel].astype(np.float64), sides) * spectrum
            out[..., channel] = np.fft.irfft2(product, sides)[:height, :width] + whole.bias
        return _finish(inputs, p, out)


def _transform(p: Parameters, image: Facts) -> tuple[int, int]:
    """Rows and columns of the transform: image and kernel, up to sizes whose factors are 2, 3 and 5."""
    tall, wide = stencil(p).taps.shape
    return _smooth_size(image.height + tall - 1), _smooth_size(image.width + wide - 1)


def _smooth_size(least: int) -> int:
    """The smallest number >= `least` without prime factors beyond 5."""
    while True:
        rest = least
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return least
        least += 1
