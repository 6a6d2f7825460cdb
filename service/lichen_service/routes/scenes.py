"""POST and QUERY on /v1/scenes: a scene in, and its buffers where it has any; the picture of it out.

The scene is the query's `scene`, the JSON part `scene` of a form, or the whole body where no picture is sent. It is
lowered to a pipeline (`lichen.scene`), and the road from there on is that of `pipelines`: `explain=true` tells which
effects would run and why the others would not, `prune=false` runs them all. Flaws are told at the scene's own places.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lichen import engine
from lichen.engine import Prepared
from lichen.image import Image
from lichen.planning.graph import RESULT
from lichen.planning.pipeline import INPUT, Exit, Pipeline
from lichen.scene.description import Output, Scene, read, refuse
from lichen.scene.layers import spread
from lichen.scene.lowering import lower
from lichen_service.formats import Delivery
from lichen_service.queries import Options
from lichen_service.refusals import relocated
from lichen_service.routes.pipelines import Pipelines, Told

PATH = "/v1/scenes"


@dataclass(frozen=True, slots=True)
class ToldScene(Told):
    """A scene as it was understood."""

    scene: Scene | None = None


class Scenes(Pipelines):
    document = "scene"

    def _understood(self, said: str | bytes, options: Options) -> Told:
        scene = read(said)
        layers = scene.buffers.layers
        if layers is None:
            return _told(scene, options)
        # What is in the layers is known when they are decoded; until then they are all that is read.
        reading = Pipeline({}, {RESULT: Exit(INPUT + layers)})
        others = [INPUT + name for name in scene.names if name != layers]
        reading = Pipeline({}, {**reading.outputs, **{f"other{at}": Exit(name) for at, name in enumerate(others)}})
        return ToldScene(reading, scene.names, _never, scene=scene)

    def _known(self, told: Told, images: dict[str, Image], options: Options) -> tuple[Told, dict[str, Image]]:
        if not isinstance(told, ToldScene) or told.scene is None or told.scene.buffers.layers is None:
            return told, images
        with relocated():
            scene, known = spread(told.scene, images)
            refuse(scene)
            made = _told(scene, options)
        return made, {name: image for name, image in known.items() if name in made.pipeline.inputs}


def _told(scene: Scene, options: Options) -> ToldScene:
    lowered = lower(scene, prune=options.prune)

    def prepare(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
        form = forms[RESULT]
        wanted = {"space": form.space, "alpha": form.alpha, "storage": form.storage}
        return engine.prepare_scene(scene, images=images, **wishes, **wanted)

    shown = scene.output in (Output.PICTURE, Output.LIGHT)
    return ToldScene(lowered.pipeline, scene.names, prepare, lowered.relocated, shown, scene)


def _never(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
    raise AssertionError("a scene whose layers are not known is not rendered")
