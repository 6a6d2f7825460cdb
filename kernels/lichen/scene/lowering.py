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
from lichen.image import Image, Space
from lichen.operations.lighting.lamps import FARTHEST, Kind, Lamp
from lichen.planning.graph import Decision
from lichen.planning.pipeline import INPUT, Exit, Pipeline
from lichen.planning.remember import Kept
from lichen.scene import predicates, tiling
from lichen.scene.description import Buffers, Light, Output, Scene
from lichen.scene.finishing import finished
from lichen.scene.keeping import Pictures
from lichen.scene.lights import Sight, apart, filtering, given_map, sight
from lichen.scene.nodes import Nodes

JOINED = 4
"""Shadows that one picture holds."""


@dataclass(frozen=True, slots=True)
class Lowered:
    """The graph of a scene, what was left out of it and why, and which part of the scene each node stems from."""

    pipeline: Pipeline
    decisions: tuple[Decision, ...]
    origins: Mapping[str, str]
    lamps: tuple[int, ...] = ()
    """the numbers of the lights that tiles tell of, in their order there"""

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


def lower(
    scene: Scene,
    *,
    prune: bool = True,
    faint: float = 0.0,
    images: Mapping[str, Image] | None = None,
) -> Lowered:
    """The graph of a scene; the one that was made before, of the same scene and pictures.

    `faint` is the light that may be left out of a pixel, beside what cannot be seen at all; `images`, the pictures sent
    along, tell how much they reflect. Raises `InvalidRequest` for parameters that fog or lighting does not take.
    """
    pictures = Pictures(images or {})
    key = (id(scene), prune, faint, pictures.key)
    kept = _kept.get(key)
    if kept is not None and kept.pictures.alive:
        return kept.lowered
    lowered = _Builder(scene, prune, faint, images or {}).lowered()
    _kept.put(key, _Frame(scene, pictures, lowered))
    return lowered


@dataclass(frozen=True, eq=False, slots=True)
class _Frame:
    """What was lowered; the scene is held so that no other has its place."""

    scene: Scene
    pictures: Pictures
    lowered: Lowered


_kept: Kept[_Frame] = Kept()


Numbered = list[tuple[int, Light]]
"""Lights with their places in the scene."""


def _grouped(lamps: Numbered, most: int) -> list[Numbered]:
    """So many at a time, then those that show pictures one by one."""
    bare = [each for each in lamps if each[1].slide is None]
    groups = [bare[first : first + most] for first in range(0, len(bare), max(most, 1))]
    return groups + [[each] for each in lamps if each[1].slide is not None]


