"""Projective warp: what one plane looks like from elsewhere, by a 3 x 3 matrix or by pairs of points.

Truth: output position (u, v) shows the source at the place whose image under the matrix it is, resampled as all warps
are (see `lichen.operations.warp.reference`). The matrix maps input to output coordinates,

    u = (a x + b y + c) / w,  v = (d x + e y + f) / w,  w = g x + h y + i,

or with `inverse` output to input. Coordinates are in pixels, y down, the centre of the first pixel at (0.5, 0.5).

What lies on or behind the plane at infinity, w <= 0 either way, is background: a vanishing line through the image ends
the plane there, and nothing is mirrored from behind. Towards it footprints grow without end; one whose ellipse is
larger than four times the source takes the mean of the source, so the work is bounded. With `border=wrap` the source
tiles the plane to the horizon.

In place of the matrix, `source_points` and `target_points` give four or more points of the input and of the output (see
`correspondences`). The findings tell the matrix, its condition number and how well the points were met. A matrix that
is singular, or within 1e-12 of it, is refused.

Source: Hartley and Zisserman, Multiple View Geometry in Computer Vision, 2004.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import HardCase, InputFacts, Inputs
from lichen.operations.warp import cases, matrices
from lichen.operations.warp.correspondences import Fit, fit
from lichen.operations.warp.maps import Projective
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size

Row = tuple[float, float, float]
Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Points = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=4, max_length=1000)]
UNDETERMINED = 1e-9


class Parameters(WarpParameters):
    matrix: tuple[Row, Row, Row] | None = Field(
        None, description="three rows of three: input to output coordinates; nothing moves if it is left out"
    )
    inverse: bool = Field(False, description="whether the matrix maps output to input coordinates instead")
    source_points: Points | None = Field(None, description="[x, y] of four or more points of the input, in px")
    target_points: Points | None = Field(None, description="where these points shall lie in the output")

    @property
    def fitted(self) -> Fit | None:
        """The matrix of the points, if points are given."""
        if self.source_points is None or self.target_points is None:
            return None
        return _fit(self.source_points, self.target_points)

    @property
    def array(self) -> Array:
        fitted = self.fitted
        if fitted is not None:
            return fitted.matrix
        return np.eye(3) if self.matrix is None else np.array(self.matrix)

    @property
    def backward(self) -> bool:
        return self.inverse and self.matrix is not None


@lru_cache(maxsize=16)
def _fit(sources: tuple[tuple[float, float], ...], targets: tuple[tuple[float, float], ...]) -> Fit:
    return fit(sources, targets)


@latest
def map_of(p: Parameters) -> Projective:
    return Projective.of(matrices.output_to_input(p.array, inverse=p.backward))


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    pairs = p.source_points, p.target_points
    if (pairs[0] is None) != (pairs[1] is None):
        missing = "source_points" if pairs[0] is None else "target_points"
        return [Flaw(f"/parameters/{missing}", "points are given in pairs: both lists or none")]
    if pairs[0] is not None and pairs[1] is not None:
        if p.matrix is not None:
            return [Flaw("/parameters/matrix", "a matrix or points: not both")]
        if len(pairs[0]) != len(pairs[1]):
            return [Flaw("/parameters/target_points", f"has {len(pairs[1])} points for {len(pairs[0])}")]
        found = fit(pairs[0], pairs[1])
        if found.determined < UNDETERMINED:
            return [
                Flaw("/parameters/source_points", "leave a choice: three of four points lie on a line, or two agree")
            ]
        if not found.ahead:
            return [Flaw("/parameters/target_points", "are no view of one plane: some would lie behind the eye")]
    flaws = matrices.condition_flaws(p.array, facts["image"], own_size(p, facts), p.backward)
    if flaws and pairs[0] is not None:
        return [Flaw("/parameters/target_points", flaws[0].detail)]
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return matrices.unmoved(p.array, own_size(p, facts), facts["image"])


WARP = Warp[Parameters](
    lambda p, inputs: map_of(p),
    largest=lambda p, facts: map_of(p).largest(),
    projective=lambda p, source, result: map_of(p),
)

HORIZON = [[1.0, 0.0, 0.0], [0.0, 0.3, 6.0], [0.0, 0.125, -1.0]]
"""Output to input: the vanishing line is row 8 of the output."""

homography = declare(
    WARP,
    name="homography",
    summary="Shows a plane from elsewhere: a projective warp by a matrix or by pairs of points.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    identity=_identity,
    examples=(
        {"matrix": [[1.05, 0.12, -3.0], [-0.04, 0.95, 2.0], [0.0012, 0.0021, 1.0]], "border": "clamp"},
        {"matrix": HORIZON, "inverse": True, "border": "wrap"},
        {
            "source_points": [[0, 0], [40, 0], [40, 30], [0, 30], [20, 15]],
            "target_points": [[3, 2], [36, 6], [30, 27], [6, 30], [18.2, 15.5]],
        },
    ),
    hard_cases=(
        HardCase(
            name="vanishing line through the image",
            why="half of the plane is behind: others mirror it, fill it with NaN, or work for minutes",
            inputs=lambda: {"image": np.full((16, 16, 4), 0.7, np.float32)},
            parameters={"matrix": HORIZON, "inverse": True, "border": "wrap"},
            holds=cases.nothing_above(8, 0.7),
        ),
        HardCase(
            name="vanishing line, bounded picture",
            why="what is large and far is more background than picture",
            inputs=lambda: {"image": np.full((16, 16, 4), 0.7, np.float32)},
            parameters={"matrix": HORIZON, "inverse": True},
            holds=cases.constant_or_background,
        ),
        HardCase(
            name="nearly singular",
            why="a condition number of 1e9 folds the plane to a line, almost",
            inputs=cases.constant,
            parameters={"matrix": [[1, 1, 0], [1, 1 + 1e-9, 0], [0, 0, 1]], "border": "wrap"},
            holds=cases.stays_constant,
        ),
    ),
)


@homography.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """The matrix, its condition number, and how well points were met."""
    found = matrices.report(p.array, matrices.sizes(p, inputs, pixels), p.backward)
    fitted = p.fitted
    return found if fitted is None else {**found, "largest_residual": fitted.residual}
