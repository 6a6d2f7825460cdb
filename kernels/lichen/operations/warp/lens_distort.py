"""Lens distortion: puts the bend of a lens into an image, or takes it out.

Truth: lengths are counted in focal lengths from the centre of distortion. `direction=undistort` makes of an image taken
through the lens the one a pinhole would have taken: the result at u shows the source at d(u). `direction=distort` does
the reverse: the result at d shows the source at u(d). Both are resampled as all warps are (see
`lichen.operations.warp.reference`); the formulas of `model`, where a lens ends, and how they are inverted stand in
`lichen.operations.warp.lenses`.

What the lens does not show, and places for which the search for an inverse did not end, are background; the findings
count both. `focal` is half the diagonal of the image if it is left out, so that the corners lie at radius 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import HardCase, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.lenses import Lens, Model
from lichen.operations.warp.maps import Doubles, Map, Recipe
from lichen.operations.warp.resampling import Warp, WarpParameters, declare, own_size
from lichen.part import place_of


class Direction(StrEnum):
    """Which way."""

    DISTORT = "distort"
    """a pinhole's image becomes the lens's"""
    UNDISTORT = "undistort"
    """the lens's image becomes a pinhole's"""


ROWS = 64
"""Rows whose background is counted at once."""
Coefficient = Annotated[float, Field(ge=-100, le=100)]


class Parameters(WarpParameters):
    model: Model = Field(Model.BROWN_CONRADY, description="the formula")
    direction: Direction = Field(Direction.UNDISTORT, description="whether the bend is taken out or put in")
    k: Annotated[tuple[Coefficient, ...], Field(max_length=4)] = Field(
        (-0.1,), description="radial coefficients, of even powers from the square up"
    )
    p: tuple[Coefficient, Coefficient] = Field((0.0, 0.0), description="tangential coefficients of brown_conrady")
    focal: float | None = Field(
        None,
        ge=1e-3,
        le=1e6,
        description="focal length; half the diagonal if left out",
        json_schema_extra={"unit": "px"},
    )
    centre: tuple[float, float] = Field((0.5, 0.5), description="of the distortion; shares of width and height")

    @property
    def lens(self) -> Lens:
        return Lens(self.model, self.k, self.p if self.model is Model.BROWN_CONRADY else (0.0, 0.0))


class Bent(Map):
    def __init__(self, p: Parameters, source: tuple[int, int], target: tuple[int, int]) -> None:
        self.p, self.source, self.target = p, source, target
        self.focal = p.focal or math.hypot(*source) / 2

    def recipe(self) -> Recipe:
        p = self.p
        (cx, cy), (width, height), (wide, tall) = p.centre, self.target, self.source
        farthest = math.hypot(max(cx, 1 - cx) * width + 1, max(cy, 1 - cy) * height + 1) / self.focal
        distorts = p.direction is Direction.UNDISTORT
        start = (list(Model).index(p.model), distorts, self.focal, cx * width, cy * height, cx * wide, cy * tall)
        return Recipe("warp/lens_distort.cl", [*start, *p.lens.p, *p.lens.numbers(farthest)])

    def counted(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        """Places of the result in focal lengths from the centre of distortion."""
        x, y = (u - self.p.centre[0] * self.target[0]), (v - self.p.centre[1] * self.target[1])
        return x / self.focal, y / self.focal

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        p, lens = self.p, self.p.lens
        x, y = np.broadcast_arrays(*self.counted(u, v))
        x, y = lens.distort(x, y) if p.direction is Direction.UNDISTORT else lens.undistort(x, y)
        return p.centre[0] * self.source[0] + self.focal * x, p.centre[1] * self.source[1] + self.focal * y


def _map(p: Parameters, inputs: Inputs) -> Bent:
    image = inputs["image"]
    return Bent(p, (image.width, image.height), WARP.extent_of(inputs, p))


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    straight = not any(p.k) and not any(p.lens.p) and p.model is not Model.KANNALA_BRANDT
    same = own_size(p, facts) == (image.width, image.height)
    return "every coefficient is 0" if straight and same else None


WARP = Warp[Parameters](_map)

lens_distort = declare(
    WARP,
    name="lens_distort",
    summary="Takes the distortion of a lens out of an image, or puts it in.",
    description=__doc__ or "",
    parameters=Parameters,
    identity=_identity,
    examples=(
        {"k": [-0.25, 0.06], "p": [0.004, -0.003], "border": "clamp"},
        {"k": [-0.18, 0.03], "p": [0.002, 0.001], "direction": "distort"},
        {"model": "kannala_brandt", "k": [0.05, -0.01], "direction": "distort", "focal": 20},
        {"model": "division", "k": [-0.2], "border": "reflect"},
    ),
    hard_cases=(
        HardCase(
            name="beyond the fold",
            why="a polynomial that turns back shows the middle again around the edge",
            inputs=cases.constant,
            parameters={"k": [-0.9], "focal": 10},
            holds=cases.constant_or_background,
        ),
        HardCase(
            name="inverse where fixed-point steps run away",
            why="five steps of x = d / (1 + k r^2) end hundreds of pixels off, in silence",
            inputs=cases.constant,
            parameters={"k": [-0.3, 0.9, -0.2], "direction": "distort", "p": [0.02, -0.01], "border": "clamp"},
            holds=cases.constant_or_background,
        ),
        HardCase(
            name="pinhole of a fisheye",
            why="what lies beside the camera has no place in a plane",
            inputs=cases.constant,
            parameters={"model": "kannala_brandt", "k": [], "direction": "distort", "focal": 8, "border": "wrap"},
            holds=cases.constant_or_background,
        ),
    ),
)


@lens_distort.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """How many pixels of the result have no place in the source, and where the lens ends, in focal lengths; the `part`
    of the result that was made, where that is not all."""
    map_, (height, width), lens, place = _map(p, inputs), pixels.shape[:2], p.lens, place_of(p)
    left, top = place.result[:2] if place else (0, 0)
    u, background = left + np.arange(width) + 0.5, 0
    for first in range(0, height, ROWS):
        v = top + np.arange(first, min(first + ROWS, height))[:, np.newaxis] + 0.5
        if lens.p == (0, 0):  # a radius tells, without the search for its place; and the ends of rows have the largest
            if _answer(lens, map_.counted(u[[0, -1]], v), p).all():
                continue
            shown = _answer(lens, map_.counted(u, v), p)
        else:
            shown = np.isfinite(map_.at(u, v)[0])
        background += int(np.count_nonzero(~shown))
    found = {"background": background, "end_of_lens": lens.radial.end}
    return found if place is None else {**found, "part": list(place.result)}


def _answer(lens: Lens, places: tuple[Doubles, Doubles], p: Parameters) -> Doubles:
    """Whether these places of the result, counted in focal lengths, have one in the source."""
    return lens.answers(np.hypot(*places), distorts=p.direction is Direction.UNDISTORT)
