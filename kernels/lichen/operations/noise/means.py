"""Means of bases: what stands for an octave that no pixel can show.

They are those of the noise at 2^12 fixed places, in doubles: part of the definition, and within a few hundredths of the
mean over all places.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operations.noise.basis import Basis, Place
from lichen.operations.noise.coordinates import pixel_axis, point_axis
from lichen.operations.noise.parameters import LatticeParameters

SIDE = 64
STEP = 0.37
"""Cells from place to place, about; less along y."""


def mean_magnitude(basis: Basis[Any], p: LatticeParameters) -> float:
    """Of |n|."""
    return float(np.abs(_sample(basis, _bare(p))).mean())


def mean(basis: Basis[Any], p: LatticeParameters) -> float:
    """Of n."""
    return float(_sample(basis, _bare(p)).mean())


def _bare(p: LatticeParameters) -> LatticeParameters:
    """The parameters with what only the basis reads; the rest as it is by default."""
    own = {name: getattr(p, name) for name in type(p).model_fields if name not in LatticeParameters.model_fields}
    return type(p)(dimensions=p.dimensions, **own)


@lru_cache(maxsize=64)
def _sample(basis: Basis[Any], p: LatticeParameters) -> Array:
    x, y = pixel_axis(0, SIDE, STEP), pixel_axis(0, SIDE, STEP * 0.83)
    axes = (x, y, point_axis(0.31, 1.0), point_axis(0.67, 1.0))[: p.dimensions]
    rows = y.rows(0, SIDE)
    slices = basis.slices(p, (0x9E3779B9, 0x7F4A7C15), axes)
    place = Place(x.cells[None, :], x.fractions[None, :], rows.cells, rows.fractions, 0, 0, slices)
    return basis.evaluate(place, p, False)[0]
