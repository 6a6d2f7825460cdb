"""Laplacian: the sum of the second derivatives, per pixel squared.

Truth: correlation with a mask that gives x^2 + y^2 the value 4, negative on a bright point:

    four        0 1 0 / 1 -4 1 / 0 1 0
    eight       (1 1 1 / 1 -8 1 / 1 1 1) / 3
    isotropic   (1 4 1 / 4 -20 4 / 1 4 1) / 6, whose error is the same in all directions
    gaussian    of a blurred image: h(x) g(y) + g(x) h(y), with g the sampled Gaussian of `sigma` and h its second
                derivative, corrected so that it sums to exactly 0 and gives x^2 exactly 2; both end where less than
                1e-8 of the Gaussian's weight is left

Colours are differentiated, coverage is kept. No pixels can be left out: weights that sum to 0 have no shares to hand
on, and without a sample on either side nothing tells a curvature from a slope. A NaN gives NaN under the mask; where
that is too much, blur first (`gaussian` has `mask` and `missing`).

Sources: Marr and Hildreth, Theory of edge detection, Proc. Royal Society B 207 (1980); McReynolds and Blythe (1998),
12.3.5, for the masks (whose signs are turned here); Collatz, The Numerical Treatment of Differential Equations (1960).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from enum import StrEnum
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
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
    Pixels,
    Rate,
)
from lichen.operations.convolution.gaussian_weights import fir_radius, half_kernel
from lichen.operations.convolution.stencil import (
    Stencil,
    correlate,
    correlated,
    kept_coverage,
    reach_of_values,
    sum_of_taps,
)


class Mask(StrEnum):
    """How the second derivatives are taken."""

    FOUR = "four"
    EIGHT = "eight"
    ISOTROPIC = "isotropic"
    GAUSSIAN = "gaussian"


class Parameters(OperationParameters):
    mask: Mask = Field(Mask.FOUR, description="how the second derivatives are taken")
    sigma: Pixels = Field(1.5, ge=0.5, le=100, description="standard deviation of the mask gaussian")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="factor on the result")
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")


_FIXED = {
    Mask.FOUR: np.array([[0, 1, 0], [1, -4, 1], [0, 1, 0]], np.float64),
    Mask.EIGHT: np.array([[1, 1, 1], [1, -8, 1], [1, 1, 1]]) / 3,
    Mask.ISOTROPIC: np.array([[1, 4, 1], [4, -20, 4], [1, 4, 1]]) / 6,
}
Term = tuple[Stencil, ...]


@lru_cache(maxsize=64)
def terms(mask: Mask, sigma: float, scale: float) -> tuple[Term, ...]:
    """What is added up: each term one mask, or one down the image and then one along it."""
    if mask is not Mask.GAUSSIAN:
        return ((Stencil(scale * _FIXED[mask], 1, 1),),)
    smooth, second = profiles(sigma)
    middle = len(smooth) // 2
    return tuple(
        (Stencil(scale * down[:, None], middle, 0), Stencil(across[None, :], 0, middle))
        for down, across in ((second, smooth), (smooth, second))
    )


def profiles(sigma: float) -> tuple[Array, Array]:
    """The Gaussian, which sums to 1, and its second derivative, which gives a constant 0 and x^2 2."""
    half = half_kernel(sigma)[: fir_radius(sigma, 1e-8)[0] + 1]
    smooth = np.concatenate([half[:0:-1], half])
    smooth /= smooth.sum()
    squares = np.square(np.arange(len(smooth)) - len(half) + 1.0)
    second = (squares - smooth @ squares) * smooth  # of mean 0 under the Gaussian, hence of sum 0
    return smooth, 2 * second / (second @ squares)


# ------------------------------------------------------------------------------------------------------ predictions


def _weights(p: Parameters) -> list[float]:
    """The l1 norm of each term."""
    return [float(np.prod([mask.weight for mask in term])) for term in terms(p.mask, p.sigma, p.scale)]


def _range(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Lowest and highest value that takes part."""
    return reach_of_values(facts["image"], p.border, p.value)


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    sides = [mask.footprint(p.border) for term in terms(p.mask, p.sigma, p.scale) for mask in term]
    rows, columns = max(side.rows or 0 for side in sides), max(side.columns or 0 for side in sides)
    return Footprint(rows, columns, wraps=p.border is Border.WRAP)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    """A mask that sums to 0 sees no more than half its norm times the range."""
    image, (low, high) = facts["image"], _range(p, facts)
    most = sum(_weights(p)) * (high - low) / 2 * (1 + 1e-12)
    low, high = -most, most
    if image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    return dataclasses.replace(image, extent=Extent(low, high, image.extent.nonfinite))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    magnitude = max(abs(bound) for bound in _range(p, facts))
    adding = [sum(mask.count + 3 for mask in term) for term in terms(p.mask, p.sigma, p.scale)]
    rounded = [count * weight for count, weight in zip(adding, _weights(p), strict=True)]
    rounding = 1.01 * ROUNDING * magnitude * (sum(rounded) + 2 * sum(_weights(p)))
    return Error(rounding, "bound", rounding)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    return max(sum(_weights(p)), 0.0 if facts["image"].alpha is Alpha.NONE else 1.0) * error


