"""How a light looks at a scene to make its map of depths.

A directional light looks along its direction without perspective, from before the ball around all objects that have an
end, as wide as the ball. A light at a place looks at the middle of that ball, as wide as the ball appears; a spot along
its axis where its cone is the narrower. One map reaches 150 degrees: from among the objects a light sees only that
much, and what it does not see is lit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operations.lighting.lamps import WIDE, Kind, Row
from lichen.scene.description import Light
from lichen.scene.predicates import Ball

WIDEST = 150.0
"""Degrees."""
MOST_POINTS = 16
MARGIN = 1.05
"""Of the ball's size, so that filters end inside the map."""


@dataclass(frozen=True, slots=True)
class Sight:
    """A light as a camera."""

    eye: tuple[float, ...]
    target: tuple[float, ...]
    up: tuple[float, ...]
    fov: float = 90.0
    extent: float | None = None
    whole: bool = True
    """whether all objects are in its map"""

    def camera(self) -> dict[str, Any]:
        """Parameters of gbuffer."""
        return {"eye": self.eye, "target": self.target, "up": self.up, "fov": self.fov, "extent": self.extent}

    def shadow(self) -> dict[str, Any]:
        """Parameters of shadow."""
        return {f"light_{key}": value for key, value in self.camera().items()}


def sight(light: Light, ball: Ball) -> Sight:
    """How a light sees the objects in a ball."""
    centre, radius = ball
    if light.kind is Kind.DIRECTIONAL:
        along = _unit(np.array(light.direction))
        eye = centre - along * (2 * radius)
        return Sight(_told(eye), _told(centre), _upright(along), extent=2 * radius * MARGIN)
    eye = np.array(light.position)
    to = centre - eye
    distance = float(np.linalg.norm(to))
    inside = distance <= radius * 1.001
    half = WIDEST / 2 if inside else math.degrees(math.asin(radius / distance))
    fov = min(2 * half * MARGIN + 0.5, WIDEST)
    if light.kind in (Kind.SPOT, Kind.PROJECTOR) or distance == 0:
        cone = 2 * light.outer if light.kind is Kind.SPOT else light.fov * max(1.0, light.aspect) * 1.2
        if (inside or cone < fov) and light.kind is not Kind.POINT:
            to, fov, half = np.array(light.direction), min(cone + 0.5, WIDEST), min(cone, WIDEST) / 2
            inside = cone > WIDEST
        elif distance == 0:
            to = np.array([0.0, -1.0, 0.0])
    along = _unit(to)
    return Sight(_told(eye), _told(eye + along), _upright(along), fov, whole=not inside)


def apart(light: Light) -> list[Light]:
    """The points of a light with extent that each cast a shadow; the light itself where it is one point."""
    shadow = light.shadow
    if shadow is None or shadow.points == 1 or light.kind not in WIDE:
        return [light]
    spread = light.model_copy(update={"kind": Kind.AREA, "samples": shadow.points})
    if math.prod(spread.grid) > MOST_POINTS:
        spread = spread.model_copy(update={"samples": MOST_POINTS // 2})
    places = spread.rows(0)[:, Row.PLACE : Row.PLACE + 3] + spread.rows(0)[:, Row.REST : Row.REST + 3]
    return [light.model_copy(update={"position": _told(place)}) for place in places]


def given_map(light: Light) -> Sight:
    """How the map that was sent along sees the scene."""
    shadow = light.shadow
    assert shadow is not None
    assert shadow.target is not None
    if light.kind is Kind.DIRECTIONAL:
        eye = np.array(light.position)
        return Sight(_told(eye), shadow.target, shadow.up, extent=shadow.extent or 10.0)
    return Sight(_told(np.array(light.position)), shadow.target, shadow.up, shadow.fov)


def _told(v: Array) -> tuple[float, ...]:
    return tuple(map(float, v))


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))


def _upright(along: Array) -> tuple[float, ...]:
    """The axis of the world that a direction is least along."""
    made = np.zeros(3)
    made[int(np.argmin(np.abs(along)))] = 1.0
    return _told(made)


def filtering(light: Light, *, prune: bool) -> tuple[Mapping[str, Any], str | None]:
    """Parameters of shadow, and why they are simpler than what was asked for."""
    shadow = light.shadow
    assert shadow is not None
    if prune and shadow.kind == "pcss" and shadow.source == 0:
        return {"kind": "pcf", "filter": 1.0}, "the light is a point: its penumbra has no width but a texel's"
    return {"kind": shadow.kind, "filter": shadow.filter, "source": shadow.source}, None
