"""Which effects of a scene can be seen at all: reasons to leave them out, each with a proof that nothing changes.

* A light of no intensity or a black colour adds nothing.
* A spot adds nothing where no object enters its cone. Objects are taken as the balls around them; planes have no end,
  so they enter every cone that is not turned away from them: one whose every ray runs from the plane.
* One object that is convex (a sphere, a plane, a box) hides none of itself that faces the light; what faces away is
  dark by its cosine already. So a shadow needs a second object, or one that is not convex.
* No surface is nearer to a light than the nearest object: errors need not count with a light on a surface.
* Fog of density 0 hides nothing; roughness that is the same everywhere is a number, no buffer; no share shines through
  fog where no object is given one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lichen.memory import Array
from lichen.operations.lighting.lamps import WIDE, Kind
from lichen.operations.scene.casting import ball_around
from lichen.operations.scene.objects import Blob, Box, Object, Plane, Sphere, Terrain
from lichen.scene.description import Light

Ball = tuple[Array, float]


def ball(each: Object) -> Ball | None:
    """Centre and radius of a ball around an object; None for one without an end."""
    match each:
        case Sphere():
            return np.array(each.centre), each.radius
        case Box():
            return np.array(each.centre), math.sqrt(sum(side * side for side in each.size)) / 2
        case Blob():
            *centre, radius = ball_around(each)
            return np.array(centre), radius
        case Terrain():
            low, high = min(map(min, each.heights)), max(map(max, each.heights))
            half = np.array([each.size[0], high - low, each.size[1]]) / 2
            return np.array(each.corner) + half + [0, low, 0], float(np.linalg.norm(half))
    return None


def around(objects: Sequence[Object]) -> Ball | None:
    """A ball around all objects that have an end; None where none has."""
    balls = [found for each in objects if (found := ball(each)) is not None]
    if not balls:
        return None
    low = np.min([centre - radius for centre, radius in balls], axis=0)
    high = np.max([centre + radius for centre, radius in balls], axis=0)
    centre = (low + high) / 2
    return centre, max(float(np.linalg.norm(each - centre)) + radius for each, radius in balls)


def dark(light: Light) -> str | None:
    """Why a light adds nothing, wherever it is."""
    return "it gives no light" if light.intensity == 0 or not any(light.colour) else None


def misses(light: Light, objects: Sequence[Object]) -> str | None:
    """Why a light adds nothing to these objects."""
    if not objects:
        return "there is nothing to be lit"
    if light.kind is not Kind.SPOT:
        return None
    if any(_enters(light, each) for each in objects):
        return None
    return "nothing lies in its cone"


def _enters(light: Light, each: Object) -> bool:
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    outer = math.radians(light.outer)
    if isinstance(each, Plane):
        normal = np.array(each.normal) / np.linalg.norm(each.normal)
        above = float(np.dot(np.array(light.position) - each.point, normal))
        # The ray of the cone that turns most against the side on which the light is.
        steepest = math.acos(min(max(float(np.dot(axis, normal)) * math.copysign(1.0, above), -1.0), 1.0)) + outer
        return above == 0 or steepest > math.pi / 2 - 1e-9
    found = ball(each)
    assert found is not None, "only planes have no ball"
    to = found[0] - np.array(light.position)
    distance = float(np.linalg.norm(to))
    if distance <= found[1]:
        return True
    off = math.atan2(float(np.linalg.norm(np.cross(axis, to))), float(np.dot(axis, to)))
    return off - math.asin(found[1] / distance) <= outer + 1e-9


def unshadowed(objects: Sequence[Object]) -> str | None:
    """Why no object hides a light from another, nor from itself."""
    if len(objects) == 1 and not isinstance(objects[0], Blob | Terrain):
        return "one convex object hides nothing of itself that faces the light"
    return None


def same_roughness(objects: Sequence[Object]) -> float | None:
    """The roughness that all objects have, or None."""
    found = {each.roughness for each in objects}
    return found.pop() if len(found) == 1 else None


def clearance(light: Light, objects: Sequence[Object]) -> float:
    """A distance from a light at a place that no surface is nearer than; 0 where nothing is known."""
    if light.kind is Kind.DIRECTIONAL or not objects:
        return 0.0
    place = np.array(light.position)
    size = math.hypot(*light.size) / 2 if light.kind in WIDE else 0.0
    near = min(_apart(place, each) for each in objects)
    return max(near * (1 - 1e-4) - size, 0.0)


def _apart(place: Array, each: Object) -> float:
    """The distance of a place from an object's surface, or less."""
    match each:
        case Sphere():
            return abs(float(np.linalg.norm(place - each.centre)) - each.radius)
        case Plane():
            return abs(float(np.dot(place - each.point, each.normal))) / float(np.linalg.norm(each.normal))
        case Box():
            turn = math.radians(each.turn)
            x, y, z = place - each.centre
            within = np.array([x * math.cos(turn) - z * math.sin(turn), y, x * math.sin(turn) + z * math.cos(turn)])
            off = np.abs(within) - np.array(each.size) / 2
            return float(np.linalg.norm(np.maximum(off, 0))) or float(-off.max())
    found = ball(each)
    assert found is not None, "only planes have no ball"
    return max(float(np.linalg.norm(place - found[0])) - found[1], 0.0)