def _bowl() -> dict[str, Array]:
    y, x = np.mgrid[-12:13, -12:13] / 16
    return {"image": (x * x + y * y).astype(np.float32)}


def _curved_by_four(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    apart = float(np.abs(pixels[9:-9, 9:-9] - 4 / 256).max())
    return None if apart <= 1e-5 else f"a bowl is off by {apart:.3g}"


def _bright() -> dict[str, Array]:
    return {"image": np.full((30, 30, 1), 1e6, np.float32)}


def _flat(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    largest = float(np.abs(pixels).max())
    return None if largest <= 10 else f"a flat image of 1e6 has the Laplacian {largest:.3g}"


laplacian = Operation(
    name="laplacian",
    family="convolution",
    summary="Sum of the second derivatives, of the image or of its Gaussian blur.",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    result=_result,
    propagate=_propagate,
    examples=(
        {},
        {"mask": "gaussian", "sigma": 1.5, "border": "reflect101"},
        {"mask": "isotropic", "scale": -2, "border": "wrap"},
        {"mask": "gaussian", "sigma": 5, "border": "constant", "value": 0.5, "scale": 25},
        {"mask": "eight", "border": "clamp"},
    ),
    hard_cases=(
        HardCase(
            "bowl", "a cut or unscaled mask has the wrong curvature", _bowl, {"mask": "gaussian"}, _curved_by_four
        ),
        HardCase("bright and flat", "a mask that does not sum to 0 adds light", _bright, {"mask": "gaussian"}, _flat),
    ),
    description=__doc__ or "",
)


@laplacian.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    out = np.zeros(image.pixels.shape)
    for term in terms(p.mask, p.sigma, p.scale):
        made, value = image.pixels, p.value
        for mask in term:
            made, value = sum_of_taps(made, mask, p.border, value), value * float(mask.taps.sum())
        out += made
    return kept_coverage(image, out)


@laplacian.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: (
        facts["image"].samples * sum(mask.count + 30.0 for term in terms(p.mask, p.sigma, p.scale) for mask in term)
    ),
    rates={"opencl": Rate(5e-4, 1.6e-11), "numpy": Rate(2e-4, 1.2e-10)},
)
class Direct:
    """One multiply-add for every tap that is not zero; the Gaussian's mask as two pairs of passes."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out, between = aligned_empty(image.pixels.shape), aligned_empty(image.pixels.shape)
        with device.session() as session:
            for number, term in enumerate(terms(p.mask, p.sigma, p.scale)):
                source, value = image.pixels, p.value
                if len(term) == 2:
                    correlate(session, source, between, term[0], p.border, value)
                    source, value = between, value * float(term[0].taps.sum())
                correlate(session, source, out, term[-1], p.border, value, add=number > 0)
        return kept_coverage(image, out)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned(np.zeros(image.pixels.shape))
        for term in terms(p.mask, p.sigma, p.scale):
            made, value = image.pixels, p.value
            for mask in term:
                made, value = correlated(made, mask, p.border, value), value * float(mask.taps.sum())
            out += made
        return kept_coverage(image, out)
