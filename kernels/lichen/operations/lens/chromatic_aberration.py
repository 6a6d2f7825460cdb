"""Chromatic aberration: every colour at its own magnification, as a lens without correction makes it; put in or out.

Truth. Channel k of the result is channel k of the image, scaled about `centre` by the k-th of `scales` and resampled as
all warps are (`affine` with that one scale; see `lichen.operations.warp.reference`). A scale above 1 magnifies. Three
scales are those of red, green and blue; further channels, coverage among them, are scaled as the second, which is the
one to leave at 1. What was put in by scales is taken out by one over each, but for what resampling costs twice, and for
what left the picture.

Fringes are widest in the corners, 1/2 |s - 1| diagonal pixels. Bends that differ by colour, and not only sizes, are
`lens_distort` on each channel.

Methods: the filters of all warps that are worth their time here: `bilinear`, `bicubic`, `lanczos3`, which is truth
where nothing shrinks, and `ewa`, which is so where a channel does.

Source: R. Willson and S. Shafer, Active lens control for high precision computer imaging, ICRA 1991, who found lateral
chromatic aberration to be a change of magnification.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
from lichen.operation import (
    WHOLE,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.warp.affine import Parameters as Affine
from lichen.operations.warp.affine import affine
from lichen.operations.warp.prediction import TRUTH_GAIN, result_facts
from lichen.operations.warp.resampling import Resampled

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from lichen.opencl.device import Device

Scale = Annotated[float, Field(ge=0.25, le=4)]


class Parameters(Resampled):
    scales: tuple[Scale, Scale, Scale] = Field((1.004, 1.0, 0.996), description="magnifications of red, green and blue")
    centre: tuple[float, float] = Field((0.5, 0.5), description="of the lens; shares of width and height")

    def of(self, channel: int, width: int, height: int) -> Affine:
        """The warp of one channel of an image of this size."""
        scale = self.scales[channel if channel < 3 else 1]
        x, y = self.centre[0] * width, self.centre[1] * height
        rows = (scale, 0.0, x - scale * x), (0.0, scale, y - scale * y)
        return Affine(matrix=rows, inverse=False, border=self.border, value=self.value, width=None, height=None)


def _channel(image: Image, channel: int) -> Image:
    return image.replace(pixels=aligned(image.pixels[..., channel : channel + 1], image.pixels.dtype), alpha=Alpha.NONE)


@latest
def _warps(p: Parameters, facts: InputFacts) -> list[Affine]:
    """Of the three channels that differ."""
    image = facts["image"]
    return [p.of(channel, image.width, image.height) for channel in range(3)]


@latest
def _smallest(p: Parameters, facts: InputFacts) -> Affine:
    """Of the channel that shrinks most, if any does: filters err most there."""
    return _warps(p, facts)[p.scales.index(min(p.scales))]


@latest
def _facts(facts: InputFacts) -> InputFacts:
    """Of one channel: no more than of all of them."""
    image = facts["image"]
    return {"image": Facts(image.height, image.width, 1, image.space, Alpha.NONE, image.extent)}


def _by_channel(
    inputs: Inputs, p: Parameters, one: Callable[[Inputs, Affine], Array], dtype: type[np.floating]
) -> Array:
    image = inputs["image"]
    made = aligned_empty(image.pixels.shape, dtype)
    for channel in range(image.channels):
        warp, alone = p.of(channel, image.width, image.height), _channel(image, channel)
        still = affine.identity(warp, {"image": Facts.of(alone)}) is not None
        made[..., channel : channel + 1] = alone.pixels if still else one({"image": alone}, warp)
    return made


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return "every scale is 1" if all(scale == 1 for scale in p.scales) else None


def _constant(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    off = float(np.abs(pixels - np.float32(0.7)).max())
    return None if off < 1e-6 else f"a constant is off by {off:g}"


chromatic_aberration = Operation(
    name="chromatic_aberration",
    family="lens",
    summary="Magnifies every colour by its own scale, as a lens without correction does, or takes that out.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture of colours", (3, None)),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    identity=_identity,
    result=lambda p, facts: result_facts(p, facts, (facts["image"].width, facts["image"].height)),
    propagate=lambda p, facts, error: error * TRUTH_GAIN,
    implied=lambda p, facts: "which part of the image a tile shows is known by its place alone",
    customary=("ewa", 1.0),
    examples=(
        {"scales": [1.05, 1.0, 1.02], "border": "clamp"},
        {"scales": [1.03, 1.0, 0.96], "border": "reflect101"},
        {"scales": [1.1, 1.02, 1.3], "centre": [0.3, 0.6]},
    ),
    hard_cases=(
        HardCase(
            name="a constant stays one",
            why="weights that do not sum to 1 make fringes of nothing",
            inputs=lambda: {"image": np.full((17, 23, 3), 0.7, np.float32)},
            parameters={"scales": [0.5, 1.0, 3.0], "border": "reflect"},
            holds=_constant,
        ),
        HardCase(
            name="what is not a number stays in its colour",
            why="channels that are weighted together share their NaN",
            inputs=lambda: {"image": np.where(np.arange(3) == 0, np.nan, np.full((9, 9, 3), 0.7)).astype(np.float32)},
            parameters={"scales": [1.1, 1.0, 0.9], "border": "clamp"},
            holds=lambda inputs, pixels: _constant(inputs, pixels[..., 1:]),
        ),
    ),
)


@chromatic_aberration.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _by_channel(inputs, p, affine.evaluate_truth, np.float64)


def _add(name: str, told: str) -> None:
    """The method of `affine` of that name, channel by channel."""
    method = affine.methods[name]

    class ByChannel:
        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
            return _by_channel(
                inputs, p, lambda one, warp: method.implementation.opencl(device, one, warp, knob), np.float32
            )

        @staticmethod
        def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
            return _by_channel(inputs, p, lambda one, warp: method.implementation.numpy(one, warp, knob), np.float32)

    def worst(p: Parameters, knob: float, facts: InputFacts) -> Error:
        return method.error(_smallest(p, facts), knob, _facts(facts))

    def least(p: Parameters, knob: float, facts: InputFacts) -> float:
        assert method.least is not None, "methods of affine say what they err by at least"
        return method.least(_smallest(p, facts), knob, _facts(facts))

    def work(p: Parameters, knob: float, facts: InputFacts) -> float:
        works = [method.work(warp, knob, _facts(facts)) for warp in _warps(p, facts)]
        return sum(works[channel if channel < 3 else 1] for channel in range(facts["image"].channels))

    ByChannel.__doc__ = told
    rates = {backend: Rate(3 * rate.start, rate.step) for backend, rate in method.rates.items()}
    chromatic_aberration.method(name, knob=method.knob, error=worst, least=least, work=work, rates=rates)(ByChannel)


for _name in ("bilinear", "bicubic", "lanczos3", "ewa"):
    _add(_name, affine.methods[_name].description)
