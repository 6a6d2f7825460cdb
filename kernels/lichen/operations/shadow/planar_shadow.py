"""Planar shadow: what a flat thing with a picture of its outline throws on what is behind it, seen from a light.

Truth. The thing is a rectangle of `size` in the plane through `centre` across `direction`, upright by `up`; `matte`
says how much of the light each of its points holds back, in one channel or for each colour, between texels linearly
and nothing around the rectangle. A point P sees of a light at L

    1 - matte(X),    X where the line from L to P meets the plane

if that lies between the two, and all of the light otherwise. With n the unit vector along `direction`, and a and b the
heights of P and L over the plane, X = (b P - a L) / (b - a): a homography of P, whose divisor w = b - a is 0 where the
line runs along the plane, and which shows the thing once more, as an anti-shadow, where both are on one side of it.
Between the two a and b have opposite signs, so that w is the sum of two magnitudes: nothing else is ever divided. A
light, or a point, in the plane itself sees no shadow of what has no thickness.

A light with `extent` is as many points as `samples`, on an even grid over a rectangle around L that faces the thing; a
point sees the mean of what it sees of each. `parallel` light comes from the direction of `light`, from infinity; its
extent is then that of the tangent. Points come as depths or positions, as for `shadow`; points at infinity are lit.

Shares are computed in doubles, in one order, and rounded to float32 once.

Methods: `exact` takes all points of the light; `sparse` fewer of them, on a coarser grid, which shows as copies of
edges beside each other.

Sources: J. Blinn, Me and my (fake) shadow, IEEE CG&A 8, 1988; P. Heckbert and M. Herf, Simulating soft shadows with
graphics hardware, CMU-CS-97-104, 1997; W. Heidrich, High-quality shading and lighting, dissertation, Erlangen 1999,
sections 6.1 and 6.4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent
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
    Knob,
    Light,
    Operation,
    Rate,
)
from lichen.operations.lighting.lamps import unit_vector
from lichen.operations.scene.camera import Vector
from lichen.operations.scene.view import View, planar, pointed, rays

if TYPE_CHECKING:
    from lichen.opencl.device import Device

SEGMENT = 64
Length = Annotated[float, Field(ge=1e-6, le=1e6)]
Span = Annotated[float, Field(ge=0, le=1e6)]


class Parameters(View):
    light: Vector = (3.0, 5.0, 0.0)
    """where the light is, in the axes of the positions, or of the camera"""
    parallel: bool = False
    """whether it shines from there, infinitely far away"""
    extent: tuple[Span, Span] = (0.0, 0.0)
    """the light's width and height"""
    samples: int = Field(16, ge=1, le=1024)
    """points that stand for a light with extent, at least"""
    centre: Vector = (0.0, 1.0, -5.0)
    """the middle of the flat thing"""
    direction: Vector = (0.0, 0.0, 1.0)
    """across it"""
    up: Vector = (0.0, 1.0, 0.0)
    """what is upwards in its picture"""
    size: tuple[Length, Length] = (1.0, 1.0)
    """its width and height"""

    @property
    def axes(self) -> Array:
        """Rows right, up and across of the thing, unit vectors."""
        across = unit_vector(self.direction)
        right = unit_vector(np.cross(unit_vector(self.up), across))
        return np.stack([right, np.cross(across, right), across])

    @property
    def grid(self) -> tuple[int, int]:
        """Points across and down the light."""
        wide, high = self.extent
        if wide == 0 or high == 0:
            return (self.samples if wide else 1), (self.samples if high else 1)
        across = min(max(1, round(math.sqrt(self.samples * wide / high))), self.samples)
        return across, -(-self.samples // across)

    def lights(self) -> Array:
        """The light's points, or directions, in the thing's axes from its middle: float64 (points, 3)."""
        middle = np.array(self.light) - (0.0 if self.parallel else np.array(self.centre))
        along = unit_vector(middle)
        if self.parallel:
            middle = along
        side = unit_vector(np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])) if along.any() else np.zeros(3)
        above, (across, down) = np.cross(side, along), self.grid
        x, y = (
            ((np.arange(count) + 0.5) / count - 0.5) * size
            for count, size in zip((across, down), self.extent, strict=True)
        )
        places = middle + (x[None, :, None] * side + y[:, None, None] * above).reshape(-1, 3)
        return np.asarray(places @ self.axes.T)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = p.depth_flaws()
    if not any(p.direction):
        flaws.append(Flaw("/parameters/direction", "has no length"))
    elif not np.linalg.norm(np.cross(unit_vector(p.direction), unit_vector(p.up))) > 1e-3:
        flaws.append(Flaw("/parameters/up", "must not point along direction"))
    if p.parallel and not any(p.light):
        flaws.append(Flaw("/parameters/light", "has no direction"))
    if facts["matte"].channels == 2:
        flaws.append(Flaw("/inputs/matte", "must be grey or a colour"))
    return flaws


