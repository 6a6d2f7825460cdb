"""Value noise: numbers at the corners of cells, smoothly interpolated.

Truth: at a place with fractions t of its cell, n is the sum over the corners of the product over the axes of s(t) or 1
- s(t), times the corner's number, which its hash gives: one of 2^24 in [-1, 1). s is the fade. The weights add up to 1,
so n never leaves [-1, 1).

It is cheaper than gradient noise and shows its cells more: a quarter of its power lies below a quarter of a cycle per
cell, and features are boxes as often as not.

Sources: Ebert, Musgrave, Peachey, Perlin and Worley, Texturing and modeling, 1994, chapter 2 (lattice value noise);
octaves.py and fractal.py.
"""

from __future__ import annotations

from lichen.hashing import Words
from lichen.memory import Array
from lichen.operation import Rate
from lichen.operations.noise.basis import Basis, Place, Slice, Values
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.declare import declared
from lichen.operations.noise.interpolation import STEEPEST, Fade, FadedParameters, interpolated, slices
from lichen.operations.noise.means import mean_magnitude
from lichen.operations.noise.octaves import Lattice


def evaluate(place: Place, p: FadedParameters, derivatives: bool) -> Values:
    def corner(h: Words, x: Array, y: Array, part: Slice) -> tuple[Array, float, float]:
        return (h >> 8).astype(x.dtype) * x.dtype.type(2.0**-23) - 1, 0.0, 0.0

    return interpolated(place, p.fade, corner, derivatives)


def _rounding(p: FadedParameters) -> float:
    """Corners are exact; a fade carries six roundings and its slope, each axis' weights twice that, and the sum one for
    each corner."""
    return 14 + 10 * (p.dimensions - 1) + 2.0**p.dimensions


BAND = 0.72

BASIS: Basis[FadedParameters] = Basis(
    lattice=lambda p: Lattice(BAND),
    slices=slices,
    evaluate=evaluate,
    mean=lambda p: (0.0, mean_magnitude(BASIS, p)),
    slope=lambda p: 2 * STEEPEST[p.fade],
    rounding=_rounding,
    slope_rounding=lambda p: 40 + 40 * (p.dimensions - 1) + 4 * 2.0**p.dimensions,
    work=lambda p: 0.8 * 2.0**p.dimensions,
    defines=lambda p: {"BASIS": 0, "GRADIENTS": 0},
    numbers=lambda p: (float(p.fade is Fade.QUINTIC),),
)

value_noise = declared(
    BASIS,
    name="value_noise",
    summary="Value noise: octaves of smoothly interpolated random numbers, tileable, with derivatives.",
    description=__doc__ or "",
    parameters=FadedParameters,
    examples=(
        {"width": 96, "height": 64, "cell": 24},
        {"width": 64, "height": 64, "cell": 16, "fractal": "turbulence", "tile": True, "lacunarity": 1.9, "low": -1},
        {"width": 48, "height": 40, "cell": 16, "dimensions": 4, "z": 0.37, "w": -3.1, "octaves": 2, "fade": "cubic",
         "output": "derivatives"},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(5e-4, 5.0e-10), Rate(5e-4, 5.5e-10)),
        "numpy": (Rate(5e-4, 2.0e-8), Rate(5e-4, 2.1e-8)),
    },
)  # fmt: skip
