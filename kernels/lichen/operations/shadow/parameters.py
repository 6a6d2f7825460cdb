"""Parameters of shadow, the light as a camera, and what is wrong with them together."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import AfterValidator, Field

from lichen.errors import Flaw
from lichen.operation import Degrees, InputFacts
from lichen.operations.compositing.layers import same_size
from lichen.operations.scene.camera import Camera, Vector
from lichen.operations.scene.view import View

WIDEST = 32
"""Texels of a filter's side."""
NARROWEST = 1e-3
"""A filter's side below is 0: what a square covers of texels is the difference of its ends, and has no digits left."""
Side = Annotated[float, Field(ge=0, le=WIDEST), AfterValidator(lambda side: side if side >= NARROWEST else 0.0)]


class Kind(StrEnum):
    """How depths of the map become a share of light."""

    PCF = "pcf"
    PCSS = "pcss"
    VARIANCE = "variance"


class Outside(StrEnum):
    """What lies beyond the map's edge, and behind the light."""

    LIT = "lit"
    DARK = "dark"


class MapKind(StrEnum):
    """What the map holds."""

    PLANAR = "planar"
    WINDOW = "window"
    REVERSED = "reversed"


class Parameters(View):
    light_eye: Vector = (3.0, 5.0, 0.0)
    """where the light is, in the axes of the positions, or of the camera"""
    light_target: Vector = (0.0, 0.0, -5.0)
    """what the map's middle shows"""
    light_up: Vector = (0.0, 1.0, 0.0)
    """what is up in the map, roughly"""
    light_fov: Degrees = Field(60.0, ge=0.01, le=175)
    """the map's vertical angle"""
    light_extent: float | None = Field(None, ge=1e-6, le=1e6)
    """of light without perspective: the height of what the map shows"""
    map_kind: MapKind = MapKind.PLANAR
    """planar: depth along the light's direction; window: 0 at light_near, 1 at light_far; reversed: 1 to 0"""
    light_near: float = Field(0.1, ge=1e-9, le=1e6)
    """of a window's depth, and of depth in few bits"""
    light_far: float | None = Field(None, gt=0, le=1e9)
    """of a window's depth, and of depth in few bits; none: infinitely far"""
    kind: Kind = Kind.PCF
    """pcf: comparisons averaged; pcss: over as much as the penumbra is wide; variance: Chebyshev's bound"""
    filter: Side = 0.0
    """side of the square that is averaged, texels; 0, and below 0.001: the nearest texel alone. Of pcss: the widest"""
    source: float = Field(0.2, ge=0, le=1e6)
    """of pcss: the light's width; of light without perspective the tangent of the angle it fills"""
    slope: float = Field(1.0, ge=0, le=100)
    """without normals: the steepest receiver, depth over width, that casts no shadow on itself"""
    outside: Outside = Outside.LIT
    """beyond the map and behind the light"""
    effect: int = Field(0, ge=0, le=4095)
    """the channel of `tiles` that is about this light"""

    @property
    def light(self) -> Camera:
        return Camera(
            eye=self.light_eye, target=self.light_target, up=self.light_up, fov=self.light_fov, extent=self.light_extent
        )

    @property
    def terms(self) -> tuple[float, float, float]:
        """s, a and b with the planar depth s / (a + b d) of a map's d."""
        window, far, near = self.map_kind is MapKind.WINDOW, self.light_far, self.light_near
        if far is None:
            return (near, 1.0, -1.0) if window else (near, 0.0, 1.0)
        return near * far, far if window else near, near - far if window else far - near


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = [
        Flaw(each.pointer.replace("/parameters/", "/parameters/light_"), each.detail) for each in p.light.camera_flaws()
    ]
    flaws += p.depth_flaws()
    flaws += same_size(facts, "depth", "normal")
    if p.light_far is not None and p.light_far <= p.light_near:
        flaws.append(
            Flaw("/parameters/light_far", f"must lie beyond light_near, {p.light_near:g} (got {p.light_far:g})")
        )
    if p.kind is not Kind.PCF and p.filter < 1:
        flaws.append(Flaw("/parameters/filter", f"{p.kind} needs a side of at least 1 texel"))
    return flaws
