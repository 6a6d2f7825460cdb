"""Depth of field: what lies off the plane in focus is blurred as a lens blurs it, from a picture and its depths.

Truth. A point at depth z is seen by a thin lens as a disc, or a polygon of `blades`, of the radius

    r(z) = `blur` |1 - `focus` / z|    px, `largest` at most; rounded to float32

`blur` being that of points at infinity: for a lens of focal length f and f-number N, focused at s, it is
f^2 / (2 N (s - f)) times the pixels per unit of length on the sensor. Every pixel spreads its light evenly over its
disc, and a pixel shows the mean of all that reach it:

    result(p) = sum over q of w(q, p) picture(q) / sum of w(q, p)
    w(q, p) = min(max(r - |p - q| + 1/2, 0), 1) / (r^2 + 1/12)

with r that of q, but no more than that of p where q lies behind p: what is behind does not spread over what is in focus
before it. |p - q| is the radius of the shape through p about q. The edge of a disc fades over a pixel, so that radii
grow without steps, and a radius of 0 leaves a pixel alone. Nothing lies beyond the picture's edges. Depths are
distances along the view; infinity is far away, NaN takes no part anywhere and is NaN itself.

One picture does not know what is hidden: what a lens sees around the edge of something near is missing, and its place
is taken by what shows. The mean of many pictures from points of the lens (`accumulate`) knows it.

Methods: `gather` takes every pixel within reach. `sampled` takes as many as asked for, along a spiral as wide as the
largest radius near a run of 64 pixels, and all where they are no more than that. `layered` blurs layers of like circles
and lays them over each other; `light_field` is the mean of pictures from points of the lens (both in views.py).

Sources: M. Potmesil and I. Chakravarty, A lens and aperture camera model for synthetic image generation, SIGGRAPH 1981;
J. Demers, Depth of field: a survey of techniques, GPU Gems, 2004; H. Vogel, A better way to construct the sunflower
head, Mathematical Biosciences 44, 1979.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    Degrees,
    Error,
    Facts,
    Footprint,
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
from lichen.operations.lens.circles import (
    NOTHING,
    SEGMENT,
    Bokeh,
    gathered,
    grouped,
    radii,
    sampled,
    segment_most,
    segmented,
    taps,
)
from lichen.operations.lens.depth_of_field_cases import CASES
from lichen.operations.lens.views import STEPS, Layers, layered, lens_points, signed, viewed

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Parameters(OperationParameters):
    focus: float = Field(1.0, gt=0, le=1e9, description="depth of the plane in focus, in the units of the depths")
    blur: Pixels = Field(8.0, ge=0, le=1e4, description="radius at which points at infinity are seen")
    largest: Pixels = Field(16.0, ge=0, le=64, description="no radius is larger")
    blades: int = Field(0, ge=0, le=16, description="of the aperture: 3 or more, or 0 for a disc")
    rotation: Degrees = Field(0.0, ge=-1e5, le=1e5, description="of the blades, to the left")

    @property
    def bokeh(self) -> Bokeh:
        return Bokeh(self.blades, self.rotation)

    @property
    def around(self) -> int:
        return math.ceil(self.largest + 0.5)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = same_size(facts, "image", "depth")
    if p.blades in (1, 2):
        flaws.append(Flaw("/parameters/blades", f"must be 0 or at least 3 (got {p.blades})"))
    return flaws


def _radius(p: Parameters, facts: InputFacts) -> float:
    """The largest that the depths can make."""
    if "depth" not in facts or facts["depth"].extent.low <= 0:
        return p.largest
    extent = facts["depth"].extent
    most = max(abs(1 - p.focus / extent.low), abs(1 - p.focus / extent.high), 1.0 if extent.nonfinite else 0.0)
    return min(p.blur * most, p.largest)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    still = _radius(p, facts) == 0 and not facts["depth"].extent.nonfinite
    return "everything is in focus" if still or (p.blur == 0 and not facts["depth"].extent.nonfinite) else None


def _gather_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Sums are doubles, rounded once; a weighted mean of values of both signs by its terms."""
    value = min(2 * ROUNDING * facts["image"].extent.magnitude, FLOAT_MAX)
    return Error(value, "bound", value)