def _result(p: Parameters, facts: InputFacts) -> Facts:
    where, matte = facts["depth"], facts["matte"]
    low, high = min(matte.extent.low, 0.0), max(matte.extent.high, 0.0)
    spoilt = any(each.extent.nonfinite for each in facts.values())
    slack = 4 * ROUNDING * (1 + matte.extent.magnitude)
    extent = Extent(1 - high - slack, 1 - low + slack, where.pixels * matte.channels if spoilt else 0)
    return Facts(where.height, where.width, matte.channels, extent=extent)


def _points(inputs: Inputs, p: Parameters) -> Array:
    """Of every pixel in the thing's axes, from its middle; float64 (3, pixels)."""
    where = inputs["depth"]
    with np.errstate(all="ignore"):
        if pointed(where):
            x, y, z = (where.pixels[..., k].astype(np.float64) for k in range(3))
        else:
            across, up = rays(p, where.height, where.width)
            depth = planar(where.pixels[..., 0].astype(np.float64), p, across, up)
            x, y, z = across * depth, up * depth, -depth
        x, y, z = (each - at for each, at in zip((x, y, z), p.centre, strict=True))
        made = np.stack([(axis[0] * x + axis[1] * y) + axis[2] * z for axis in p.axes])
        lost, far = np.isnan(x) | np.isnan(y) | np.isnan(z), np.isinf(x) | np.isinf(y) | np.isinf(z)
        made[:, far & ~lost] = np.inf
        made[:, lost] = np.nan
    return made.reshape(3, -1)


def _seen(inputs: Inputs, p: Parameters) -> Array:
    """The definition, float64 (height, width, channels)."""
    where, matte = inputs["depth"], inputs["matte"].pixels
    height, width, channels = matte.shape
    points = _points(inputs, p)
    framed = np.pad(matte.astype(np.float64), ((1, 1), (1, 1), (0, 0))).reshape(-1, channels)
    total, pitch = np.zeros((points.shape[1], channels)), width + 2
    lights = p.lights()
    with np.errstate(all="ignore"):
        px, py, a = points
        for lx, ly, b in lights:
            w = np.full_like(a, b) if p.parallel else b - a
            x = width * (0.5 + (b * px - a * lx) / w / p.size[0]) + 0.5
            y = height * (0.5 - (b * py - a * ly) / w / p.size[1]) + 0.5
            between = (a < 0) if b > 0 else (a > 0) & (b < 0)
            inside = np.flatnonzero(between & (x > 0) & (y > 0) & (x < width + 1) & (y < height + 1))
            x, y = x[inside], y[inside]
            column, row = np.floor(x), np.floor(y)
            right, low = (x - column)[:, None], (y - row)[:, None]
            corner = (row * pitch + column).astype(np.int64)
            upper = framed[corner] + right * (framed[corner + 1] - framed[corner])
            lower = framed[corner + pitch] + right * (framed[corner + pitch + 1] - framed[corner + pitch])
            total[inside] += upper + low * (lower - upper)
        made = 1 - total / len(lights)
        made[np.isnan(a)] = np.nan
    return np.asarray(made.reshape(where.height, where.width, channels))


