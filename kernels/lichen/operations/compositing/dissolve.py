"""Dissolve: one picture turns into another, pixel by pixel, each at its own time.

Truth: every pixel has a threshold T. With `amount` t and `softness` s,

    w = 1 where T < t, else 0                         s = 0
    w = (t (1 + s) - T) / s, brought into [0, 1]      s > 0
    result = (1 - w) image + w base

so amount 0 gives the image and 1 the base, wholly, for T in [0, 1]. It is monotone: what has turned stays so as the
amount grows. T is an input of one channel, a wipe or any other pattern in [0, 1], or else white noise in [0, 1) from a
hash of place and `seed`, the same on every machine. A weight of zero takes nothing, not even NaN; a T that is NaN makes
its pixel NaN.

Source: McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, section 14.1; M. Jarzynski
and M. Olano, Hash functions for GPU rendering, JCGT 9(3), 2020.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.hashing import pcg3d, unit
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
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
from lichen.operations.compositing.blending import part
from lichen.operations.compositing.layers import FLOAT_MAX, same_size

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    amount: float = Field(0.5, ge=0, le=1)
    """how far: 0 is the image, 1 the base"""
    softness: float = Field(0.0, ge=0, le=10)
    """how much of the amount a pixel takes to turn; 0 at once, else 0.001 at least"""
    seed: int = Field(0, ge=0, le=2**32 - 1)
    """of the noise that stands in for a missing pattern"""


def noise(height: int, width: int, seed: int) -> Array:
    """Thresholds, float32 (height, width, 1); dissolve.cl gives the same bits."""
    return unit(pcg3d(np.arange(width), np.arange(height)[:, None], seed)[0])[:, :, None]


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, base = facts["image"], facts["base"]
    flaws = same_size(facts, "image", "base", "pattern")
    if (image.channels, image.alpha is Alpha.NONE) != (base.channels, base.alpha is Alpha.NONE):
        flaws.append(
            Flaw(
                "/inputs/base",
                f"has {base.channels} channels, alpha {base.alpha}; the image {image.channels}, {image.alpha}",
            )
        )
    if 0 < p.softness < 1e-3:
        flaws.append(Flaw("/parameters/softness", f"must be 0, or 0.001 at least (got {p.softness:g})"))
    return flaws


def _ends(facts: InputFacts) -> tuple[float, float]:
    # Facts are asked for before the inputs are checked, so the base may not be there yet.
    image, base = facts["image"].extent, facts.get("base", facts["image"]).extent
    return min(image.low, base.low), max(image.high, base.high)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The rounding of the weight, for soft ones, and of the sum."""
    low, high = _ends(facts)
    value = 0.0
    if p.softness and p.amount < 1:
        far = facts["pattern"].extent.magnitude if "pattern" in facts else 1.0
        weight = min(8 * ROUNDING * (1 + p.softness + far) / p.softness, 1.0)
        value = min((high - low) * weight + 4 * ROUNDING * max(abs(low), abs(high)), FLOAT_MAX)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, (low, high) = facts["image"], _ends(facts)
    slack = _error(p, 0.0, facts).value
    bad = image.samples if any(each.extent.nonfinite for each in facts.values()) else 0
    return dataclasses.replace(image, extent=Extent(max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX), bad))


def _halves(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels.reshape(-1)
    fine = np.array_equal(got, [2, 2, 1, 1, np.nan], equal_nan=True)
    return None if fine else f"got {got.tolist()}"


def _pattern() -> Mapping[str, Any]:
    return {
        "image": np.array([[[np.nan], [1], [1], [1], [1]]], np.float32),
        "base": np.array([[[2], [2], [np.nan], [2], [2]]], np.float32),
        "pattern": np.array([[[-1], [0.25], [0.5], [1], [np.nan]]], np.float32),
    }


dissolve = Operation(
    name="dissolve",
    family="compositing",
    summary="Turns one picture into another pixel by pixel, by noise or by a pattern.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the picture at amount 0"),
        Input("base", "the picture at amount 1, of the same size and channels"),
        Input("pattern", "when each pixel turns, 0 to 1; noise by default", (1, 1), required=False, picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "the amount is 0" if p.amount == 0 and "pattern" not in facts else None,
    result=_result,
    propagate=lambda p, facts, error: error,
    implied=lambda p, facts: (
        {} if "pattern" in facts else {"pattern": noise(facts["image"].height, facts["image"].width, p.seed)}
    ),
    check=_check,
    examples=({}, {"amount": 0.3, "softness": 0.5, "seed": 7}, {"amount": 0.8, "softness": 0.001}),
    hard_cases=(
        HardCase(
            name="thresholds at the amount, beyond the ends, and none",
            why="what has turned must hide what it hides, NaN too, and a pixel without a threshold is none",
            inputs=_pattern,
            parameters={"amount": 0.5},
            holds=_halves,
        ),
    ),
)


def _turned(inputs: Inputs, p: Parameters) -> Array:
    """The definition, in the precision of the pictures. The amount counts as a float32 number, as thresholds do."""
    image, base = inputs["image"], inputs["base"]
    kind = image.pixels.dtype.type
    pattern = inputs.get("pattern")
    t = noise(image.height, image.width, p.seed).astype(kind) if pattern is None else pattern.pixels
    amount, one = kind(np.float32(p.amount)), kind(1)
    with np.errstate(all="ignore"):
        if p.amount >= 1:
            w = np.where(np.isnan(t), t, one)
        elif p.softness == 0:
            w = np.where(np.isnan(t), t, (t < amount).astype(kind))
        else:
            softness = kind(p.softness)
            w = np.clip((amount * (one + softness) - t) / softness, 0, 1)
        w = np.broadcast_to(w, image.pixels.shape)
        return part(image.pixels, one - w) + part(base.pixels, w)


@dissolve.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _turned(inputs, p)


@dissolve.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(3e-4, 4e-9), "numpy": Rate(1e-4, 3.5e-8)},
)
class Exact:
    """One threshold and one weighted sum for each pixel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, pattern = inputs["image"], inputs.get("pattern")
        pixels = image.height * image.width
        first, out = aligned(image.pixels), aligned_empty(image.pixels.shape)
        with device.session() as session:
            session.launch(
                "compositing/dissolve.cl", "dissolve", (-(-pixels // 16),),
                first, aligned(inputs["base"].pixels), first if pattern is None else aligned(pattern.pixels),
                session.write(out), np.int32(pattern is not None), np.uint32(p.seed), np.float32(p.amount),
                np.float32(p.softness), np.uint64(image.width), np.uint64(pixels),
                defines={"CHANNELS": image.channels},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_turned(inputs, p))
