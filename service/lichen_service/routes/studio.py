"""The page at `/`, its files, and the pictures that only a page needs.

    GET /                                  the page
    GET /studio/{name}, /studio/lib/{name} ...   its files
    GET /studio/thumbnails/{name}          an operation at a glance
    GET /studio/cases/{name}               a hard case that was run: `gaussian.0.json`, `gaussian.0.result.png`;
                                           all of them, not run: `all.json`
    GET /studio/showcase.json              what operations are first shown with

No key is needed for any of them: they show the same to everybody and take nothing in. What the page asks of the API
needs whatever key the API needs; the page asks its user for it.
"""

from __future__ import annotations

import hashlib
from functools import cache

import lichen
from lichen_service.documents import canonical, document, unchanged
from lichen_service.http.message import Request, Response
from lichen_service.refusals import Refusal
from lichen_service.routes.system import versions
from lichen_service.routing import Route
from lichen_service.studio.cases import examined, listed
from lichen_service.studio.files import INDEX, PREFIX, files, folders
from lichen_service.studio.samples import showcases
from lichen_service.studio.thumbnails import thumbnail

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob: data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)
"""Nothing from elsewhere, and nothing that stands in the page itself, is run."""
_HEADERS = {"Content-Security-Policy": POLICY, "Referrer-Policy": "no-referrer"}


class Studio:
    """The routes of the page."""

    @property
    def routes(self) -> tuple[Route, ...]:
        return (
            Route("/", {"GET": self.index}, scope=None),
            Route(f"{PREFIX}/showcase.json", {"GET": self.showcase}, scope=None),
            Route(f"{PREFIX}/thumbnails/{{name}}", {"GET": self.thumbnail}, scope=None),
            Route(f"{PREFIX}/cases/{{name}}", {"GET": self.case}, scope=None),
            *(self._folder(each) for each in folders()),
        )

    def index(self, request: Request, name: str) -> Response:
        return self._file(request, INDEX)

    def showcase(self, request: Request, name: str) -> Response:
        return document(request.head, _showcases())

    def thumbnail(self, request: Request, name: str) -> Response:
        """Known by its tag before it is made: it changes with the engine alone."""
        tag = _tag("thumbnail", name)
        if unchanged(request.head, tag):
            return Response(304, headers={"ETag": tag, "Cache-Control": "no-cache"})
        headers = {"ETag": tag, "Cache-Control": "no-cache", "Content-Type": "image/png"}
        return Response(200, thumbnail(name), headers)

    def case(self, request: Request, name: str) -> Response:
        if name == "all.json":
            return document(request.head, _cases())
        operation, index, part, form = _parts(name)
        try:
            found = examined(operation, index)
        except IndexError:
            raise _missing() from None
        if (part, form) == ("", "json"):
            return document(request.head, canonical(found.account))
        if form != "png" or part not in found.pictures:
            raise _missing()
        return document(request.head, found.pictures[part], "image/png")

    def _folder(self, folder: str) -> Route:
        start = f"{folder}/" if folder else ""
        return Route(
            f"{PREFIX}/{start}{{name}}", {"GET": lambda request, name: self._file(request, start + name)}, scope=None
        )

    def _file(self, request: Request, path: str) -> Response:
        file = files().get(path)
        if file is None:
            raise _missing()
        response = document(request.head, file.data, file.media_type)
        response.headers |= _HEADERS
        return response


@cache
def _showcases() -> bytes:
    return canonical(showcases())


@cache
def _cases() -> bytes:
    return canonical(listed())


@cache
def _tag(*what: str) -> str:
    said = canonical([*what, lichen.__version__, versions(), hashlib.sha256(_showcases()).hexdigest()])
    return f'"{hashlib.sha256(said).hexdigest()[:32]}"'


def _parts(name: str) -> tuple[str, int, str, str]:
    """`gaussian.2.result.png` as operation, number, part and form."""
    operation, *rest = name.split(".")
    if len(rest) not in (2, 3) or not (rest[0].isascii() and rest[0].isdigit() and len(rest[0]) < 4):
        raise _missing()
    return operation, int(rest[0]), rest[1] if len(rest) == 3 else "", rest[-1]


def _missing() -> Refusal:
    return Refusal(404, "not-found", "There is nothing at this path", "The page has no such file.")