def _launched(device: Device, inputs: Inputs, p: Parameters) -> Array:
    where, matte = inputs["depth"], inputs["matte"]
    out, lights = aligned_empty((where.height, where.width, matte.channels)), p.lights()
    pixels = where.height * where.width
    framed = np.pad(matte.pixels, ((1, 1), (1, 1), (0, 0)))
    points = np.pad(_points(inputs, p), ((0, 0), (0, -pixels % SEGMENT)), mode="edge")
    with device.session() as session:
        session.launch(
            "shadow/planar_shadow.cl", "planar_shadow", (-(-pixels // SEGMENT),),
            aligned(points, np.float64), aligned(framed), aligned(lights, np.float64),
            aligned(np.array(p.size), np.float64), session.write(out), np.int32(len(lights)), np.int32(p.parallel),
            np.int32(matte.width), np.int32(matte.height), np.uint64(pixels),
            defines={"CHANNELS": matte.channels},
        )  # fmt: skip
    return out


def _row(*points: tuple[float, float, float]) -> Mapping[str, Any]:
    return {"matte": np.ones((2, 2, 1), np.float32), "depth": np.array([points], np.float32)}


def _is(*expected: float) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, expected, rtol=0, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


BESIDE: Mapping[str, Any] = {"centre": [0, 0, -1], "size": [1, 1]}

planar_shadow = Operation(
    name="planar_shadow",
    family="shadow",
    summary="Throws the shadow of a flat thing, given by a picture of its outline, on what is behind it.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("matte", "how much of the light each point of the thing holds back, 0 to 1", (1, 3)),
        Input("depth", "how far from the camera each pixel is, or, of three channels, where", (1, 3), picture=False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, error: error,
    implied=lambda p, facts: "where the matte is read has nothing to do with where a pixel lies",
    check=_check,
    examples=(
        {"light": [0.5, 0.4, 3], "centre": [0.4, 0.5, 1.5], "size": [0.4, 0.5]},
        {"light": [1, 2, 1], "parallel": True, "centre": [0.5, 1, 1], "direction": [0, 1, 0.5], "extent": [0.3, 0.1]},
    ),
    hard_cases=(
        HardCase(
            "before the thing, in its plane, behind the light, beside the shadow",
            "w < 0 throws the shadow once more, towards the light; w = 0 is no point",
            lambda: _row((0, 0, -2), (0, 0, -1), (0, 0, -0.5), (0, 0, 3), (2, 0, -2), (0, 0, -1e30)),
            {**BESIDE, "light": [0, 0, 1]},
            _is(0, 1, 1, 1, 1, 0),
        ),
        HardCase(
            "a light in the thing's plane, and points nowhere",
            "an edge that has no thickness, 0 / 0, and inf - inf",
            lambda: _row((0, 0, -2), (0, 0, -0.5), (np.inf, 0, 0), (np.nan, 0, 0), (0.2, 0, -1)),
            {**BESIDE, "light": [2, 0, -1]},
            _is(1, 1, 1, np.nan, 1),
        ),
        HardCase(
            "parallel light along the thing",
            "the shadow of an edge, infinitely long",
            lambda: _row((0, 0, -2), (0, 0, 1)),
            {**BESIDE, "light": [1, 0, 0], "parallel": True},
            _is(1, 1),
        ),
    ),
)  # fmt: skip


@planar_shadow.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _seen(inputs, p)


def _points_of(p: Parameters) -> int:
    return math.prod(p.grid)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return facts["depth"].pixels * (4.0 + facts["matte"].channels * _points_of(p))


def _rounding(facts: InputFacts) -> float:
    """Of doubles, and to float32 once."""
    return 2 * ROUNDING * (1 + facts["matte"].extent.magnitude)


def _fewer(p: Parameters, share: float) -> Parameters:
    return p.model_copy(update={"samples": max(1, round(p.samples * share))})


def _sparse_error(p: Parameters, share: float, facts: InputFacts) -> Error:
    """Both are 1 less a mean of the matte."""
    rounding, extent = _rounding(facts), facts["matte"].extent
    if _fewer(p, share).grid == p.grid:
        return Error(rounding, "bound", rounding)
    spread = max(extent.high, 0.0) - min(extent.low, 0.0)
    return Error(spread + rounding, "bound", rounding, 0.2 * spread / math.sqrt(_points_of(_fewer(p, share))))


@planar_shadow.method(
    "sparse",
    error=_sparse_error,
    work=lambda p, share, facts: _work(_fewer(p, share), share, facts),
    rates={"opencl": Rate(3e-4, 2e-9), "numpy": Rate(1e-3, 2e-8)},
    knob=Knob("share", (1 / 16, 1 / 4, 1 / 2, 1.0), "of the points of a light with extent", 1 / 1024, 1.0),
    unfit=lambda p, facts: None if _points_of(p) > 1 else "the light is one point",
)
class Sparse:
    """A `share` of the light's points."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, share: float) -> Array:
        return Exact.opencl(device, inputs, _fewer(p, share), share)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, share: float) -> Array:
        return Exact.numpy(inputs, _fewer(p, share), share)


@planar_shadow.method(
    "exact",
    error=lambda p, knob, facts: Error(_rounding(facts), "bound", _rounding(facts)),
    work=_work,
    rates={"opencl": Rate(3e-4, 2e-9), "numpy": Rate(1e-3, 2e-8)},
)
class Exact:
    """Every point of the light, in doubles; on a device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_seen(inputs, p))
