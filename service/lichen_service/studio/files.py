"""The files of the page, read once. Only what lay in the folder then is ever served: no path of a request becomes one
of the file system."""

from __future__ import annotations

import html
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

import lichen

PAGE = Path(__file__).parent / "page"
INDEX = "index.html"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".jpg": "image/jpeg",
}
"""Media types by suffix; a file with another is not served."""
PREFIX = "/studio"
"""What paths of the page's files begin with."""


@dataclass(frozen=True, slots=True)
class File:
    """One file of the page."""

    data: bytes
    media_type: str


@cache
def files() -> Mapping[str, File]:
    """All files by their path below the folder, such as `lib/dom.js`."""
    found = {
        path.relative_to(PAGE).as_posix(): File(path.read_bytes(), TYPES[path.suffix])
        for path in sorted(PAGE.rglob("*"))
        if path.suffix in TYPES and path.is_file()
    }
    found[INDEX] = File(_index(found), TYPES[".html"])
    return MappingProxyType(found)


def folders() -> tuple[str, ...]:
    """Folders that hold files, relative to the page; the page itself is the empty one."""
    return tuple(sorted({path.rpartition("/")[0] for path in files()}))


def _index(found: Mapping[str, File]) -> bytes:
    """The page with the modules that its first one will ask for, so that a browser fetches them all at once."""
    preloads = [f'<link rel="modulepreload" href="{PREFIX}/{path}">' for path in found if path.endswith(".js")]
    sheets = [f'<link rel="stylesheet" href="{PREFIX}/{path}">' for path in found if path.endswith(".css")]
    text = found[INDEX].data.decode()
    text = text.replace("<!-- modules -->", "\n".join([*sheets, *preloads]))
    return text.replace("<!-- version -->", html.escape(lichen.__version__)).encode()
