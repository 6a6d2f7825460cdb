"""From a scene to the graph that renders it, with only those effects in it that can be seen.

Every effect is a node of an operation that can be used alone, so methods, errors, times and truth follow as for any
pipeline, and the planner goes on from there: what it can prove of buffers and parameters it leaves out, too. What is
left out here is so by `predicates`, each a decision of the pass `scene`, and nothing is left out where `prune` is not
set: the two pictures then differ by no more than the bounds say.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.catalogue import operation
from lichen.errors import Flaw, InvalidRequest
from lichen.operations.lighting.lamps import Kind
from lichen.planning.graph import Decision
from lichen.planning.pipeline import INPUT, Exit, Pipeline, Step
from lichen.scene import predicates
from lichen.scene.description import Light, Output, Scene
from lichen.scene.lights import Sight, filtering, given_map, sight

JOINED = 4
"""Shadows that one picture holds."""


@dataclass(frozen=True, slots=True)
class Lowered:
    """The graph of a scene, what was left out of it and why, and which part of the scene each node stems from."""

    pipeline: Pipeline
    decisions: tuple[Decision, ...]
    origins: Mapping[str, str]

    def relocated(self, flaws: Iterable[Flaw]) -> list[Flaw]:
        """Flaws of nodes as flaws of the scene."""
        found = []
        for flaw in flaws:
            _, _, rest = flaw.pointer.partition("/nodes/")
            name, _, tail = rest.partition("/")
            origin = self.origins.get(name)
            if origin is None:
                found.append(flaw)
                continue
            kind, _, key = tail.partition("/")
            pointer = f"/buffers/{key}" if kind == "inputs" else f"{origin}/{key}" if key else origin
            found.append(Flaw(pointer, flaw.detail))
        return list(dict.fromkeys(found))


def lower(scene: Scene, *, prune: bool = True) -> Lowered:
    """The graph of a scene. Raises `InvalidRequest` for parameters that fog or lighting does not take."""
    return _Builder(scene, prune).lowered()


class _Builder:
    """Adds nodes as they are needed, each under one name."""

    def __init__(self, scene: Scene, prune: bool) -> None:
        self._scene, self._prune = scene, prune
        self._steps: dict[str, Step] = {}
        self._origins: dict[str, str] = {}
        self._decisions: list[Decision] = []

    def lowered(self) -> Lowered:
        scene = self._scene
        if scene.output in (Output.PICTURE, Output.LIGHT):
            made = self._lit()
            if scene.output is Output.PICTURE:
                made = self._fogged(self._before_background(made))
        else:
            made = self._buffer(str(scene.output))
        return Lowered(Pipeline(self._steps, {"result": Exit(made)}), tuple(self._decisions), self._origins)

    def _add(self, name: str, what: str, parameters: Mapping[str, Any], inputs: Mapping[str, str], origin: str) -> str:
        if name not in self._steps:
            self._steps[name] = Step(what, dict(parameters), dict(inputs))
            self._origins[name] = origin
        return name

    def _leave_out(self, node: str, reason: str, action: str = "not lowered") -> None:
        self._decisions.append(Decision("scene", node, action, reason))

    # ------------------------------------------------------------------------------------------------------ buffers

    def _buffer(self, name: str) -> str:
        """The node or picture that holds a buffer."""
        scene = self._scene
        given = scene.buffers.given
        if name in given:
            return INPUT + given[name]
        if given and name == "position":
            return self._add("position", "deproject", self._depth(), {"depth": self._buffer("depth")}, "/camera")
        camera = scene.camera.model_dump(include={"eye", "target", "up", "fov", "extent", "width", "height", "far"})
        seen = {**camera, "buffer": name, "frame": "world", "objects": [each.model_dump() for each in scene.objects]}
        return self._add(name, "gbuffer", seen, {}, "/camera")

    def _depth(self) -> dict[str, Any]:
        """What the buffer of depths holds."""
        camera = self._scene.camera
        far = None if camera.endless else camera.far
        return {"fov": camera.fov, "depth_kind": camera.depth_kind, "near": camera.near, "far": far}

    def _has(self, name: str) -> bool:
        return name in self._scene.buffers.given if self._scene.everything_given else True

    # -------------------------------------------------------------------------------------------------------- light

    def _lit(self) -> str:
        """The light that surfaces send to the camera."""
        scene = self._scene
        parts: list[str] = []
        plain: list[Light] = []
        hidden: list[tuple[Light, str]] = []
        for number, light in enumerate(scene.lights):
            name = f"light_{number}"
            reason = predicates.dark(light)
            if reason is None and not scene.everything_given:
                reason = predicates.misses(light, scene.objects)
            if reason is not None and self._prune:
                self._leave_out(name, reason)
                continue
            shadow = self._shadow(name, number, light)
            if shadow is None:
                plain.append(light)
            else:
                hidden.append((light, shadow))
        if plain:
            parts.append(self._lighting("lighting", plain, None))
        for first in range(0, len(hidden), JOINED):
            some = hidden[first : first + JOINED]
            name = f"shadowed_{first // JOINED}"
            parts.append(self._lighting(name, [light for light, _ in some], self._joined(name, some)))
        if any(scene.ambient):
            parts.append(self._ambient())
        return self._summed(parts)

    def _joined(self, name: str, some: list[tuple[Light, str]]) -> str:
        """The shadows of some lights as the channels of one picture."""
        names = [shadow for _, shadow in some]
        if len(names) == 1:
            return names[0]
        letters = "abcd"[: len(names)]
        joined = {"expression": f"({', '.join(letters)})"}
        return self._add(f"{name}_seen", "expression", joined, dict(zip(letters, names, strict=True)), "/lights")

    def _shadow(self, name: str, number: int, light: Light) -> str | None:
        """The share of a light that reaches each pixel; None where all of it does."""
        scene, shadow = self._scene, light.shadow
        if shadow is None:
            return None
        where = f"/lights/{number}/shadow"
        if shadow.map is not None:
            seen, depths = given_map(light), INPUT + shadow.map
        else:
            reason = predicates.unshadowed(scene.objects)
            ball = predicates.around(scene.objects)
            if ball is None:
                self._leave_out(f"{name}_shadow", reason or "planes without an end are in no map")
                return None
            if reason is not None and self._prune:
                self._leave_out(f"{name}_shadow", reason)
                return None
            seen = sight(light, ball)
            if not seen.whole:
                self._leave_out(f"{name}_map", "one map shows no more; what it does not show is lit", "narrowed")
            depths = self._map(name, seen, shadow.size, where)
        filters, simpler = filtering(light, prune=self._prune)
        if simpler is not None:
            self._leave_out(f"{name}_shadow", simpler, "simplified")
        inputs = {"map": depths, "depth": self._buffer("position"), "normal": self._buffer("normal")}
        return self._add(f"{name}_shadow", "shadow", {**seen.shadow(), **filters}, inputs, where)

    def _map(self, name: str, seen: Sight, size: int, where: str) -> str:
        far = min(1e6, 1e4 + self._scene.camera.far)
        parameters = {**seen.camera(), "width": size, "height": size, "buffer": "depth", "far": far}
        objects = [each.model_dump() for each in self._scene.objects]
        return self._add(f"{name}_map", "gbuffer", {**parameters, "objects": objects}, {}, where)

    def _lighting(self, name: str, lamps: list[Light], seen: str | None) -> str:
        scene = self._scene
        surface = dict(scene.surface)
        dull = surface.get("model", "lambert") == "lambert"
        inputs = {"normal": self._buffer("normal")}
        local = not dull and scene.camera.extent is None
        if local or any(each.kind is not Kind.DIRECTIONAL for each in lamps) or not self._prune:
            inputs["position"] = self._buffer("position")
            surface.setdefault("eye", scene.camera.eye)
        else:
            self._leave_out(f"{name}_position", "no light and no highlight depends on where a point is")
        if scene.camera.extent is not None:
            back = np.subtract(scene.camera.eye, scene.camera.target)
            surface |= {"local_viewer": False, "view": [float(each) for each in back]}
        for buffer in ("albedo", "specular"):
            if buffer == "albedo" and self._has(buffer):
                inputs[buffer] = self._buffer(buffer)
                surface.setdefault("diffuse", (1.0, 1.0, 1.0))
            elif buffer in scene.buffers.given:
                inputs[buffer] = self._buffer(buffer)
        if not dull:
            self._roughness(name, surface, inputs)
        if seen is not None:
            inputs["visibility"] = seen
        lights = [each.model_dump(mode="json", exclude={"shadow"}) for each in lamps]
        return self._add(name, "lighting", {"model": "lambert", **surface, "lights": lights}, inputs, "/surface")

    def _roughness(self, name: str, surface: dict[str, Any], inputs: dict[str, str]) -> None:
        """A buffer, or a number where it is the same everywhere."""
        scene = self._scene
        if "facet_roughness" in surface or surface.get("exponent") is not None:
            return
        same = predicates.same_roughness(scene.objects)
        if not scene.everything_given and same is not None and self._prune:
            self._leave_out(f"{name}_roughness", f"it is {same:g} everywhere")
            surface["facet_roughness"] = same
        elif self._has("roughness"):
            inputs["roughness"] = self._buffer("roughness")

    def _ambient(self) -> str:
        if not self._has("albedo"):
            raise InvalidRequest("The scene is not valid.", [Flaw("/buffers/albedo", "is required by ambient light")])
        r, g, b = self._scene.ambient
        product = {"expression": f"({r!r} * a[0], {g!r} * a[1], {b!r} * a[2])", "light": "linear"}
        return self._add("ambient", "expression", product, {"a": self._buffer("albedo")}, "/ambient")

    def _summed(self, parts: list[str]) -> str:
        """All light together, added in the order of the parts."""
        if not parts:
            return self._add(
                "black", "expression", {"expression": "(0, 0, 0)"}, {"a": self._buffer("normal")}, "/lights"
            )
        total = parts[0]
        for number, first in enumerate(range(1, len(parts), 15)):
            some = [total, *parts[first : first + 15]]
            inputs = {f"image_{at + 1}": each for at, each in enumerate(some)}
            total = self._add(f"sum_{number}", "accumulate", {"weights": [1.0] * len(some)}, inputs, "/lights")
        return total

    # ---------------------------------------------------------------------------------------- background and fog

    def _before_background(self, lit: str) -> str:
        """The light, and that of the background where there is nothing."""
        scene = self._scene
        if not any(scene.background) and self._prune and not scene.everything_given:
            self._leave_out("background", "it is black, as what is not lit")
            return lit
        where = self._where()
        if where is None:
            return lit
        return self._add(
            "background", "background", {"colour": scene.background}, {"image": lit, "depth": where}, "/background"
        )

    def _where(self) -> str | None:
        """What is infinite where there is nothing: positions where they are needed anyway, or depths."""
        given = self._scene.buffers.given
        if given:
            plain = self._scene.camera.depth_kind in ("planar", "euclidean")
            return self._buffer("depth" if "depth" in given and plain else "position")
        return self._buffer("position" if "position" in self._steps else "depth")

    def _fogged(self, picture: str) -> str:
        scene = self._scene
        if scene.fog is None:
            return picture
        fog = operation("fog")
        try:
            p = fog.validate(scene.fog)
        except InvalidRequest as invalid:
            flaws = [Flaw(each.pointer.replace("/parameters", "/fog", 1), each.detail) for each in invalid.flaws]
            raise InvalidRequest(invalid.detail, flaws) from None
        if p.clear and self._prune:
            self._leave_out("fog", "its density is 0")
            return picture
        parameters: dict[str, Any] = {**scene.fog, "eye": scene.camera.eye}
        given = scene.buffers.given
        if "depth" in given:
            where = self._buffer("depth")
            parameters |= self._depth()
        elif given or "position" in self._steps or p.by_height or p.distance != "euclidean":
            where = self._buffer("position")
            forward = np.subtract(scene.camera.target, scene.camera.eye)
            parameters |= {"forward": [float(each) for each in forward]}
            if given:
                parameters.setdefault("up", scene.camera.up)
        else:
            where = self._buffer("distance")
            parameters |= {"depth_kind": "euclidean", "fov": scene.camera.fov}
        inputs = {"image": picture, "depth": where}
        shines = "emissive" in given if given else any(each.emissive for each in scene.objects)
        if shines or (not self._prune and not given):
            inputs["emissive"] = self._buffer("emissive")
        elif self._prune:
            self._leave_out("emissive", "nothing shines through the fog")
        return self._add("fog", "fog", parameters, inputs, "/fog")
