"""White noise: every pixel a number of its own.

Truth: the words a, b, c are `pcg3d` of a pixel's column, row and seed, 32-bit integers; u, v and t are their upper 24
bits as numbers in [0, 1). n, which becomes the picture as in all noises, is

* uniform: 2 u - 1;
* triangular: u - v, what dithering wants;
* normal: sqrt(-2 ln(u + 2^-25)) cos(2 pi v) / 6 (Box and Muller 1958), whose standard deviation is 1 / 6; u + 2^-25 is
  never 0, so no value leaves [-1, 1] by itself: the largest is 0.981.

Further channels take the words of the same pixel under other seeds. Nothing repeats before 2^32 pixels in a row, and a
picture that repeats at its edges is no different from one that does not, so there is nothing to tile. Uniform and
triangular noise is the same bit for bit everywhere: there is no accuracy to trade.

Sources: Jarzynski and Olano, Hash functions for GPU rendering, JCGT 9(3), 2020; Box and Muller, A note on the
generation of random normal deviates, 1958."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from lichen.hashing import pcg3d, unit
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import POINTWISE, ROUNDING, Error, HardCase, InputFacts, Inputs, Light, Operation, Rate
from lichen.operations.noise.character import studied
from lichen.operations.noise.parameters import Generated, no_inputs

CHANNEL = 0x9E3779B9
"""Added to the seed from channel to channel."""
BLOCK = 1 << 16


class Distribution(StrEnum):
    """How often a value comes."""

    UNIFORM = "uniform"
    """all equally often"""
    TRIANGULAR = "triangular"
    """the difference of two uniform ones"""
    NORMAL = "normal"
    """the bell, its standard deviation a sixth of the way from the middle to an end"""


class Parameters(Generated):
    distribution: Distribution = Field(Distribution.UNIFORM, description="how often a value comes")
    channels: int = Field(1, ge=1, le=4, description="of the picture, each a noise of its own")
    x: int = Field(0, ge=-(2**31), le=2**31 - 1, description="of the first column", json_schema_extra={"unit": "px"})
    y: int = Field(0, ge=-(2**31), le=2**31 - 1, description="of the first row", json_schema_extra={"unit": "px"})


def _noise(p: Parameters, rows: Array, channel: int, dtype: Any) -> Array:
    """n in some rows."""
    kind = np.dtype(dtype).type
    a, b, _ = pcg3d(np.arange(p.width) + p.x, rows[:, None] + p.y, (p.seed + channel * CHANNEL) % 2**32)
    u, v = unit(a).astype(kind), unit(b).astype(kind)
    if p.distribution is Distribution.UNIFORM:
        return np.asarray(2 * u - 1)
    if p.distribution is Distribution.TRIANGULAR:
        return np.asarray(u - v)
    far = np.sqrt(-2 * np.log(u + kind(2.0**-25)))
    return np.asarray(far * np.cos(kind(2 * np.pi) * v) * kind(1 / 6))


def picture(p: Parameters, dtype: Any) -> Array:
    out = aligned_empty((p.height, p.width, p.channels), dtype)
    step = max(1, BLOCK // p.width)
    for top in range(0, p.height, step):
        rows = np.arange(top, min(top + step, p.height))
        for channel in range(p.channels):
            n = _noise(p, rows, channel, dtype)
            out[top : top + step, :, channel] = out.dtype.type(p.middle) + out.dtype.type(p.half) * n
    return out


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Uniform and triangular n are exact. A normal one carries the rounding of u + 2^-25, which counts by the slope of
    the root of the logarithm, largest at both ends; and those of the functions, an eighth of u where the root is
    steep."""
    n = 60.0 if p.distribution is Distribution.NORMAL else 0.0
    near_one = 2.0**-12 if p.distribution is Distribution.NORMAL else 0.0
    value = ROUNDING * (3 * abs(p.middle) + (n + 4) * abs(p.half)) + near_one * abs(p.half) / 6
    return Error(value, "bound", value)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return p.width * p.height * p.channels * (4.0 if p.distribution is Distribution.NORMAL else 1.0)


def _plain(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    if not np.isfinite(pixels).all() or pixels.min() < 0 or pixels.max() > 1:
        return f"values in [{pixels.min()}, {pixels.max()}]"
    apart = np.abs(np.corrcoef(pixels[:, 1:].ravel(), pixels[:, :-1].ravel())[0, 1])
    return None if apart < 0.05 else f"neighbours are alike: {apart}"


white_noise = Operation(
    name="white_noise",
    family="noise",
    summary="White noise: every pixel a random number of its own, uniform, triangular or normal.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=lambda p, facts: p.facts(slack=1e-5 * (abs(p.middle) + abs(p.half)), channels=p.channels),
    implied=no_inputs,
    examples=(
        {"width": 96, "height": 64},
        {"width": 64, "height": 48, "distribution": "normal", "channels": 3},
        {"width": 64, "height": 48, "distribution": "triangular", "low": -1},
    ),
    hard_cases=(
        HardCase(
            "at the end of the integers",
            "columns pass from 2^31 - 1 to -2^31",
            dict,
            {"width": 64, "height": 64, "x": 2**31 - 20, "y": -(2**31)},
            _plain,
        ),
    ),
)


white_noise.study = studied(white_noise, {}, 1, "after 2^32 px")


@white_noise.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return picture(p, np.float64)


@white_noise.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: (
        p.width * p.height * p.channels * (4.0 if p.distribution is Distribution.NORMAL else 1.0)
    ),
    rates={"opencl": Rate(3e-4, 6e-10), "numpy": Rate(2e-4, 1.2e-8)},
)
class Exact:
    """The formula in float32; uniform and triangular noise without any rounding before the last step."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        out = aligned_empty((p.height, p.width, p.channels))
        kind = list(Distribution).index(p.distribution)
        with device.session() as session:
            session.launch(
                "noise/white.cl", "white", (-(-p.width // 16), p.height),
                session.write(out), *(np.int32(n) for n in (p.width, p.height, p.x, p.y, p.channels, kind)),
                np.uint32(p.seed), np.float32(p.middle), np.float32(p.half), local=(16, 4),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return picture(p, np.float32)
