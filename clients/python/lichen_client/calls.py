"""Requests as values, and answers read: all that both clients share, without a socket.

How a call becomes a request:

* The image goes as the body. With further images the body is `multipart/form-data`, one part per input name; the
  part `image` stands for the operation's first input.
* An image is an array (sent as NPY, bit for bit), the bytes of an encoded file, or a path to one. As a keyword an
  array of two or more dimensions is an image, and text is always a parameter: name a file with `pathlib.Path`.
* Everything else is a query parameter: numbers and text plain, booleans as true and false, sequences, mappings and
  vectors as JSON. None is left out.
* The method is QUERY (RFC 10008): safe, so anything on the way may repeat it, and yet with a body.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlencode, urlsplit

from lichen_client.errors import ConnectionFailed, status_error
from lichen_client.npy import MEDIA_TYPE as NPY
from lichen_client.npy import to_npy
from lichen_client.pipeline import Pipeline, document_of
from lichen_client.results import Result, Results
from lichen_client.retry import Reply, retry_after
from lichen_client.values import as_text

if TYPE_CHECKING:
    import numpy.typing as npt

    ImageLike = npt.ArrayLike | str | os.PathLike[str] | bytes | bytearray | memoryview | None

DEFAULT_URL = "http://127.0.0.1:8080"
_FIRST = "image"
_UNTOLD = "application/octet-stream"
"""The service looks at the bytes themselves."""


@dataclass(frozen=True, slots=True)
class Part:
    """One encoded image."""

    name: str
    content: bytes = field(repr=False)
    media_type: str


@dataclass(frozen=True, slots=True)
class Call:
    """A request that can be sent any number of times. `target` is path and query, percent-encoded."""

    method: str
    target: str
    parts: tuple[Part, ...] = ()
    accept: str = "application/json"

    @property
    def _plain(self) -> bool:
        """Whether the body is one image under the name that needs no form."""
        return len(self.parts) == 1 and self.parts[0].name == _FIRST

    @property
    def headers(self) -> dict[str, str]:
        headers = {"Accept": self.accept}
        if self._plain:
            headers["Content-Type"] = self.parts[0].media_type
        return headers

    @property
    def content(self) -> bytes | None:
        """The body, where it is one image."""
        return self.parts[0].content if self._plain else None

    @property
    def files(self) -> list[tuple[str, tuple[str, bytes, str]]] | None:
        """The parts of a form, where the body is one."""
        if self._plain or not self.parts:
            return None
        return [(part.name, (part.name, part.content, part.media_type)) for part in self.parts]


def base_url(given: str | None) -> str:
    """The service's address: what was given, else LICHEN_URL, else this machine. Raises ValueError."""
    url = given or os.environ.get("LICHEN_URL") or DEFAULT_URL
    split = urlsplit(url)
    if split.scheme not in ("http", "https") or not split.hostname or split.query or split.fragment:
        raise ValueError(f"a service's address looks like {DEFAULT_URL} (got {url!r})")
    return url.rstrip("/")


def run_call(
    operation: str, image: Any, values: Mapping[str, Any], *, format: str | None, explain: bool = False
) -> Call:
    """The request that runs (or only explains) an operation."""
    images = {name: value for name, value in values.items() if _is_image(value)}
    parameters = {name: as_text(value) for name, value in values.items() if name not in images and value is not None}
    if image is not None:
        if _FIRST in images:
            raise TypeError("the first image is given twice")
        images = {_FIRST: image, **images}
    parts = tuple(_part(name, value) for name, value in images.items())
    wanted = {"format": format or "npy"} | ({"explain": "true"} if explain else {})
    return Call(
        method="QUERY",
        target=f"/v1/operations/{quote(operation, safe='')}?{urlencode({**parameters, **wanted}, quote_via=quote)}",
        parts=parts,
        accept="application/json" if explain else "*/*",
    )


