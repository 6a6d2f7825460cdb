"""Polar and log-polar: circles become rows, rays become columns, and back.

Truth, for `direction=forward`: column u of the result is the angle 360 u / width degrees, from the positive x axis
clockwise as it is seen (y is down) plus `start`; row v is the radius, linear from `inner` at the upper edge to `outer`
at the lower, or with `log` inner (outer / inner)^(v / height). The result shows the source there, resampled as all
warps are (see `lichen.operations.warp.reference`). `direction=inverse` takes such an image back: the place of a pixel
is its angle and its radius about the centre, columns go around without a seam whatever the border, and what lies within
`inner` or beyond `outer` is background.

`centre` is in shares of the picture's width and height. `outer` is the radius to the farthest corner if it is left out,
`inner` 0, or with `log` 1 px.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.operation import Degrees, HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.maps import Doubles, Map, Rays, Recipe
from lichen.operations.warp.prediction import Size
from lichen.operations.warp.reference import Closed
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size

APART = 1e-6
"""px; what radii differ by at least, so that no row is wider than a double can tell."""


class Direction(StrEnum):
    """Which way."""

    FORWARD = "forward"
    """a picture becomes angle and radius"""
    INVERSE = "inverse"
    """angle and radius become a picture"""


class Parameters(WarpParameters):
    direction: Direction = Field(Direction.FORWARD, description="to polar coordinates, or back from them")
    log: bool = Field(False, description="whether rows are even in the logarithm of the radius")
    centre: tuple[float, float] = Field((0.5, 0.5), description="shares of the picture's width and height")
    inner: float | None = Field(
        None, ge=0, le=1e6, description="radius of the upper edge, px", json_schema_extra={"unit": "px"}
    )
    outer: float | None = Field(
        None, gt=0, le=1e6, description="radius of the lower edge, px", json_schema_extra={"unit": "px"}
    )
    start: Degrees = Field(0.0, ge=-1e5, le=1e5, description="angle of the left edge")


def _radii(p: Parameters, picture: Size) -> tuple[float, float]:
    width, height = picture
    corner = math.hypot(max(p.centre[0], 1 - p.centre[0]) * width, max(p.centre[1], 1 - p.centre[1]) * height)
    inner = p.inner if p.inner is not None else (min(1.0, corner / 2) if p.log else 0.0)
    return inner, p.outer if p.outer is not None else corner


class Polar(Map):
    """Columns are angles and rows are radii; the picture has the size (width, height)."""

    def __init__(self, p: Parameters, picture: Size, chart: Size) -> None:
        self.p, self.picture, self.chart = p, picture, chart
        self.inner, self.outer = _radii(p, picture)
        self.middle = p.centre[0] * picture[0], p.centre[1] * picture[1]

    def recipe(self) -> Recipe:
        forward, logarithm = isinstance(self, Forward), math.log(self.outer / self.inner) if self.p.log else 0.0
        ends = self.inner, self.outer, self.p.start / 360, logarithm
        return Recipe("warp/polar.cl", (forward, *self.middle, *self.chart, *ends))


class Forward(Polar):
    def rays(self, u: Doubles, v: Doubles) -> Rays:
        angle = math.radians(self.p.start) + 2 * math.pi * u / self.chart[0]
        share = v / self.chart[1]
        if self.p.log:
            r = self.inner * (self.outer / self.inner) ** share
        else:
            r = self.inner + (self.outer - self.inner) * share
        return Rays(self.middle, np.cos(angle), np.sin(angle), r)

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        (x, y), cosine, sine, r = self.rays(u, v)
        return x + r * cosine, y + r * sine


class Inverse(Polar):
    def __init__(self, p: Parameters, picture: Size, chart: Size) -> None:
        super().__init__(p, picture, chart)
        self.periods = float(chart[0]), math.inf

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        dx, dy = u - self.middle[0], v - self.middle[1]
        r = np.hypot(dx, dy)
        turn = (np.arctan2(dy, dx) / (2 * math.pi) - self.p.start / 360) % 1.0
        inside = (r >= self.inner) & (r <= self.outer)
        if self.p.log:
            some = np.where(inside & (r > 0), r, self.inner)
            share = np.log(some / self.inner) / math.log(self.outer / self.inner)
        else:
            share = (r - self.inner) / (self.outer - self.inner)
        x, y = np.broadcast_arrays(self.chart[0] * turn, self.chart[1] * share)
        return np.where(inside, x, np.nan), np.where(inside, y, np.nan)


def _map(p: Parameters, inputs: Inputs) -> Map:
    image = inputs["image"]
    own, made = (image.width, image.height), WARP.extent_of(inputs, p)
    return Forward(p, own, made) if p.direction is Direction.FORWARD else Inverse(p, made, own)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    picture = (image.width, image.height) if p.direction is Direction.FORWARD else own_size(p, facts)
    inner, outer = _radii(p, picture)
    if p.log and inner < APART:
        return [Flaw("/parameters/inner", f"must be {APART:g} or more where rows are even in its logarithm")]
    if inner > outer * (1 - 1e-9) - APART:
        return [Flaw("/parameters/inner", f"must be {APART:g} or more below outer, which is {outer:g}")]
    return []


def _closed(p: Parameters) -> Closed | None:
    return Closed.RING if p.direction is Direction.INVERSE else None


WARP = Warp[Parameters](_map, closed=_closed)

polar = declare(
    WARP,
    name="polar",
    summary="Turns circles into rows and rays into columns, linear or logarithmic, and back.",
    description=__doc__ or "",
    parameters=Parameters,
    check=_check,
    examples=(
        {},
        {"direction": "inverse", "log": True, "start": 30.0, "inner": 2.0, "outer": 20.0},
        {"log": True, "centre": [0.3, 0.6], "border": "clamp"},
    ),
    hard_cases=(
        HardCase(
            name="the pole",
            why="all of the first row is one point, and its logarithm is none",
            inputs=cases.constant,
            parameters={"direction": "inverse"},
            holds=cases.stays_constant,
        ),
        HardCase(
            name="the seam",
            why="the last column and the first are neighbours; footprints across would be an image wide",
            inputs=lambda: {"image": np.full((8, 64, 1), 0.7, np.float32)},
            parameters={"direction": "inverse", "width": 33, "height": 33},
            holds=cases.stays_constant,
        ),
    ),
)
