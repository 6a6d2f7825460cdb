"""Curve: colour through a curve that control points draw.

Truth: y = f(x) for every colour channel, or for the one named; f passes through the points, as monotone cubic pieces
(Fritsch and Butland 1984, also called PCHIP) or as straight lines. It is monotone wherever its points are and never
leaves their range. Beyond the first and the last point f keeps their values, or goes on straight with the slopes it has
there. Coverage passes untouched and NaN stays.

Methods: `exact` evaluates the pieces, one after the other; `table` interpolates linearly in a uniform table, with a
proved error, at a cost that does not grow with the number of points.

Sources: F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5(2), 1984; McReynolds and Blythe, Advanced Graphics
Programming Using OpenGL, 2005, section 12.2.3 (lookup tables).
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.tone.pieces import Pieces, Points, tabulated, through
from lichen.operations.tone.pointwise import FLOAT_MAX, blockwise, carried, launch_flat, spanned, within
from lichen.stage import Stage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from lichen.opencl.device import Device

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
FEW = (4, 8)
"""Pieces of the kernels that keep a curve in registers."""
CLOSEST = 1e-5
"""Points lie apart by this much of the largest |x| at least, so that float32 tells them apart."""


class Interpolation(StrEnum):
    """How the curve goes between its points."""

    MONOTONE = "monotone"
    LINEAR = "linear"


class Beyond(StrEnum):
    """What the curve is beyond its points."""

    CLAMP = "clamp"
    EXTEND = "extend"


class Parameters(OperationParameters):
    points: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2, max_length=256)] = ((0.0, 0.0), (1.0, 1.0))
    """control points [x, y], x ascending"""
    interpolation: Interpolation = Interpolation.MONOTONE
    """between the points: monotone cubic pieces (PCHIP), or straight lines"""
    beyond: Beyond = Beyond.CLAMP
    """beyond the points: clamp keeps the end's value, extend goes on straight"""
    channel: int | None = Field(None, ge=0, le=63)
    """the one colour channel that is changed, counted from 0; all unless given"""

    @field_validator("points")
    @classmethod
    def _ascending(cls, points: Points) -> Points:
        x = np.array(points)[:, 0]
        least = CLOSEST * float(np.abs(x).max())
        close = np.flatnonzero(np.diff(x) < max(least, 1e-12))
        if close.size:
            raise ValueError(f"x must ascend by {max(least, 1e-12):g} at least, which point {close[0] + 1} does not")
        return points

    @property
    def straight(self) -> bool:
        return self.interpolation is Interpolation.LINEAR


def pieces(p: Parameters) -> Pieces:
    return through(p.points, p.straight)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    colours = image.channels - (image.alpha is not Alpha.NONE)
    if p.channel is not None and p.channel >= colours:
        return [Flaw("/parameters/channel", f"is {p.channel}; the image has {colours} colour channel(s), from 0")]
    return []


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    if any(x != y for x, y in p.points):
        return None
    same = p.beyond is Beyond.EXTEND or within(facts["image"], p.points[0][0], p.points[-1][0])
    return "every point lies on y = x" if same else None


def _reach(p: Parameters, facts: Facts) -> float:
    """The largest |y| that the picture's range takes; beyond the points too."""
    shape, (low, high) = pieces(p), (facts.extent.low, facts.extent.high)
    size = max(map(abs, shape.range))
    if p.beyond is Beyond.EXTEND:
        under, over = max(0.0, float(shape.knots[0]) - low), max(0.0, high - float(shape.knots[-1]))
        size += max(under * abs(shape.first[1]), over * abs(shape.last[1]))
    return min(size, FLOAT_MAX)


def _rounding(p: Parameters, facts: Facts) -> float:
    """Of a knot, which the steepest slope turns into value; of the terms of a cubic; of what goes on beyond."""
    shape = pieces(p)
    far = float(np.abs(shape.knots).max())
    return ROUNDING * (3 * shape.steepest * far + 8 * shape.terms + 5 * _reach(p, facts))


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(p, facts["image"])
    return Error(value, "bound", value)


