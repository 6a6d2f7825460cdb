"""Gaussian blur.

Truth: the image, continued by `border`, convolved along rows and along columns with the sampled Gaussian
exp(-k^2 / 2 sigma^2), normalised so that its sum over all integers k is 1.

Methods:

* `fir` cuts the kernel where the weight left outside is at most `tail` and normalises what remains. Both kernels sum
  to 1, so one pass is wrong by at most the weight cut off times the spread of the input, and two passes by twice that.
  Where the kernel is longer than the image the taps are folded onto the image by the border rule, which is exact and
  bounds the work.
* `dct`, for the reflecting border: the cosine transform diagonalises a symmetric kernel there, and a wide Gaussian
  passes only low frequencies. The transform is computed for those K modes alone, as two thin matrix products, so the
  work *falls* as sigma grows and any image size is as good as another. Its eigenvalues are sums of Gaussians by
  Poisson's formula, so nothing is truncated but the modes; each mode dropped costs at most its eigenvalue times the
  spread of the input.

Sources: Getreuer, A Survey of Gaussian Convolution Algorithms, IPOL 3 (2013); Martucci, Symmetric convolution and the
discrete sine and cosine transforms, IEEE Trans. Signal Processing 42 (1994) for the symmetries.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    ROUNDING,
    Border,
    Error,
    Facts,
    Footprint,
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
from lichen.operations.convolution.gaussian_cases import CASES
from lichen.operations.convolution.gaussian_weights import dct_bases, dct_modes, fir_radius, fir_weights, half_kernel
from lichen.operations.convolution.passes import Steps, folded, separable_numpy, separable_opencl

MOST_MODES = 1536
"""Modes that the dct method keeps at most; a kernel that passes more is narrow enough for fir."""


class Parameters(OperationParameters):
    sigma: Pixels = Field(ge=0, le=1e5, description="standard deviation")
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")


# ------------------------------------------------------------------------------------------------------ predictions


def _spread(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Largest difference between input values, and largest magnitude, with the constant beyond the border."""
    extent = facts["image"].extent
    low, high = extent.low, extent.high
    if p.border is Border.CONSTANT:
        low, high = min(low, p.value), max(high, p.value)
    return high - low, max(abs(low), abs(high))


def _taps(p: Parameters, tail: float, size: int) -> int:
    """Multiply-adds for each sample of one FIR pass."""
    return min(2 * fir_radius(p.sigma, tail)[0] + 1, size)


def fir_error(p: Parameters, tail: float, facts: InputFacts) -> Error:
    """Truncation, proved; plus rounding: n taps added in any order lose at most n + 1 roundings of the magnitude."""
    image, (spread, magnitude) = facts["image"], _spread(p, facts)
    cut = fir_radius(p.sigma, tail)[1]
    taps = _taps(p, tail, image.width) + _taps(p, tail, image.height)
    rounding = 1.01 * (taps + 4) * ROUNDING * magnitude
    return Error(2 * cut * spread + rounding, "bound", rounding)


def fir_work(p: Parameters, tail: float, facts: InputFacts) -> float:
    """Multiply-adds, or the time to move samples where they are few: processors do one while the other waits.

    Kernels longer than the image are folded onto it, which takes time for each number of that matrix.
    """
    image, sides = facts["image"], (facts["image"].width, facts["image"].height)
    taps = sum(_taps(p, tail, side) for side in sides)
    matrices = sum(side * side for side in sides if 2 * fir_radius(p.sigma, tail)[0] >= side)
    return image.samples * math.hypot(taps, MOVED) + FOLDED * matrices


MOVED, FOLDED = 54, 700
"""Multiply-adds that take as long as moving a sample through both passes, or as folding into one number of a matrix."""


def dct_error(p: Parameters, tail: float, facts: InputFacts) -> Error:
    """Dropped modes, proved; rounding as the worst seen over sizes, sigmas and images, with a margin of two.

    It grows with the root of the number of modes, as sums of independent roundings do.
    """
    image, (spread, magnitude) = facts["image"], _spread(p, facts)
    (rows, below), (columns, beside) = (dct_modes(p.sigma, size, tail) for size in (image.height, image.width))
    dropped = below + beside
    rounding = (8 + 3 * math.sqrt(rows + columns)) * ROUNDING * magnitude
    return Error(dropped * (1 + dropped) * spread + rounding, "estimate", rounding)


def dct_work(p: Parameters, tail: float, facts: InputFacts) -> float:
    """Multiply-adds of the four products, and what it takes to read the image, to write it and to flip the modes."""
    image = facts["image"]
    rows, columns = dct_modes(p.sigma, image.height, tail)[0], dct_modes(p.sigma, image.width, tail)[0]
    few = rows * image.width * image.channels
    return 2.0 * image.samples * rows + 2.0 * few * columns + 90.0 * image.samples + 360.0 * few


