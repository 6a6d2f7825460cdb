"""Mask: tests pixels, and keeps counters by what they come out as.

Truth: a value v, one channel of the image, is compared with `reference`, or with the pixel's counter s where `against`
is counter. Where it passes, the counter becomes what `on_pass` says, elsewhere what `on_fail` says:

    keep s    zero 0    replace `value`, or v itself    increment min(s + 1, most)    decrement max(s - 1, 0)
    invert most - s                                     where most = 2^bits - 1

Counters are another image of one channel, 0 where none is given, so that by itself this is a threshold: 1 where the
test passes. A chain of masks does what a stencil buffer is for:

* logic of masks, with the other as counter and bits=1: and = keep, zero; or = replace, keep; xor = invert, keep; and
  not = zero, keep;
* counters: how many layers cover a pixel (increment, keep), with both ends saturating;
* decals by priority: the image holds a decal's number where it lies and something large elsewhere; less than the
  counter, it replaces it (against=counter, write=image). Of equal numbers the first stays, or with at_most the last.

A test with NaN fails, but for always and unequal. References count as float32 numbers, like pixels.

Sources: McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, sections 14.1 to 14.3,
whose printed test of priorities masks all bits out and could never pass.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
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
from lichen.operations.compositing.layers import FLOAT_MAX, same_size

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Test(StrEnum):
    """What a value is to be."""

    NEVER = "never"
    ALWAYS = "always"
    LESS = "less"
    AT_MOST = "at_most"
    EQUAL = "equal"
    AT_LEAST = "at_least"
    GREATER = "greater"
    UNEQUAL = "unequal"


class Step(StrEnum):
    """What becomes of a counter."""

    KEEP = "keep"
    ZERO = "zero"
    REPLACE = "replace"
    INCREMENT = "increment"
    DECREMENT = "decrement"
    INVERT = "invert"


class Against(StrEnum):
    """What a value is compared with."""

    REFERENCE = "reference"
    COUNTER = "counter"


class Write(StrEnum):
    """What replaces a counter."""

    VALUE = "value"
    IMAGE = "image"


class Parameters(OperationParameters):
    test: Test = Test.AT_LEAST
    """what the image's value must be"""
    against: Against = Against.REFERENCE
    """compared with what"""
    reference: float = Field(0.5, ge=-1e30, le=1e30)
    """what it is compared with"""
    channel: int = Field(0, ge=0, le=63)
    """the channel of the image that is tested, from 0"""
    on_pass: Step = Step.REPLACE
    """what becomes of the counter where the test passes"""
    on_fail: Step = Step.KEEP
    """and where it does not"""
    write: Write = Write.VALUE
    """what replaces: value, or the image's own"""
    value: float = Field(1.0, ge=-1e30, le=1e30)
    """what replaces counters"""
    bits: int = Field(8, ge=1, le=24)
    """counters end at 2^bits - 1"""

    @property
    def most(self) -> float:
        return 2.0**self.bits - 1


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = same_size(facts, "image", "counter")
    if p.channel >= facts["image"].channels:
        flaws.append(Flaw("/parameters/channel", f"is {p.channel}; the image has {facts['image'].channels}, from 0"))
    return flaws