def _table_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    grid = tabulated(p.points, p.straight, round(knob))
    rounding = _rounding(p, facts["image"]) + grid.rounding
    return Error(grid.bound + rounding, "bound", rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if _identity(p, facts):
        return image
    low, high = pieces(p).range
    if p.beyond is Beyond.EXTEND:
        low, high = min(low, -_reach(p, image)), max(high, _reach(p, image))
    if p.channel is not None:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    return dataclasses.replace(image, extent=spanned(image, low, high, _rounding(p, image)))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    steepest = pieces(p).steepest if p.channel is None else max(pieces(p).steepest, 1.0)
    magnitude = _result(p, facts).extent.magnitude
    return carried(facts["image"], magnitude, lambda change: steepest * change, error)


# ------------------------------------------------------------------------------------------------------- hard cases


def _row(*values: float) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.array(values, dtype=np.float32).reshape(1, -1, 1)}


def _holds(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, np.array(expected), rtol=1e-5, atol=1e-5, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


def _no_overshoot(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    row = pixels.reshape(-1)
    if row.min() < -1e-6 or row.max() > 1 + 1e-6:
        return f"left the points' range: {row.min()} to {row.max()}"
    return None if (np.diff(row) > -2e-6).all() else "falls where its points rise"


STEP = [[0, 0], [0.45, 0.02], [0.5, 0.98], [1, 1]]
S_CURVE = [[0, 0], [0.25, 0.15], [0.5, 0.5], [0.75, 0.88], [1, 1]]
WAVE = [[k / 40, 0.5 + 0.4 * (-1) ** k * (k % 3) / 2] for k in range(41)]

curve = Operation(
    name="curve",
    family="tone",
    summary="Passes colour through a curve drawn by control points, monotone wherever they are.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"points": S_CURVE},
        {"points": [[0, 0.1], [0.3, 0.6], [1, 0.9]], "beyond": "extend"},
        {"points": [[0, 1], [0.37, 0.2], [1, 0]], "interpolation": "linear"},
        {"points": WAVE, "channel": 0},
        {"points": [[-0.2, 0], [0.4, 0.7]], "beyond": "extend"},
    ),
    hard_cases=(
        HardCase(
            name="steep step between flat parts",
            why="a spline through such points overshoots them and turns back",
            inputs=lambda: {"image": np.linspace(-0.5, 1.5, 4001, dtype=np.float32).reshape(1, -1, 1)},
            parameters={"points": STEP},
            holds=_no_overshoot,
        ),
        HardCase(
            name="what is not finite",
            why="NaN has no piece, and a flat end times an infinity is NaN",
            inputs=_row(np.nan, np.inf, -np.inf, 0.5),
            parameters={"points": [[0, 0], [0.5, 0.5], [1, 0.5]], "beyond": "extend"},
            holds=_holds(np.nan, 0.5, -np.inf, 0.5),
        ),
        HardCase(
            name="exactly on the points",
            why="a search that is off by one takes the piece before",
            inputs=_row(*(x for x, _ in WAVE)),
            parameters={"points": WAVE},
            holds=_holds(*(y for _, y in WAVE)),
            methods=("exact",),
        ),
    ),
)


def _extended(y: Array, x: Array, held: Array, p: Parameters) -> Array:
    """What lies beyond the points goes on straight; a slope of 0 stays 0 for an infinity."""
    shape = pieces(p)
    if p.beyond is Beyond.EXTEND:
        for beyond, slope in ((x < held, shape.first[1]), (x > held, shape.last[1])):
            if slope and beyond.any():
                y[beyond] += (x[beyond] - held[beyond]) * x.dtype.type(slope)
    return y


def _chosen(p: Parameters, x: Array, y: Array) -> Array:
    """y in the named channel, x in the others."""
    if p.channel is None:
        return y
    result = x.copy()
    result[..., p.channel] = y[..., p.channel]
    return result


@curve.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    result, x = image.pixels.copy(), image.pixels[..., : image.colours]
    held = np.clip(x, p.points[0][0], p.points[-1][0])
    result[..., : image.colours] = _chosen(p, x, _extended(pieces(p)(held), x, held, p))
    return result


# ---------------------------------------------------------------------------------------------------------- methods


@lru_cache(maxsize=64)
def _rows(points: Points, straight: bool) -> Array:
    """Knot and coefficients, a row for each."""
    shape = through(points, straight)
    return np.vstack([shape.knots[:-1], shape.coefficients.T]).astype(np.float32)


def _few(count: int) -> int:
    """How many pieces a kernel is made for that takes so many, or 0 where it is made for any number."""
    return next((few for few in FEW if count <= few), 0)


@lru_cache(maxsize=64)
def _columns(points: Points, straight: bool) -> Array:
    """The rows, as long as the kernel takes them: pieces that nothing begins stand in for those that are missing."""
    rows = _rows(points, straight)
    made = np.zeros((len(rows), _few(rows.shape[1]) or rows.shape[1]), np.float32)
    made[0] = FLOAT_MAX
    made[:, : rows.shape[1]] = rows
    return aligned(made)


def _ends(p: Parameters, cells: int) -> Array:
    shape = pieces(p)
    low, high = float(shape.knots[0]), float(shape.knots[-1])
    return aligned(np.array([low, high, shape.first[1], shape.last[1], cells / (high - low)], dtype=np.float32))


def _defines(p: Parameters, image: Image) -> dict[str, int]:
    picked = -1 if p.channel is None else p.channel
    few = _few(len(p.points) - 1)
    return {"EXTENDED": int(p.beyond is Beyond.EXTEND), "PICKED": picked, "CHANNELS": image.channels, "FEW": few}


def _stage(p: Parameters) -> Stage:
    """The pieces as a step of a generated kernel."""
    columns, picked = _columns(p.points, p.straight), -1 if p.channel is None else p.channel
    numbers = tuple(map(float, [*_ends(p, 1), *columns.reshape(-1)]))
    shape = {"COUNT": len(p.points) - 1, "APART": columns.shape[1]}
    defines = {"EXTENDED": int(p.beyond is Beyond.EXTEND), "PICKED": picked, **shape}
    return Stage("tone/curve_stage.clh", defines, numbers, numbers if picked < 0 else None)


@curve.method(
    "exact",
    error=_exact_error,
    work=lambda p, knob, facts: facts["image"].samples * (2.0 + len(p.points) / 4),
    rates={"opencl": Rate(2e-4, 1.2e-10), "numpy": Rate(1e-4, 3e-9)},
    stage=lambda p, facts: _stage(p),
)
class Exact:
    """The pieces themselves; its time grows with the number of points."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, columns = inputs["image"], _columns(p.points, p.straight)
        arguments = (_ends(p, 1), columns, np.int32(columns.shape[1]))
        return launch_flat(device, "tone/curve.cl", "exact", image, *arguments, defines=_defines(p, image))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        low, high = (np.float32(p.points[end][0]) for end in (0, -1))
        rows = _rows(p.points, p.straight)
        shape = pieces(p)
        narrow = Pieces(np.append(rows[0], high), rows[1:].T, shape.last)

        def body(x: Array) -> Array:
            held = np.clip(x, low, high)
            return _chosen(p, x, _extended(narrow(held), x, held, p))

        return blockwise(inputs["image"], body)


@curve.method(
    "table",
    error=_table_error,
    work=lambda p, knob, facts: facts["image"].samples + knob,
    rates={"opencl": Rate(2e-4, 1e-9), "numpy": Rate(1e-4, 3.5e-9)},
    knob=Knob("size", (64, 256, 1024, 4096, 16384), "cells of the table", 16, 65536, order=-2),
    orderly=True,
)
class Interpolated:
    """Linear interpolation in a uniform table, whose error is proved from the pieces' bends and kinks."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, cells = inputs["image"], round(knob)
        arguments = (_ends(p, cells), tabulated(p.points, p.straight, cells).nodes, np.int32(cells))
        return launch_flat(device, "tone/curve.cl", "table", image, *arguments, defines=_defines(p, image))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        cells = round(knob)
        values, rises = tabulated(p.points, p.straight, cells).nodes.T
        low, high, _, _, scale = _ends(p, cells)

        def body(x: Array) -> Array:
            held = np.clip(x, low, high)
            place = (held - low) * scale
            cell = np.clip(np.nan_to_num(place).astype(np.int32), 0, cells)
            y = values[cell] + (place - cell.astype(np.float32)) * rises[cell]
            return _chosen(p, x, _extended(y, x, held, p))

        return blockwise(inputs["image"], body)
