"""Thin-plate spline: an image bent so that points come to lie on points, and as little as possible elsewhere.

Truth: the map from the result to the source is x + g(x), with g the function that takes the value s - t at each target
point t (s being its source point) and bends least, the integral of the squared second derivatives. It is

    g(x) = a + B x + sum of w_i U(|x - t_i|),  U(r) = r^2 log r,

the w orthogonal to all linear functions on the points. With `smoothing` it need not meet the points: the sum of squared
misses plus smoothing times the bending is least. Points are first moved and scaled to mean 0 and root mean square
distance 1, so nothing depends on the unit they are given in. The source is resampled as all warps are (see
`lichen.operations.warp.reference`).

The equations are solved on the complement of the linear functions, where their matrix is positive definite whatever the
points are, even all on one line: of the linear functions that fit as well, the least is then taken, so across the line
nothing moves that does not along it. Points that lie closer together than a millionth of their spread are one point if
they go to one place; if not, no smooth map takes them apart, and they are refused.

Sources: Duchon, Splines minimizing rotation-invariant semi-norms in Sobolev spaces, 1977; Bookstein, Principal warps,
IEEE PAMI 11, 1989; Wahba, Spline Models for Observational Data, 1990, for the complement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.operation import HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.maps import Doubles, Map, Places, Recipe
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size

Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Points = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=1, max_length=500)]
NEAR = 1e-6
"""Of the spread: points closer than this are one, or cannot be told apart."""


class Parameters(WarpParameters):
    source_points: Points = Field(((0.0, 0.0),), description="[x, y] of points of the input, px")
    target_points: Points = Field(((0.0, 0.0),), description="where these points shall lie in the result")
    smoothing: float = Field(0.0, ge=0, le=1e6, description="the price of bending; 0 meets every point")


@dataclass(frozen=True)
class Plate:
    """g in scaled coordinates (x - centre) / scale, in pixels."""

    centre: Doubles
    scale: float
    knots: Doubles
    weights: Doubles
    linear: Doubles
    """three rows: constant, x, y"""
    condition: float
    miss: float
    """the largest distance between where a point should look and where it does, px"""


def _bend(squared: Doubles) -> Doubles:
    """U as a function of r^2; 0 at 0."""
    made: Doubles = 0.5 * squared * np.log(np.where(squared > 0, squared, 1.0))
    return made


def spread(points: Doubles) -> float:
    """Root mean square distance from the mean; 1 for a single point."""
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum(axis=1).mean())) or 1.0


def solve(sources: Doubles, targets: Doubles, smoothing: float) -> Plate:
    """The spline through (n, 2) points, no two of `targets` alike."""
    centre, scale = targets.mean(axis=0), spread(targets)
    knots = (targets - centre) / scale
    moved = sources - targets
    count = len(knots)
    linear = np.concatenate([np.ones((count, 1)), knots], axis=1)
    apart = np.square(knots[:, np.newaxis] - knots).sum(axis=-1)
    bending = _bend(apart)
    u, sizes, _ = np.linalg.svd(linear)
    rank = int(np.count_nonzero(sizes > 1e-9 * sizes[0]))
    rest = u[:, rank:]
    weights, condition = np.zeros((count, 2)), 1.0
    if rest.shape[1]:
        inner = rest.T @ bending @ rest + smoothing * np.eye(rest.shape[1])
        weights = rest @ np.linalg.solve(inner, rest.T @ moved)
        condition = float(np.linalg.cond(inner))
    least = np.linalg.lstsq(linear, moved - (bending + smoothing * np.eye(count)) @ weights, rcond=1e-9)[0]
    miss = float(np.hypot(*(bending @ weights + linear @ least - moved).T).max())
    return Plate(centre, scale, knots, weights, least, condition, miss)


def merged(sources: Doubles, targets: Doubles) -> tuple[Doubles, Doubles, list[tuple[int, int]]]:
    """Without points that are another one again; and the pairs that lie on one place but go to two."""
    near = NEAR * max(spread(targets), 1e-300)
    kept: list[int] = []
    torn = []
    for number, target in enumerate(targets):
        close = [k for k in kept if np.hypot(*(targets[k] - target)) <= near]
        if not close:
            kept.append(number)
        elif np.hypot(*(sources[close[0]] - sources[number])) > 1e3 * near:
            torn.append((close[0], number))
    return sources[kept], targets[kept], torn


@lru_cache(maxsize=16)
def _plate(p: Parameters) -> Plate:
    sources, targets, _ = merged(np.array(p.source_points), np.array(p.target_points))
    return solve(sources, targets, p.smoothing)


class Bending(Map):
    def __init__(self, plate: Plate) -> None:
        self.plate = plate

    def recipe(self) -> Recipe:
        plate = self.plate
        knots = np.concatenate([plate.knots, plate.weights], axis=1)
        start = len(knots), *plate.centre, 1 / plate.scale
        return Recipe("warp/thin_plate.cl", np.concatenate([start, plate.linear.ravel(), knots.ravel()]))

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        at = self._evaluate(*np.broadcast_arrays(u, v))
        return at.x, at.y

    def places(self, u: Doubles, v: Doubles) -> Places:
        return self._evaluate(*np.broadcast_arrays(u[np.newaxis, :], v[:, np.newaxis]))

    def _evaluate(self, u: Doubles, v: Doubles) -> Places:
        """Values and derivatives: of U by x, (log r^2 + 1) dx, which is 0 where dx is."""
        plate = self.plate
        x, y = (u - plate.centre[0]) / plate.scale, (v - plate.centre[1]) / plate.scale
        constant, by_x, by_y = plate.linear
        moved = [constant[k] + by_x[k] * x + by_y[k] * y for k in (0, 1)]
        along = [[np.full(x.shape, by[k]) for k in (0, 1)] for by in (by_x, by_y)]
        for (kx, ky), weight in zip(plate.knots, plate.weights, strict=True):
            dx, dy = x - kx, y - ky
            squared = dx * dx + dy * dy
            logarithm = np.log(np.where(squared > 0, squared, 1.0))
            value, slope = 0.5 * squared * logarithm, logarithm + 1
            for k in (0, 1):
                moved[k] += weight[k] * value
                along[0][k] += weight[k] * slope * dx
                along[1][k] += weight[k] * slope * dy
        (xu, yu), (xv, yv) = ([each / plate.scale for each in pair] for pair in along)
        return Places(u + moved[0], v + moved[1], 1 + xu, yu, xv, 1 + yv)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    sources, targets = np.array(p.source_points), np.array(p.target_points)
    if len(sources) != len(targets):
        return [Flaw("/parameters/target_points", f"has {len(targets)} points for {len(sources)}")]
    _, _, torn = merged(sources, targets)
    if torn:
        pairs = ", ".join(f"{a} and {b}" for a, b in torn[:5])
        return [Flaw("/parameters/target_points", f"lie on one place and come from two: {pairs}")]
    return []


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    same = own_size(p, facts) == (image.width, image.height)
    return "no point is moved" if same and p.source_points == p.target_points else None


FOUR = [[4, 5], [40, 3], [38, 29], [6, 28], [22, 16]]
MOVED = [[6, 4], [39, 6], [40, 27], [3, 29], [26, 13]]
LINE = [[2.0 + 4 * k, 6.0 + 3 * k] for k in range(9)]

thin_plate = declare(
    Warp[Parameters](lambda p, inputs: Bending(_plate(p))),
    name="thin_plate",
    summary="Bends an image so that points come to lie on points, as smoothly as can be.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    identity=_identity,
    examples=(
        {"source_points": FOUR, "target_points": MOVED, "border": "clamp"},
        {"source_points": FOUR, "target_points": MOVED, "smoothing": 0.1},
    ),
    hard_cases=(
        HardCase(
            name="nine points on a line",
            why="no linear function is determined across it: others refuse, or give one colour",
            inputs=cases.ramp,
            parameters={"source_points": LINE, "target_points": [[x + 1, y] for x, y in LINE], "border": "clamp"},
            holds=cases.shifted_ramp(1.0),
            methods=("bilinear", "bicubic", "lanczos2", "lanczos3", "ewa"),
        ),
        HardCase(
            name="one point twice",
            why="equal rows make the equations singular",
            inputs=cases.ramp,
            parameters={
                "source_points": [[0, 0], [20, 1], [5, 8], [5, 8 + 1e-9]],
                "target_points": [[1, 0], [21, 1], [6, 8], [6, 8 + 1e-9]],
                "border": "clamp",
            },
            holds=cases.shifted_ramp(1.0),
            methods=("bilinear", "bicubic", "lanczos2", "lanczos3", "ewa"),
        ),
    ),
)


@thin_plate.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """How far the equations are from singular, and how well the points are met."""
    plate = _plate(p)
    return {"condition": plate.condition, "largest_miss": plate.miss, "points": len(plate.knots)}
