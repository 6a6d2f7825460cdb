"""Critical points of a vector field: where it vanishes, and what it does around there.

Truth: between four pixel centres the field is bilinear in each component; its zeros there solve a quadratic equation
and are found in closed form, in double precision. A zero is given by its place in pixels (centres at +0.5), its
Jacobian J = (du/dx, du/dy; dv/dx, dv/dy) in units of the field per pixel, and its kind:

    saddle               det J < 0
    source, sink         det J > 0, real eigenvalues, positive or negative
    outward, inward      det J > 0, complex eigenvalues, real parts positive or negative: spirals
    centre               det J > 0, complex eigenvalues, |trace| at most 1e-6 of the largest entry
    degenerate           det J at most 1e-12 of the largest entry's square: the Jacobian alone does not tell

Cells in which the field is zero or not finite at a whole side are at rest or in a hole, and have no such points.
Findings are the points, in rows from top to bottom. The picture marks them on black: discs of the given `radius`, edges
one pixel soft, saddles yellow, sources and outward spirals red, sinks and inward ones blue, centres green, degenerate
ones white. There is no trade: points are found in double precision by every method.

Source: J. L. Helman and L. Hesselink, Representation and display of vector field topology in fluid flow data sets, IEEE
Computer 22(8), 1989. The closed form is derived at `zeros`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from lichen.image import Extent
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
from lichen.operations.streamlines.strokes import Strokes, drawn_exactly, drawn_numpy, drawn_opencl, rounding
from lichen.operations.streamlines.task import decode_any

SAME = 1e-6
"""px; zeros nearer than this to one another are one, found in two cells."""
MOST = 100_000
"""Points reported and marked at most, from the top."""


class Kind(StrEnum):
    SADDLE = "saddle"
    SOURCE = "source"
    SINK = "sink"
    OUTWARD = "outward"
    INWARD = "inward"
    CENTRE = "centre"
    DEGENERATE = "degenerate"


COLOURS: Mapping[Kind, tuple[float, float, float]] = {
    Kind.SADDLE: (1.0, 1.0, 0.0),
    Kind.SOURCE: (1.0, 0.0, 0.0),
    Kind.OUTWARD: (1.0, 0.0, 0.0),
    Kind.SINK: (0.0, 0.0, 1.0),
    Kind.INWARD: (0.0, 0.0, 1.0),
    Kind.CENTRE: (0.0, 1.0, 0.0),
    Kind.DEGENERATE: (1.0, 1.0, 1.0),
}


class Parameters(OperationParameters):
    radius: Pixels = Field(4.0, ge=0.5, le=64, description="of the marks")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="v = (c - bias) * scale")
    bias: float = Field(0.0, ge=-1e6, le=1e6, description="the stored value of a zero component")


@dataclass(frozen=True, slots=True)
class Point:
    place: tuple[float, float]
    kind: Kind
    jacobian: tuple[tuple[float, float], tuple[float, float]]


def points_of(inputs: Inputs, p: Parameters) -> list[Point]:
    vectors = decode_any(inputs["field"].pixels, p.scale, p.bias)
    places, jacobians = zeros(vectors)
    return [
        Point((float(x), float(y)), kind_of(j), ((float(j[0, 0]), float(j[0, 1])), (float(j[1, 0]), float(j[1, 1]))))
        for (x, y), j in zip(places[:MOST], jacobians[:MOST], strict=True)
    ]


def kind_of(jacobian: Array) -> Kind:
    """From the Jacobian, brought near 1 first."""
    largest = float(np.abs(jacobian).max())
    if not 0 < largest < np.inf:
        return Kind.DEGENERATE
    (a, b), (c, d) = (jacobian / largest).tolist()
    determinant, trace = a * d - b * c, a + d
    if abs(determinant) <= 1e-12:
        return Kind.DEGENERATE
    if determinant < 0:
        return Kind.SADDLE
    if (a - d) * (a - d) + 4 * b * c >= 0:
        return Kind.SOURCE if trace > 0 else Kind.SINK
    if abs(trace) <= 1e-6:
        return Kind.CENTRE
    return Kind.OUTWARD if trace > 0 else Kind.INWARD


def zeros(vectors: Array) -> tuple[Array, Array]:
    """Places (n, 2) and Jacobians (n, 2, 2) of the zeros between pixel centres, in rows.

    In a cell, u = a + b x + c y + d x y, and v likewise. Without y, the two are a quadratic in x; y then follows from
    the one of them that depends on it more.
    """
    corners = [vectors[:-1, :-1], vectors[:-1, 1:], vectors[1:, :-1], vectors[1:, 1:]]
    if not corners[0].size:
        return np.zeros((0, 2)), np.zeros((0, 2, 2))
    with np.errstate(all="ignore"):
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        crossed = ((low <= 0) & (high >= 0)).all(axis=2)
        moving = [(corner != 0).any(axis=2) & np.isfinite(corner).all(axis=2) for corner in corners]
        crossed &= (moving[0] | moving[1]) & (moving[2] | moving[3]) & (moving[0] | moving[2]) & (moving[1] | moving[3])
    rows, columns = np.nonzero(crossed)
    values = np.stack([corner[rows, columns] for corner in corners])  # (4, n, 2)
    size = np.abs(values).max(axis=0, initial=0.0)
    values = values / np.where(size > 0, size, 1)
    a, b, c = values[0], values[1] - values[0], values[2] - values[0]
    d = values[3] - values[2] - values[1] + values[0]
    at, cells = _solved(a, b, c, d)
    places = at + np.stack([columns, rows], axis=1)[cells] + 0.5
    x, y = at[:, :1], at[:, 1:]
    jacobians = np.stack([b[cells] + d[cells] * y, c[cells] + d[cells] * x], axis=2) * size[cells][:, :, None]
    order = np.lexsort((places[:, 0], places[:, 1]))
    return _distinct(places[order], jacobians[order])


def _solved(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Zeros (m, 2) within cells, and the cells (m,) they lie in; coefficients (n, 2) are those of u and v."""
    slack = 1e-9
    (a0, a1), (b0, b1), (c0, c1), (d0, d1) = (each.T for each in (a, b, c, d))
    second, first, none = b1 * d0 - b0 * d1, a1 * d0 + b1 * c0 - b0 * c1 - a0 * d1, a1 * c0 - a0 * c1
    found, cells = [], []
    with np.errstate(all="ignore"):
        root = np.sqrt(first * first - 4 * second * none)
        far = -0.5 * (first + np.copysign(root, first))
        for x in (far / second, none / far):
            slope_u, slope_v = c0 + d0 * x, c1 + d1 * x
            y = np.where(np.abs(slope_u) >= np.abs(slope_v), -(a0 + b0 * x) / slope_u, -(a1 + b1 * x) / slope_v)
            inside = (x >= -slack) & (x <= 1 + slack) & (y >= -slack) & (y <= 1 + slack)
            found.append(np.clip(np.stack([x, y], axis=1)[inside], 0, 1))
            cells.append(np.flatnonzero(inside))
    return np.concatenate(found), np.concatenate(cells)