def _reach(p: Parameters, facts: InputFacts) -> float:
    """Largest magnitude of a counter before or after."""
    counter = facts["counter"].extent.magnitude if "counter" in facts else 0.0
    written = facts["image"].extent.magnitude if p.write is Write.IMAGE else abs(p.value)
    return min(counter + max(p.most, written, 1.0), FLOAT_MAX)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Whole counters are exact; others may be rounded by a step, and a value that replaces them is."""
    value = 1.01 * ROUNDING * _reach(p, facts)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, most = facts["image"], min(_reach(p, facts) * (1 + 1e-6), FLOAT_MAX)
    bad = image.pixels if any(each.extent.nonfinite for each in facts.values()) or most >= FLOAT_MAX else 0
    written = image.extent.low if p.write is Write.IMAGE else p.value
    counter = facts["counter"].extent if "counter" in facts else Extent(0.0, 0.0, 0)
    below = min(counter.low, written, p.most - counter.high if Step.INVERT in (p.on_pass, p.on_fail) else 0.0, 0.0)
    return Facts(
        image.height,
        image.width,
        1,
        Space.DATA,
        Alpha.NONE,
        Extent(max(below * (1 + 1e-6) - 1e-30, -FLOAT_MAX), most, bad),
    )


def _decals() -> Mapping[str, Any]:
    return {
        "image": np.array([[[2.0], [9.0], [np.nan], [5.0]]], np.float32),
        "counter": np.array([[[8.0], [8.0], [8.0], [5.0]]], np.float32),
    }


def _ends() -> Mapping[str, Any]:
    return {"image": np.ones((1, 3, 1)), "counter": np.array([[[254.0], [255.0], [300.0]]], np.float32)}


def _are(*expected: float) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1).tolist()
        return None if got == list(expected) else f"expected {list(expected)}, got {got}"

    return holds


mask = Operation(
    name="mask",
    family="compositing",
    summary="Tests pixels for masks, counters and priorities: thresholds, logic of masks, layers counted.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "what is tested, as it is stored"),
        Input("counter", "masks or counters so far", (1, 1), required=False, picture=False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=lambda p, facts, error: 2 * _reach(p, facts) if error else 0.0,
    check=_check,
    examples=(
        {},
        {"test": "less", "reference": 0.25, "on_fail": "replace", "value": 0.75, "on_pass": "invert", "bits": 1},
        {"test": "greater", "against": "counter", "write": "image", "on_fail": "increment"},
        {"test": "unequal", "on_pass": "increment", "on_fail": "decrement"},
    ),
    hard_cases=(
        HardCase(
            name="priority decals",
            why="a NaN is no number that could win, and of equal numbers one must stay",
            inputs=_decals,
            parameters={"test": "less", "against": "counter", "write": "image"},
            holds=_are(2, 8, 8, 5),
        ),
        HardCase(
            name="counters at their end",
            why="they saturate and do not begin anew at 0",
            inputs=_ends,
            parameters={"test": "always", "on_pass": "increment"},
            holds=_are(255, 255, 255),
        ),
    ),
)


def _kept(inputs: Inputs, p: Parameters) -> Array:
    """The definition, in the precision of the image."""
    v = inputs["image"].pixels[..., p.channel : p.channel + 1]
    s = inputs["counter"].pixels if "counter" in inputs else np.zeros_like(v)
    kind = v.dtype.type
    r = s if p.against is Against.COUNTER else kind(np.float32(p.reference))
    tests: Mapping[Test, Callable[[], Array]] = {
        Test.NEVER: lambda: np.zeros(v.shape, bool),
        Test.ALWAYS: lambda: np.ones(v.shape, bool),
        Test.LESS: lambda: v < r,
        Test.AT_MOST: lambda: v <= r,
        Test.EQUAL: lambda: v == r,
        Test.AT_LEAST: lambda: v >= r,
        Test.GREATER: lambda: v > r,
        Test.UNEQUAL: lambda: v != r,
    }

    def stepped(step: Step) -> Array:
        by = v if p.write is Write.IMAGE else np.full_like(v, p.value)
        with np.errstate(all="ignore"):
            steps: Mapping[Step, Callable[[], Array]] = {
                Step.KEEP: lambda: s,
                Step.ZERO: lambda: np.zeros_like(s),
                Step.REPLACE: lambda: by,
                Step.INCREMENT: lambda: np.minimum(s + kind(1), kind(p.most)),
                Step.DECREMENT: lambda: np.maximum(s - kind(1), kind(0)),
                Step.INVERT: lambda: kind(p.most) - s,
            }
            return steps[step]()

    return np.where(tests[p.test](), stepped(p.on_pass), stepped(p.on_fail))


@mask.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _kept(inputs, p)


@mask.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels,
    rates={"opencl": Rate(3e-4, 2e-9), "numpy": Rate(1e-4, 7e-9)},
)
class Exact:
    """One comparison and one step for each pixel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned_empty((image.height, image.width, 1))
        pixels, counter = aligned(image.pixels), inputs.get("counter")
        choices = (
            list(Test).index(p.test), list(Step).index(p.on_pass), list(Step).index(p.on_fail),
            p.against is Against.COUNTER, p.write is Write.IMAGE,
        )  # fmt: skip
        with device.session() as session:
            session.launch(
                "compositing/mask.cl", "mask", (-(-out.size // 16),),
                pixels, pixels if counter is None else aligned(counter.pixels), session.write(out),
                np.int32(image.channels), np.int32(p.channel), np.int32(counter is not None),
                *(np.int32(each) for each in choices),
                np.float32(p.reference), np.float32(p.value), np.float32(p.most), np.uint64(out.size),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_kept(inputs, p).astype(np.float32))
