"""Saturation: colours moved away from, or towards, the grey of their luminance.

Truth: with L the luminance of a pixel in linear light, y = L + amount (x - L) in every colour channel. 0 gives
luminance, 1 changes nothing, -1 the complementary colours; luminance stays as it is throughout, and grey stays grey.
Beyond [0, 1] colours may leave the gamut; nothing is clamped. At 0 a NaN in one channel has no luminance, so the pixel
has none.

The shares of red, green and blue in luminance follow from the BT.709 primaries and their white.

Source: P. Haeberli, Matrix operations for image processing, 1993; ITU-R BT.709-6.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import (
    POINTWISE,
    Error,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
)
from lichen.operations.colour import affine
from lichen.operations.colour.affine import Affine
from lichen.operations.colour.primaries import luminance


class Parameters(OperationParameters):
    amount: float = Field(1.5, ge=-100, le=100)
    """distance from grey: 0 is grey, 1 as it was, more is more colourful, less than 0 the complement"""

    @property
    def affine(self) -> Affine:
        return _affine(self.amount)


@lru_cache(maxsize=1024)
def _affine(amount: float) -> Affine:
    return Affine.of((1 - amount) * np.broadcast_to(luminance(), (3, 3)) + amount * np.eye(3))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return affine.error(p.affine, facts["image"])


def _greys() -> dict[str, Any]:
    values = np.array([0, 1e-40, 1e-7, 0.18, 0.5, 1, -0.25, 1e4, 1e30], np.float32)
    return {"image": np.repeat(values, 3).reshape(1, -1, 3)}


def _still_grey(inputs: Any, pixels: Array) -> str | None:
    if np.allclose(pixels, inputs["image"], rtol=2e-5, atol=1e-44):
        return None
    return f"grey became {pixels.tolist()}"


saturation = Operation(
    name="saturation",
    family="colour",
    summary="Moves colours away from the grey of their luminance, or towards it.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after the third pass unchanged", channels=(3, None)),),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "amount is 1" if p.amount == 1 else None,
    result=lambda p, facts: affine.result(p.affine, facts["image"]) if p.amount != 1 else facts["image"],
    propagate=lambda p, facts, by: affine.propagate(p.affine, facts["image"], by),
    departure=lambda p, facts: affine.departure(p.affine, facts["image"]),
    link=lambda p, facts: affine.Mixing.of(p.affine, facts["image"]),
    examples=({"amount": 1.5}, {"amount": 0}, {"amount": -1}, {"amount": 0.25}),
    hard_cases=(
        HardCase(
            name="grey at every brightness",
            why="shares that do not add up to 1 give grey a colour or another brightness",
            inputs=_greys,
            parameters={"amount": 20},
            holds=_still_grey,
        ),
        HardCase(
            name="no light",
            why="a ratio of luminances is 0 / 0",
            inputs=lambda: {"image": np.zeros((3, 7, 4), np.float32)},
            parameters={"amount": 3},
            holds=lambda inputs, pixels: None if not pixels.any() else "black became something else",
        ),
    ),
)


@saturation.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Per channel the distance from the pixel's luminance; no luminance is asked where the amount is 1."""
    image = inputs["image"]
    result = image.pixels.copy()
    if p.amount == 1:
        return result
    grey = (image.pixels[..., :3] @ luminance())[..., np.newaxis]
    result[..., :3] = grey + p.amount * (image.pixels[..., :3] - grey) if p.amount else grey
    return result


@saturation.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates=affine.RATES,
    stage=lambda p, facts: affine.stage(p.affine, facts["image"]),
)
class Exact(affine.Applied):
    """One matrix for each amount, applied by fused multiply-adds in float32."""