def _sampled_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Usually by what the mean of as many independent values would."""
    return _mixed_error(facts, knob + 12, 0.3 / math.sqrt(knob))


def _mixed_error(facts: InputFacts, terms: float, usual: float) -> Error:
    """Both are means of the picture's values, so they differ by its range at most; as a rule by a share of it."""
    extent = facts["image"].extent
    rounding = min(terms * 2 * ROUNDING * extent.magnitude, FLOAT_MAX)
    return Error(min(extent.spread + rounding, FLOAT_MAX), "bound", rounding, usual * extent.spread + rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    slack = 600 * ROUNDING * image.extent.magnitude
    bad = any(each.extent.nonfinite for each in facts.values()) or image.extent.magnitude + slack >= FLOAT_MAX
    low, high = max(image.extent.low - slack, -FLOAT_MAX), min(image.extent.high + slack, FLOAT_MAX)
    return Facts(
        image.height, image.width, image.channels, image.space, image.alpha,
        Extent(low, high, image.samples if bad else 0),
    )  # fmt: skip


depth_of_field = Operation(
    name="depth_of_field",
    family="lens",
    summary="Blurs what lies off the plane in focus, as a lens with an aperture of a shape does.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture"),
        Input("depth", "distances along the view", (1, 1), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: Footprint(p.around, p.around),
    identity=_identity,
    result=_result,
    check=_check,
    examples=(
        {"focus": 0.6, "blur": 4.0, "largest": 5.0},
        {"focus": 0.3, "blur": 1.5, "largest": 4.0, "blades": 6, "rotation": 10},
        {"focus": 2.0, "blur": 0.8, "largest": 8.0},
    ),
    hard_cases=CASES,
)


def _planes(inputs: Inputs, p: Parameters) -> tuple[Array, Array]:
    """Depths and radii."""
    depth = inputs["depth"].pixels[..., 0]
    return depth, radii(depth, p.focus, p.blur, p.largest)


@depth_of_field.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    depth, radius = _planes(inputs, p)
    return gathered(inputs["image"].pixels, depth, radius, p.bokeh)


def _laid_out(plane: Array, around: int, value: float) -> Array:
    """Planes with nothing about them, and to the right as much more as a segment may read."""
    sides = [(0, 0)] * (plane.ndim - 2) + [(around, around), (around, around + SEGMENT)]
    return aligned(np.pad(plane, sides, constant_values=value))


def _gather(device: Device, inputs: Inputs, p: Parameters) -> Array:
    image, (depth, radius) = inputs["image"], _planes(inputs, p)
    height, width = radius.shape
    around = max(math.ceil(float(radius.max()) + 0.5), 0)
    offsets = np.array(grouped(around), np.float64)
    distance = p.bokeh.distance(-offsets[:, 1], -offsets[:, 0])
    out = aligned_empty(image.pixels.shape)
    planes = _laid_out(np.moveaxis(image.pixels, -1, 0), around, 0.0)
    with device.session() as session:
        session.launch(
            "lens/depth_of_field.cl", "gathered", (-(-width // SEGMENT), height),
            planes, _laid_out(radius, around, float(NOTHING)), _laid_out(depth, around, np.inf),
            aligned(segmented(radius, around), np.int32), aligned(distance, np.float64), session.write(out),
            np.int32(width), np.int32(height), np.int32(planes.shape[2]), np.int32(around), np.int32(2 * around + 1),
            local=(1, 1), defines={"CHANNELS": image.channels},
        )  # fmt: skip
    return out


def _sampled(device: Device, inputs: Inputs, p: Parameters, samples: int) -> Array:
    image, (depth, radius) = inputs["image"], _planes(inputs, p)
    height, width = radius.shape
    planes = _laid_out(np.moveaxis(image.pixels, -1, 0), p.around, 0.0)
    reaches, which = np.unique(segmented(radius, p.around), return_inverse=True)
    lists = [taps(int(reach), samples, p.bokeh) for reach in reaches]
    ends = np.cumsum([0, *map(len, lists)])
    ranges = np.stack([ends[:-1], ends[1:]], axis=-1)[which.reshape(-1)]
    out = aligned_empty(image.pixels.shape)
    with device.session() as session:
        session.launch(
            "lens/depth_of_field.cl", "sampled", (-(-width // SEGMENT), height),
            planes, _laid_out(radius, p.around, float(NOTHING)), _laid_out(depth, p.around, np.inf),
            aligned(ranges, np.int32), aligned(np.concatenate(lists)), session.write(out), np.int32(width),
            np.int32(height), np.int32(planes.shape[2]), np.int32(p.around),
            local=(1, 1), defines={"CHANNELS": image.channels},
        )  # fmt: skip
    return out


@depth_of_field.method(
    "gather",
    error=_gather_error,
    work=lambda p, knob, facts: (
        facts["image"].pixels * (2 * _radius(p, facts) + 2) ** 2 * (4.0 + facts["image"].channels)
    ),
    rates={"opencl": Rate(1e-3, 2.5e-10), "numpy": Rate(1e-3, 6e-9)},
)
class Gather:
    """Every pixel within reach, sums in doubles."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _gather(device, inputs, p) if device.has_fp64 else Gather.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        depth, radius = _planes(inputs, p)
        return aligned(gathered(inputs["image"].pixels, depth, radius, p.bokeh).astype(np.float32))


@depth_of_field.method(
    "sampled",
    knob=Knob("samples", (16, 32, 64, 128), "pixels taken around each", 4, 1024),
    error=_sampled_error,
    work=lambda p, knob, facts: facts["image"].pixels * (knob + 50) * (4.0 + facts["image"].channels),
    rates={"opencl": Rate(2e-3, 1.7e-10), "numpy": Rate(2e-3, 2e-8)},
)
class Sampled:
    """Pixels along a spiral within the largest radius nearby; all of them where they are few."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _sampled(device, inputs, p, round(knob))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        depth, radius = _planes(inputs, p)
        return aligned(sampled(inputs["image"].pixels, depth, radius, p.bokeh, p.largest, round(knob)))


def _layered(device: Device, inputs: Inputs, p: Parameters, count: int) -> Array:
    image, (depth, radius) = inputs["image"], _planes(inputs, p)
    height, width = radius.shape
    layers = Layers.of(depth, radius, p.focus, p.bokeh, count)
    around, begins = layers.around, np.cumsum([0, *map(len, layers.taps)])
    near = np.where(layers.index < 0, NOTHING, layers.index.astype(np.float32))
    far = np.where(layers.index < 0, NOTHING, count - near)
    most, least = segment_most(near, around), count - segment_most(far, around)
    ranges = np.stack([np.where(most < 0, 1, least), np.where(most < 0, 0, most)], axis=-1)
    planes = _laid_out(np.moveaxis(image.pixels, -1, 0), around, 0.0)
    index = _laid_out(layers.index.astype(np.float32), around, -1.0)
    taps = np.concatenate([*layers.taps, np.zeros((1, 3))])
    out = aligned_empty(image.pixels.shape)
    with device.session() as session:
        session.launch(
            "lens/views.cl", "layered", (-(-width // SEGMENT), height),
            planes, aligned(index, np.int32), aligned(radius), aligned(taps), aligned(begins, np.int32),
            aligned(ranges, np.int32), session.write(out), np.int32(width), np.int32(height), np.int32(planes.shape[2]),
            np.int32(around), local=(1, 1), defines={"CHANNELS": image.channels},
        )  # fmt: skip
    return out


@depth_of_field.method(
    "layered",
    knob=Knob("layers", (2, 4, 8, 16), "ranges of circles that are blurred alike", 1, 64),
    error=lambda p, layers, facts: _mixed_error(facts, 4.0 * (2 * p.largest + 2) ** 2 * layers, 0.3 / layers),
    work=lambda p, layers, facts: (
        facts["image"].pixels * (1 + round(layers)) * ((_radius(p, facts) + 1) ** 2) * (1.0 + facts["image"].channels)
    ),
    rates={"opencl": Rate(3e-3, 4e-10), "numpy": Rate(3e-3, 3e-9)},
)
class Layered:
    """Layers of pixels with like circles, each blurred by one circle, the nearer over the farther."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, layers: float) -> Array:
        return _layered(device, inputs, p, round(layers))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, layers: float) -> Array:
        depth, radius = _planes(inputs, p)
        made = Layers.of(depth, radius, p.focus, p.bokeh, round(layers))
        return aligned(layered(inputs["image"].pixels, made, radius))


@depth_of_field.method(
    "light_field",
    knob=Knob("views", (8, 16, 32, 64), "points of the lens", 1, 1024),
    error=lambda p, views, facts: _mixed_error(facts, 2 * views + 4, 0.3 / math.sqrt(views)),
    work=lambda p, views, facts: facts["image"].pixels * views * (4.0 + facts["image"].channels),
    rates={"opencl": Rate(2e-3, 1.2e-9), "numpy": Rate(2e-3, 2e-8)},
)
class LightField:
    """The mean of views from points of the lens, each pixel followed back to what it shows."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, views: float) -> Array:
        image, (depth, radius) = inputs["image"], _planes(inputs, p)
        height, width = radius.shape
        out, points = aligned_empty(image.pixels.shape), lens_points(round(views), p.bokeh)
        with device.session() as session:
            session.launch(
                "lens/views.cl", "viewed", (-(-width // SEGMENT), height),
                aligned(image.pixels), aligned(signed(depth, radius, p.focus)), aligned(radius), aligned(points),
                session.write(out), np.int32(len(points)), np.int32(STEPS), np.int32(width), np.int32(height),
                local=(1, 1), defines={"CHANNELS": image.channels},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, views: float) -> Array:
        depth, radius = _planes(inputs, p)
        points = lens_points(round(views), p.bokeh)
        return aligned(viewed(inputs["image"].pixels, signed(depth, radius, p.focus), radius, points))
