"""Gabor noise: short waves strewn at random, which set its spectrum.

Truth: the sum over all impulses of window x cos(2 pi (waves d . e + phase)), over four standard deviations. d is the
way from the impulse, in cells, e a direction no more than `spread` from `angle`, and phase and direction come from the
impulse's hash; impulses.py says how they lie and what the window is.

The spectrum is a pair of bumps `waves` cycles per cell from the middle, about half a cycle wide; with a `spread` of 90
degrees it is a ring, the same in all directions. Many `waves` in a cell make a narrow band.

Lagae's kernel has a Gaussian window, cut where it is 5 % of its height, which leaves a jump; this one ends by itself.

Sources: Lagae, Lefebvre, Drettakis and Dutré, Procedural noise using sparse Gabor convolution, SIGGRAPH 2009; with
random phases after Lagae and Drettakis, Filtering solid Gabor noise, SIGGRAPH 2011; octaves.py and fractal.py."""

from __future__ import annotations

from pydantic import Field

from lichen.once import latest
from lichen.operation import Rate
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.declare import declared
from lichen.operations.noise.impulses import ImpulseParameters, Kernel, basis, scale


class Parameters(ImpulseParameters):
    waves: float = Field(2.0, ge=0.01, le=32, description="cycles of a wave in a cell; its window is two cells across")
    spread: float = Field(
        90.0,
        ge=0,
        le=90,
        description="how far directions stray from angle; 90 for all",
        json_schema_extra={"unit": "deg"},
    )


@latest
def kernel(p: Parameters) -> Kernel:
    return Kernel(p.impulses, scale(p, 1.0, waves=True), 1.0, p.angle, p.waves, p.spread / 180)


BASIS = basis(kernel, gabor=True, band=lambda p: p.waves + 0.6)

gabor_noise = declared(
    BASIS,
    name="gabor_noise",
    summary="Gabor noise: random short waves of one frequency, in one direction or in all; tileable.",
    description=__doc__ or "",
    parameters=Parameters,
    examples=(
        {"width": 64, "height": 64, "cell": 24},
        {"width": 64, "height": 48, "cell": 24, "spread": 10, "angle": 30, "impulses": 6, "tile": True},
        {"width": 40, "height": 32, "cell": 24, "waves": 1.5, "output": "derivatives", "dimensions": 3, "impulses": 2},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(5e-4, 1.2e-9), Rate(5e-4, 4.1e-9)),
        "numpy": (Rate(5e-4, 2.8e-8), Rate(5e-4, 7.6e-8)),
    },
)
