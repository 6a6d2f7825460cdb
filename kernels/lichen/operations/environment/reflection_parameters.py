"""Parameters of reflection, and what is wrong with them together."""

from __future__ import annotations

from enum import StrEnum

from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.operation import Degrees, InputFacts
from lichen.operations.compositing.layers import same_size
from lichen.operations.environment import framed
from lichen.operations.environment.surfaces import Seen
from lichen.operations.warp.charts import Chart


class Mode(StrEnum):
    """What is seen of the environment."""

    MIRROR = "mirror"
    REFRACTION = "refraction"
    GLASS = "glass"


class Fresnel(StrEnum):
    """How much is reflected."""

    NONE = "none"
    """a constant"""
    DIELECTRIC = "dielectric"
    """by Fresnel's equations"""


class Background(StrEnum):
    """What shows where there is no surface."""

    NONE = "none"
    """the base, or 0"""
    ENVIRONMENT = "environment"


class Parameters(Seen):
    chart: Chart = Field(Chart.LATLONG, description="how the environment, and the irradiance, hold all directions")
    mode: Mode = Field(Mode.MIRROR, description="what is reflected, what is seen through the surface, or both")
    fresnel: Fresnel = Field(Fresnel.NONE, description="a constant reflectance, or that of a dielectric")
    reflectance: float = Field(1.0, ge=0, le=1, description="where fresnel is none; of refraction, what passes")
    index: float = Field(1.5, ge=0.1, le=1000, description="of refraction: the body's over that around it")
    coated: bool = Field(False, description="whether the base loses what is reflected above it")
    background: Background = Field(Background.NONE, description="what shows where there is no surface")
    yaw: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far the environment's middle is turned to the right")
    pitch: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far up")
    roll: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far it is tilted clockwise")
    effect: int = Field(0, ge=0, le=4095, description="the channel of `tiles` that is about the environment")
    faint: float = Field(0.0, ge=0, le=1e6, description="what `tiles` leave out of a pixel's light at most")

    @property
    def turn(self) -> Array:
        return framed.turn(self.yaw, self.pitch, self.roll)


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    environment = facts["environment"]
    flaws = same_size(facts, "normal", "position", "base")
    if p.chart is Chart.FISHEYE:
        flaws.append(Flaw("/parameters/chart", "a fisheye does not hold all directions; convert it by panorama"))
        return flaws
    for name in ("environment", "irradiance"):
        if name in facts:
            flaws += framed.flaws_of(name, p.chart, facts[name])
    for name in ("base", "irradiance"):
        if name in facts and facts[name].channels != environment.channels:
            text = f"has {facts[name].channels} channel(s); the environment has {environment.channels}"
            flaws.append(Flaw(f"/inputs/{name}", text))
    if p.coated and not {"base", "irradiance"} & facts.keys():
        flaws.append(Flaw("/parameters/coated", "there is neither a base nor an irradiance to be coated"))
    return flaws