def _distinct(places: Array, jacobians: Array) -> tuple[Array, Array]:
    """Without those that were found twice: on the border of two cells, or as both roots of one equation."""
    kept: list[int] = []
    seen: dict[tuple[int, int], list[int]] = {}
    for number, (x, y) in enumerate(places.tolist()):
        cell = (int(x), int(y))
        near = [other for i in (-1, 0, 1) for j in (-1, 0, 1) for other in seen.get((cell[0] + i, cell[1] + j), ())]
        if all(np.abs(places[other] - (x, y)).max() > SAME for other in near):
            kept.append(number)
            seen.setdefault(cell, []).append(number)
    return places[kept], jacobians[kept]


def marks(points: list[Point], radius: float) -> Strokes:
    at = np.array([point.place for point in points], np.float64).reshape(-1, 2)
    colours = np.array([COLOURS[point.kind] for point in points], np.float64).reshape(-1, 3)
    return Strokes(at, at, np.full(len(at), radius), colours)


# ------------------------------------------------------------------------------------------------------- declaration


def _result(p: Parameters, facts: InputFacts) -> Facts:
    field = facts["field"]
    return Facts(field.height, field.width, 3, extent=Extent(0.0, 1.0, 0))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = rounding(p.radius, 0.0)
    return Error(value, "bound", value)


