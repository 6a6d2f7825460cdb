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

from lichen.errors import Flaw, InvalidRequest
from lichen.operations.lighting.lamps import Kind
from lichen.planning.graph import Decision
from lichen.planning.pipeline import INPUT, Exit, Pipeline
from lichen.scene import predicates
from lichen.scene.description import Buffers, Light, Output, Scene
from lichen.scene.finishing import finished
from lichen.scene.lights import Sight, filtering, given_map, sight
from lichen.scene.nodes import Nodes

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
            if kind == "inputs":
                pointer = f"/buffers/{key}" if key in Buffers.model_fields else origin
            else:
                pointer = f"{origin}/{key}" if key else origin
            found.append(Flaw(pointer, flaw.detail))
        return list(dict.fromkeys(found))


def lower(scene: Scene, *, prune: bool = True) -> Lowered:
    """The graph of a scene. Raises `InvalidRequest` for parameters that fog or lighting does not take."""
    return _Builder(scene, prune).lowered()


class _Builder(Nodes):
    """Adds what lights the surfaces."""

    def lowered(self) -> Lowered:
        scene = self.scene
        if scene.output in (Output.PICTURE, Output.LIGHT):
            made = self._lit()
            if scene.output is Output.PICTURE:
                made = finished(self, made)
        else:
            made = self.buffer(str(scene.output))
        return Lowered(Pipeline(self.steps, {"result": Exit(made)}), tuple(self.decisions), self.origins)

    # -------------------------------------------------------------------------------------------------------- light

    def _lit(self) -> str:
        """The light that surfaces send to the camera."""
        scene = self.scene
        parts: list[str] = []
        plain: list[Light] = []
        hidden: list[tuple[Light, str]] = []
        for number, light in enumerate(scene.lights):
            name = f"light_{number}"
            reason = predicates.dark(light)
            if reason is None and not scene.everything_given:
                reason = predicates.misses(light, scene.objects)
            if reason is not None and self.prune:
                self.leave_out(name, reason)
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
        return self.add(f"{name}_seen", "expression", joined, dict(zip(letters, names, strict=True)), "/lights")

    def _shadow(self, name: str, number: int, light: Light) -> str | None:
        """The share of a light that reaches each pixel; None where all of it does."""
        scene, shadow = self.scene, light.shadow
        if shadow is None:
            return None
        where = f"/lights/{number}/shadow"
        if shadow.map is not None:
            seen, depths = given_map(light), INPUT + shadow.map
        else:
            reason = predicates.unshadowed(scene.objects)
            ball = predicates.around(scene.objects)
            if ball is None:
                self.leave_out(f"{name}_shadow", reason or "planes without an end are in no map")
                return None
            if reason is not None and self.prune:
                self.leave_out(f"{name}_shadow", reason)
                return None
            seen = sight(light, ball)
            if not seen.whole:
                self.leave_out(f"{name}_map", "one map shows no more; what it does not show is lit", "narrowed")
            depths = self._map(name, seen, shadow.size, where)
        filters, simpler = filtering(light, prune=self.prune)
        if simpler is not None:
            self.leave_out(f"{name}_shadow", simpler, "simplified")
        inputs = {"map": depths, "depth": self.buffer("position"), "normal": self.buffer("normal")}
        return self.add(f"{name}_shadow", "shadow", {**seen.shadow(), **filters}, inputs, where)

    def _map(self, name: str, seen: Sight, size: int, where: str) -> str:
        far = min(1e6, 1e4 + self.scene.camera.far)
        parameters = {**seen.camera(), "width": size, "height": size, "buffer": "depth", "far": far}
        objects = [each.model_dump() for each in self.scene.objects]
        return self.add(f"{name}_map", "gbuffer", {**parameters, "objects": objects}, {}, where)

    def _lighting(self, name: str, lamps: list[Light], seen: str | None) -> str:
        scene = self.scene
        surface = dict(scene.surface)
        dull = surface.get("model", "lambert") == "lambert"
        inputs = {"normal": self.buffer("normal")}
        local = not dull and scene.camera.extent is None
        if local or any(each.kind is not Kind.DIRECTIONAL for each in lamps) or not self.prune:
            inputs["position"] = self.buffer("position")
            surface.setdefault("eye", scene.camera.eye)
        else:
            self.leave_out(f"{name}_position", "no light and no highlight depends on where a point is")
        if scene.camera.extent is not None:
            back = np.subtract(scene.camera.eye, scene.camera.target)
            surface |= {"local_viewer": False, "view": [float(each) for each in back]}
        for buffer in ("albedo", "specular"):
            if buffer == "albedo" and self.has(buffer):
                inputs[buffer] = self.buffer(buffer)
                surface.setdefault("diffuse", (1.0, 1.0, 1.0))
            elif buffer in scene.buffers.given:
                inputs[buffer] = self.buffer(buffer)
        if not dull:
            self._roughness(name, surface, inputs)
        if seen is not None:
            inputs["visibility"] = seen
        lights = [each.model_dump(mode="json", exclude={"shadow"}) for each in lamps]
        return self.add(name, "lighting", {"model": "lambert", **surface, "lights": lights}, inputs, "/surface")

    def _roughness(self, name: str, surface: dict[str, Any], inputs: dict[str, str]) -> None:
        """A buffer, or a number where it is the same everywhere."""
        scene = self.scene
        if "facet_roughness" in surface or surface.get("exponent") is not None:
            return
        same = predicates.same_roughness(scene.objects)
        if not scene.everything_given and same is not None and self.prune:
            self.leave_out(f"{name}_roughness", f"it is {same:g} everywhere")
            surface["facet_roughness"] = same
        elif self.has("roughness"):
            inputs["roughness"] = self.buffer("roughness")

    def _ambient(self) -> str:
        if not self.has("albedo"):
            raise InvalidRequest("The scene is not valid.", [Flaw("/buffers/albedo", "is required by ambient light")])
        r, g, b = self.scene.ambient
        product = {"expression": f"({r!r} * a[0], {g!r} * a[1], {b!r} * a[2])", "light": "linear"}
        return self.add("ambient", "expression", product, {"a": self.buffer("albedo")}, "/ambient")

    def _summed(self, parts: list[str]) -> str:
        """All light together, added in the order of the parts."""
        if not parts:
            return self.add("black", "expression", {"expression": "(0, 0, 0)"}, {"a": self.buffer("normal")}, "/lights")
        total = parts[0]
        for number, first in enumerate(range(1, len(parts), 15)):
            some = [total, *parts[first : first + 15]]
            inputs = {f"image_{at + 1}": each for at, each in enumerate(some)}
            total = self.add(f"sum_{number}", "accumulate", {"weights": [1.0] * len(some)}, inputs, "/lights")
        return total
