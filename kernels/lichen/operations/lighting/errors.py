"""What lighting may be wrong by, from what arrives and how a surface reflects it.

A highlight's relative error is a few roundings times how steeply it falls: 1 / m for facets of slope m, the root of the
exponent for powers of a cosine that come from its squared sine, the exponent for those that come from the cosine. So
errors are stated as

    rounding x arriving x (a x albedo + b x specular x peak x steepness)

with factors a and b twice or more of what some 1e4 pictures of all kinds have shown. Where G is that of v-grooves, and
in Ward's model, a highlight at grazing angles has no bound; its peak counts as at a cosine of 1/1000.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lichen.image import Extent
from lichen.operation import ROUNDING, Error
from lichen.operations.lighting.reflection import (
    Distribution,
    Fresnel,
    Masking,
    Material,
    Model,
    peak_of_lobe,
    reflectance,
)
from lichen.operations.lighting.tables import apart, factored

FLOAT_MAX = float(np.finfo(np.float32).max)
DIFFUSE, SHINY = 12.0, 12.0
"""Roundings of the diffuse part and of a highlight, each relative to its largest value."""
GRAZING = 250.0
"""1 / (4 cos) at a cosine of 1/1000."""


@dataclass(frozen=True, slots=True)
class Reflected:
    """Largest values: of what arrives, of the diffuse share and of the factor on highlights; the least slope; discs."""

    arriving: float
    albedo: float
    specular: float
    slope: float
    rows: int


def finite(value: float) -> float:
    return min(value, FLOAT_MAX)


def _exponent(material: Material, slope: float) -> float:
    return material.exponent or 2 / slope**2


def peak(material: Material, slope: float) -> float:
    """The largest highlight; of Smith's G, since S(u) u / u <= 1 and S(w) / w <= 1.8 / m."""
    k = _exponent(material, slope)
    match material.model:
        case Model.LAMBERT:
            return 0.0
        case Model.PHONG | Model.BANKS:
            return 1.0
        case Model.COSINE_LOBE | Model.LAFORTUNE | Model.BLINN_PHONG:
            return float(peak_of_lobe(material.model, k))
        case Model.TORRANCE_SPARROW if material.masking is Masking.SMITH:
            return (0.5 if material.distribution is Distribution.GGX else 2.7) / slope**3
        case _:
            return GRAZING / slope**2


def bounded(material: Material) -> bool:
    """Whether no highlight is brighter than its peak."""
    grooved = material.model is Model.TORRANCE_SPARROW and material.masking is Masking.V_GROOVE
    return not grooved and material.model is not Model.WARD


def _steepness(material: Material, slope: float) -> float:
    k = _exponent(material, slope)
    match material.model:
        case Model.LAFORTUNE:
            return 8 * k
        case Model.TORRANCE_SPARROW | Model.WARD:
            return 1 / slope
        case _:
            return 1 + math.sqrt(k)


def exact(r: Reflected, material: Material, texels: int) -> Error:
    """Of float32 arithmetic, all of it rounding. `texels`: the slide's longer side, whose place is off by roundings."""
    highlight = peak(material, r.slope)
    shiny = SHINY * r.specular * highlight * _steepness(material, r.slope)
    added = 1 + (r.rows + 8 * texels) / 16
    value = finite(ROUNDING * r.arriving * added * (DIFFUSE * r.albedo + shiny))
    if material.model is Model.PHONG and r.specular:
        typical, value = value, finite(value + r.arriving * r.specular)
        return Error(value, "estimate", value, typical)
    return Error(value, "estimate", value)


def schlick(r: Reflected, material: Material, texels: int) -> Error:
    rounding = exact(r, material, texels).value
    apart = _schlick_apart(material.contrast) * r.arriving * r.specular * peak(material, r.slope)
    return Error(finite(rounding + apart), "estimate", rounding)


def looked_up(r: Reflected, material: Material, size: int, texels: int) -> Error:
    """Of tables with `size` entries, for the one slope."""
    rounding = exact(r, material, texels).value
    if not r.specular or not factored(material):
        return Error(rounding, "estimate", rounding)
    over = 1.0
    if material.model is not Model.TORRANCE_SPARROW:
        over = peak(material, r.slope)
    off = 1.5 * over * apart(material, r.slope, size) * r.arriving * r.specular
    return Error(finite(rounding + off), "estimate", rounding)


@lru_cache(maxsize=64)
def _schlick_apart(contrast: float) -> float:
    """The largest difference of Schlick's approximation from Fresnel's formula."""
    cosine = 1 - np.linspace(0, 1, 4001) ** 2
    exact_one, other = (
        reflectance(cosine, Material(Model.TORRANCE_SPARROW, fresnel=kind, contrast=contrast))
        for kind in (Fresnel.EXACT, Fresnel.SCHLICK)
    )
    return 1.01 * float(np.abs(exact_one - other).max())


def gain(r: Reflected, material: Material, *, shiny: bool) -> float:
    """The largest change of the result by a change of a colour."""
    if not shiny or not r.specular:
        return finite(r.arriving)
    return finite(r.arriving * (1 + peak(material, r.slope))) if bounded(material) else FLOAT_MAX


def extent(r: Reflected, material: Material, nonfinite: int) -> Extent:
    """Both ways, since colours that are images may be negative."""
    most = r.arriving * (r.albedo + r.specular * peak(material, r.slope)) * 1.001
    if r.specular and not bounded(material):
        most = FLOAT_MAX
    most = finite(most + exact(r, material, 0).value)
    return Extent(-most, most, nonfinite)
