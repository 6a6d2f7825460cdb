"""Spot noise: smooth spots strewn at random, half of them light and half dark.

Truth: the sum of the windows of all impulses, each with a sign of its hash, over four standard deviations: impulses.py
says how they lie and what the window is. `stretch` makes spots ellipses along `angle`, which gives a surface a grain.

Its spectrum is that of one spot, the same in all directions (stretched, along one), and it shows no lattice: what
lattice noises cannot give, and what its many spots cost.

Sources: van Wijk, Spot noise: texture synthesis for data visualization, SIGGRAPH 1991; Lewis, Algorithms for solid
noise synthesis, SIGGRAPH 1989; octaves.py and fractal.py."""

from __future__ import annotations

from pydantic import Field

from lichen.operation import Rate
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.declare import declared
from lichen.operations.noise.impulses import ImpulseParameters, Kernel, basis, scale


class Parameters(ImpulseParameters):
    stretch: float = Field(1.0, ge=1, le=16, description="how much longer than wide spots are")


def kernel(p: Parameters) -> Kernel:
    return Kernel(p.impulses, scale(p, p.stretch, waves=False), p.stretch, p.angle)


BASIS = basis(kernel, gabor=False, band=lambda p: 0.78 * p.stretch)

spot_noise = declared(
    BASIS,
    name="spot_noise",
    summary="Spot noise: random smooth spots, round or stretched along a direction, without a lattice; tileable.",
    description=__doc__ or "",
    parameters=Parameters,
    examples=(
        {"width": 64, "height": 64, "cell": 16},
        {"width": 64, "height": 48, "cell": 24, "stretch": 4, "angle": 30, "impulses": 8, "tile": True},
        {"width": 40, "height": 32, "cell": 16, "fractal": "fbm", "octaves": 3, "output": "derivatives"},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(5e-4, 7.5e-10), Rate(5e-4, 1.1e-9)),
        "numpy": (Rate(5e-4, 2.9e-8), Rate(5e-4, 4.2e-8)),
    },
)
