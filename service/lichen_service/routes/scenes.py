"""POST and QUERY on /v1/scenes: a scene in, and its buffers where it has any; the picture of it out.

The scene is the query's `scene`, the JSON part `scene` of a form, or the whole body where no picture is sent. It is
lowered to a pipeline (`lichen.scene`), and the road from there on is that of `pipelines`: `explain=true` tells which
effects would run and why the others would not, `prune=false` runs them all. Flaws are told at the scene's own places.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lichen import engine
from lichen.engine import Prepared
from lichen.image import Image
from lichen.planning.graph import RESULT
from lichen.scene.description import Output, read
from lichen.scene.lowering import lower
from lichen_service.formats import Delivery
from lichen_service.queries import Options
from lichen_service.routes.pipelines import Pipelines, Told

PATH = "/v1/scenes"


class Scenes(Pipelines):
    document = "scene"

    def _understood(self, said: str | bytes, options: Options) -> Told:
        scene = read(said)
        lowered = lower(scene, prune=options.prune)

        def prepare(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
            form = forms[RESULT]
            wanted = {"space": form.space, "alpha": form.alpha, "storage": form.storage}
            return engine.prepare_scene(scene, images=images, **wishes, **wanted)

        shown = scene.output in (Output.PICTURE, Output.LIGHT)
        return Told(lowered.pipeline, scene.names, prepare, lowered.relocated, shown)
