"""Simplex noise: a smooth bump with a gradient around every point of a lattice, summed.

Truth: n is the sum over the lattice points within a radius R of (R^2 - r^2)^4 g . d, where d is the way from the point,
r its length and g the gradient of the point's hash. R is the height of a simplex of the lattice, so no bump reaches
beyond the simplices around its point and the sum has three continuous derivatives everywhere: the radius of many
programs, sqrt(0.6), is larger and jumps. The lattices are such that pictures can repeat along x and y:

* two dimensions: equilateral triangles of side 1, rows along x; R^2 = 3/4;
* three: the corners and the centres of unit cubes, whose simplices are the tetrahedra of Perlin's skewed cubes,
  standing upright; R^2 = 1/2;
* four: likewise the corners and centres of unit hypercubes (the lattice D4; its cells are no simplices); R^2 = 1/2.

A cell is a triangle's side, or the side of a cube. Perlin's unit is 0.82 of the triangle's side.

Range: with unit gradients the sum is at most the sum over the points of (R^2 - r^2)^4 r. In two dimensions that is
largest in the middle of a side, where it is 1/16; in three and four the maximum was found on a grid, 1/107.65 and
1/108.73. n is scaled by a little less than the inverse, which makes the bound 1.

Methods look at two points of each row of the lattice that comes near enough: others are out of reach.

Sources: Perlin, Noise hardware, SIGGRAPH course 36, 2001; Gustavson, Simplex noise demystified, 2005; Conway and
Sloane, Sphere packings, lattices and groups, chapter 4."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lichen.hashing import keyed
from lichen.operation import Rate
from lichen.operations.noise.basis import Basis, Place, Slice, Values, corners, padded
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.declare import declared
from lichen.operations.noise.gradients import LENGTH, ONES, gradient
from lichen.operations.noise.means import mean_magnitude
from lichen.operations.noise.octaves import Key, Lattice
from lichen.operations.noise.parameters import LatticeParameters

HEIGHT = math.sqrt(3) / 2
"""Of a triangle of side 1."""
REACH = {2: 0.75, 3: 0.5, 4: 0.5}
"""R^2 by the number of dimensions."""
INVERSE = {2: 16.0, 3: 107.4, 4: 108.5}
"""Of the largest sum with unit gradients, a little less."""
CENTRES = 0xB5297A4D
"""Turns the key of an octave into that of its cubes' centres."""


class Parameters(LatticeParameters):
    pass


def slices(p: Parameters, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    """The planes of lattice points around z and w that come within reach; in two dimensions the only one."""
    if p.dimensions == 2:
        return (Slice(key, 0.0, 0.0),)
    found = [Slice(own, **padded(away)) for own, away in corners(key, axes)]
    half = tuple(_half_back(axis) for axis in axes)
    centres = (key[0] ^ CENTRES, key[1])
    found += [Slice(own, centred=True, **padded(away)) for own, away in corners(centres, half)]
    return tuple(found)


def _half_back(axis: Axis) -> Axis:
    """The axis as the centres of cells see it."""
    back = np.floor(axis.fractions - 0.5)
    return Axis(axis.cells + back.astype(np.int64), axis.fractions - 0.5 - back, axis.period)


def evaluate(place: Place, p: Parameters, derivatives: bool) -> Values:
    size = np.broadcast_shapes(place.x.shape, place.y.shape)
    total, along_x, along_y = (np.zeros(size, place.x.dtype) for _ in range(3))
    height = HEIGHT if p.dimensions == 2 else 1.0
    for part in place.slices:
        for below in (0, 1):
            above = place.y - (0.5 if part.centred else 0.0)
            down = np.floor(above)
            offset = down.astype(np.int64) + below
            away = (above - down - below) * above.dtype.type(height)
            key = place.row(part, offset)
            half: Any = 0.5 * ((place.y_cells + offset) & 1) if p.dimensions == 2 else (0.5 if part.centred else 0.0)
            right = place.x - np.asarray(half, place.x.dtype)
            whole = np.floor(right)
            right = right - whole
            for beyond in (0, 1):
                x = right - beyond
                h = keyed(place.column(whole.astype(np.int64) + beyond), *key)
                squared = x * x + (away * away + part.z * part.z + part.w * part.w)
                rest = np.maximum(REACH[p.dimensions] - squared, 0)
                product, step_x, step_y = gradient(h, x, away, part, p.dimensions)
                total += rest**4 * product
                if derivatives:
                    along_x += rest**4 * step_x - 8 * rest**3 * product * x
                    along_y += rest**4 * step_y - 8 * rest**3 * product * away
    scale = INVERSE[p.dimensions] / LENGTH[p.dimensions]
    if not derivatives:
        return total * scale, None, None
    return total * scale, along_x * scale, along_y * (scale * height)


STEEPEST = {2: 6.5, 3: 7.5, 4: 8.0}
"""Bound of the derivative along any direction: the largest sum of (R^2 - r^2)^4 + 8 (R^2 - r^2)^3 r^2, scaled."""


def _rounding(p: Parameters) -> float:
    """Of each bump: r^2 carries three roundings of up to 1, which count eightfold by the fourth power's slope; the
    product with the gradient two for each component."""
    top = REACH[p.dimensions] ** 4
    one = 4 * REACH[p.dimensions] ** 3 * 5 * 0.87 + top * (3 * ONES[p.dimensions] + 5)
    return INVERSE[p.dimensions] / LENGTH[p.dimensions] * one * (4 if p.dimensions == 2 else 6)


def _steepest_here(p: Parameters) -> float:
    return STEEPEST[p.dimensions]


BANDS = {2: 1.31, 3: 1.58, 4: 1.63}

BASIS: Basis[Parameters] = Basis(
    lattice=lambda p: (
        Lattice(BANDS[2], rows_per_cell=1 / HEIGHT, rows_multiple=2)
        if p.dimensions == 2
        else Lattice(BANDS[p.dimensions])
    ),
    slices=slices,
    evaluate=evaluate,
    mean=lambda p: (0.0, mean_magnitude(BASIS, p)),
    slope=_steepest_here,
    rounding=_rounding,
    slope_rounding=lambda p: 12 * _rounding(p),
    work=lambda p: {2: 5.0, 3: 9.0, 4: 12.0}[p.dimensions],
    defines=lambda p: {"BASIS": 1, "GRADIENTS": 1},
)

simplex_noise = declared(
    BASIS,
    name="simplex_noise",
    summary="Simplex noise: octaves of smooth bumps on triangles or tetrahedra, tileable, with derivatives.",
    description=__doc__ or "",
    parameters=Parameters,
    examples=(
        {"width": 96, "height": 64, "cell": 24},
        {"width": 64, "height": 64, "cell": 20, "fractal": "billow", "tile": True, "lacunarity": 2.3},
        {"width": 48, "height": 40, "cell": 16, "dimensions": 3, "z": 0.37, "octaves": 2, "output": "derivatives"},
        {"width": 40, "height": 32, "cell": 16, "dimensions": 4, "z": 0.2, "w": 4.6, "octaves": 2, "warp": 5},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(5e-4, 7.8e-10), Rate(5e-4, 1.2e-9)),
        "numpy": (Rate(5e-4, 6.0e-8), Rate(5e-4, 6.2e-8)),
    },
)
