"""What a caller may say about lamps, surface and viewer."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field

from lichen.operation import OperationParameters
from lichen.operations.lighting.lamps import Colour, Doubles, Lamp, Vector
from lichen.operations.lighting.reflection import SMOOTHEST, Distribution, Fresnel, Masking, Material, Model


@lru_cache(maxsize=64)
def _rows(lights: tuple[Lamp, ...]) -> Doubles:
    """Kept, since frames of one scene ask for the same: of 64 lamps they take longer than a picture without light."""
    made = np.concatenate([lamp.rows(number) for number, lamp in enumerate(lights)])
    made.flags.writeable = False
    return made


class Parameters(OperationParameters):
    lights: Annotated[tuple[Lamp, ...], Field(min_length=1, max_length=256)] = (
        Lamp.model_validate({"direction": (-1.0, -1.0, -2.0)}),
    )
    """the lamps, each by its kind (directional, point, spot, area, projector, slab), colour, intensity and place"""
    model: Model = Model.TORRANCE_SPARROW
    """how the surface reflects besides diffusely"""
    diffuse: Colour = (0.8, 0.8, 0.8)
    """share of light that is reflected diffusely, linear; times the input albedo"""
    highlight: Colour = (1.0, 1.0, 1.0)
    """factor on highlights, linear; times the input specular; 0 leaves them out"""
    facet_roughness: float = Field(0.4, ge=0, le=1)
    """where there is no input roughness; its square is the slope of facets; less than 0.05 is taken as that"""
    exponent: float | None = Field(None, ge=1, le=1e5)
    """of the models that are powers of a cosine, in place of the one from the roughness"""
    index: float | None = Field(1.5, ge=1, le=1000)
    """of refraction, for torrance_sparrow; null: all is reflected"""
    distribution: Distribution = Distribution.GGX
    """of the facets of torrance_sparrow"""
    masking: Masking = Masking.SMITH
    """how facets of torrance_sparrow hide one another"""
    grain: Vector = (1.0, 0.0, 0.0)
    """its direction for ward, lafortune and banks, where there is no input tangent"""
    stretch: float = Field(1.0, ge=0.1, le=10)
    """for ward: how much rougher the surface is along the grain than on the mean, and smoother across it"""
    lobe: Annotated[
        tuple[
            Annotated[float, Field(ge=-1, le=1)],
            Annotated[float, Field(ge=-1, le=1)],
            Annotated[float, Field(ge=-1, le=1)],
        ],
        Field(),
    ] = (-1.0, -1.0, 1.0)
    """for lafortune: factors along the grain, across it and along the normal; -1, -1, 1 mirrors"""
    eye: Vector = (0.0, 0.0, 0.0)
    """where the viewer is"""
    view: Vector = (0.0, 0.0, 1.0)
    """the direction towards a viewer at infinity"""
    local_viewer: bool = True
    """whether the viewer is at `eye`, given positions, or at infinity"""
    effect: int = Field(0, ge=0, le=4095)
    """the channel of `tiles` that is about the first lamp; the others follow"""
    faint: float = Field(0.0, ge=0, le=1e6)
    """what `tiles` leave out of the light of a pixel at most: it counts as an error"""

    @property
    def fresnel(self) -> Fresnel:
        return Fresnel.NONE if self.index is None else Fresnel.EXACT

    @property
    def grained(self) -> bool:
        """Whether the model looks at the grain."""
        plain = self.lobe[0] == self.lobe[1] if self.model is Model.LAFORTUNE else self.stretch == 1
        return self.model is Model.BANKS or (self.model in (Model.LAFORTUNE, Model.WARD) and not plain)

    @property
    def shines(self) -> bool:
        dull = self.model is Model.TORRANCE_SPARROW and self.index == 1
        return self.model is not Model.LAMBERT and any(self.highlight) and not dull

    @property
    def drawn(self) -> Model:
        """The model whose code is needed."""
        return self.model if self.shines or self.model is Model.BANKS else Model.LAMBERT

    @property
    def slope(self) -> float:
        """Of the facets, where no image gives it."""
        return min(max(self.facet_roughness, SMOOTHEST), 1.0) ** 2

    def material(self, fresnel: Fresnel | None = None, size: int = 0) -> Material:
        """What the model needs; F by another formula, or factors from tables of `size` entries."""
        contrast = 0.0 if self.index is None else (self.index - 1) * (self.index + 1)
        return Material(
            self.drawn, self.distribution, self.masking, fresnel or self.fresnel, contrast, self.exponent,
            self.stretch, self.lobe, size,
        )  # fmt: skip

    @property
    def discs(self) -> int:
        """Of all lamps together: rows."""
        return sum(math.prod(lamp.grid) for lamp in self.lights)

    def rows(self) -> Doubles:
        """Of all discs; not to be written."""
        return _rows(self.lights)

    def sparse(self, share: float) -> Parameters:
        """With that share of the discs of areas and slabs, one at least."""
        if share >= 1:
            return self
        return self.model_copy(update={"lights": tuple(lamp.sparse(share) for lamp in self.lights)})
