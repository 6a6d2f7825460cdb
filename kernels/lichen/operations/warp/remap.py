"""Remap: every pixel of the result says where in the source it looks.

Truth: the first two channels of `map` are source coordinates, resampled as all warps are (see
`lichen.operations.warp.reference`), one for each pixel of the result, which has the map's size. With `units=pixels`
they are x and y in pixels, the centre of the first sample at (0.5, 0.5); with `units=unit` they are s and t in [0, 1]
over the image, as ST and UV maps hold them. `origin=bottom` measures y and t upwards from the lower edge. Coordinates
that are NaN or infinite are background. A third channel, where there is one, is no part of the map.

The footprint of a pixel is taken between its neighbours in the map: from the middle towards the one before to the
middle towards the one after, the values of the map being joined by straight lines.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.image import Image
from lichen.memory import Array
from lichen.operation import HardCase, Input, InputFacts, Inputs
from lichen.operations.warp import cases
from lichen.operations.warp.grids import Coordinate, Sampled
from lichen.operations.warp.prediction import Size
from lichen.operations.warp.resampling import Resampled, Warp, declare


class Units(StrEnum):
    """What the numbers of the map are."""

    PIXELS = "pixels"
    UNIT = "unit"
    """shares of the image's width and height"""


class Origin(StrEnum):
    """From where the second coordinate is measured."""

    TOP = "top"
    BOTTOM = "bottom"


class Parameters(Resampled):
    units: Units = Field(Units.PIXELS, description="pixels, or shares of width and height")
    origin: Origin = Field(Origin.TOP, description="from where y is measured")


def _map(p: Parameters, inputs: Inputs) -> Sampled:
    image = inputs["image"]
    wide, tall = (image.width, image.height) if p.units is Units.UNIT else (1, 1)
    y = Coordinate(-tall, added=image.height) if p.origin is Origin.BOTTOM else Coordinate(tall)
    return Sampled(inputs["map"].pixels, Coordinate(wide), y)


def _size(p: Parameters, facts: InputFacts) -> Size:
    return facts["map"].width, facts["map"].height


def still() -> cases.Given:
    """A picture with a NaN, and the map that moves nothing."""
    picture = cases.noise_with_nan()["image"]
    y, x = np.mgrid[0 : picture.shape[0], 0 : picture.shape[1]] + 0.5
    return {"image": picture, "map": np.stack([x, y], axis=-1).astype(np.float32)}


def _nowhere() -> cases.Given:
    given = np.full((5, 6, 2), np.nan, np.float32)
    given[1] = np.inf
    given[2, :, 0] = 3e38
    return {"image": np.full((9, 9, 1), 0.7, np.float32), "map": given}


def _background(inputs: cases.Given, pixels: Array) -> str | None:
    return None if not pixels.any() else "what has no place shows something"


remap = declare(
    Warp[Parameters](_map, _size),
    name="remap",
    summary="Fetches every pixel from where a map says: ST and UV maps, look-up of positions.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "what is fetched from"),
        Input("map", "x and y for every pixel of the result; further channels are not read", (2, 4), picture=False),
    ),
    examples=({"border": "wrap"}, {"units": "unit", "origin": "bottom", "value": 0.2}),
    hard_cases=(
        HardCase(
            name="nothing moves",
            why="whole pixels must come back bit for bit, and NaN stay where it is",
            inputs=still,
            parameters={},
            holds=cases.unmoved,
            methods=("nearest", "bilinear", "bicubic", "lanczos2", "lanczos3", "mip", "supersampled", "ewa"),
        ),
        HardCase(
            name="no place",
            why="NaN converted to an integer is a pixel somewhere",
            inputs=_nowhere,
            parameters={},
            holds=_background,
        ),
    ),
)


def identity_map(image: Image) -> Array:
    """The map that moves nothing, float32 (height, width, 2)."""
    y, x = np.mgrid[0 : image.height, 0 : image.width] + 0.5
    return np.stack([x, y], axis=-1).astype(np.float32)
