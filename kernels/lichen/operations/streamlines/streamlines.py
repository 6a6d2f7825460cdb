"""Streamlines: the lines of a vector field as polylines, and as a picture.

Truth: lines begin at seeds and follow v = (c - bias) * scale, x to the right and y down, interpolated bilinearly, both
ways for at most `length` px, by classical Runge-Kutta steps of `step` px in double precision; a line ends at the
border, where there is no direction, and at critical points. Seeds are

* `even`: chosen so that lines are evenly `spacing` px apart (Jobard and Lefer), from the middle of the image and of its
  parts outwards;
* `grid`: in rows and columns, `spacing` px apart;
* `points`: those given.

Findings are the lines: places in pixels, in the direction of the field. As a table (`findings=npy`) they are a row for
each point: which line it is of, x and y; `np.split(t[:, 1:], np.flatnonzero(np.diff(t[:, 0])) + 1)` are the lines. The
picture is how much a pen of the given `width` covers of each pixel, with an edge one pixel soft. Lines are found in
double precision by every method, so the picture's error is that of drawing alone; there is no trade.

Sources: see `lichen.operations.streamlines.tracing` and `lichen.operations.streamlines.strokes`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent, Image
from lichen.memory import Array
from lichen.opencl.device import Device
from lichen.operation import (
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
    Pixels,
    Rate,
)
from lichen.operations.streamlines.lines import Grid
from lichen.operations.streamlines.strokes import Strokes, drawn_exactly, drawn_numpy, drawn_opencl, rounding
from lichen.operations.streamlines.task import decode_any
from lichen.operations.streamlines.tracing import Tracer, evenly, grid_of_seeds
from lichen.operations.streamlines.walker import Walker

MOST_LINES, MOST_POINTS = 100_000, 20_000_000
PARTS = 4
"""Of the image's sides: evenly spaced lines begin in the middle of each part."""
DIGITS = 3
"""Of places in the findings: thousandths of a pixel."""


class Seeding(StrEnum):
    """Where lines begin."""

    EVEN = "even"
    GRID = "grid"
    POINTS = "points"


class Parameters(OperationParameters):
    seeding: Seeding = Field(Seeding.EVEN, description="where lines begin")
    spacing: Pixels = Field(16.0, ge=2, le=4096, description="between lines (even) or seeds (grid)")
    points: tuple[tuple[float, float], ...] = Field((), max_length=10_000, description="seeds (x, y) in pixels, y down")
    length: Pixels = Field(400.0, ge=0, le=20_000, description="how far to follow a line each way")
    step: Pixels = Field(1.0, ge=0.1, le=4, description="between the points of a line")
    width: Pixels = Field(1.0, ge=0, le=16, description="of the pen")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="v = (c - bias) * scale")
    bias: float = Field(0.0, ge=-1e6, le=1e6, description="the stored value of a zero component")


_found: WeakKeyDictionary[Image, tuple[Parameters, list[Array]]] = WeakKeyDictionary()
"""The last lines of each field that is still in use: the picture and the findings are of the same ones."""


def lines_of(inputs: Inputs, p: Parameters) -> list[Array]:
    """The polylines, float64 (n, 2)."""
    image = inputs["field"]
    known = _found.get(image)
    if known is None or known[0] != p:
        known = _found[image] = (p, _lines(image, p))
    return known[1]


def _lines(image: Image, p: Parameters) -> list[Array]:
    grid = Grid.of(decode_any(image.pixels, p.scale, p.bias))
    tracer = Tracer(grid, p.length, p.step)
    if p.seeding is Seeding.EVEN:
        first = grid_of_seeds(image.width, image.height, max(image.width, image.height) / PARTS)
        return list(evenly(Walker(grid, p.length, p.step), first, p.spacing, MOST_LINES))
    seeds = grid_of_seeds(image.width, image.height, p.spacing)
    if p.seeding is Seeding.POINTS:
        seeds = np.array(p.points, np.float64).reshape(-1, 2)
        seeds = seeds[((seeds >= 0) & (seeds <= [image.width, image.height])).all(axis=1)]
    return [line for line in tracer.lines(seeds) if len(line) > 1]


def strokes_of(lines: list[Array], width: float) -> Strokes:
    start = np.concatenate([line[:-1] for line in lines] or [np.zeros((0, 2))])
    end = np.concatenate([line[1:] for line in lines] or [np.zeros((0, 2))])
    return Strokes(start, end, np.full(len(start), width / 2), np.ones((len(start), 1)))


# ------------------------------------------------------------------------------------------------------- predictions


def _result(p: Parameters, facts: InputFacts) -> Facts:
    field = facts["field"]
    return Facts(field.height, field.width, 1, extent=Extent(0.0, 1.0, 0))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = rounding(p.width / 2, p.step)
    return Error(value, "bound", value)


def seeds_expected(p: Parameters, facts: InputFacts) -> float:
    field = facts["field"]
    return len(p.points) if p.seeding is Seeding.POINTS else max(field.pixels / p.spacing**2, 1.0)


