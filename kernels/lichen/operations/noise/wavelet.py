"""Wavelet noise: noise of one octave's frequencies and no others, so that no octave aliases or repeats another.

Truth: n is the sum over cells of a coefficient times the quadratic B-spline around the middle of the cell along x and
y, over four standard deviations and kept within [-1, 1]. bands.py says what the coefficients are: random signs without
what a lattice twice as coarse could hold. Where two octaves of Perlin noise share a third of their power, those of
wavelet noise share next to none: what is sharp enough to show is all there, and what is too fine is all gone.

In three and four dimensions there is a choice, since a plane through a solid band holds low frequencies again:

* `projected`: coefficients are those of signs that are themselves a quadratic spline along z and w, at its own
  variance. Every slice is a band, as in two dimensions; along z the noise is merely smooth.
* `solid`: U D goes along z too. The solid is a band, its slices are not; a fourth dimension is smooth, as above.

Cook and DeRose project a solid along a plane's normal, by the weights of a spline; their slices are nearly bands.

Tables repeat after 128 cells, or as often as a picture that repeats. The variance is that of the weights: with s = 0.55
and c = 0.4093, the means over a place of the squares of the spline's weights and of those through U D, s^d - c^d where
U D goes along d axes.

Sources: Cook and DeRose, Wavelet noise, SIGGRAPH 2005; octaves.py and fractal.py."""

from __future__ import annotations

import math
from enum import StrEnum
from itertools import product

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import Rate
from lichen.operations.noise import bands
from lichen.operations.noise.basis import Basis, Place, Slice, Values
from lichen.operations.noise.cases import lattice_cases
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.declare import declared
from lichen.operations.noise.impulses import NORMAL_MAGNITUDE
from lichen.operations.noise.octaves import Key, Lattice, chained
from lichen.operations.noise.parameters import LatticeParameters


class Depth(StrEnum):
    """What the third and the fourth dimension do."""

    PROJECTED = "projected"
    """every slice holds one octave of frequencies"""
    SOLID = "solid"
    """the solid does, its slices do not"""


class Parameters(LatticeParameters):
    depth: Depth = Field(Depth.PROJECTED, description="what holds one octave of frequencies beyond two dimensions")

    @property
    def axes(self) -> int:
        """Along which U D goes."""
        return min(self.dimensions, 3) if self.depth is Depth.SOLID else 2


def scale(p: Parameters) -> float:
    """One over four standard deviations."""
    plain, low = bands.VARIANCE
    return 1 / (4 * math.sqrt(plain**p.axes - low**p.axes))


# ------------------------------------------------------------------------------------------------------- coefficients