class _Builder(Nodes):
    """Adds what lights the surfaces."""

    def __init__(self, scene: Scene, prune: bool, faint: float, images: Mapping[str, Image]) -> None:
        super().__init__(scene, prune)
        self.faint, self.images = faint, images
        self.lamps: list[tuple[int, Light]] = []
        """those that are seen, those without shadows first"""

    def lowered(self) -> Lowered:
        scene = self.scene
        if scene.output is Output.TILES:
            made = self._mapped()
        elif scene.output in (Output.PICTURE, Output.LIGHT):
            made = self._lit()
            if scene.output is Output.PICTURE:
                made = finished(self, made)
        else:
            made = self.facing() if scene.output is Output.NORMAL else self.buffer(str(scene.output))
        lamps = tuple(number for number, _ in self.lamps)
        return Lowered(Pipeline(self.steps, {"result": Exit(made)}), tuple(self.decisions), self.origins, lamps)

    # -------------------------------------------------------------------------------------------------------- light

    def _seen(self) -> tuple[list[Numbered], list[Numbered]]:
        """The lamps that light something in groups that light together: those without shadows, and those with. A lamp
        that shows a picture is a group of its own."""
        plain: Numbered = []
        hidden: Numbered = []
        for number, light in enumerate(self.scene.lights):
            reason = predicates.dark(light)
            if reason is None and not self.scene.everything_given:
                reason = predicates.misses(light, self.scene.objects)
            if reason is not None and self.prune:
                self.leave_out(f"light_{number}", reason)
            else:
                (hidden if self._hides(number, light) else plain).append((number, light))
        groups = _grouped(plain, len(plain)), _grouped(hidden, JOINED)
        self.lamps = [each for some in groups for group in some for each in group]
        return groups

    def _lit(self) -> str:
        """The light that surfaces send to the camera."""
        scene = self.scene
        parts: list[str] = []
        plain, hidden = self._seen()
        lamps = [light for _, light in self.lamps]
        if self.prune and lamps and tiling.worthwhile(scene, lamps, self.faint, self.images):
            self._tiles()
        effect = 0
        for at, some in enumerate(plain):
            name = "lighting" if at == 0 else f"lighting_{at}"
            parts.append(self._lighting(name, [light for _, light in some], None, effect))
            effect += len(some)
        for number_of, some in enumerate(hidden):
            name = f"shadowed_{number_of}"
            shadows = [self._shadow(number, light, effect + at) for at, (number, light) in enumerate(some)]
            parts.append(self._lighting(name, [light for _, light in some], self._joined(name, shadows), effect))
            effect += len(some)
        if any(scene.ambient):
            parts.append(self._ambient())
        return self._summed(parts)

    def _mapped(self) -> str:
        self._seen()
        if not self.lamps:
            flaw = Flaw("/lights", "none of them lights anything, so there is nothing to be left out of tiles")
            raise InvalidRequest("The scene has no map.", [flaw])
        self._tiles()
        return "tiles"

    def _tiles(self) -> None:
        """The lists of what is left out where."""
        inputs = {"position": self.buffer("position"), "normal": self.facing()}
        lamps = [light for _, light in self.lamps]
        said = tiling.parameters(self.scene, lamps, self.faint if self.prune else 0.0, self.images)
        self.tiled, self.lit = self.add("tiles", "tiles", said, inputs, "/lights"), len(lamps)

    def _joined(self, name: str, names: list[str]) -> str:
        """The shadows of some lights as the channels of one picture."""
        if len(names) == 1:
            return names[0]
        letters = "abcd"[: len(names)]
        joined = {"expression": f"({', '.join(letters)})"}
        return self.add(f"{name}_seen", "expression", joined, dict(zip(letters, names, strict=True)), "/lights")

    def _hides(self, number: int, light: Light) -> bool:
        """Whether something stands before a light, as far as a map can show it."""
        if light.shadow is None or light.shadow.map is not None:
            return light.shadow is not None
        reason = predicates.unshadowed(self.scene.objects)
        if predicates.around(self.scene.objects) is None:
            self.leave_out(f"light_{number}_shadow", reason or "planes without an end are in no map")
            return False
        if reason is not None and self.prune:
            self.leave_out(f"light_{number}_shadow", reason)
            return False
        return True

    def _shadow(self, number: int, light: Light, effect: int) -> str:
        """The share of a light that reaches each pixel: the mean of its points' shares."""
        points = apart(light)
        if len(points) == 1:
            if light.shadow is not None and light.shadow.points > 1:
                self.leave_out(f"light_{number}_points", "the light is one point", "simplified")
            return self._hard(f"light_{number}", number, light, effect)
        shares = [self._hard(f"light_{number}_{at}", number, each, effect) for at, each in enumerate(points)]
        inputs = {f"image_{at + 1}": each for at, each in enumerate(shares)}
        return self.add(f"light_{number}_shadow", "accumulate", {}, inputs, f"/lights/{number}/shadow")

    def _hard(self, name: str, number: int, light: Light, effect: int) -> str:
        """The share that reaches each pixel of a light that is one point."""
        shadow, where = light.shadow, f"/lights/{number}/shadow"
        assert shadow is not None
        if shadow.map is not None:
            seen, depths = given_map(light), INPUT + shadow.map
        else:
            ball = predicates.around(self.scene.objects)
            assert ball is not None, "what has no end is in no map"
            seen = sight(light, ball)
            if not seen.whole:
                self.leave_out(f"{name}_map", "one map shows no more; what it does not show is lit", "narrowed")
            depths = self._map(name, seen, shadow.size, where)
        filters, simpler = filtering(light, prune=self.prune)
        if simpler is not None:
            self.leave_out(f"{name}_shadow", simpler, "simplified")
        inputs = {"map": depths, "depth": self.buffer("position"), "normal": self.buffer("normal")}
        said = {**seen.shadow(), **filters, **self._skipping(inputs, effect)}
        return self.add(f"{name}_shadow", "shadow", said, inputs, where)

    def _skipping(self, inputs: dict[str, str], effect: int) -> dict[str, Any]:
        """What makes a node skip tiles, where there are any lists of them."""
        if self.tiled is None:
            return {}
        inputs["tiles"] = self.tiled
        return {"effect": effect}

    def _map(self, name: str, seen: Sight, size: int, where: str) -> str:
        far = min(1e6, 1e4 + self.scene.camera.far)
        parameters = {**seen.camera(), "width": size, "height": size, "buffer": "depth", "far": far}
        objects = [each.model_dump() for each in self.scene.objects]
        return self.add(f"{name}_map", "gbuffer", {**parameters, "objects": objects}, {}, where)

    def _lighting(self, name: str, lamps: list[Light], seen: str | None, effect: int) -> str:
        scene = self.scene
        surface = dict(scene.surface)
        dull = surface.get("model", "lambert") == "lambert"
        inputs = {"normal": self.facing()}
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
        if lamps[0].slide is not None:
            inputs["slab" if lamps[0].kind is Kind.SLAB else "slide"] = INPUT + lamps[0].slide
        surface |= self._skipping(inputs, effect)
        if self.tiled is not None:
            surface["faint"] = self.faint
        lights = [self._lamp(each) for each in lamps]
        return self.add(name, "lighting", {"model": "lambert", **surface, "lights": lights}, inputs, "/surface")

    def _lamp(self, light: Light) -> Lamp:
        """As `lighting` has it, with how near it comes to what stands in the scene."""
        said = light.model_dump(exclude={"shadow", "slide"})
        if light.nearest == 0 and not self.scene.everything_given:
            said["nearest"] = min(predicates.clearance(light, self.scene.objects), FARTHEST)
        return Lamp.model_validate(said)

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
        sent = self.images.get(self.scene.buffers.given.get("albedo", ""))
        if self.prune and r == g == b == 1 and sent is not None and (sent.space, sent.channels) == (Space.LINEAR, 3):
            self.leave_out("ambient", "it is white and of strength 1, and shows the albedo as it is")
            return self.buffer("albedo")
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