def _field(vector: Any) -> dict[str, Array]:
    y, x = np.mgrid[:24, :32] + 0.5
    return {"field": np.stack(np.broadcast_arrays(*vector(x, y), x)[:2], axis=-1).astype(np.float32)}


def _marked(colour: tuple[int, int, int]) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        middle = pixels[12, 16].round().astype(int)
        return None if tuple(middle.tolist()) == colour else f"the middle is {middle}"

    return holds


def _black(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if not pixels.any() else "something was marked"


def _table(findings: Mapping[str, Any]) -> Array:
    """A row for each point: its place and its Jacobian."""
    rows = [[point["x"], point["y"], *np.ravel(point["jacobian"])] for point in findings["points"]]
    return np.array(rows, np.float64).reshape(-1, 6)


critical_points = Operation(
    name="critical_points",
    family="streamlines",
    summary="Finds where a vector field vanishes: place, kind and Jacobian, and a picture that marks them.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("field", "vectors: x to the right, y down; further channels are not read", (2, 4), picture=False),),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    implied=lambda p, facts: "marks reach beyond the cell of their point",
    examples=({}, {"radius": 1.5, "scale": -2, "bias": 0.5}),
    table=_table,
    table_columns=("x", "y", "du/dx", "du/dy", "dv/dx", "dv/dy"),
    hard_cases=(
        HardCase("zero field", "it vanishes everywhere", lambda: _field(lambda x, y: (0, 0)), {}, _black),
        HardCase("field of NaN", "comparisons fail", lambda: _field(lambda x, y: (np.nan, 1)), {}, _black),
        HardCase(
            "saddle on a pixel centre",
            "four cells share the zero",
            lambda: _field(lambda x, y: (x - 16.5, 12.5 - y)),
            {},
            _marked((1, 1, 0)),
        ),
        HardCase(
            "vortex between pixels",
            "the field is linear: the quadratic has no square",
            lambda: _field(lambda x, y: (12.3 - y, x - 16.2)),
            {},
            _marked((0, 1, 0)),
        ),
        HardCase(
            "sink of 1e-30",
            "products underflow",
            lambda: _field(lambda x, y: (1e-30 * (16.4 - x), 1e-30 * (12.2 - y))),
            {},
            _marked((0, 0, 1)),
        ),
    ),
)


@critical_points.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    field = inputs["field"]
    return drawn_exactly(marks(points_of(inputs, p), p.radius), field.height, field.width)


@critical_points.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    points = points_of(inputs, p)
    counts = {kind.value: sum(point.kind is kind for point in points) for kind in Kind}
    return {
        "counts": counts,
        "points": [
            {"x": point.place[0], "y": point.place[1], "kind": point.kind.value, "jacobian": point.jacobian}
            for point in points
        ],
    }


@critical_points.method(
    "direct",
    error=_error,
    work=lambda p, knob, facts: facts["field"].pixels * (1 + 0.01 * p.radius * p.radius),
    rates={"opencl": Rate(1e-3, 2e-7), "numpy": Rate(1e-2, 2.5e-7)},
)
class Direct:
    """Zeros of the bilinear cells in closed form, marked disc by disc."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        field, strokes = inputs["field"], marks(points_of(inputs, parameters), parameters.radius)
        return drawn_opencl(device, strokes, field.height, field.width)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        field, strokes = inputs["field"], marks(points_of(inputs, parameters), parameters.radius)
        return drawn_numpy(strokes, field.height, field.width)
