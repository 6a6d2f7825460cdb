"""Parameters, predictions and hard cases that operations on horizons share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import ROUNDING, Border, Footprint, InputFacts, Knob, OperationParameters, Pixels
from lichen.operations.relief.horizons import Ring


class Source(StrEnum):
    """What the input holds."""

    HEIGHT = "height"
    """heights above a plane that faces the viewer"""
    DEPTH = "depth"
    """distances along the viewing direction, as a camera has them"""


class RingParameters(OperationParameters):
    source: Source = Source.HEIGHT
    """height: towards the viewer; depth: away from it, in perspective"""
    scale: Pixels = Field(8.0, ge=0, le=1e6)
    """of heights: how high the value 1 is"""
    pixel_size: float = Field(0.002, ge=1e-6, le=1)
    """of depths: how large a pixel is at depth 1: 2 tan(fov / 2) over the picture's height"""
    radius: Pixels = Field(12.0, ge=1, le=256)
    """how far around itself a pixel looks"""
    directions: int = Field(8, ge=4, le=64)
    """evenly around, the first to the right, then counterclockwise"""
    border: Border = Border.CLAMP
    """how the input continues beyond its edges"""
    value: float = Field(0.0, ge=-1e6, le=1e6)
    """what lies beyond a constant border"""

    def ring(self, spacing: float) -> Ring:
        depth = self.source is Source.DEPTH
        scale = 1 / self.pixel_size if depth else self.scale
        return Ring(self.directions, self.radius, spacing, scale, depth, self.border, self.value)


SPACING = Knob("spacing", (6.0, 3.0, 2.0, 1.0), "pixels between the places that a direction looks at", 1.0, 16.0)


def footprint(p: RingParameters, facts: InputFacts) -> Footprint:
    """All heights that its rings reach."""
    reach = p.ring(1.0).reach
    return Footprint(reach, reach, wraps=p.border is Border.WRAP)


def slope_rounding(p: RingParameters, facts: InputFacts) -> float:
    """Of a slope that is not below the ground: differences of heights, or of depths relative to the nearer."""
    if p.source is Source.DEPTH:
        return 6 * ROUNDING / p.pixel_size
    return 6 * ROUNDING * p.scale * max(facts["height"].extent.magnitude, abs(p.value))


def looked_at(p: RingParameters, spacing: float, facts: InputFacts) -> float:
    """Work: pixels times places, and each direction's own."""
    places = max(1.0, p.radius / spacing)
    return facts["height"].pixels * p.directions * (places + 4)


# ------------------------------------------------------------------------------------------------------- hard cases


def step() -> Mapping[str, Any]:
    """A cliff of height 1 between columns 7 and 8."""
    heights = np.zeros((15, 16, 1), np.float32)
    heights[:, 8:] = 1
    return {"height": heights}


def spoilt() -> Mapping[str, Any]:
    heights = np.ones((15, 16, 1), np.float32)
    heights[7, 8] = np.nan
    return {"height": heights}


def nan_in_reach(radius: int) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        y, x = np.mgrid[0:15, 0:16]
        nan = np.asarray(np.isnan(pixels).any(axis=2))
        if not nan[7, 8]:
            return "NaN became a number"
        far = np.maximum(abs(y - 7), abs(x - 8)) > radius
        return "NaN went too far" if nan[far].any() else None

    return holds


def nothing() -> Mapping[str, Any]:
    """Depths of a wall with holes in it that go on for ever."""
    depths = np.full((15, 16, 1), 5, np.float32)
    depths[3:6, 4:9] = np.inf
    depths[9, 9] = 0
    depths[10, 3] = -2
    return {"height": depths}


def all_are(value: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        apart = float(np.abs(pixels - value).max())
        return None if apart <= 1e-6 else f"off by {apart:g}"

    return holds


def column_is(column: int, value: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        found = float(pixels[7, column, 0])
        return None if math.isclose(found, value, abs_tol=1e-5) else f"{found} in place of {value}"

    return holds
