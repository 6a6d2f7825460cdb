"""Motion blur: every pixel takes the mean of the picture along its own motion while the shutter is open.

Truth. With m the pixel's motion, in pixels to the right and down per frame, shortened to `largest` where it is longer,

    result(p) = 1 / shutter  integral of  picture(p - m t)  for t from `start` to `start` + `shutter`

What is at p at time t was at p - m t in the picture. Between pixels the picture is bilinear, and beyond its edges it
goes on as `border` says. A start of -0.5 and a shutter of 1 expose a full frame about the picture's own time; film
is exposed for half a frame (180 degrees: start -0.25, shutter 0.5). A pixel that does not move keeps its value; one
whose motion is not finite becomes NaN.

A pixel looks along its own motion alone, as is usual where a renderer gives motion vectors: what moves does not spread
over what stands still beside it. Frames averaged (`frame_blur`) do not have that flaw.

Methods: `exact` goes from crossing to crossing of the lines through pixel centres; between two of them the picture is a
quadratic along the path, for which Simpson's rule has no error. `sampled` takes the mean of as many bilinear samples as
asked for. For a path of length l that mean is off by no more than the picture's range times l / (4 samples), since the
picture changes by at most its range from pixel to pixel along either axis.

Sources: P. Haeberli and K. Akeley, The accumulation buffer, SIGGRAPH 1990; McReynolds et al., Programming with OpenGL:
advanced rendering, SIGGRAPH course 1997, section 9.1; M. Potmesil and I. Chakravarty, Modeling motion blur in
computer-generated images, SIGGRAPH 1983.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
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
    Knob,
    Light,
    Operation,
    OperationParameters,
    Pixels,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX, same_size
from lichen.operations.motion.paths import Picture, along, sampled, shortened

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    shutter: float = Field(1.0, ge=1e-3, le=4, description="how long it is open, in frames")
    start: float = Field(-0.5, ge=-4, le=4, description="when it opens, in frames from the picture's own time")
    largest: Pixels = Field(64.0, gt=0, le=1024, description="longer motions are shortened to this")
    border: Border = Field(Border.CLAMP, description="how the picture continues beyond its edges")
    value: float = Field(0.0, ge=-1e9, le=1e9, description="what lies beyond a constant border, in every channel")

    @property
    def end(self) -> float:
        return self.start + self.shutter


def _longest(p: Parameters, facts: InputFacts) -> float:
    """Of the motions, as they are used."""
    return min(p.largest, math.sqrt(2) * facts["motion"].extent.magnitude) if "motion" in facts else p.largest


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    reach = math.ceil(_longest(p, facts) * max(abs(p.start), abs(p.end))) + 1
    if p.border is Border.WRAP:
        return Footprint(reach, reach, wraps=True)
    return Footprint(reach, reach)


def _range(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    extent = facts["image"].extent
    low, high = extent.low, extent.high
    return (min(low, p.value), max(high, p.value)) if p.border is Border.CONSTANT else (low, high)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    motion = facts["motion"].extent
    return "nothing moves" if motion.magnitude == 0 and not motion.nonfinite else None


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A weight's rounding, and the sum's, in doubles but for its last."""
    low, high = _range(p, facts)
    value = min(3 * ROUNDING * max(abs(low), abs(high)), FLOAT_MAX)
    return Error(value, "bound", value)


def _sampled_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    low, high = _range(p, facts)
    samples = round(knob)
    rounding = min((samples + 8) * ROUNDING * max(abs(low), abs(high)), FLOAT_MAX)
    # Along a slanted path both coordinates change, together by up to the square root of 2 times its length.
    off = min(1.0, math.sqrt(2) * _longest(p, facts) * p.shutter / (4 * samples))
    return Error(min((high - low) * off + rounding, FLOAT_MAX), "bound", rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    low, high = _range(p, facts)
    slack = (300 * ROUNDING) * max(abs(low), abs(high))
    bad = any(each.extent.nonfinite for each in facts.values()) or max(abs(low), abs(high)) + slack >= FLOAT_MAX
    return dataclasses.replace(
        image,
        extent=Extent(max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX), image.samples if bad else 0),
    )


def _moving(*motion: tuple[float, float]) -> Mapping[str, Any]:
    """A row of an edge, three rows of it, each pixel with its motion."""
    row = np.repeat([0.0, 1.0], len(motion))[: 2 * len(motion)].reshape(1, -1, 1)
    image = np.repeat(row, 3, axis=0).astype(np.float32)
    vectors = np.array(motion * 2, np.float32).reshape(1, -1, 2)
    return {"image": image, "motion": np.repeat(vectors, 3, axis=0)}