def slices(p: Parameters, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    """One plane, whose table all that lies around z and w has gone into."""
    columns, rows = (bands.side(axis.period, bands.SIDE) for axis in axes[:2])
    layers = _solid(key, axes[2], axes[3:]) if p.axes > 2 else _projected(key, axes[2:])
    return (Slice(key, 0.0, 0.0, table=bands.table(layers, rows, columns) * scale(p)),)


def _key(key: Key, axes: tuple[Axis, ...], cells: tuple[int, ...]) -> Key:
    """Of the plane of signs at these cells of z and w."""
    found = (np.atleast_1d(np.uint32(key[0])), np.atleast_1d(np.uint32(key[1])))
    for axis, cell in reversed(list(zip(axes, cells, strict=True))):
        found = chained(found, axis.wrapped(np.array([cell])))
    return int(found[0][0]), int(found[1][0])


def _smooth(key: Key, axes: tuple[Axis, ...]) -> dict[Key, float]:
    """Keys of the planes that the spline reaches and their weights, at the variance of one plane; those that are one
    because the noise comes round count together."""
    found: dict[Key, float] = {}
    for offsets in product((-1, 0, 1), repeat=len(axes)):
        weight = math.prod(bands.weights(float(a.fractions[0]))[o + 1] for o, a in zip(offsets, axes, strict=True))
        own = _key(key, axes, tuple(int(a.cells[0]) + o for o, a in zip(offsets, axes, strict=True)))
        found[own] = found.get(own, 0.0) + weight
    size = math.sqrt(math.fsum(weight * weight for weight in found.values()))
    return {own: weight / size for own, weight in found.items()}


def _projected(key: Key, axes: tuple[Axis, ...]) -> bands.Layers:
    return tuple((own, (weight,), (weight,)) for own, weight in _smooth(key, axes).items())


def _solid(key: Key, z: Axis, others: tuple[Axis, ...]) -> bands.Layers:
    """Planes that count plainly, or through U D, for each place of the coarse lattice along z."""
    both = [bands.along(int(z.cells[0]), float(z.fractions[0]), parity) for parity in (0, 1)]
    found = []
    for space, weight in _smooth(key, others).items():
        for cell in sorted(set(both[0]) | set(both[1])):
            pairs = [each.get(cell, (0.0, 0.0)) for each in both]
            plain, low = (tuple(weight * pair[which] for pair in pairs) for which in (0, 1))
            found.append((_key(space, (z,), (cell,)), plain, low))
    return tuple(found)


# ---------------------------------------------------------------------------------------------------------- the noise


def _spline(t: Array) -> tuple[Array, Array, Array]:
    return (1 - t) * (1 - t) / 2, t.dtype.type(0.5) + t * (1 - t), t * t / 2


def _slope(t: Array) -> tuple[Array, Array, Array]:
    return t - 1, 1 - 2 * t, t


def evaluate(place: Place, p: Parameters, derivatives: bool) -> Values:
    (part,) = place.slices
    assert part.table is not None
    kind = place.x.dtype.type
    table = part.table.astype(kind)
    rows = [(place.y_cells + j) % table.shape[0] for j in (-1, 0, 1)]
    columns = [(place.x_cells + i) % table.shape[1] for i in (-1, 0, 1)]
    across, down = _spline(place.x), _spline(place.y)
    size = np.broadcast_shapes(place.x.shape, place.y.shape)
    sums = [np.zeros(size, kind) for _ in range(3 if derivatives else 1)]
    for j, i in product(range(3), repeat=2):
        value = table[rows[j], columns[i]]
        sums[0] += down[j] * (across[i] * value)
        if derivatives:
            sums[1] += down[j] * (_slope(place.x)[i] * value)
            sums[2] += _slope(place.y)[j] * (across[i] * value)
    inside = np.abs(sums[0]) < 1
    slopes = [np.where(inside, each, 0) for each in sums[1:]]
    value = np.clip(sums[0], -1, 1)
    return (value, slopes[0], slopes[1]) if derivatives else (value, None, None)


# -------------------------------------------------------------------------------------------------------- declaration


def largest(p: Parameters) -> float:
    """Bound of a coefficient, over four standard deviations: signs add up in the sum over the places of the coarse
    lattice, plainly and through U D; along z the spline's weights are 1 at most, over their root of squares where they
    are brought to one variance."""
    further = math.sqrt(3.0) ** (p.dimensions - p.axes)
    return float(2 ** (p.axes / 2) * (1 + bands.SPREAD**p.axes) * further * scale(p))


def _rounding(p: Parameters) -> float:
    """A coefficient carries one rounding, each axis' weights six, and the sum of nine one for each."""
    return 24 * largest(p) + 2


BASIS: Basis[Parameters] = Basis(
    lattice=lambda p: Lattice(0.6, side=bands.SIDE),
    slices=slices,
    evaluate=evaluate,
    mean=lambda p: (0.0, NORMAL_MAGNITUDE),
    slope=lambda p: 2 * math.sqrt(2) * largest(p),
    rounding=_rounding,
    slope_rounding=lambda p: None,
    work=lambda p: 3.0,
    defines=lambda p: {"BASIS": 4},
)

wavelet_noise = declared(
    BASIS,
    name="wavelet_noise",
    summary="Wavelet noise: octaves of random bands of frequencies that do not overlap, tileable, with derivatives.",
    description=__doc__ or "",
    parameters=Parameters,
    examples=(
        {"width": 96, "height": 64, "cell": 12},
        {"width": 64, "height": 64, "cell": 16, "dimensions": 3, "z": 0.37, "depth": "solid", "fractal": "none",
         "tile": True},
        {"width": 48, "height": 40, "cell": 16, "dimensions": 3, "z": 0.37, "octaves": 2, "output": "derivatives"},
    ),
    hard_cases=lattice_cases(),
    rates={
        "opencl": (Rate(3e-3, 4.1e-10), Rate(3e-3, 5.5e-10)),
        "numpy": (Rate(3e-3, 3.4e-8), Rate(3e-3, 4.2e-8)),
    },
    period="after 128 cells in each octave",
)  # fmt: skip
