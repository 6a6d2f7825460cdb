"""What comes between the light of surfaces and the picture: environment, background, fog, lens and shutter."""

from __future__ import annotations

from typing import Any

import numpy as np

from lichen.planning.pipeline import INPUT
from lichen.scene.nodes import Nodes, understood

PLAIN = ("planar", "euclidean")
"""Kinds of depth that are infinite where there is nothing."""


def finished(nodes: Nodes, lit: str) -> str:
    """The picture of the light that surfaces send."""
    made = fogged(nodes, before_background(nodes, mirrored(nodes, lit)))
    return shuttered(nodes, seen_through_lens(nodes, made))


def mirrored(nodes: Nodes, lit: str) -> str:
    """The light, and the environment that surfaces show."""
    scene = nodes.scene
    if scene.environment is None:
        return lit
    said = dict(scene.environment)
    image = said.pop("image")
    p = understood("reflection", said, "/environment")
    if p.mode == "mirror" and p.fresnel == "none" and p.reflectance == 0 and p.background == "none" and nodes.prune:
        nodes.leave_out("environment", "surfaces reflect nothing of it")
        return lit
    inputs = {"normal": nodes.facing(), "environment": INPUT + image, "position": nodes.buffer("position")}
    said = {"eye": scene.camera.eye, **said}
    if nodes.tiled is not None:
        inputs["tiles"] = nodes.tiled
        said |= {"effect": nodes.lit, "faint": nodes.faint}
    return nodes.add("environment", "reflection", said, {**inputs, "base": lit}, "/environment")


def seen_through_lens(nodes: Nodes, picture: str) -> str:
    """The picture as a lens with an aperture has it."""
    scene = nodes.scene
    if scene.lens is None:
        return picture
    p = understood("depth_of_field", scene.lens, "/lens")
    if (p.blur == 0 or p.largest == 0) and nodes.prune:
        nodes.leave_out("lens", "its aperture is a point")
        return picture
    return nodes.add("lens", "depth_of_field", scene.lens, {"image": picture, "depth": nodes.buffer("depth")}, "/lens")


def shuttered(nodes: Nodes, picture: str) -> str:
    """The picture as long as the shutter is open."""
    scene = nodes.scene
    if scene.shutter is None:
        return picture
    understood("motion_blur", scene.shutter, "/shutter")
    given = scene.buffers.given
    if not given and not any(any(each.velocity) for each in scene.objects) and nodes.prune:
        nodes.leave_out("shutter", "nothing moves")
        return picture
    inputs = {"image": picture, "motion": nodes.buffer("motion")}
    return nodes.add("shutter", "motion_blur", scene.shutter, inputs, "/shutter")


def before_background(nodes: Nodes, lit: str) -> str:
    """The light, and that of the background where there is nothing."""
    scene = nodes.scene
    if scene.environment is not None and scene.environment.get("background") == "environment":
        return lit
    if not any(scene.background) and nodes.prune and not scene.everything_given:
        nodes.leave_out("background", "it is black, as what is not lit")
        return lit
    if nodes.prune and _veiled(nodes):
        nodes.leave_out("background", "fog hides whatever is infinitely far")
        return lit
    return nodes.add(
        "background", "background", {"colour": scene.background}, {"image": lit, "depth": _where(nodes)}, "/background"
    )


def _veiled(nodes: Nodes) -> bool:
    """Whether fog shows its colour alone where there is nothing, with the background or without: nothing comes through
    it from there, and nothing there could spoil the colour, since lamps that know where points are leave it dark."""
    scene = nodes.scene
    if scene.fog is None or scene.environment is not None or any(scene.ambient) or _shines(nodes):
        return False
    if "depth" in scene.buffers.given and scene.camera.depth_kind not in PLAIN:
        return False  # fog and background would see different depths
    lamps = [step for step in nodes.steps.values() if step.operation == "lighting"]
    return understood("fog", scene.fog, "/fog").opaque and all("position" in step.inputs for step in lamps)


def _shines(nodes: Nodes) -> bool:
    """Whether something may shine through fog."""
    given = nodes.scene.buffers.given
    return "emissive" in given if given else any(each.emissive for each in nodes.scene.objects)


def _where(nodes: Nodes) -> str:
    """What is infinite where there is nothing: positions where they are needed anyway, or depths."""
    given = nodes.scene.buffers.given
    if given:
        return nodes.buffer("depth" if "depth" in given and nodes.scene.camera.depth_kind in PLAIN else "position")
    return nodes.buffer("position" if "position" in nodes.steps else "depth")


def fogged(nodes: Nodes, picture: str) -> str:
    scene = nodes.scene
    if scene.fog is None:
        return picture
    p = understood("fog", scene.fog, "/fog")
    if p.clear and nodes.prune:
        nodes.leave_out("fog", "its density is 0")
        return picture
    parameters: dict[str, Any] = {**scene.fog, "eye": scene.camera.eye}
    given = scene.buffers.given
    if "depth" in given:
        where = nodes.buffer("depth")
        parameters |= nodes.depth()
    elif given or "position" in nodes.steps or p.by_height or p.distance != "euclidean":
        where = nodes.buffer("position")
        forward = np.subtract(scene.camera.target, scene.camera.eye)
        parameters |= {"forward": [float(each) for each in forward]}
        if given:
            parameters.setdefault("up", scene.camera.up)
    else:
        where = nodes.buffer("distance")
        parameters |= {"depth_kind": "euclidean", "fov": scene.camera.fov}
    inputs = {"image": picture, "depth": where}
    if _shines(nodes) or (not nodes.prune and not given):
        inputs["emissive"] = nodes.buffer("emissive")
    elif nodes.prune:
        nodes.leave_out("emissive", "nothing shines through the fog")
    return nodes.add("fog", "fog", parameters, inputs, "/fog")