def _kept(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """NaN where the motion is not finite, and within the picture's range elsewhere."""
    lost = ~np.isfinite(inputs["motion"]).all(axis=-1, keepdims=True)
    if not np.isnan(pixels[lost]).all():
        return "a motion that is not finite became a colour"
    inside = pixels[~lost]
    good = np.isfinite(inside).all() and inside.min() >= 0 and inside.max() <= 1 + 1e-6
    return None if good else f"left the range: {inside.min():g} to {inside.max():g}"


motion_blur = Operation(
    name="motion_blur",
    family="motion",
    summary="Blurs every pixel along its own motion vector while a shutter is open.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture"),
        Input("motion", "px to the right and down that each pixel moves in a frame", (2, 2), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    identity=_identity,
    result=_result,
    check=lambda p, facts: same_size(facts, "image", "motion"),
    examples=(
        {"shutter": 3.5, "start": -1.75},
        {"shutter": 0.5, "start": -0.25, "border": "constant", "value": 0.5},
        {"largest": 3.0, "border": "reflect", "start": 0.0},
    ),
    hard_cases=(
        HardCase(
            name="motions of no length, of any, and of none",
            why="a direction of nothing is 0 / 0, and a path without end never ends",
            inputs=lambda: _moving((0, 0), (1e-30, 0), (1e30, -1e30), (np.nan, 1), (0, np.inf), (-0.0, 1e-12)),
            parameters={},
            holds=_kept,
        ),
        HardCase(
            name="a constant stays one",
            why="weights that do not sum to 1 darken what does not change",
            inputs=lambda: {
                "image": np.full((9, 12, 1), 0.7, np.float32),
                "motion": np.random.default_rng(0).normal(0, 5, (9, 12, 2)).astype(np.float32),
            },
            parameters={"shutter": 0.7},
            holds=lambda inputs, pixels: (
                None if np.abs(pixels - np.float32(0.7)).max() <= 1e-6 else f"off by {np.abs(pixels - 0.7).max():g}"
            ),
        ),
        HardCase(
            name="highlights of 1e4 draw their own trace",
            why="sums beside them lose what is dark",
            inputs=lambda: {
                "image": np.where(np.arange(16) == 8, 1e4, 0.0).astype(np.float32).reshape(1, 16, 1),
                "motion": np.full((1, 16, 2), (4.0, 0.0), np.float32),
            },
            parameters={},
            holds=lambda inputs, pixels: (
                None if abs(float(pixels.sum()) - 1e4) < 0.1 else f"the trace holds {float(pixels.sum()):g}"
            ),
            methods=("exact",),
        ),
    ),
)


def _picture(inputs: Inputs, p: Parameters) -> Picture:
    return Picture(inputs["image"].pixels, p.border, p.value)


@motion_blur.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return along(_picture(inputs, p), shortened(inputs["motion"].pixels, p.largest), p.start, p.end)


def _launched(device: Device, inputs: Inputs, p: Parameters, samples: int) -> Array:
    image = inputs["image"]
    out = aligned_empty(image.pixels.shape)
    defines: dict[str, int | float | str] = {
        "CHANNELS": image.channels, "BORDER": list(Border).index(p.border), "WALK": int(samples == 0),
        "TOTAL": "float" if samples else "double",
    }  # fmt: skip
    pixels = image.height * image.width
    with device.session() as session:
        session.launch(
            "motion/motion_blur.cl", "blurred", (-(-pixels // 16),),
            aligned(image.pixels), aligned(inputs["motion"].pixels), session.write(out),
            aligned(np.array([p.start, p.end, p.largest, p.value]), np.float64), np.int32(image.width),
            np.int32(image.height), np.int32(samples), np.uint64(pixels),
            defines=defines,
        )  # fmt: skip
    return out


def _work(p: Parameters, each: float, facts: InputFacts) -> float:
    return facts["image"].pixels * each * (2.0 + facts["image"].channels)


@motion_blur.method(
    "exact",
    error=_exact_error,
    work=lambda p, knob, facts: _work(p, 1 + 4 * _longest(p, facts) * p.shutter / math.sqrt(2), facts),
    rates={"opencl": Rate(3e-4, 5e-10), "numpy": Rate(1e-3, 6e-8)},
)
class Exact:
    """From crossing to crossing of the lines through pixel centres, where Simpson's rule has no error."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, 0) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(along(_picture(inputs, p), shortened(inputs["motion"].pixels, p.largest), p.start, p.end))


@motion_blur.method(
    "sampled",
    knob=Knob("samples", (4, 8, 16, 32, 64), "bilinear samples along each path", 2, 256, order=-2),
    error=_sampled_error,
    work=lambda p, knob, facts: _work(p, knob, facts),
    rates={"opencl": Rate(3e-4, 2.5e-9), "numpy": Rate(1e-3, 6e-8)},
)
class Sampled:
    """The mean of bilinear samples at even distances."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        samples = round(knob)
        return _launched(device, inputs, p, samples) if device.has_fp64 else Sampled.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        motion = shortened(inputs["motion"].pixels, p.largest)
        return aligned(sampled(_picture(inputs, p), motion, p.start, p.end, round(knob)))
