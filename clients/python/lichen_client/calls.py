"""Requests as values, and answers read: all that both clients share, without a socket.

How a call becomes a request:

* The image goes as the body. With further images the body is `multipart/form-data`, one part per input name; the
  part `image` stands for the operation's first input.
* An image is an array (sent as NPY, bit for bit), a picture of Pillow's (sent as PNG, which loses nothing of it), the
  bytes of an encoded file, a path to one, or an `Asset` that the service keeps (only its name is sent). As a keyword an
  array of two or more dimensions is an image, and text is always a parameter: name a file with `pathlib.Path`.
* Everything else is a query parameter: numbers and text plain, booleans as true and false, sequences, mappings and
  vectors as JSON. None is left out.
* The method is QUERY (RFC 10008): safe, so anything on the way may repeat it, and yet with a body.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias
from urllib.parse import quote, urlencode, urlsplit

from lichen_client.errors import ConnectionFailed, status_error
from lichen_client.npy import MEDIA_TYPE as NPY
from lichen_client.npy import npy_pieces
from lichen_client.operations import FIRST_INPUTS
from lichen_client.pipeline import Pipeline, document_of
from lichen_client.results import MIXED, Result, Results, is_mixed, parts_of
from lichen_client.retry import Reply, retry_after
from lichen_client.values import as_text

if TYPE_CHECKING:
    import numpy.typing as npt
    from PIL import Image as Pillow

    from lichen_client.scene import Scene

    ImageLike: TypeAlias = (
        "npt.ArrayLike | str | os.PathLike[str] | bytes | bytearray | memoryview | Pillow.Image | Asset | None"
    )

Bytes: TypeAlias = bytes | memoryview
DEFAULT_URL = "http://127.0.0.1:8080"
_FIRST = "image"
_UNTOLD = "application/octet-stream"
"""The service looks at the bytes themselves."""


@dataclass(frozen=True, slots=True)
class Part:
    """One encoded image, in the pieces in which it lies in memory."""

    name: str
    pieces: tuple[Bytes, ...] = field(repr=False)
    media_type: str


@dataclass(frozen=True, slots=True)
class Asset:
    """An image that the service keeps: give it wherever an image is wanted, and only its name is sent."""

    id: str
    width: int = 0
    height: int = 0
    channels: int = 0


@dataclass(frozen=True)
class Call:
    """A request that can be sent any number of times. `target` is path and query, percent-encoded."""

    method: str
    target: str
    parts: tuple[Part, ...] = ()
    accept: str = "application/json"
    further: Mapping[str, str] = field(default_factory=dict)
    """header fields of this call alone"""

    @property
    def headers(self) -> dict[str, str]:
        media_type = self.body[0]
        return {"Accept": self.accept, **({"Content-Type": media_type} if media_type else {}), **self.further}

    @cached_property
    def content(self) -> bytes | None:
        return b"".join(self.body[1]) if self.parts else None

    @cached_property
    def body(self) -> tuple[str, tuple[Bytes, ...]]:
        """Media type and pieces: one image under the name that needs no form as it is, all others as a form."""
        if not self.parts:
            return "", ()
        if len(self.parts) == 1 and self.parts[0].name == _FIRST:
            return self.parts[0].media_type, self.parts[0].pieces
        boundary = os.urandom(16).hex()
        pieces: list[Bytes] = []
        for part in self.parts:
            name = quote(part.name, safe=" !#$&'()*+,/:;<=>?@[]^`{|}~")
            head = (
                f'Content-Disposition: form-data; name="{name}"; filename="{name}"\r\nContent-Type: {part.media_type}'
            )
            pieces += [f"--{boundary}\r\n{head}\r\n\r\n".encode(), *part.pieces, b"\r\n"]
        return f"multipart/form-data; boundary={boundary}", (*pieces, f"--{boundary}--\r\n".encode())


def base_url(given: str | None) -> str:
    """The service's address: what was given, else LICHEN_URL, else this machine. Raises ValueError."""
    url = given or os.environ.get("LICHEN_URL") or DEFAULT_URL
    split = urlsplit(url)
    if split.scheme not in ("http", "https") or not split.hostname or split.query or split.fragment:
        raise ValueError(f"a service's address looks like {DEFAULT_URL} (got {url!r})")
    return url.rstrip("/")


