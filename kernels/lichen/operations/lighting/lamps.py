"""Sources of light: as a caller describes them, and as rows of numbers that kernels take.

A lamp of `intensity` 1 and colour white lights a white diffuse surface that faces it to the radiance 1: a directional
lamp anywhere, the others, with their falloff of 1 / distance^2, at distance 1. In radiometric units its irradiance is
pi x intensity.

    kind          shines
    directional   everywhere along `direction`
    point         from `position` to all sides
    spot          from `position` within a cone about `direction`: all of it up to `inner` from the axis, none beyond
                  `outer`, between them 3 t^2 - 2 t^3 of the cosine
    area          from a rectangle of `size` at `position`, across `direction` and upright by `up`: `samples` small
                  discs on an even grid, each with the cosine of a diffuse emitter
    projector     from `position` along `direction`, the input `slide` in colours: `fov` high, `aspect` times as wide;
                  dark beside the slide and behind the lamp
    slab          from a rectangle of `size`, as an area, each of its `cells` with a picture of its own (`cell` below)

Falloff is 1 / (a + b s + c s^2) with s^2 = distance^2 + radius^2, where (a, b, c) is `falloff`, and what arrives at the
surface is that times the cosine times distance / s. For a, b, c = 0, 0, 1 this is exactly the flux from a transparent
ball of glowing gas of Plummer's density: the inverse square far away, finite and smooth everywhere, and nothing at the
centre, where light comes from all sides alike. So no smallest distance is needed, but `nearest` may say that nothing is
nearer. Each disc of an area has the radius
that makes up the area.

A slab holds what leaves a real lamp, measured or computed once, in whatever way it is bent on the way out: its light
through every small cell of a plane (u, v) before it, in every direction (s, t). The input `slab` is a sheet of
pictures, `cells` across and down as seen from behind the lamp. Each is what leaves its cell's middle, `fov` high and
`aspect` times as wide: pictures of what lies infinitely far away, or of one plane at `distance`, the same part of which
all of them show. A slab shines as an area of so many discs does, each through its picture; of one cell, it is a
projector with the extent of an area.

Sources: W. Heidrich, High-quality shading and lighting for hardware-accelerated rendering, dissertation, Erlangen 1999,
sections 2.4, 4.1 and 7.2 (equation 7.4); M. Segal et al., Fast shadows and lighting effects using texture mapping,
SIGGRAPH 1992 (projectors).
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, field_validator, model_validator

from lichen.operation import Degrees, OperationParameters

Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Number, Number, Number]
Share = Annotated[float, Field(ge=0, le=1e6)]
Colour = tuple[Share, Share, Share]
Doubles = npt.NDArray[np.float64]

DIRECTIONAL, POSITIONAL = 0, 1
FARTHEST = 1e6
"""Of the distances that a lamp may say nothing is within."""
ROW = 40
"""Numbers of a row; `Row` says what they are."""


class Row:
    """Where in a row what begins."""

    TYPE = 0
    """DIRECTIONAL or POSITIONAL"""
    COLOUR = 1
    PLACE = 4
    """the direction towards the lamp; or its position, rounded to float32, then the rest of it"""
    REST = 7
    AXIS = 10
    """unit vector along which it shines"""
    RADIUS = 13
    """its square"""
    FALLOFF = 14
    EMITTER = 17
    """1: with the cosine of a diffuse emitter"""
    CONE = 18
    """1 - cos outer, then 1 / (cos inner - cos outer), which is 0 where there is no cone"""
    SLIDE = 20
    """1: through the slide, 2: through the slab, whose axes follow: across and down, in slides of the distance along
    the axis"""
    ACROSS = 21
    DOWN = 24
    LAMP = 27
    """number of the lamp"""
    NEAREST = 28
    """its square"""
    CELL = 29
    """of a slab: the column and the row of its picture, then how many there are across and down"""
    MOVED = 33
    """how far its picture is moved to the right and down, in pictures"""


class Kind(StrEnum):
    """What a lamp is."""

    DIRECTIONAL = "directional"
    POINT = "point"
    SPOT = "spot"
    AREA = "area"
    PROJECTOR = "projector"
    SLAB = "slab"


TURNED = (Kind.AREA, Kind.PROJECTOR, Kind.SLAB)
"""Lamps that have an upper side, and shine to one side only."""
WIDE = (Kind.AREA, Kind.SLAB)
"""Lamps that are made up of discs."""


class Lamp(OperationParameters):
    kind: Kind = Kind.DIRECTIONAL
    """directional, point, spot, area, projector or slab"""
    position: Vector = (0.0, 0.0, 0.0)
    """where it is; no part in directional light"""
    direction: Vector = (0.0, 0.0, -1.0)
    """the way it shines, of any length; no part in a point"""
    up: Vector = (0.0, 1.0, 0.0)
    """what is upwards for an area, a projector or a slab"""
    colour: Colour = (1.0, 1.0, 1.0)
    """linear"""
    intensity: float = Field(1.0, ge=0, le=1e9)
    """factor on the colour"""
    radius: float = Field(0.05, ge=1e-6, le=1e6)
    """half of the lamp's extent, within which its falloff ends"""
    nearest: float = Field(0.0, ge=0, le=FARTHEST)
    """distances below count as this: where nothing is nearer it changes no light, but what may be said of errors"""
    falloff: tuple[Share, Share, Share] = (0.0, 0.0, 1.0)
    """constant, linear and quadratic part of what the distance divides by"""
    inner: Degrees = Field(30.0, ge=0, le=179)
    """angle from the axis up to which a spot shines wholly"""
    outer: Degrees = Field(45.0, ge=1, le=180)
    """angle from the axis at which it ends; a degree more than inner at least"""
    size: tuple[Annotated[float, Field(ge=1e-6, le=1e6)], Annotated[float, Field(ge=1e-6, le=1e6)]] = (1.0, 1.0)
    """width and height of an area or a slab"""
    samples: int = Field(16, ge=1, le=1024)
    """discs that make up an area, at least"""
    fov: Degrees = Field(45.0, ge=1, le=170)
    """height of a projector's picture, or of a slab's pictures"""
    aspect: float = Field(1.0, ge=0.01, le=100)
    """width of a projector's picture by its height"""
    cells: tuple[Annotated[int, Field(ge=1, le=64)], Annotated[int, Field(ge=1, le=64)]] = (8, 8)
    """of a slab: pictures across and down its sheet"""
    lit: tuple[Annotated[int, Field(ge=1, le=64)], Annotated[int, Field(ge=1, le=64)]] | None = None
    """of a slab: so many of its cells shine for all of them, evenly chosen; none: each for itself"""
    distance: float | None = Field(None, ge=1e-3, le=1e6)
    """of a slab: how far away lies what its pictures show; none: infinitely far"""

    @field_validator("direction")
    @classmethod
    def _directed(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(value):
            raise ValueError("has no length")
        return value

    @field_validator("falloff")
    @classmethod
    def _finite(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if sum(value) < 1e-6:
            raise ValueError("needs a part of 1e-6 or more")
        return value

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.kind is Kind.SPOT and self.outer < self.inner + 1:
            raise ValueError(f"outer must be a degree more than inner ({self.inner:g})")
        if self.kind in TURNED:
            along, up = (unit_vector(each) for each in (self.direction, self.up))
            if np.linalg.norm(np.cross(along, up)) < 1e-3:
                raise ValueError("up must not point along direction")
        return self

    @property
    def grid(self) -> tuple[int, int]:
        """Discs across and down: of an area as near to square as can be, of a slab the cells that shine."""
        if self.kind is Kind.SLAB:
            across, down = self.lit or self.cells
            return min(across, self.cells[0]), min(down, self.cells[1])
        if self.kind is not Kind.AREA:
            return 1, 1
        across = max(1, round(math.sqrt(self.samples * self.size[0] / self.size[1])))
        across = min(across, self.samples)
        return across, -(-self.samples // across)

    def sparse(self, share: float) -> Lamp:
        """With that share of its discs, one at least."""
        if self.kind is Kind.AREA:
            return self.model_copy(update={"samples": max(1, round(self.samples * share))})
        if self.kind is not Kind.SLAB:
            return self
        across, down = (max(1, round(count * math.sqrt(share))) for count in self.grid)
        return self.model_copy(update={"lit": (across, down)})

    @property
    def brightest(self) -> float:
        """The largest radiance that it gives a white diffuse surface, for a slide of values up to 1."""
        most = max(self.colour) * self.intensity
        if self.kind is Kind.DIRECTIONAL:
            return most
        a, b, c = self.falloff
        radius = math.hypot(self.reach, self.nearest)
        return most / (a + b * radius + c * radius * radius)

    @property
    def reach(self) -> float:
        """The radius of a lamp, or of each disc of an area."""
        if self.kind not in WIDE:
            return self.radius
        across, down = self.grid
        return math.sqrt(self.size[0] * self.size[1] / (math.pi * across * down))

    def rows(self, number: int) -> Doubles:
        """One row for each disc; `number` is the lamp's place in the list."""
        along = unit_vector(self.direction)
        across, down = self.grid
        row = np.zeros(ROW)
        row[Row.LAMP] = number
        row[Row.COLOUR : Row.COLOUR + 3] = np.array(self.colour) * self.intensity / (across * down)
        row[Row.AXIS : Row.AXIS + 3] = along
        if self.kind is Kind.DIRECTIONAL:
            row[Row.PLACE : Row.PLACE + 3] = -along
            return row[None]
        row[Row.TYPE] = POSITIONAL
        row[Row.RADIUS] = self.reach**2
        row[Row.NEAREST] = self.nearest**2
        row[Row.FALLOFF : Row.FALLOFF + 3] = self.falloff
        if self.kind is Kind.SPOT:
            inner, outer = (2 * math.sin(math.radians(each) / 2) ** 2 for each in (self.inner, self.outer))
            row[Row.CONE : Row.CONE + 2] = outer, 1 / (outer - inner)
        right = unit_vector(np.cross(along, self.up)) if self.kind in TURNED else np.zeros(3)
        upwards = np.cross(right, along)
        half = 2 * math.tan(math.radians(self.fov) / 2)
        if self.kind in (Kind.PROJECTOR, Kind.SLAB):
            row[Row.SLIDE] = 1 + (self.kind is Kind.SLAB)
            row[Row.ACROSS : Row.ACROSS + 3] = right / (half * self.aspect)
            row[Row.DOWN : Row.DOWN + 3] = -upwards / half
        row[Row.EMITTER] = self.kind in WIDE
        made = []
        for v in range(down):
            for u in range(across):
                (i, j), of = (u, v), (across, down)
                if self.kind is Kind.SLAB:
                    of = self.cells
                    i, j = int((u + 0.5) / across * of[0]), int((v + 0.5) / down * of[1])
                    row[Row.CELL : Row.CELL + 4] = i, j, *of
                x, y = ((i + 0.5) / of[0] - 0.5) * self.size[0], (0.5 - (j + 0.5) / of[1]) * self.size[1]
                if self.kind is Kind.SLAB and self.distance is not None:
                    away = self.distance * half
                    row[Row.MOVED : Row.MOVED + 2] = x / (away * self.aspect), -y / away
                place = np.array(self.position) + x * right + y * upwards
                near = place.astype(np.float32).astype(np.float64)
                row[Row.PLACE : Row.PLACE + 3], row[Row.REST : Row.REST + 3] = near, place - near
                made.append(row.copy())
        return np.array(made)


def unit_vector(vector: npt.ArrayLike) -> Doubles:
    """Of the same direction and length 1; of no length where that has none."""
    given = np.asarray(vector, np.float64)
    largest = np.abs(given).max()
    if largest == 0:
        return given
    near = given / largest
    made: Doubles = near / np.linalg.norm(near)
    return made
