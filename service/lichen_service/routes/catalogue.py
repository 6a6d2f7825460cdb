"""What operations there are, and how each is called."""

from __future__ import annotations

from functools import cache

from lichen import catalogue
from lichen_service.descriptions import description_of, summary_of
from lichen_service.documents import Shelf, canonical
from lichen_service.http.message import Request, Response
from lichen_service.settings import Settings


class Catalogue:
    def __init__(self, settings: Settings, shelf: Shelf) -> None:
        self._settings = settings
        self._shelf = shelf

    def list(self, request: Request, name: str) -> Response:
        return self._shelf.answer(request.head, _list)

    def describe(self, request: Request, name: str) -> Response:
        """Raises `UnknownOperation` with the nearest names."""
        operation = catalogue.operation(name)
        return self._shelf.answer(request.head, lambda: canonical(description_of(operation, self._settings)))


@cache
def _list() -> bytes:
    return canonical({"operations": [summary_of(each) for each in catalogue.operations().values()]})
