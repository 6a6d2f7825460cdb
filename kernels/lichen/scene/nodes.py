"""The nodes of a scene's graph as they are added, and its buffers, each made once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lichen.catalogue import operation
from lichen.errors import Flaw, InvalidRequest
from lichen.planning.graph import Decision
from lichen.planning.pipeline import INPUT, Step
from lichen.scene.description import Scene


def understood(name: str, said: Mapping[str, Any], where: str) -> Any:
    """Parameters of an operation. Raises `InvalidRequest` with flaws at the scene's own place."""
    try:
        return operation(name).validate(said)
    except InvalidRequest as invalid:
        flaws = [Flaw(each.pointer.replace("/parameters", where, 1), each.detail) for each in invalid.flaws]
        raise InvalidRequest(invalid.detail, flaws) from None


class Nodes:
    """Adds nodes as they are needed, each under one name, with the part of the scene that each stems from."""

    def __init__(self, scene: Scene, prune: bool) -> None:
        self.scene, self.prune = scene, prune
        self.steps: dict[str, Step] = {}
        self.origins: dict[str, str] = {}
        self.decisions: list[Decision] = []
        self.tiled: str | None = None
        """the lists of what is left out where, once they are made"""
        self.lit = 0
        """lamps that they tell of; the environment comes after them"""
        self.faint = 0.0
        """the light that may be left out of a pixel"""

    def add(self, name: str, what: str, parameters: Mapping[str, Any], inputs: Mapping[str, str], origin: str) -> str:
        if name not in self.steps:
            self.steps[name] = Step(what, dict(parameters), dict(inputs))
            self.origins[name] = origin
        return name

    def leave_out(self, node: str, reason: str, action: str = "not lowered") -> None:
        self.decisions.append(Decision("scene", node, action, reason))

    # ------------------------------------------------------------------------------------------------------ buffers

    def buffer(self, name: str) -> str:
        """The node or picture that holds a buffer."""
        scene = self.scene
        given = scene.buffers.given
        if name in given:
            return INPUT + given[name]
        if given and name == "position":
            return self.add("position", "deproject", self.depth(), {"depth": self.buffer("depth")}, "/camera")
        camera = scene.camera.model_dump(include={"eye", "target", "up", "fov", "extent", "width", "height", "far"})
        seen = {**camera, "buffer": name, "frame": "world", "objects": [each.model_dump() for each in scene.objects]}
        return self.add(name, "gbuffer", seen, {}, "/camera")

    def facing(self) -> str:
        """The node or picture that holds normals as lights and environment see them: bent where there is a relief."""
        if "height" not in self.scene.buffers.given:
            return self.buffer("normal")
        inputs = {name: self.buffer(name) for name in ("normal", "position", "height")}
        return self.add("relief", "bump", self.scene.relief or {}, inputs, "/relief")

    def depth(self) -> dict[str, Any]:
        """What the buffer of depths holds."""
        camera = self.scene.camera
        far = None if camera.endless else camera.far
        return {"fov": camera.fov, "depth_kind": camera.depth_kind, "near": camera.near, "far": far}

    def has(self, name: str) -> bool:
        return name in self.scene.buffers.given if self.scene.everything_given else True