def pipeline_call(
    pipeline: Pipeline | Mapping[str, Any] | str,
    image: Any,
    images: Mapping[str, Any] | None,
    wishes: Mapping[str, Any],
    *,
    format: str | None,
    explain: bool = False,
) -> Call:
    """The request that runs (or only explains) a pipeline: a form of the pipeline and its pictures."""
    given = dict(images or {})
    if image is not None:
        if _FIRST in given:
            raise TypeError("the first image is given twice")
        given = {_FIRST: image, **given}
    said = document_of(pipeline).encode()
    parts = (Part("pipeline", said, "application/json"), *(_part(name, value) for name, value in given.items()))
    asked = {name: as_text(value) for name, value in wishes.items() if value is not None}
    wanted = {} if format is None else {"format": format}
    query = urlencode({**asked, **wanted, **({"explain": "true"} if explain else {})}, quote_via=quote)
    return Call(
        method="QUERY",
        target="/v1/pipelines" + (f"?{query}" if query else ""),
        parts=parts,
        accept="application/json" if explain else f"multipart/mixed, {_form_of(format)};q=0.9",
    )


def scene_call(
    scene: Mapping[str, Any] | str,
    images: Mapping[str, Any] | None,
    wishes: Mapping[str, Any],
    *,
    format: str | None,
    explain: bool = False,
) -> Call:
    """The request that renders (or only explains) a scene: a form of the scene and its pictures."""
    said = (scene if isinstance(scene, str) else json.dumps(scene)).encode()
    pictures = (_part(name, value) for name, value in (images or {}).items())
    asked = {name: as_text(value) for name, value in wishes.items() if value is not None}
    wanted = {"format": format or "npy"} | ({"explain": "true"} if explain else {})
    return Call(
        method="QUERY",
        target=f"/v1/scenes?{urlencode({**asked, **wanted}, quote_via=quote)}",
        parts=(Part("scene", said, "application/json"), *pictures),
        accept="application/json" if explain else "*/*",
    )


def _form_of(format: str | None) -> str:
    """What outputs come as where the pipeline does not say: arrays, or the format that was named."""
    return NPY if format is None else "*/*"


def get_call(*path: str) -> Call:
    return Call("GET", "/" + "/".join(quote(part, safe="") for part in path))


def read_result(reply: Reply) -> Result:
    """The result in an answer. Raises `StatusError`, or `ConnectionFailed` where the body is not what it claims."""
    _require_success(reply)
    result = Result.read(reply)
    if result.media_type == NPY:
        try:
            result.array  # noqa: B018  (read now, so that a broken body is an error of this call)
        except ValueError as broken:
            raise ConnectionFailed(f"the answer holds no readable array: {broken}") from broken
    return result


def read_results(reply: Reply) -> Results:
    """The results in an answer of several parts. Raises as `read_result`."""
    _require_success(reply)
    try:
        return Results.read(reply)
    except ValueError as broken:
        raise ConnectionFailed(f"the answer cannot be taken apart: {broken}") from broken


def read_json(reply: Reply) -> dict[str, Any]:
    """The document in an answer. Raises as `read_result`."""
    _require_success(reply)
    try:
        document = json.loads(reply.body)
    except ValueError as broken:
        raise ConnectionFailed("the answer is not JSON; is this address a Lichen service?") from broken
    if not isinstance(document, dict):
        raise ConnectionFailed("the answer is not a JSON object; is this address a Lichen service?")
    return document


def _require_success(reply: Reply) -> None:
    if not 200 <= reply.status < 300:
        raise status_error(reply.status, reply.headers, bytes(reply.body), retry_after(reply.headers))


def _is_image(value: Any) -> bool:
    """Whether a keyword's value is an image rather than a parameter. Works without importing NumPy."""
    if isinstance(value, bytes | bytearray | memoryview | os.PathLike):
        return True
    if hasattr(value, "__array__") or hasattr(value, "__array_interface__"):
        return int(getattr(value, "ndim", 2)) >= 2
    return False


def _part(name: str, value: Any) -> Part:
    if isinstance(value, bytes | bytearray | memoryview):
        return Part(name, bytes(value), _UNTOLD)
    if isinstance(value, str | os.PathLike):
        return Part(name, Path(value).read_bytes(), _UNTOLD)
    return Part(name, to_npy(value), NPY)
