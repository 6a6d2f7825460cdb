"""Premultiply: straight colour to colour associated with its coverage, and back.

Truth: with coverage a in the last channel, associated colour is c a; the inverse is c / a, and where |a| is zero or
below the smallest normal float32 the colour stays as it is (an emissive pixel keeps its light). Images without
coverage, or already in the asked form, pass unchanged.

The inverse magnifies errors of c by 1 / a, where they are seen through coverage a: the difference of straight images is
therefore measured with colour weighted by coverage, and under that measure neither direction magnifies anything.

Source: Porter and Duff, Compositing Digital Images, SIGGRAPH 1984.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    POINTWISE,
    ROUNDING,
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
from lichen.stage import Stage

SMALLEST = np.finfo(np.float32).tiny


class Parameters(OperationParameters):
    inverse: bool = Field(False, description="from associated to straight instead")


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if image.alpha is Alpha.NONE:
        return image
    extent = Extent(min(image.extent.low, 0.0), max(image.extent.high, 1.0), image.extent.nonfinite)
    return dataclasses.replace(image, alpha=Alpha.STRAIGHT if p.inverse else Alpha.ASSOCIATED, extent=extent)


def _changes(p: Parameters, alpha: Alpha) -> bool:
    """Whether there is coverage to multiply by or to divide out."""
    return alpha is (Alpha.ASSOCIATED if p.inverse else Alpha.STRAIGHT)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    alpha = facts["image"].alpha
    if alpha is Alpha.NONE:
        return "the image has no coverage"
    return None if _changes(p, alpha) else f"the image is {alpha} already"


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    rounding = 3 * ROUNDING * facts["image"].extent.magnitude  # OpenCL divides to 2.5 ULP at worst
    return Error(rounding, "bound", rounding)


premultiply = Operation(
    name="premultiply",
    family="compositing",
    summary="Multiply colour by coverage (associated alpha), or divide it out again.",
    parameters=Parameters,
    inputs=(Input("image", "a picture whose last channel is coverage"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    inverse=lambda p: Parameters(inverse=not p.inverse),
    hard_cases=(
        HardCase(
            name="colour under no coverage",
            why="dividing by zero makes NaN of every transparent pixel",
            inputs=lambda: {"image": np.zeros((4, 5, 4), np.float32)},
            parameters={"inverse": True},
            holds=lambda inputs, pixels: None if np.isfinite(pixels).all() else "NaN under zero coverage",
        ),
    ),
    description=__doc__ or "",
)


@premultiply.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    pixels = np.array(image.pixels)
    if _changes(p, image.alpha):
        coverage = pixels[..., -1:]
        if p.inverse:
            pixels[..., :-1] /= np.where(np.abs(coverage) < SMALLEST, 1.0, coverage)
        else:
            pixels[..., :-1] *= coverage
    return pixels


@premultiply.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(2e-4, 4e-10), "numpy": Rate(2.5e-5, 1.3e-9)},
    stage=lambda p, facts: Stage(
        "compositing/premultiply_stage.clh",
        {"INVERSE": int(p.inverse), "CHANGING": int(_changes(p, facts["image"].alpha))},
    ),
)
class Exact:
    """One multiplication or division for each colour sample."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned_empty(image.pixels.shape)
        if not _changes(p, image.alpha):
            out[...] = image.pixels
            return out
        pixels = aligned(image.pixels)
        items = -(-pixels.size // 16) if image.channels == 4 else -(-image.height * image.width // 64)
        with device.session() as session:
            session.launch(
                "compositing/premultiply.cl", "dissociate" if p.inverse else "associate", (items,),
                pixels, session.write(out), np.uint64(pixels.size), defines={"CHANNELS": image.channels},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        pixels = inputs["image"].pixels
        out = aligned_empty(pixels.shape)
        if not _changes(p, inputs["image"].alpha):
            out[...] = pixels
            return out
        coverage = pixels[..., -1:]
        if p.inverse:
            np.divide(pixels, np.where(np.abs(coverage) < SMALLEST, np.float32(1), coverage), out=out)
        else:
            np.multiply(pixels, coverage, out=out)
        out[..., -1:] = coverage
        return out
