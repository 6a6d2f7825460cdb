"""Which lamps give something where: the lists of tiles that what shades reads, and whether they are worth their time.

Lists come from the operation `tiles`, by the real positions and normals of a picture. Lamps come in the order of the
scene, first those without shadows, so that the lamps of each node that lights are neighbours.

What is left out is nothing at all, or, where the caller allows an error, no more than a small part of it: stored light
grows by up to 13 on its way to display values, and by less than 2.5 between primaries.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lichen.image import Image, Storage
from lichen.memory import Array
from lichen.operations.fog.parameters import Kind as Fog
from lichen.operations.lighting import errors
from lichen.operations.lighting.lamps import Kind, Lamp
from lichen.operations.lighting.reflection import SMOOTHEST
from lichen.operations.scene.objects import Object
from lichen.operations.scene.tiles import bounds_of_points, share_left_out
from lichen.operations.shadow.parameters import Kind as Filtering
from lichen.scene.description import Light, Output, Scene
from lichen.scene.nodes import understood

PART = 1 / 32
"""Of the error that is asked for."""
WORTH = 24.0
"""Lists are made where lamps take so many times as long as a plain one."""
MAKING = 8.0
"""What making lists takes, in plain lamps, and as much again for what is not foreseen."""
MIRROR = 20.0
"""What an environment takes, in plain lamps."""
SAVED = 0.1
"""Of the pairs of a lamp and a tile, in some tiles or at some points that are looked at first; less does not pay."""
LOOKED_AT = 6, 8
"""Rows and columns of points of buffers that are sent along which are looked at first."""
THICK = 0.01
"""What comes through fog that may hide a lamp."""


def allowed(wishes: Mapping[str, Any]) -> float:
    """The light that may be left out of a pixel."""
    asked, storage = wishes.get("max_error"), wishes.get("storage")
    if asked is not None:
        return float(asked) * PART
    if storage is not None and Storage(storage).integer:
        return 0.25 / Storage(storage).levels * PART
    return 0.0


def worthwhile(scene: Scene, lamps: Sequence[Light], faint: float, images: Mapping[str, Image]) -> bool:
    """Whether lamps take long, and may give nothing in some places: by their cones, or for the fog. Where buffers are
    sent along a few of their points tell how many; otherwise the operation `tiles` finds out."""
    aimed = any(each.kind not in (Kind.DIRECTIONAL, Kind.POINT) for each in lamps)
    if not aimed and not _thick(scene, images):
        return False
    each = 1.0 if scene.surface.get("model", "lambert") == "lambert" else 3.0
    surroundings = 0.0 if scene.environment is None else MIRROR
    taken = surroundings + sum(each * math.prod(lamp.grid) + _shadowing(lamp) for lamp in lamps)
    if taken < WORTH:
        return False
    points = _points(scene, images)
    if points is None:
        return True
    p = understood("tiles", parameters(scene, lamps, faint, images), "/lights")
    return share_left_out(points, p) >= max(SAVED, MAKING / taken)


def _points(scene: Scene, images: Mapping[str, Image]) -> Array | None:
    """Bounds of some points of the surfaces, evenly spread; None where no pictures of them are sent along."""
    names = [scene.buffers.given.get(name) for name in ("position", "normal")]
    sent = [images.get(name) for name in names if name is not None]
    if len(sent) < 2 or any(each is None or each.channels != 3 for each in sent):
        return None
    some = []
    for each in sent:
        assert each is not None, "it was sent"
        rows, columns = (
            np.arange(count) * size // count + size // (2 * count)
            for count, size in zip(LOOKED_AT, (each.height, each.width), strict=True)
        )
        some.append(each.pixels[rows[:, None], columns].reshape(-1, 3))
    return bounds_of_points(*some)


def _thick(scene: Scene, images: Mapping[str, Image]) -> bool:
    """Whether the fog can hide what is farthest away."""
    said = _hiding(scene)
    if said is None:
        return False
    fog = understood("fog", said, "/fog")
    far = _farthest(scene, images)
    if fog.kind is Fog.LINEAR:
        return bool(far > fog.start + (1 - THICK) * (fog.end - fog.start))
    most = max(fog.densities) if fog.kind is Fog.LAYERED else 1.0
    deep = fog.density * most * far
    return fog.kind is Fog.HEIGHT or (deep * deep if fog.kind is Fog.SQUARED else deep) > -math.log(THICK)


def _farthest(scene: Scene, images: Mapping[str, Image]) -> float:
    """No point is farther from the eye, as far as pictures sent along tell."""
    given = scene.buffers.given
    if "position" in given and given["position"] in images:
        return 2 * (images[given["position"]].extent.magnitude + max(map(abs, scene.camera.eye)))
    if "depth" in given and given["depth"] in images and scene.camera.depth_kind in ("planar", "euclidean"):
        return images[given["depth"]].extent.magnitude / math.cos(math.radians(scene.camera.fov) / 2) ** 2
    return math.inf


def _shadowing(lamp: Light) -> float:
    """What its shadow takes, in plain lamps."""
    if lamp.shadow is None:
        return 0.0
    return (2 if lamp.shadow.kind is Filtering.PCSS else 1) * (lamp.shadow.filter + 1) ** 2


def parameters(scene: Scene, lamps: Sequence[Light], faint: float, images: Mapping[str, Image]) -> dict[str, Any]:
    """Of the operation `tiles`."""
    lights = [Lamp.model_validate(each.model_dump(exclude={"shadow", "slide"})) for each in lamps]
    made: dict[str, Any] = {"lights": lights, "faint": faint, "reflected": _reflected(scene, images)}
    made["worth"] = 0.0 if scene.output is Output.TILES or _points(scene, images) is not None else SAVED
    fog = _hiding(scene)
    if fog is not None:
        made["fog"] = fog
    return made | _surroundings(scene, images)


def _surroundings(scene: Scene, images: Mapping[str, Image]) -> dict[str, Any]:
    """What tiles are told of the environment."""
    if scene.environment is None:
        return {}
    said = {name: value for name, value in scene.environment.items() if name != "image"}
    p = understood("reflection", said, "/environment")
    image = images.get(str(scene.environment["image"]))
    known = image is not None and not image.extent.nonfinite and not p.coated
    return {
        "surroundings": "everywhere" if p.background == "environment" else "surfaces",
        "brightest": image.extent.magnitude if image is not None and known else None,
    }


def _hiding(scene: Scene) -> dict[str, Any] | None:
    """The fog, where nothing shines through it."""
    shines = "emissive" in scene.buffers.given or any(each.emissive for each in scene.objects)
    if scene.fog is None or shines:
        return None
    said: dict[str, Any] = {**scene.fog, "eye": scene.camera.eye}
    if scene.everything_given:
        said.setdefault("up", scene.camera.up)
    said["forward"] = [float(each) for each in np.subtract(scene.camera.target, scene.camera.eye)]
    return None if understood("fog", said, "/fog").clear else said


def _reflected(scene: Scene, images: Mapping[str, Image]) -> float | None:
    """The most that any surface sends of what a lamp of 1 gives; None where nothing is known."""
    surface = understood("lighting", {"model": "lambert", **scene.surface}, "/surface")
    albedo, specular = (_largest(scene, name, images) for name in ("albedo", "specular"))
    if albedo is None or specular is None:
        return None
    diffuse = 1.0 if "diffuse" not in scene.surface and _coloured(scene) else max(surface.diffuse)
    shiny = 0.0
    if surface.shines:
        material = surface.material()
        if not errors.bounded(material):
            return None
        roughest = min([each.roughness for each in scene.objects], default=SMOOTHEST)
        least = surface.facet_roughness if "facet_roughness" in scene.surface else roughest
        slope = min(max(least, SMOOTHEST), 1.0) ** 2
        shiny = max(surface.highlight) * specular * errors.peak(material, slope)
    shown = [images.get(each.slide) for each in scene.lights if each.slide is not None]
    if any(each is None or each.extent.nonfinite for each in shown):
        return None
    brightest = max([1.0, *(each.extent.magnitude for each in shown if each is not None)])
    return 1.001 * brightest * (diffuse * albedo + shiny)


def _coloured(scene: Scene) -> bool:
    return "albedo" in scene.buffers.given or not scene.everything_given


def _largest(scene: Scene, name: str, images: Mapping[str, Image]) -> float | None:
    """Of a colour that is a picture sent along or an object's; 1 where nothing multiplies what `surface` says."""
    given = scene.buffers.given
    if name in given:
        image = images.get(given[name])
        return None if image is None or image.extent.nonfinite else image.extent.magnitude
    if name == "albedo" and not scene.everything_given:
        return max((_brightest(each) for each in scene.objects), default=1.0)
    return 1.0


def _brightest(each: Object) -> float:
    return max(*each.albedo, *(each.checker or (0.0,)))
