"""Frame blur: motion blur from frames, the mean of as many as an exposure takes, for every step of a sequence.

Truth. The image holds `frames` pictures of equal height, one below the other, in the order of time; rows that remain
are not read. Page i of the
result is the mean of the `window` frames from frame i `stride` on; there are 1 + floor((frames - window) / stride)
pages. A window of all frames, the default, gives one picture: an exposure as long as the sequence. A stride as long as
the window makes of a fast sequence one of fewer frames, each blurred by what it replaces; a stride of 1 a sequence seen
through a shutter that stays open.

What moves is blurred as a camera does it, over what stands behind it, which no single picture with motion vectors
(`motion_blur`) can show.

Methods: `summed` sums every window, in doubles. `running` keeps one sum, adds the frames that come and takes off
those that go: two frames for each page, however long the window; its sum is a double, so that it does not drift. It
does not take what is not finite, which would never leave a running sum again. `single` is the same in float32, as
machines with few bits did it; its drift is bounded by the number of frames.

Sources: P. Haeberli and K. Akeley, The accumulation buffer, SIGGRAPH 1990; McReynolds et al., Programming with OpenGL:
advanced rendering, SIGGRAPH course 1997, section 9.1.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    WHOLE,
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
from lichen.operations.compositing.layers import FLOAT_MAX

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    frames: int = Field(1, ge=1, le=4096, description="pictures in the image, one below the other")
    window: int | None = Field(None, ge=1, le=4096, description="frames of an exposure; all of them if left out")
    stride: int = Field(1, ge=1, le=4096, description="frames from one exposure to the next")

    @property
    def length(self) -> int:
        return self.window or self.frames

    @property
    def pages(self) -> int:
        return 1 + (self.frames - self.length) // self.stride


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws, height = [], facts["image"].height
    if p.frames > height:
        flaws.append(Flaw("/parameters/frames", f"is more than the image's {height} row(s) (got {p.frames})"))
    if p.length > p.frames:
        flaws.append(Flaw("/parameters/window", f"is longer than the sequence of {p.frames} (got {p.length})"))
    return flaws


def _summed_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Sums are doubles; one rounding, and what of a double's is left where terms cancel."""
    largest = facts["image"].extent.magnitude
    value = min(1.01 * ROUNDING * largest + 2.0**-50 * p.frames * p.length * largest, FLOAT_MAX)
    return Error(value, "bound", value)


