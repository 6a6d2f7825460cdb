"""POST and QUERY on /v1/scenes: a scene in, and its buffers where it has any; the picture of it out.

The scene is the query's `scene`, the JSON part `scene` of a form, or the whole body where no picture is sent. It is
lowered to a pipeline (`lichen.scene`), and the road from there on is that of `pipelines`: `explain=true` tells which
effects would run and why the others would not, `explain=map` which lights are looked at in which tiles of the picture,
`prune=false` runs them all. Flaws are told at the scene's own places.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lichen import engine
from lichen.engine import Prepared
from lichen.files import encode
from lichen.image import Image, Storage
from lichen.planning.graph import RESULT
from lichen.planning.pipeline import INPUT, Exit, Pipeline
from lichen.scene import heat
from lichen.scene.description import Output, Scene, read, refuse
from lichen.scene.heat import TileMap
from lichen.scene.layers import spread
from lichen.scene.lowering import lower
from lichen_service import mixed, reports
from lichen_service.documents import canonical, momentary
from lichen_service.formats import Delivery
from lichen_service.http.message import Head, Response
from lichen_service.negotiation import prefers
from lichen_service.queries import Options
from lichen_service.refusals import relocated
from lichen_service.routes.pipelines import Pipelines, Told
from lichen_service.routes.running import JSON
from lichen_service.stages import Stages


@dataclass(frozen=True, slots=True)
class ToldScene(Told):
    """A scene as it was understood."""

    scene: Scene | None = None


class Scenes(Pipelines):
    document = "scene"

    def _understood(self, said: str | bytes | Mapping[str, Any], options: Options) -> Told:
        scene = heat.mapped(read(said)) if options.explain == "map" else read(said)
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

    def _explained(
        self, told: Told, prepared: Prepared, deliveries: Mapping[str, Delivery], head: Head, options: Options,
        stages: Stages,
    ) -> Response:  # fmt: skip
        """The plan, or the map."""
        if options.explain != "map" or not isinstance(told, ToldScene) or told.scene is None:
            return super()._explained(told, prepared, deliveries, head, options, stages)
        with stages.stage("run"):
            (result,) = prepared.run().values()
        found = heat.told(told.scene, prepared.plan.graph, result.image.pixels, result.decisions)
        return _map(found, head.headers.get("accept"), stages)


def _map(found: TileMap, accept: str | None, stages: Stages) -> Response:
    """As a picture, as JSON, or as both, whichever is accepted by name."""
    dropped = reports.skipped(found.decisions)
    headers = {"Server-Timing": stages.header(), "Vary": "Accept"} | ({"Lichen-Skipped": dropped} if dropped else {})
    if prefers(accept, JSON):
        response = momentary(200, found.to_json())
        response.headers |= headers
        return response
    picture = encode(found.picture(), "png")
    if not prefers(accept, mixed.MIXED):
        return Response(200, picture.data, {"Content-Type": picture.media_type, **headers})
    content_type, body = mixed.join(
        [({"Content-Type": picture.media_type}, picture.data), ({"Content-Type": JSON}, canonical(found.to_json()))]
    )
    return Response(200, body, {"Content-Type": content_type, **headers})


def _told(scene: Scene, options: Options) -> ToldScene:
    lowered = lower(scene, prune=options.prune)

    def prepare(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
        form = forms[RESULT]
        wanted = {"space": form.space, "alpha": form.alpha, "storage": form.storage}
        if options.explain == "map":  # lists are told as of the picture that would be sent
            wanted = {"storage": options.storage or Storage.UINT8}
        return engine.prepare_scene(scene, images=images, **wishes, **wanted)

    shown = scene.output in (Output.PICTURE, Output.LIGHT)
    return ToldScene(lowered.pipeline, scene.names, prepare, lowered.relocated, shown, scene)


def _never(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
    raise AssertionError("a scene whose layers are not known is not rendered")
