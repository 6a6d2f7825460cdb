"""Vector fields from pictures and from one another.

Truth, x to the right and y down, f the mean of a picture's channels, (u, v) the first two channels of a field:

    gradient        (df/dx, df/dy): towards the light
    perpendicular   (-df/dy, df/dx): along the contours, the light to the left as seen, so that lines follow edges
    rotate          (u, v) turned by `angle` from x towards y
    normalise       (u, v) / |(u, v)|; zero stays zero
    curl            dv/dx - du/dy: positive where the field turns from x towards y, clockwise as seen
    divergence      du/dx + dv/dy

Slopes are per pixel, halves of the difference of both neighbours; at the border the difference from the one there is,
and zero across a single row or column. Results are data, whatever the picture was. A gradient of a fine texture is as
rough as the texture: blur first (`gaussian`) for lines that run far. There is no trade of accuracy here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Degrees,
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
    halo,
)

SOURCE = "streamlines/vector.cl"


class Made(StrEnum):
    """What is made."""

    GRADIENT = "gradient"
    PERPENDICULAR = "perpendicular"
    ROTATE = "rotate"
    NORMALISE = "normalise"
    CURL = "curl"
    DIVERGENCE = "divergence"

    @property
    def of_pictures(self) -> bool:
        return self in (Made.GRADIENT, Made.PERPENDICULAR)

    @property
    def of_points(self) -> bool:
        return self in (Made.ROTATE, Made.NORMALISE)

    @property
    def channels(self) -> int:
        return 1 if self in (Made.CURL, Made.DIVERGENCE) else 2


class Parameters(OperationParameters):
    make: Made = Field(Made.PERPENDICULAR, description="what is made of the image")
    angle: Degrees = Field(90.0, ge=-360, le=360, description="of rotate, from x towards y")


def slope(values: Array, axis: int) -> Array:
    """Per pixel along an axis (0: down), in the precision of `values`."""
    size = values.shape[axis]
    before, after = np.maximum(np.arange(size) - 1, 0), np.minimum(np.arange(size) + 1, size - 1)
    apart = (after - before).astype(values.dtype).reshape([-1 if each == axis else 1 for each in range(values.ndim)])
    rise = values.take(after, axis) - values.take(before, axis)
    made: Array = rise / apart if size > 1 else rise * 0
    return made


def computed(pixels: Array, p: Parameters) -> Array:
    """The definition in the precision of `pixels`, (height, width, channels)."""
    if p.make.of_pictures:
        total = np.zeros_like(pixels[:, :, 0])
        for channel in range(pixels.shape[2]):
            total = total + pixels[:, :, channel]
        mean = total / pixels.dtype.type(pixels.shape[2])
        x, y = slope(mean, 1), slope(mean, 0)
        return np.stack([x, y] if p.make is Made.GRADIENT else [-y, x], axis=2)
    u, v = pixels[:, :, 0], pixels[:, :, 1]
    match p.make:
        case Made.ROTATE:
            turn = math.radians(p.angle)
            c, s = pixels.dtype.type(math.cos(turn)), pixels.dtype.type(math.sin(turn))
            return np.stack([c * u - s * v, s * u + c * v], axis=2)
        case Made.NORMALISE:
            return _unit(pixels[:, :, :2])
        case Made.CURL:
            return (slope(v, 1) - slope(u, 0))[:, :, np.newaxis]
        case _:
            return (slope(u, 1) + slope(v, 0))[:, :, np.newaxis]


def _unit(vectors: Array) -> Array:
    """By an exact power of two first, so that no square overflows or vanishes; NaN for what is not finite."""
    largest = np.abs(vectors).max(axis=2, keepdims=True)
    scaled = np.ldexp(vectors, -np.frexp(largest)[1])
    length = np.sqrt(np.square(scaled).sum(axis=2, keepdims=True))
    one = (vectors * 0).sum(axis=2, keepdims=True)
    unit: Array = np.where(largest > 0, scaled / length, vectors) + one
    return unit


# ------------------------------------------------------------------------------------------------------- predictions


def _longest(p: Parameters, facts: InputFacts) -> float:
    """No component is larger."""
    extent = facts["image"].extent
    match p.make:
        case Made.NORMALISE:
            return 1.0
        case Made.ROTATE:
            return math.sqrt(2) * extent.magnitude
        case Made.CURL | Made.DIVERGENCE:
            return 2 * extent.spread
        case _:
            return extent.spread


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    longest = min(_longest(p, facts) * (1 + 1e-5) + 1e-5 * image.extent.magnitude, float(np.finfo(np.float32).max))
    return Facts(image.height, image.width, p.make.channels, extent=Extent(-longest, longest, image.extent.nonfinite))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Each operation once: of a mean, its difference and product, or two products and a sum."""
    image = facts["image"]
    if p.make is Made.NORMALISE:
        value = 8 * ROUNDING
    else:
        terms = image.channels + 6 if p.make.of_pictures else 8
        value = 2 * terms * ROUNDING * max(image.extent.magnitude, _longest(p, facts))
    return Error(value, "bound", value)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    match p.make:
        case Made.NORMALISE:
            return 2.0 if error > 0 else 0.0  # a vector near zero turns round
        case Made.ROTATE:
            return math.sqrt(2) * error
        case Made.CURL | Made.DIVERGENCE:
            return 4 * error
        case _:
            return 2 * error


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    channels = facts["image"].channels
    if p.make.of_pictures or channels >= 2:
        return []
    return [Flaw("/inputs/image", f"has {channels} channel, and {p.make.value} needs two components")]


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    return POINTWISE if p.make.of_points else halo(1)


