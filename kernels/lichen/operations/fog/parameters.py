"""Parameters of fog, and what is wrong with them together."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from lichen.errors import Flaw
from lichen.image import Alpha
from lichen.once import latest
from lichen.operation import Facts, InputFacts
from lichen.operations.compositing.layers import same_size
from lichen.operations.fog.column import Column
from lichen.operations.scene.view import View, pointed

Amount = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Amount, Amount, Amount]
NONE = 1e-30
"""A density below is none: no float32 distance makes a difference of it, and endless ones make one of rounding."""
Density = Annotated[float, Field(ge=0, le=1e6), AfterValidator(lambda density: density if density >= NONE else 0.0)]
LOWEST, HIGHEST = 80.0, 1000.0
"""Falloffs that the eye may lie below and above `base`, where the density is e^80 and e^-1000 of what it is there."""


class Kind(StrEnum):
    """How fog hides with distance."""

    LINEAR = "linear"
    EXPONENTIAL = "exponential"
    SQUARED = "squared"
    LAYERED = "layered"
    HEIGHT = "height"


class Distance(StrEnum):
    """Along what fog is counted."""

    EUCLIDEAN = "euclidean"
    PLANAR = "planar"


class Background(StrEnum):
    """What becomes of pixels where there is nothing."""

    FOG = "fog"
    KEEP = "keep"


class Parameters(View):
    kind: Kind = Kind.EXPONENTIAL
    """linear, exponential, squared (exponential of the square), layered (by a profile over height), height"""
    distance: Distance = Distance.EUCLIDEAN
    """euclidean: from the eye; planar: along the viewing direction, as hardware once did"""
    density: Density = 0.1
    """what is hidden per unit of distance; of layered fog a factor; below 1e-30 none"""
    start: float = Field(1.0, ge=0, le=1e9)
    """of linear fog: nothing is hidden up to here"""
    end: float = Field(100.0, ge=0, le=1e9)
    """of linear fog: everything is hidden from here on"""
    colour: Amount | Annotated[tuple[Amount, ...], Field(min_length=1, max_length=64)] = 0.5
    """the fog's light; one number, or one for each colour channel"""
    heights: Annotated[tuple[Amount, ...], Field(min_length=1, max_length=256)] = (0.0,)
    """of layered fog, rising"""
    densities: Annotated[tuple[Density, ...], Field(min_length=1, max_length=256)] = (1.0,)
    """at each of the heights; linear between them, constant beyond"""
    base: Amount = 0.0
    """of height fog: where the density is `density`"""
    falloff: float = Field(10.0, ge=1e-6, le=1e9)
    """of height fog: over this height the density falls to 1 / e"""
    eye: Vector = (0.0, 0.0, 0.0)
    """where the camera is; depths begin there"""
    up: Vector = (0.0, 1.0, 0.0)
    """the direction in which heights are counted, in the axes of the positions, or of the camera; any length but 0"""
    forward: Vector = (0.0, 0.0, -1.0)
    """the viewing direction, where planar distances of positions are asked for"""
    background: Background = Background.FOG
    """pixels that are infinitely far: fog as dense as it gets, or left as they are"""

    @property
    def upward(self) -> np.ndarray:
        """`up` of length 1."""
        return _unit(self.up)

    @property
    def ahead(self) -> np.ndarray:
        return _unit(self.forward)

    @property
    def eye_height(self) -> float:
        return float(np.dot(self.upward, self.eye))

    @property
    def column(self) -> Column:
        return _column(self)

    @property
    def lift(self) -> float:
        """Falloffs from the eye up to the base."""
        return (self.base - self.eye_height) / self.falloff

    @property
    def clear(self) -> bool:
        """Whether there is no fog anywhere."""
        if self.kind is Kind.LINEAR:
            return False
        return self.density == 0 or (self.kind is Kind.LAYERED and not any(self.densities))

    @property
    def opaque(self) -> bool:
        """Whether nothing at all comes through from infinitely far, in whatever direction."""
        if self.background is Background.KEEP:
            return False
        return self.kind is Kind.LINEAR or (self.kind in (Kind.EXPONENTIAL, Kind.SQUARED) and self.density > 0)

    @property
    def by_height(self) -> bool:
        return self.kind in (Kind.LAYERED, Kind.HEIGHT)

    def light(self, colours: int) -> tuple[float, ...]:
        """The fog's colour, a number for each channel."""
        return self.colour if isinstance(self.colour, tuple) else (self.colour,) * colours


@latest
def _column(p: Parameters) -> Column:
    return Column.around(p.eye_height, p.heights, p.densities)


def _unit(vector: tuple[float, float, float]) -> np.ndarray:
    made = np.array(vector, np.float64)
    largest = np.abs(made).max()
    if largest == 0:
        return made
    made = made / largest
    return np.asarray(made / np.sqrt(np.sum(made * made)))


def colours(facts: Facts) -> int:
    return facts.channels - (facts.alpha is not Alpha.NONE)


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    flaws = same_size(facts, "image", "depth", "emissive") + p.depth_flaws()
    if isinstance(p.colour, tuple) and len(p.colour) != colours(image):
        flaws.append(Flaw("/parameters/colour", f"has {len(p.colour)} numbers for {colours(image)} colour channel(s)"))
    if p.kind is Kind.LINEAR and not p.end - p.start >= 1e-6 * p.end > 0:
        flaws.append(Flaw("/parameters/end", f"must lie beyond start, {p.start:g} (got {p.end:g})"))
    if p.kind is Kind.LAYERED:
        flaws += _profile_flaws(p)
    for name in ("up",) * p.by_height + ("forward",) * (pointed(facts["depth"]) and p.distance is Distance.PLANAR):
        if not any(getattr(p, name)):
            flaws.append(Flaw(f"/parameters/{name}", "is no direction"))
    if p.by_height and p.distance is Distance.PLANAR:
        flaws.append(Flaw("/parameters/distance", f"{p.kind} fog is counted along the ray itself"))
    if p.kind is Kind.HEIGHT and any(p.up) and not -HIGHEST <= p.lift <= LOWEST:
        span = f"at most {LOWEST:g} below and {HIGHEST:g} above"
        flaws.append(Flaw("/parameters/falloff", f"the eye lies {p.lift:.3g} falloffs below base; {span}"))
    return flaws


def _profile_flaws(p: Parameters) -> list[Flaw]:
    flaws = []
    if len(p.heights) != len(p.densities):
        flaws.append(Flaw("/parameters/densities", f"has {len(p.densities)} numbers for {len(p.heights)} height(s)"))
    if any(b <= a for a, b in zip(p.heights, p.heights[1:], strict=False)):
        flaws.append(Flaw("/parameters/heights", "must rise from each to the next"))
    return flaws