def authorization(key: str | None) -> dict[str, str]:
    """The header field of a key: what was given, else LICHEN_KEY, else none."""
    said = key or os.environ.get("LICHEN_KEY")
    return {"Authorization": f"Bearer {said}"} if said else {}


def run_call(
    operation: str,
    image: Any,
    values: Mapping[str, Any],
    *,
    images: Mapping[str, Any] | None = None,
    format: str | None,
    explain: bool = False,
    accept: str = f"{MIXED}, */*;q=0.9",
) -> Call:
    """The request that runs (or only explains) an operation."""
    found = {name: value for name, value in values.items() if is_image(value)}
    parameters = {name: as_text(value) for name, value in values.items() if name not in found and value is not None}
    given = _together(image, {**(images or {}), **found})
    parts, kept = _sent(given, FIRST_INPUTS.get(operation, _FIRST))
    wanted = {"format": format or "npy"} | ({"explain": "true"} if explain else {})
    query = urlencode({**parameters, **kept, **wanted}, quote_via=quote)
    return Call(
        method="QUERY",
        target=f"/v1/operations/{quote(operation, safe='')}?{query}",
        parts=parts,
        accept="application/json" if explain else accept,
    )


def pipeline_call(
    pipeline: Pipeline | Scene | Mapping[str, Any] | str,
    image: Any,
    images: Mapping[str, Any] | None,
    wishes: Mapping[str, Any],
    *,
    format: str | None,
    explain: bool = False,
    kind: str = "pipeline",
) -> Call:
    """The request that runs (or only explains) a pipeline, or a scene: a form of it and its pictures."""
    sent, kept = _sent(_together(image, images or {}), _FIRST)
    said = document_of(pipeline).encode()
    parts = (Part(kind, (said,), "application/json"), *sent)
    asked = {name: as_text(value) for name, value in wishes.items() if value is not None}
    wanted = {"format": format or "npy"} | ({"explain": "true"} if explain else {})
    query = urlencode({**asked, **kept, **wanted}, quote_via=quote)
    return Call(
        method="QUERY",
        target=f"/v1/{kind}s?{query}",
        parts=parts,
        accept="application/json" if explain else f"{MIXED}, */*;q=0.9",
    )


def scene_call(
    scene: Scene | Mapping[str, Any] | str,
    images: Mapping[str, Any] | None,
    wishes: Mapping[str, Any],
    *,
    format: str | None,
    explain: bool = False,
) -> Call:
    """The request that renders (or only explains) a scene, with the pictures it brings along."""
    said, given = settled(scene, images)
    return pipeline_call(said, None, given, wishes, format=format, explain=explain, kind="scene")


def settled(
    built: Pipeline | Scene | Mapping[str, Any] | str, images: Mapping[str, ImageLike] | None
) -> tuple[str, dict[str, ImageLike]]:
    """A pipeline or a scene as it is now, as the service reads it, and all pictures that are sent along."""
    own = {} if isinstance(built, Mapping | str) else getattr(built, "images", {})
    return document_of(built), {**own, **(images or {})}


def get_call(*path: str) -> Call:
    return _path_call("GET", path)


def delete_call(*path: str) -> Call:
    return _path_call("DELETE", path)


def _path_call(method: str, path: tuple[str, ...]) -> Call:
    return Call(method, "/" + "/".join(quote(part, safe="") for part in path))


def result_call(job: str) -> Call:
    """The request for what a job made."""
    return replace(get_call("v1", "jobs", job, "result"), accept="*/*")


def asset_call(image: Any) -> Call:
    """The request that lets the service keep an image."""
    return Call("PUT", "/v1/assets", (_part(_FIRST, image),))


def as_job(call: Call) -> Call:
    """The same request, to be answered later. Its key makes repeating it safe: the service keeps one job for a key."""
    key = os.urandom(16).hex()
    return replace(call, method="POST", further={"Prefer": "respond-async", "Idempotency-Key": key})


