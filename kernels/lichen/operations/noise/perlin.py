"""Perlin noise: gradients at the corners of cells, smoothly interpolated.

Truth: at a place with fractions t of its cell, n is the sum over the corners c of the product over the axes of s(t) or
1 - s(t), times the product of the corner's gradient with the way from it, t - c. s is the fade. Gradients come from a
hash of the cell: eight directions in two dimensions, the edges of a cube or a hypercube in three or four.

Range: by Jensen's inequality the sum of weight x distance is at most the root of the sum over the axes of
(1 - s) t^2 + s (1 - t)^2 <= 1/4, so |n| <= |g| sqrt(d) / 2 in d dimensions, and that becomes 1. It is 0 at every corner
of the first octave, so a picture whose pixel centres are corners is the middle all over: that is no fault.

The printed weight of some course notes, 2 |t|^3 + 3 |t|^2 + 1, has a sign wrong; with it cells jump by 40.

Sources: Perlin, An image synthesizer, SIGGRAPH 1985; Improving noise, SIGGRAPH 2002; octaves.py and fractal.py.
"""

from __future__ import annotations

import math

from lichen.hashing import Words
from lichen.memory import Array
from lichen.operation import Rate
from lichen.operations.noise.basis import Basis, Place, Slice, Values
from lichen.operations.noise.cases import lattice_cases, zero_at_corners
from lichen.operations.noise.declare import declared
from lichen.operations.noise.gradients import LENGTH, ONES, gradient
from lichen.operations.noise.interpolation import STEEPEST, Fade, FadedParameters, interpolated, slices
from lichen.operations.noise.means import mean_magnitude
from lichen.operations.noise.octaves import Lattice


def scale(dimensions: int) -> float:
    """What brings the bound of the sum to 1."""
    return 2 / (math.sqrt(dimensions) * LENGTH[dimensions])


def evaluate(place: Place, p: FadedParameters, derivatives: bool) -> Values:
    def corner(h: Words, x: Array, y: Array, part: Slice) -> tuple[Array, Array, Array]:
        return gradient(h, x, y, part, p.dimensions)

    found = interpolated(place, p.fade, corner, derivatives)
    total, along_x, along_y = (None if each is None else each * scale(p.dimensions) for each in found)
    assert total is not None
    return total, along_x, along_y


def _rounding(p: FadedParameters) -> float:
    """Distances carry one rounding; a fade six and their slope; each axis' weights twice that; and the sum of
    corners."""
    far, ones = LENGTH[p.dimensions] * math.sqrt(p.dimensions), ONES[p.dimensions]
    return scale(p.dimensions) * float(
        2 * ones + 12 * far + 10 * (p.dimensions - 1) * far + 2 ** (p.dimensions - 1) * far
    )


def _slope_rounding(p: FadedParameters) -> float:
    far, ones = LENGTH[p.dimensions] * math.sqrt(p.dimensions), ONES[p.dimensions]
    one_line = 24 + 22 * far + 1.875 * (4 * ones + 2 * far)
    sums = (p.dimensions - 1) * 10 * (2 + 3.75 * far) + 2 ** (p.dimensions - 1) * (1 + 3.75 * far)
    return scale(p.dimensions) * float(one_line + sums)


BANDS = {2: 0.97, 3: 0.89, 4: 0.9}

BASIS: Basis[FadedParameters] = Basis(
    lattice=lambda p: Lattice(BANDS[p.dimensions]),
    slices=slices,
    evaluate=evaluate,
    mean=lambda p: (0.0, mean_magnitude(BASIS, p)),
    slope=lambda p: scale(p.dimensions) + 2 * STEEPEST[p.fade],
    rounding=_rounding,
    slope_rounding=_slope_rounding,
    work=lambda p: 2.0**p.dimensions,
    defines=lambda p: {"BASIS": 0, "GRADIENTS": 1},
    numbers=lambda p: (float(p.fade is Fade.QUINTIC),),
)

perlin_noise = declared(
    BASIS,
    name="perlin_noise",
    summary="Perlin noise: octaves of smooth gradient noise, tileable, in two to four dimensions, with derivatives.",
    description=__doc__ or "",
    parameters=FadedParameters,
    examples=(
        {"width": 96, "height": 64, "cell": 24},
        {"width": 64, "height": 64, "cell": [32, 16], "fractal": "ridged", "tile": True, "lacunarity": 2.17},
        {"width": 48, "height": 40, "cell": 16, "dimensions": 3, "z": 0.37, "octaves": 2, "output": "derivatives"},
        {"width": 64, "height": 48, "cell": 24, "fractal": "turbulence", "warp": 12, "fade": "cubic", "low": -1},
    ),
    hard_cases=(zero_at_corners(), *lattice_cases()),
    rates={
        "opencl": (Rate(5e-4, 4.5e-10), Rate(5e-4, 8.5e-10)),
        "numpy": (Rate(5e-4, 3.2e-8), Rate(5e-4, 3.8e-8)),
    },
)