def _single_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Every addition rounds a sum of up to window + stride terms; their errors stay and are divided at the end."""
    steps = p.length + (2 * p.stride * (p.pages - 1))
    value = ROUNDING * facts["image"].extent.magnitude * (2 + steps * (1 + p.stride / p.length))
    value = min(1.01 * value, FLOAT_MAX)
    return Error(value, "bound", min(value, 2 * ROUNDING * facts["image"].extent.magnitude))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    height = max(image.height // p.frames, 1) * max(p.pages, 1)
    slack = _single_error(p, 0.0, facts).value
    low, high = max(image.extent.low - slack, -FLOAT_MAX), min(image.extent.high + slack, FLOAT_MAX)
    bad = image.extent.nonfinite or max(abs(low), abs(high)) >= FLOAT_MAX
    extent = Extent(low, high, height * image.width * image.channels if bad else 0)
    return dataclasses.replace(image, height=height, extent=extent, pages=max(p.pages, 1))


def _unfit(p: Parameters, facts: InputFacts) -> str | None:
    return "what is not finite never leaves a running sum" if facts["image"].extent.nonfinite else None


def _spoilt() -> Mapping[str, Any]:
    frames = np.ones((6, 1, 1), np.float32)
    frames[2] = np.nan
    return {"image": frames}


frame_blur = Operation(
    name="frame_blur",
    family="motion",
    summary="Blurs motion by the mean of neighbouring frames, for every step of a sequence.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "frames of equal height, one below the other"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    identity=lambda p, facts: "an exposure of one frame" if p.length == 1 and p.stride == 1 and p.frames == 1 else None,
    result=_result,
    implied=lambda p, facts: "which frame a row is of depends on where it lies",
    check=_check,
    examples=(
        {"frames": 12, "window": 4},
        {"frames": 7, "window": 2, "stride": 3},
        {"frames": 20, "window": 8, "stride": 4},
    ),
    hard_cases=(
        HardCase(
            name="a frame that is not a number spoils its own windows",
            why="NaN less NaN is NaN, and a running sum has it for ever",
            inputs=_spoilt,
            parameters={"frames": 6, "window": 2},
            holds=lambda inputs, pixels: (
                None if np.isnan(pixels.reshape(-1)).tolist() == [False, True, True, False, False] else f"got {pixels}"
            ),
        ),
        HardCase(
            name="dark frames after a highlight",
            why="a running sum keeps the rounding of 1e8",
            inputs=lambda: {"image": np.array([1e8, 0.1, 0.1, 0.1, 0.1], np.float32).reshape(5, 1, 1)},
            parameters={"frames": 5, "window": 2},
            holds=lambda inputs, pixels: (
                None if np.allclose(pixels[1:], 0.1, rtol=0, atol=1e-7) else f"got {pixels.reshape(-1)}"
            ),
            methods=("summed", "running"),
        ),
    ),
)


def _frames(image: Array, p: Parameters) -> Array:
    """(frames, rows, width, channels)."""
    rows = len(image) // p.frames
    return image[: rows * p.frames].reshape(p.frames, rows, *image.shape[1:])


def _means(inputs: Inputs, p: Parameters) -> Array:
    """Every window summed, float64."""
    image = inputs["image"].pixels
    frames = _frames(image, p)
    out = np.empty((p.pages, *frames.shape[1:]))
    with np.errstate(all="ignore"):
        for number in range(p.pages):
            begin = number * p.stride
            out[number] = frames[begin : begin + p.length].sum(axis=0, dtype=np.float64) / p.length
    return out.reshape(-1, *image.shape[1:])


def _running(inputs: Inputs, p: Parameters, kind: type[np.floating]) -> Array:
    image = inputs["image"].pixels
    frames = _frames(image, p)
    out, total = np.empty((p.pages, *frames.shape[1:]), np.float32), np.zeros(frames.shape[1:], kind)
    known = 0
    with np.errstate(all="ignore"):
        for number in range(p.pages):
            begin = number * p.stride
            for frame in range(begin - p.stride if number else begin, begin):
                total -= frames[frame]
            for frame in range(known, begin + p.length):
                total += frames[frame]
            known = begin + p.length
            out[number] = total / kind(p.length)
    return aligned(out.reshape(-1, *image.shape[1:]))


@frame_blur.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _means(inputs, p)


def _launched(device: Device, inputs: Inputs, p: Parameters, kind: str, *, running: bool) -> Array:
    image = inputs["image"]
    samples = image.height // p.frames * image.width * image.channels
    out = aligned_empty((image.height // p.frames * p.pages, image.width, image.channels))
    with device.session() as session:
        session.launch(
            "motion/frame_blur.cl", "means", (-(-samples // 64),),
            aligned(image.pixels), session.write(out), np.uint64(samples), np.int32(p.length), np.int32(p.stride),
            np.int32(p.pages),
            local=(1,), defines={"RUNNING": int(running), "TOTAL": kind},
        )  # fmt: skip
    return out


def _work(p: Parameters, facts: InputFacts, each: int) -> float:
    """Frames that are added or taken off."""
    return facts["image"].samples / p.frames * (p.length + each * max(p.pages - 1, 0) + p.pages)


@frame_blur.method(
    "summed",
    error=_summed_error,
    work=lambda p, knob, facts: _work(p, facts, p.length),
    rates={"opencl": Rate(3e-4, 5e-10), "numpy": Rate(2e-4, 3e-9)},
)
class Summed:
    """Every window, in doubles."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Summed.numpy(inputs, p, knob)
        return _launched(device, inputs, p, "double", running=False)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_means(inputs, p).astype(np.float32))


@frame_blur.method(
    "running",
    error=_summed_error,
    work=lambda p, knob, facts: _work(p, facts, 2 * p.stride),
    rates={"opencl": Rate(3e-4, 5e-10), "numpy": Rate(2e-4, 3e-9)},
    unfit=_unfit,
)
class Running:
    """One sum in doubles, that takes what comes and gives back what goes."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Running.numpy(inputs, p, knob)
        return _launched(device, inputs, p, "double", running=True)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _running(inputs, p, np.float64)


@frame_blur.method(
    "single",
    error=_single_error,
    work=lambda p, knob, facts: _work(p, facts, 2 * p.stride),
    rates={"opencl": Rate(3e-4, 3e-10), "numpy": Rate(2e-4, 1.5e-9)},
    unfit=_unfit,
)
class Single:
    """One sum in float32."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, "float", running=True)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _running(inputs, p, np.float32)
