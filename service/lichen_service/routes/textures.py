"""Named textures: what there is, and the pipeline of one, as POST on /v1/pipelines takes it."""

from __future__ import annotations

from lichen.errors import Flaw, InvalidRequest
from lichen.presets import texture, textures
from lichen_service.documents import canonical, document
from lichen_service.http.message import Request, Response

PATH = "/v1/textures"


class Textures:
    def list(self, request: Request, name: str) -> Response:
        """All of them, each with its summary."""
        listed = [
            {"name": each, "summary": summary, "links": {"self": f"{PATH}/{each}"}}
            for each, summary in textures().items()
        ]
        return document(request.head, canonical({"textures": listed}))

    def one(self, request: Request, name: str) -> Response:
        """One as a pipeline. Raises `UnknownTexture`, `InvalidRequest` naming every bad value of the query."""
        given = dict(request.head.query)
        if len(given) < len(request.head.query):
            names = [key for key, _ in request.head.query]
            twice = sorted({key for key in names if names.count(key) > 1})
            raise InvalidRequest(
                "The query says something twice.", [Flaw(f"/query/{key}", "is given more than once") for key in twice]
            )
        return document(request.head, canonical(texture(name, **given)))
