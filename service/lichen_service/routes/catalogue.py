"""What operations there are, and how each is called."""

from __future__ import annotations

from functools import cache

from lichen import catalogue
from lichen_service.descriptions import description_of, summary_of
from lichen_service.documents import canonical, document
from lichen_service.http.message import Request, Response
from lichen_service.settings import Settings


class Catalogue:
    def __init__(self, settings: Settings) -> None:
        self._settings = settings

    def list(self, request: Request, name: str) -> Response:
        return document(request.head, _list())

    def describe(self, request: Request, name: str) -> Response:
        """Raises `UnknownOperation` with the nearest names."""
        return document(request.head, _description(name, self._settings))


@cache
def _list() -> bytes:
    return canonical({"operations": [summary_of(each) for each in catalogue.operations().values()]})


@cache
def _description(name: str, settings: Settings) -> bytes:
    return canonical(description_of(catalogue.operation(name), settings))