def read_result(reply: Reply) -> Result:
    """The result in an answer. Raises `StatusError`, or `ConnectionFailed` where the body is not what it claims."""
    require_success(reply)
    try:
        result = Result.read(reply)
    except ValueError as broken:
        raise ConnectionFailed(f"the answer cannot be taken apart: {broken}") from broken
    if result.media_type == NPY:
        try:
            result.array  # noqa: B018  (read now, so that a broken body is an error of this call)
        except ValueError as broken:
            raise ConnectionFailed(f"the answer holds no readable array: {broken}") from broken
    return result


def read_any(reply: Reply) -> Result | Results:
    """The result, or the results where there are several, in the answer that a job kept. Raises as `read_result`."""
    names = {headers.get("lichen-output", "") for headers, _ in parts_of(reply)} - {""} if is_mixed(reply) else set()
    return read_results(reply) if len(names) > 1 else read_result(reply)


def read_asset(reply: Reply) -> Asset:
    """What the service keeps. Raises as `read_result`."""
    said = read_json(reply)
    return Asset(str(said["id"]), *(int(said.get(name, 0)) for name in ("width", "height", "channels")))


def read_results(reply: Reply) -> Results:
    """The results in an answer of several parts. Raises as `read_result`."""
    require_success(reply)
    try:
        return Results.read(reply)
    except ValueError as broken:
        raise ConnectionFailed(f"the answer cannot be taken apart: {broken}") from broken


def read_json(reply: Reply) -> dict[str, Any]:
    """The document in an answer. Raises as `read_result`."""
    require_success(reply)
    try:
        document = json.loads(reply.body)
    except ValueError as broken:
        raise ConnectionFailed("the answer is not JSON; is this address a Lichen service?") from broken
    if not isinstance(document, dict):
        raise ConnectionFailed("the answer is not a JSON object; is this address a Lichen service?")
    return document


def require_success(reply: Reply) -> None:
    if not 200 <= reply.status < 300:
        raise status_error(reply.status, reply.headers, bytes(reply.body), retry_after(reply.headers))


def _together(image: Any, further: Mapping[str, Any]) -> dict[str, Any]:
    """All images by name, the first one first."""
    if image is None:
        return dict(further)
    if _FIRST in further:
        raise TypeError("the first image is given twice")
    return {_FIRST: image, **further}


def _sent(images: Mapping[str, Any], first: str) -> tuple[tuple[Part, ...], dict[str, str]]:
    """Images as parts of the body, and those that the service keeps as names in the query. `first` is what the first
    input is called there."""
    kept = {name: value.id for name, value in images.items() if isinstance(value, Asset)}
    parts = tuple(_part(name, value) for name, value in images.items() if name not in kept)
    return parts, {first if name == _FIRST else name: id for name, id in kept.items()}


def is_image(value: Any) -> bool:
    """Whether a keyword's value is an image rather than a parameter. Works without importing NumPy."""
    if isinstance(value, bytes | bytearray | memoryview | os.PathLike | Asset) or _is_pillow(value):
        return True
    if hasattr(value, "__array__") or hasattr(value, "__array_interface__"):
        return int(getattr(value, "ndim", 2)) >= 2
    return False


def _is_pillow(value: Any) -> bool:
    return hasattr(value, "mode") and hasattr(value, "getbands") and hasattr(value, "save")


def _part(name: str, value: Any) -> Part:
    if isinstance(value, bytes | bytearray | memoryview):
        return Part(name, (bytes(value),), _UNTOLD)
    if isinstance(value, str | os.PathLike):
        return Part(name, (Path(value).read_bytes(),), _UNTOLD)
    if _is_pillow(value) and value.mode in _AS_PNG:
        file = io.BytesIO()
        value.save(file, "PNG", compress_level=1, icc_profile=value.info.get("icc_profile"))
        return Part(name, (file.getvalue(),), "image/png")
    return Part(name, npy_pieces(value), NPY)


_AS_PNG = frozenset({"1", "L", "LA", "P", "RGB", "RGBA", "I;16"})
"""Kinds of Pillow's pictures that PNG holds as they are; the others go as arrays."""
