"""Affine warp: scale, rotate, shear and move, by a matrix.

Truth: output position (u, v) shows the source at the place whose image under `matrix` it is, resampled as all warps
are (see `lichen.operations.warp.reference`). The matrix [[a, b, c], [d, e, f]] maps input to output coordinates,
u = a x + b y + c, v = d x + e y + f, or with `inverse` output to input. Coordinates are in pixels, y down, the centre
of the first pixel at (0.5, 0.5): a scale by 2 about the corner is [[2, 0, 0], [0, 2, 0]], without half-pixel terms.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.maps import Projective
from lichen.operations.warp.matrices import condition_flaws, output_to_input, report, sizes, unmoved
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size

Row = Annotated[tuple[float, float, float], Field()]


class Parameters(WarpParameters):
    matrix: tuple[Row, Row] = Field(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), description="two rows of three: input to output coordinates"
    )
    inverse: bool = Field(False, description="whether the matrix maps output to input coordinates instead")

    @property
    def array(self) -> Array:
        """The matrix with its third row."""
        return np.array([*self.matrix, (0.0, 0.0, 1.0)])


@latest
def map_of(p: Parameters) -> Projective:
    return Projective.of(output_to_input(p.array, inverse=p.inverse))


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    return condition_flaws(p.array, facts["image"], own_size(p, facts), p.inverse)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return unmoved(p.array, own_size(p, facts), facts["image"])


WARP = Warp[Parameters](
    lambda p, inputs: map_of(p),
    largest=lambda p, facts: map_of(p).largest(),
    projective=lambda p, source, result: map_of(p),
)

affine = declare(
    WARP,
    name="affine",
    summary="Scales, rotates, shears and moves an image by a matrix.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    identity=_identity,
    examples=(
        {"matrix": [[0.87, -0.5, 12.0], [0.5, 0.87, -4.0]]},
        {"matrix": [[0.3, 0.05, 4.25], [-0.08, 0.45, 6.5]], "border": "reflect"},
        {"matrix": [[0.6, 0.0, 0.5], [0.2, 1.7, -3.0]], "inverse": True, "border": "clamp"},
    ),
    hard_cases=(
        HardCase(
            name="shift by exactly half a pixel",
            why="a grid of 1/32 px moves what lies between its steps",
            inputs=cases.ramp,
            parameters={"matrix": [[1, 0, 0.5], [0, 1, 0]], "border": "clamp"},
            holds=cases.shifted_ramp(0.5),
            methods=("bilinear", "bicubic", "mitchell", "bspline", "lanczos2", "lanczos3", "ewa"),
        ),
        HardCase(
            name="nothing moves",
            why="weights of 1 beside weights of 0 that meet a NaN, and coordinates that come back rounded",
            inputs=cases.noise_with_nan,
            parameters={},
            holds=cases.unmoved,
            methods=("nearest", "bilinear", "bicubic", "lanczos2", "lanczos3", "mip", "supersampled", "ewa"),
        ),
        HardCase(
            name="quarter turn",
            why="sines of a quarter turn are not exactly 0, and weights beside them not either",
            inputs=cases.noise_with_nan,
            parameters={"matrix": [[0, -1, 31], [1, 0, 0]], "width": 31, "height": 23},
            holds=cases.turned,
            methods=("nearest", "bilinear", "bicubic", "lanczos2", "lanczos3", "supersampled", "ewa", "mip"),
        ),
        HardCase(
            name="scale by a millionth",
            why="a footprint of a million pixels: unbounded work",
            inputs=cases.constant,
            parameters={"matrix": [[1e-6, 0, 8], [0, 1e-6, 8]], "border": "wrap"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="scale by a million",
            why="one sample fills the result, and fractions of 1e-6 lose their digits in float32",
            inputs=cases.constant,
            parameters={"matrix": [[1e6, 0, -3.2e6], [0, 1e6, -5.1e6]], "border": "wrap"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="one NaN",
            why="it must reach what a kernel reaches, and no pixel beyond",
            inputs=cases.noise_with_nan,
            parameters={"matrix": [[1, 0, 0.25], [0, 1, 0.25]]},
            holds=cases.nan_stays_near,
            methods=("nearest", "bilinear", "bicubic", "mitchell", "lanczos2", "lanczos3", "supersampled", "ewa"),
        ),
    ),
)


@affine.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> dict[str, object]:
    """How near the matrix is to a singular one."""
    return report(p.array, sizes(p, inputs, pixels), p.inverse)
