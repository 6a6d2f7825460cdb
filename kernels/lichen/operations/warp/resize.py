"""Resize: another number of rows and columns over the same rectangle.

Truth: rows and columns, each by the Lanczos kernel of radius 3, stretched where the image shrinks so that it covers
what a pixel of the result does (see `lichen.operations.warp.separable`). Pixels are squares: with n samples in and m
out, the centre of sample i lies at (i + 1/2) n / m of the input, and edges lie on edges.

The size is that of `width` and `height`, of which one may be left out to keep the proportions, or that of the image
times `scale`, to the nearest whole pixel.

Methods are the kernels, all stretched alike: nothing aliases, but by what a kernel lets through.

* `nearest` takes the sample below the middle of each pixel, the only one that does alias.
* `box` is the mean of the samples a pixel covers; enlarged, it repeats them.
* `triangle`, `bicubic` (Catmull-Rom), `mitchell`, `lanczos2`, `lanczos3` (truth).

All errors but rounding are those of the weights: the bound is the sum of the magnitudes of their differences from
truth's, times half the range of the image.

Sources: Turkowski, Filters for common resampling tasks, Graphics Gems 1990; Mitchell and Netravali, SIGGRAPH 1988.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, StoredImage
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
from lichen.opencl.device import Device
from lichen.opencl.session import Held, Session
from lichen.operation import (
    ROUNDING,
    WHOLE,
    Border,
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
from lichen.operations.warp import cases, kernels
from lichen.operations.warp.kernels import Kernel
from lichen.operations.warp.launch import built_for
from lichen.operations.warp.prediction import LARGEST, Size, check_size, result_facts
from lichen.operations.warp.separable import Axis, axis, ring
from lichen.part import Part, Place, Rectangle, place_of, placed

Factor = Annotated[float, Field(gt=0, le=LARGEST)]
STRIP, BLOCK = 64, 4
"""Floats of a row, or columns, and rows that one work-item does; as in resize.cl."""
WIDE, BAND = 1280, 64
"""Floats of a source row, and rows of the result, that one work-item does both axes of."""


class Parameters(OperationParameters):
    width: int | None = Field(None, ge=1, le=LARGEST, description="columns of the result")
    height: int | None = Field(None, ge=1, le=LARGEST, description="rows of the result")
    scale: Factor | tuple[Factor, Factor] | None = Field(
        None, description="in place of width and height: one factor, or one across and one down"
    )
    border: Border = Field(Border.CLAMP, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")


def size_of(p: Parameters, facts: InputFacts) -> Size:
    """Width and height of the result."""
    image = facts["image"]
    if p.scale is not None:
        across, down = p.scale if isinstance(p.scale, tuple) else (p.scale, p.scale)
        return max(1, math.floor(image.width * across + 0.5)), max(1, math.floor(image.height * down + 0.5))
    width, height = p.width, p.height
    if width is None and height is None:
        return image.width, image.height
    if width is None:
        width = max(1, math.floor(image.width * (height or 1) / image.height + 0.5))
    if height is None:
        height = max(1, math.floor(image.height * width / image.width + 0.5))
    return width, height


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    if p.scale is not None and (p.width is not None or p.height is not None):
        return [Flaw("/parameters/scale", "a scale, or width and height: not both")]
    size = size_of(p, facts)
    if max(size) > LARGEST:
        return [Flaw("/parameters/scale", f"makes {size[0]} x {size[1]} pixels; a side has {LARGEST} at most")]
    return check_size(facts["image"], size)


TRUTH = kernels.LANCZOS3
BOX = Kernel("box", 0.5, kernels.NEAREST.value, 0)
METHODS: dict[str, tuple[Kernel, str]] = {
    "nearest": (kernels.NEAREST, "The sample below the middle of each pixel."),
    "box": (BOX, "The mean of the samples that a pixel covers."),
    "triangle": (kernels.BILINEAR, "The triangle kernel: bilinear where the image grows."),
    "bicubic": (kernels.CATMULL_ROM, "The Catmull-Rom spline."),
    "mitchell": (kernels.MITCHELL, "Mitchell and Netravali's cubic: no rings, a little blur."),
    "lanczos2": (kernels.LANCZOS2, "The Lanczos kernel of radius 2."),
    "lanczos3": (kernels.LANCZOS3, "The Lanczos kernel of radius 3: truth, in float32."),
}


@lru_cache(maxsize=64)
def table(before: int, after: int, name: str, border: Border) -> Axis:
    """The weights of a method along one axis. Nearest takes one sample; box the share of each that a pixel covers."""
    if name == "nearest":
        place = np.minimum(np.floor((np.arange(after) + 0.5) * before / after), before - 1).astype(np.int32)
        return Axis(place[:, np.newaxis], np.ones((after, 1)), np.zeros(after))
    if name == "box":
        return _covered(before, after)
    return axis(before, after, METHODS[name][0], border)


def _covered(before: int, after: int) -> Axis:
    """The mean over the pixel, of samples that are constant over theirs: exact shares, no sample outside."""
    step = before / after
    begin, end = np.arange(after) * step, np.arange(1, after + 1) * step
    if step < 1:  # a smaller pixel than a sample: the sample it lies in, as wide as one is
        middle = (begin + end) / 2
        begin, end = np.floor(middle), np.floor(middle) + 1
    first = np.floor(begin).astype(np.int64)
    index = first[:, np.newaxis] + np.arange(int(np.ceil(step)) + 1)
    weights = np.clip(np.minimum(index + 1, end[:, np.newaxis]) - np.maximum(index, begin[:, np.newaxis]), 0, None)
    weights[weights < 1e-9] = 0
    index = np.where(weights > 0, np.minimum(index, before - 1), np.minimum(first, before - 1)[:, np.newaxis])
    return Axis(index.astype(np.int32), weights / weights.sum(axis=1, keepdims=True), np.zeros(after))


@latest
def _sizes(p: Parameters, image: Facts) -> tuple[Size, Size]:
    """Of the whole image and of the whole result."""
    if place := place_of(p):
        return place.source_size, place.result_size
    return (image.width, image.height), size_of(p, {"image": image})


def made(p: Parameters, image: Facts) -> Size:
    """Of what is made, which may be a part."""
    place = place_of(p)
    return place.result[2:] if place else _sizes(p, image)[1]


def _axes(p: Parameters, image: Facts, name: str) -> tuple[Axis, Axis]:
    """Across and down."""
    before, after = _sizes(p, image)
    across, down = (table(before[way], after[way], name, p.border) for way in (0, 1))
    place = place_of(p)
    if place is None:
        return across, down
    (left, top, width, height), (x, y, columns, rows) = place.source, place.result
    return across.part(x, columns, left, width), down.part(y, rows, top, height)


def _part(p: Parameters, facts: InputFacts, wanted: Rectangle) -> Part:
    """The samples that any of the kernels takes."""
    before, after = _sizes(p, facts["image"])
    x, y, columns, rows = wanted
    spans = []
    for way, first, count in ((0, x, columns), (1, y, rows)):
        each = [table(before[way], after[way], name, p.border).read(first, count) for name in METHODS]
        low, high = min(start for start, _ in each), max(end for _, end in each)
        spans.append((low, high - low))
    shown = spans[0][0], spans[1][0], spans[0][1], spans[1][1]
    return Part(
        placed(p, Place(source=shown, result=wanted, source_size=before, result_size=after)), {"image": shown}, wanted
    )


@lru_cache(maxsize=128)
def apart(before: int, after: int, name: str, border: Border) -> tuple[float, float]:
    """Largest sum, and mean root of squares, of the differences between a method's weights and truth's."""
    one, other = table(before, after, name, border), table(before, after, "lanczos3", border)
    # No row takes samples that lie further apart than this, counted round where the border is periodic.
    reach = math.ceil(TRUTH.radius * max(before / after, 1.0)) + 2
    width = min(2 * reach + 1, before)
    first = np.floor((np.arange(after) + 0.5) * (before / after)).astype(np.int64)[:, np.newaxis] - reach
    largest, squares = 0.0, 0.0
    rows = max(1, (1 << 20) // width)
    for start in range(0, after, rows):
        some = slice(start, start + rows)
        size = len(one.index[some]) * width
        dense, at = np.zeros(size), np.arange(0, size, width)[:, np.newaxis]
        for each, sign in ((one, 1.0), (other, -1.0)):
            places = at + (each.index[some] - first[some]) % before
            dense += sign * np.bincount(places.ravel(), each.weights[some].ravel(), size)
        off, constant = dense.reshape(-1, width), one.constant[some] - other.constant[some]
        largest = max(largest, float((np.abs(off).sum(axis=1) + np.abs(constant)).max()))
        squares += float(np.square(off).sum() + np.square(constant).sum())
    return largest, math.sqrt(squares / after)


APART: Mapping[str, float] = {
    "nearest": 0.25, "box": 0.15, "triangle": 0.14, "bicubic": 0.065, "mitchell": 0.12, "lanczos2": 0.06,
}  # fmt: skip
"""The mean of `apart` at least along an axis of 8 samples or more before and after, over the root of its shrinking."""


@latest
def _unlike(p: Parameters, facts: InputFacts) -> float:
    """How far methods are from truth at least, over `APART`: of the axis that is further, which takes no table."""
    extent, sizes = facts["image"].extent, zip(*_sizes(p, facts["image"]), strict=True)
    changed = [min(after / before, 1.0) for before, after in sizes if before != after and min(before, after) >= 8]
    return 0.2 * math.sqrt(max(changed, default=0.0)) * (extent.high - extent.low)


def error(name: str, p: Parameters, knob: float, facts: InputFacts) -> Error:
    image = facts["image"]
    low, high = image.extent.low, image.extent.high
    if p.border is Border.CONSTANT:
        low, high = min(low, p.value), max(high, p.value)
    across, down = _axes(p, image, name)
    least = 1.01 * (across.taps + down.taps + 8) * ROUNDING * across.gain * down.gain * max(abs(low), abs(high))
    if name == "lanczos3":
        return Error(least, "bound", least)
    before, after = _sizes(p, image)
    wide, wide_rms = apart(before[0], after[0], name, p.border)
    tall, tall_rms = apart(before[1], after[1], name, p.border)
    off = wide * table(before[1], after[1], "lanczos3", p.border).gain + across.gain * tall
    typical = min(0.2 * math.hypot(wide_rms, tall_rms), off / 2)
    return Error((high - low) / 2 * off + least, "bound", least, (high - low) * typical + least)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    gains = [math.prod(each.gain for each in _axes(p, image, name)) for name in METHODS]
    return result_facts(p, facts, made(p, image), max(gains))


def _propagate(p: Parameters, facts: InputFacts, by: float) -> float:
    return by * math.prod(each.gain for each in _axes(p, facts["image"], "lanczos3"))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    return "the size is the image's" if size_of(p, facts) == (image.width, image.height) else None


def _work(name: str, p: Parameters, knob: float, facts: InputFacts) -> float:
    """Multiplications of both passes, rows first."""
    image, (width, height) = facts["image"], made(p, facts["image"])
    across, down = _axes(p, image, name)
    return float(image.channels * (height * image.width * (down.taps + 1) + height * width * (across.taps + 1)))


def _checkerboard() -> cases.Given:
    at = np.arange(64)
    return {"image": ((at[:, None] + at) % 2).astype(np.float32)[..., None].repeat(3, axis=2)}


def _half(inputs: cases.Given, pixels: Array) -> str | None:
    wrong = float(np.abs(pixels - 0.5).max())
    return None if wrong <= 1e-6 else f"off by {wrong:g}"


resize = Operation(
    name="resize",
    family="warp",
    summary="Gives an image another number of rows and columns.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=_propagate,
    implied=lambda p, facts: "the result has another size than the image",
    part=_part,
    identity=_identity,
    check=_check,
    customary=("lanczos3", None),
    examples=(
        {"scale": 0.4},
        {"width": 96, "height": 20, "border": "reflect"},
        {"scale": [0.25, 1.6], "border": "constant", "value": 0.3},
        {"height": 7, "border": "wrap"},
    ),
    hard_cases=(
        HardCase(
            name="checkerboard",
            why="the mean of light and dark is half the light; taken from display values it is far darker",
            inputs=_checkerboard,
            parameters={"width": 8, "border": "wrap"},
            holds=_half,
            methods=("box", "triangle", "bicubic", "mitchell", "lanczos2", "lanczos3"),
        ),
        HardCase(
            name="to one pixel",
            why="weights of thousands of samples must still sum to one",
            inputs=cases.constant,
            parameters={"width": 1, "height": 1},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="to many",
            why="a constant must not ripple",
            inputs=lambda: {"image": np.full((3, 1, 2), 0.7, np.float32)},
            parameters={"width": 501, "height": 333},
            holds=cases.stays_constant,
        ),
    ),
)


@resize.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    across, down = _axes(p, Facts.sized(image), "lanczos3")
    return across.apply(down.apply(image.pixels, p.value).swapaxes(0, 1), p.value).swapaxes(0, 1)


def _opencl(device: Device, inputs: Inputs, p: Parameters, name: str) -> Array:
    image = inputs["image"]
    across, down = _axes(p, Facts.sized(image), name)
    coded = isinstance(image, StoredImage) and ring(across, down, WIDE // image.channels)
    pixels, meant = image.coded if isinstance(image, StoredImage) and coded else (aligned(image.pixels), None)
    with device.session() as session:
        return launched(device, session, pixels, across, down, p.value, meant)


def launched(
    device: Device, session: Session, pixels: Array, across: Axis, down: Axis, value: float, meant: Array | None = None
) -> Array:
    """Both axes of aligned pixels on a device, or where there is a `ring` of codes and what they are `meant` to be."""
    (height, width), (_, columns, channels) = (len(down.index), len(across.index)), pixels.shape
    out = aligned_empty((height, width, channels))
    given = tables(device, down, value), tables(device, across, value)
    if not session.in_step and (laid := ring(across, down, WIDE // channels)):  # such rings are for first caches
        slots, reach, wide, spans = laid
        strips, band = len(spans), BAND
        while band > 8 and strips * -(-height // band) < 4 * device.compute_units:
            band //= 2
        session.launch(
            "warp/resize.cl", "both", (strips, -(-height // band)), pixels, meant, session.readwrite(out),
            *given[0], *given[1], reach, spans, np.int32(columns), np.int32(width), np.int32(height),
            np.int32(band), np.int32(channels), local=(1, 1),
            defines={**built_for(channels), "SLOTS": slots, "OUT": wide, "WIDE": WIDE, "CODED": int(meant is not None)},
        )  # fmt: skip
        return out
    between = session.scratch((height, columns, channels))
    session.launch(
        "warp/resize.cl", "down", (-(-columns * channels // STRIP), height), pixels,
        session.readwrite(between), *given[0], np.int32(columns * channels), np.int32(height), local=(1, 16),
        defines=built_for(channels),
    )  # fmt: skip
    session.launch(
        "warp/resize.cl", "across", (-(-width // STRIP), -(-height // BLOCK)), between, session.readwrite(out),
        *given[1], *map(np.int32, (columns, width, height, channels)), local=(1, 16), defines=built_for(channels),
    )  # fmt: skip
    return out


@lru_cache(maxsize=64)
def tables(device: Device, one: Axis, value: float) -> tuple[Held, Held, Held, np.int32]:
    """Index, weights, what the border adds and how many taps, as the kernels of resize.cl take them; kept."""
    keep = device.constant
    return keep(one.index, np.int32), keep(one.weights), keep(one.constant * value), np.int32(one.taps)


def _numpy(inputs: Inputs, p: Parameters, name: str) -> Array:
    image = inputs["image"]
    across, down = _axes(p, Facts.sized(image), name)
    return aligned(across.apply(down.apply(image.pixels, p.value).swapaxes(0, 1), p.value).swapaxes(0, 1))


def _add(name: str, told: str) -> None:
    class ByKernel:
        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
            return _opencl(device, inputs, p, name)

        @staticmethod
        def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
            return _numpy(inputs, p, name)

    ByKernel.__doc__ = told
    resize.method(
        name,
        error=partial(error, name),
        work=partial(_work, name),
        least=lambda p, knob, facts: APART.get(name, 0.0) * _unlike(p, facts),
        coded=True,
        rates={"opencl": Rate(4e-4, 8e-11), "numpy": Rate(3e-4, 1.5e-9)},
    )(ByKernel)


for _name, (_, _told) in METHODS.items():
    _add(_name, _told)
