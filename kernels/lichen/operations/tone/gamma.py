"""Gamma: every colour channel raised to a power.

Truth: y = sign(x) |x|^gamma, with one exponent or one for each colour channel; its reciprocal where `direction` is
encode. Coverage passes. Above 1 gamma darkens what lies between 0 and 1, below 1 it lightens. Negative values are
mirrored or, clamped, 0.

This is `transfer` with curve=gamma by its plain name, computed by the same bodies to the same bits: `exact` evaluates
the power, `table` interpolates it linearly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import (
    POINTWISE,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Method,
    Operation,
    OperationParameters,
)
from lichen.operations.tone.curves import Curve, Direction
from lichen.operations.tone.transfer import transfer
from lichen.operations.tone.transfer_parameters import Exponent, Negative
from lichen.operations.tone.transfer_parameters import Parameters as TransferParameters

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lichen.image import Image
    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    gamma: Exponent | Annotated[tuple[Exponent, ...], Field(min_length=1, max_length=64)] = 2.2
    """the exponent, or one for each colour channel"""
    direction: Direction = Direction.DECODE
    """decode raises to gamma, encode to its reciprocal"""
    negative: Negative = Negative.MIRROR
    """negative values: mirror keeps them by odd extension, clamp makes them 0"""

    @property
    def as_transfer(self) -> TransferParameters:
        return _as_transfer(self)


@latest
def _as_transfer(p: Parameters) -> TransferParameters:
    return TransferParameters.model_validate({"curve": Curve.GAMMA, **p.model_dump()})


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    return transfer.check(p.as_transfer, facts)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    return transfer.result(p.as_transfer, facts)


def _inverse(p: Parameters) -> Parameters | None:
    back = transfer.inverse(p.as_transfer)
    return p.model_copy(update={"direction": back.direction}) if back else None


def _zeros(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = [0.0, 0.0, 0.0, 0.25, -0.25]
    got = pixels.reshape(-1)
    same = np.allclose(got[:5], expected, atol=1e-6) and np.isnan(got[5]) and np.isinf(got[6])
    return None if same else f"expected {expected}, NaN and infinity, got {got.tolist()}"


gamma = Operation(
    name="gamma",
    family="tone",
    summary="Raises every colour channel to a power.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: transfer.identity(p.as_transfer, facts),
    result=_result,
    propagate=lambda p, facts, error: transfer.propagate(p.as_transfer, facts, error),
    inverse=_inverse,
    wants_alpha=transfer.wants_alpha,
    check=_check,
    examples=(
        {"gamma": 2.2},
        {"gamma": [1.8, 2.2, 2.6], "direction": "encode"},
        {"gamma": 0.5, "negative": "clamp"},
    ),
    hard_cases=(
        HardCase(
            name="zeros, signs, NaN and infinity",
            why="log2(0) is infinite, and a power of a negative number NaN",
            inputs=lambda: {
                "image": np.array([0.0, -0.0, 1e-40, 0.5, -0.5, np.nan, np.inf], np.float32).reshape(1, -1, 1)
            },
            parameters={"gamma": 2.0},
            holds=_zeros,
        ),
    ),
)


@gamma.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image: Image = inputs["image"]
    exponent = np.array(p.gamma) if p.direction is Direction.DECODE else 1 / np.array(p.gamma)
    result, x = image.pixels.copy(), image.pixels[..., : image.colours]
    with np.errstate(all="ignore"):
        y = np.copysign(np.abs(x) ** exponent, x)
    result[..., : image.colours] = np.where(x < 0, 0, y) if p.negative is Negative.CLAMP else y
    return result


class Taken:
    """The bodies of transfer's method."""

    taken: ClassVar[Method[TransferParameters]]

    @classmethod
    def opencl(cls, device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return cls.taken.implementation.opencl(device, inputs, parameters.as_transfer, knob)

    @classmethod
    def numpy(cls, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return cls.taken.implementation.numpy(inputs, parameters.as_transfer, knob)


def _declare(name: str) -> Callable[[type[Taken]], type[Taken]]:
    """Declares a body as transfer's method of the same name, seen by these parameters."""
    taken = transfer.methods[name]

    def register(body: type[Taken]) -> type[Taken]:
        body.taken = taken
        gamma.method(
            name,
            error=lambda p, knob, facts: taken.error(p.as_transfer, knob, facts),
            work=lambda p, knob, facts: taken.work(p.as_transfer, knob, facts),
            rates=taken.rates,
            knob=taken.knob,
            orderly=taken.orderly,
            unfit=lambda p, facts: taken.unfit(p.as_transfer, facts),
        )(body)
        return body

    return register


@_declare("exact")
class Exact(Taken):
    """The power in float32, to a few roundings times its exponent."""


@_declare("table")
class Interpolated(Taken):
    """Linear interpolation in a table whose cells shrink with the sample; proved up to 1, computed above it."""