def _dct_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if p.border is not Border.REFLECT:
        return f"the border is {p.border}; a cosine transform continues by reflection"
    image = facts["image"]
    if max(dct_modes(p.sigma, size, 1e-7)[0] for size in (image.height, image.width)) > MOST_MODES:
        return f"more than {MOST_MODES} modes pass so narrow a kernel"
    if image.extent.nonfinite:
        return "a transform would spread NaN and infinity over the whole image"
    return None


def _result(p: Parameters, facts: InputFacts) -> Facts:
    """A mean of the input's values and of what lies beyond a constant border."""
    image = facts["image"]
    if p.border is not Border.CONSTANT:
        return image
    extent = image.extent
    return dataclasses.replace(
        image, extent=Extent(min(extent.low, p.value), max(extent.high, p.value), extent.nonfinite)
    )


def _departure(p: Parameters, facts: InputFacts) -> dict[str, float]:
    """All but the weight of the pixel itself goes to others, which differ from it by the spread at most."""
    return {"image": (1 - float(half_kernel(p.sigma)[0]) ** 2) * _spread(p, facts)[0]}


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """As far as the kernel changes anything in float64."""
    radius = len(half_kernel(p.sigma)) - 1
    image = facts["image"]
    return Footprint(min(radius, image.height), min(radius, image.width), wraps=p.border is Border.WRAP)


# -------------------------------------------------------------------------------------------------------- operation


gaussian = Operation(
    name="gaussian",
    family="convolution",
    summary="Gaussian blur of any width, with a stated error.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    departure=_departure,
    result=_result,
    identity=lambda p, facts: "sigma is 0" if p.sigma == 0 else None,
    examples=(
        {"sigma": 1.5},
        {"sigma": 6.0, "border": "reflect101"},
        {"sigma": 2.5, "border": "constant", "value": 0.25},
        {"sigma": 3.0, "border": "wrap"},
        {"sigma": 40.0, "border": "clamp"},
        {"sigma": 40.0},
    ),
    hard_cases=CASES,
    description=__doc__ or "",
)


@gaussian.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"].pixels
    weights = np.concatenate([half_kernel(p.sigma)[:0:-1], half_kernel(p.sigma)])
    for axis in (0, 1):
        matrix, constant = folded(weights, image.shape[axis], p.border)
        lines = np.moveaxis(image, axis, 0)
        image = np.moveaxis(np.tensordot(matrix, lines, 1) + p.value * constant[:, None, None], 0, axis)
    return image


@gaussian.method(
    "fir",
    knob=Knob("tail", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "weight of the kernel that is cut off", 1e-9, 0.5),
    error=fir_error,
    work=fir_work,
    rates={"opencl": Rate(5e-4, 1.6e-11), "numpy": Rate(1e-4, 7e-11)},
)
class Fir:
    """The kernel, cut where little weight is left and normalised, as two passes of multiply-adds."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        weights = fir_weights(p.sigma, tail)
        return separable_opencl(device, inputs["image"], weights, weights, p.border, p.value)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        weights = fir_weights(p.sigma, tail)
        return separable_numpy(inputs["image"], weights, weights, p.border, p.value)


@gaussian.method(
    "dct",
    knob=Knob("tail", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "weight of the modes that are dropped", 1e-9, 0.5),
    error=dct_error,
    work=dct_work,
    rates={"opencl": Rate(6e-4, 1.25e-11), "numpy": Rate(1e-5, 9e-12)},
    unfit=_dct_unfit,
)
class Dct:
    """The few low frequencies that a wide Gaussian passes, as thin matrix products; cheaper the wider it is."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, tail: float) -> Array:
        return _dct_opencl(device, inputs["image"], p, tail)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, tail: float) -> Array:
        pixels = inputs["image"].pixels
        height, width, channels = pixels.shape
        down, up = dct_bases(p.sigma, height, tail)
        left, right = dct_bases(p.sigma, width, tail)
        few = down @ pixels.reshape(height, -1)
        few = few.reshape(-1, width, channels).transpose(1, 0, 2).reshape(width, -1)
        few = right @ (left @ few)
        few = few.reshape(width, -1, channels).transpose(1, 0, 2).reshape(-1, width * channels)
        out = aligned_empty(pixels.shape)
        np.matmul(up, few, out=out.reshape(height, -1))
        return out


def _dct_opencl(device: Device, image: Image, p: Parameters, tail: float) -> Array:
    """Down the image to K rows, those to K x K modes and back, up to the image: four products and two flips."""
    height, width, channels = image.pixels.shape
    down, up = dct_bases(p.sigma, height, tail)
    left, right = dct_bases(p.sigma, width, tail)
    out = aligned_empty(image.pixels.shape)
    with device.session() as session:
        steps = Steps(session, p.border)
        few, again = (session.scratch((len(down), width, channels)) for _ in range(2))
        turned, back = (session.scratch((width, len(down), channels)) for _ in range(2))
        modes = session.scratch((len(left), len(down), channels))
        steps.multiply(down, None, image.pixels, few)
        steps.flip(few, turned)
        steps.multiply(left, None, turned, modes)
        steps.multiply(right, None, modes, back)
        steps.flip(back, again)
        steps.multiply(up, None, again, out)
    return out
