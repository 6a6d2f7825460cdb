"""Tables of the factors that highlights are products of, each of one angle: what the hardware of 1999 could look up.

    reflectance   F by the cosine <h, v>
    spread        pi D, or the lobe, by the sine s of the angle from its middle, at the place s (1 + b) / (s + b) of the
                  table: evenly where s is large, and with as many entries within the lobe's width b as beyond it
    leaving       u / (2 u / S(u)), arriving 1 / (2 w / S(w)), by the cosines: G u / (u w) without a division by either

all linear between `size` entries that are even in their places. Tables hold for one roughness, and for a G that is a
product: not for that of v-grooves.

An index by the cosine of the angle, as the texture hardware had it, loses narrow lobes between two entries: for a slope
of 0.05 linear tables of 256 entries are off by a third of the peak (W. Heidrich's dissertation, section 5.1).
"""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache

import numpy as np

from lichen.memory import Array
from lichen.operations.lighting.reflection import (
    Masking,
    Material,
    Model,
    dot,
    facets,
    peak_of_lobe,
    reflectance,
    seen,
    turn,
    unmasked,
)

LOBES = (Model.PHONG, Model.COSINE_LOBE, Model.BLINN_PHONG)
FACTORS = 4


def factored(material: Material) -> bool:
    """Whether highlights are a product of such factors."""
    whole = material.model is Model.TORRANCE_SPARROW and material.masking is Masking.SMITH
    return whole or material.model in LOBES


def width(material: Material, slope: float) -> float:
    """b, of the table of the spread."""
    if material.model in LOBES:
        return 1 / math.sqrt(material.exponent or 2 / slope**2)
    return slope


def _exactly(material: Material, slope: float, place: Array) -> Array:
    """All factors at these places, in doubles."""
    b = width(material, slope)
    sine = np.minimum(place * b / (1 + b - place), 1)
    m = np.full_like(place, slope)
    with np.errstate(all="ignore"):
        if material.model in LOBES:
            exponent = material.exponent or 2 / slope**2
            lobe = np.maximum(1 - sine * sine, 0) ** (exponent / 2)
            return np.stack([np.ones_like(place), lobe, np.ones_like(place), np.ones_like(place)])
        spread = facets(material.distribution, m, np.sqrt(1 - sine * sine), sine * sine, np.ones_like(place))
        open_part = 2 * unmasked(material.distribution, m, place)
        return np.stack([reflectance(place, material), spread, place / open_part, 1 / open_part])


@lru_cache(maxsize=64)
def entries(material: Material, slope: float, size: int) -> Array:
    """float64, one row for each factor."""
    made = _exactly(dataclasses.replace(material, size=0), slope, np.linspace(0, 1, size))
    made.flags.writeable = False
    return made


@lru_cache(maxsize=256)
def apart(material: Material, slope: float, size: int) -> float:
    """What products of the factors are off by at most, for want of entries: seven places between two are looked at."""
    place = np.linspace(0, 1, 8 * (size - 1) + 1)
    exact = _exactly(dataclasses.replace(material, size=0), slope, place)
    looked = np.stack([np.interp(place, np.linspace(0, 1, size), row) for row in entries(material, slope, size)])
    off, most = np.abs(looked - exact).max(axis=1), np.maximum(np.abs(exact), np.abs(looked)).max(axis=1)
    return float(sum(off[i] * np.prod(np.delete(most, i)) for i in range(FACTORS)))


def looked_up(rows: Array, factor: int, place: Array) -> Array:
    """Between two entries, in the precision of `place`; NaN stays."""
    row = rows[factor].astype(place.dtype)
    at = np.clip(place, 0, 1) * place.dtype.type(len(row) - 1)
    first = np.minimum(np.where(np.isnan(at), 0, at).astype(np.int64), len(row) - 2)
    return np.asarray(row[first] + (at - first.astype(place.dtype)) * (row[first + 1] - row[first]))


def highlight(s: Material, slope: float, n: Array, l: Array, v: Array) -> Array:  # noqa: E741
    """As `reflection.highlight` has it, its factors looked up."""
    u, w, rows, b = dot(n, l), dot(n, v), entries(s, slope, s.size), width(s, slope)
    mirrored = s.model in (Model.PHONG, Model.COSINE_LOBE)
    middle, facing = (2 * u * n - l, v) if mirrored else (n, l + v)
    square = dot(facing, facing)
    across = turn(middle, facing, np.ones_like(u) if mirrored else u + w)
    sine = np.sqrt(across / (np.ones_like(square) if mirrored else square))
    spread = looked_up(rows, 1, sine * (1 + b) / (sine + b))
    if s.model is Model.TORRANCE_SPARROW:
        part = looked_up(rows, 0, np.sqrt(square) / 2) * looked_up(rows, 2, u) * looked_up(rows, 3, w)
        made = spread * part
    else:
        k = s.exponent or 2 / slope**2
        spread = np.where(dot(middle, facing) > 0, spread, spread * 0)
        if s.model is Model.PHONG:
            return np.asarray(np.where(u > 0, spread, u - u))
        whole = peak_of_lobe(s.model, k)
        made = whole * spread * u
    return seen(made, u, w, l + v)