# -------------------------------------------------------------------------------------------------------- hard cases


def _vectors(u: Any, v: Any) -> dict[str, Array]:
    y, x = np.mgrid[:9, :12].astype(np.float64)
    made = np.broadcast_arrays(u(x, y), v(x, y), x)[:2]
    return {"image": np.stack(made, axis=-1).astype(np.float32)}


def _all(*expected: float) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        apart = float(np.abs(pixels - np.array(expected)).max())
        return None if apart <= 1e-5 else f"off by {apart:.3g} from {expected}"

    return holds


vector = Operation(
    name="vector",
    family="streamlines",
    summary="Makes vector fields: gradients of pictures, turned and normalised fields, curl and divergence.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture, of which the gradient is taken, or a field (x, y)", picture=False),),
    light=Light.STORED,
    footprint=_footprint,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=({}, {"make": "normalise"}, {"make": "curl"}, {"make": "rotate", "angle": 30}),
    hard_cases=(
        HardCase(
            "zero has no direction",
            "0 / 0",
            lambda: _vectors(lambda x, y: 0, lambda x, y: 0),
            {"make": "normalise"},
            _all(0, 0),
        ),
        HardCase(
            "vectors of 1e30",
            "squares overflow",
            lambda: _vectors(lambda x, y: 1e30, lambda x, y: 0),
            {"make": "normalise"},
            _all(1, 0),
        ),
        HardCase(
            "denormal vectors",
            "squares vanish",
            lambda: _vectors(lambda x, y: 0, lambda x, y: -1e-40),
            {"make": "normalise"},
            _all(0, -1),
        ),
        HardCase(
            "a ramp up to its border",
            "there is no neighbour",
            lambda: {"image": np.broadcast_to(np.arange(12, dtype=np.float32), (9, 12))[..., None].copy()},
            {"make": "gradient"},
            _all(1, 0),
        ),
        HardCase(
            "a single pixel",
            "there is no difference",
            lambda: {"image": np.full((1, 1, 3), 0.5, np.float32)},
            {"make": "perpendicular"},
            _all(0, 0),
        ),
        HardCase(
            "rotation",
            "curl is twice the angular speed",
            lambda: _vectors(lambda x, y: 3 - y, lambda x, y: x - 5),
            {"make": "curl"},
            _all(2),
        ),
    ),
)


@vector.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    with np.errstate(all="ignore"):
        return computed(inputs["image"].pixels, p)


@vector.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: float(facts["image"].samples),
    rates={"opencl": Rate(2e-4, 4e-9), "numpy": Rate(1e-4, 1.2e-8)},
)
class Direct:
    """The formulas in single precision."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        image, turn = inputs["image"], math.radians(parameters.angle)
        result = aligned_empty((image.height, image.width, parameters.make.channels))
        with device.session() as session:
            session.launch(
                SOURCE,
                "make",
                (image.width, image.height),
                image.pixels,
                session.write(result),
                *(np.int32(each) for each in (image.width, image.height, image.channels)),
                np.float32(math.cos(turn)),
                np.float32(math.sin(turn)),
                defines={"MADE": list(Made).index(parameters.make)},
            )
        return result

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return aligned(computed(inputs["image"].pixels, parameters), np.float32)