def points_expected(p: Parameters, facts: InputFacts) -> float:
    """Lines that are evenly spaced fill the image; others may all go as far as they can."""
    field = facts["field"]
    if p.seeding is Seeding.EVEN:
        return 4 * field.pixels / (p.spacing * p.step)
    return seeds_expected(p, facts) * (2 * p.length / p.step + 1)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = []
    if p.seeding is Seeding.POINTS and not p.points:
        flaws.append(Flaw("/parameters/points", "is needed where seeding is points"))
    if p.seeding is not Seeding.POINTS and seeds_expected(p, facts) > MOST_LINES:
        flaws.append(Flaw("/parameters/spacing", f"would make more than {MOST_LINES} lines"))
    if points_expected(p, facts) > MOST_POINTS:
        flaws.append(Flaw("/parameters/step", f"would make lines of more than {MOST_POINTS} points together"))
    return flaws


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Points that are followed from all seeds at once, and drawn by as many pixels as the pen reaches. A step of all
    takes as long as 250 points beside them, and a point of a line that is followed alone as seven."""
    drawn = (p.width + 2 * p.step + 3) ** 2 / 100
    points, pixels = points_expected(p, facts), 0.02 * facts["field"].pixels
    if p.seeding is Seeding.EVEN:
        return points * (7.0 + drawn) + pixels
    return points * (1.0 + drawn) + 250.0 * (2 * p.length / p.step + 1) + pixels


# -------------------------------------------------------------------------------------------------------- hard cases


def _field(vector: Any) -> dict[str, Array]:
    y, x = np.mgrid[:24, :32] + 0.5
    return {"field": np.stack(np.broadcast_arrays(*vector(x, y), x)[:2], axis=-1).astype(np.float32)}


def _black(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if not pixels.any() else "something was drawn"


def _some(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    if not np.isfinite(pixels).all() or pixels.min() < 0 or pixels.max() > 1:
        return "coverage is not within [0, 1]"
    return None if pixels.max() > 0.9 else "nothing was drawn"


def _row_drawn(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """A pen one pixel wide along the middle of row 10."""
    expected = np.zeros((24, 32, 1))
    expected[10] = 1
    apart = float(np.abs(pixels[:, 2:-2] - expected[:, 2:-2]).max())
    return None if apart <= 1e-5 else f"off by {apart:.3g}"


def _table(findings: Mapping[str, Any]) -> Array:
    """A row for each point: which line it is of, x and y."""
    lines = [np.asarray(line["points"], np.float64).reshape(-1, 2) for line in findings["lines"]]
    numbers = np.repeat(np.arange(len(lines), dtype=np.float64), [len(line) for line in lines])
    return np.column_stack([numbers, np.concatenate([*lines, np.zeros((0, 2))])])


_SHORT = {"length": 20.0, "spacing": 6.0}

streamlines = Operation(
    name="streamlines",
    family="streamlines",
    summary="Follows the lines of a vector field: polylines as findings, and a picture of them.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("field", "vectors: x to the right, y down; further channels are not read", (2, 4), picture=False),),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    implied=lambda p, facts: "lines are as far apart as others left them",
    check=_check,
    table=_table,
    table_columns=("line", "x", "y"),
    examples=(
        {"spacing": 9, "length": 60},
        {"seeding": "grid", "spacing": 11, "length": 6, "width": 2.5, "step": 0.5},
        {"seeding": "points", "points": [[3.5, 4.25], [20, 10]], "length": 30},
    ),
    hard_cases=(
        HardCase("zero field", "no line exists", lambda: _field(lambda x, y: (0, 0)), _SHORT, _black),
        HardCase("field of NaN", "no line exists", lambda: _field(lambda x, y: (np.nan, 1)), _SHORT, _black),
        HardCase(
            "vortex", "lines close", lambda: _field(lambda x, y: (12 - y, x - 16)), {**_SHORT, "length": 400.0}, _some
        ),
        HardCase("saddle", "lines part", lambda: _field(lambda x, y: (x - 16.2, 11.9 - y)), _SHORT, _some),
        HardCase(
            "vectors of 1e30 and 1e-30",
            "squares overflow and vanish",
            lambda: _field(lambda x, y: (np.where(x < 16, 1e30, 1e-30), 0)),
            {"seeding": "points", "points": [[16.0, 10.5]], "length": 40},
            _row_drawn,
        ),
    ),
)


@streamlines.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    field = inputs["field"]
    return drawn_exactly(strokes_of(lines_of(inputs, p), p.width), field.height, field.width)


@streamlines.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    lines = lines_of(inputs, p)
    lengths = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines]
    return {
        "count": len(lines),
        "length": round(math.fsum(lengths), DIGITS),
        "lines": [{"points": np.round(line, DIGITS).tolist()} for line in lines],
    }


@streamlines.method("direct", error=_error, work=_work, rates={"opencl": Rate(2e-3, 2e-6), "numpy": Rate(3e-3, 2e-6)})
class Direct:
    """Lines in double precision, drawn stroke by stroke."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        field, strokes = inputs["field"], strokes_of(lines_of(inputs, parameters), parameters.width)
        return drawn_opencl(device, strokes, field.height, field.width)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        field, strokes = inputs["field"], strokes_of(lines_of(inputs, parameters), parameters.width)
        return drawn_numpy(strokes, field.height, field.width)
