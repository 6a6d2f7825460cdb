"""PUT /v1/assets, and GET, HEAD and DELETE on /v1/assets/{id}: inputs that are sent once and named often.

An asset is an image, or a file of data, in a format that is read here, kept as it came. Its name, `sha256:` and the
digest of its bytes, stands for it in the query of a run (`image=sha256:...`); whoever knows the name may use it.
"""

from __future__ import annotations

from collections.abc import Mapping

from lichen.errors import Flaw
from lichen.files import probe, recognise
from lichen_service.access.guard import Caller
from lichen_service.assets import Assets, Full, InUse, is_id
from lichen_service.documents import content_digest, momentary
from lichen_service.http.message import Request, Response
from lichen_service.logs import log
from lichen_service.negotiation import media_type_of
from lichen_service.refusals import RETRY_AFTER, Refusal
from lichen_service.stored import respond
from lichen_service.uploads import UNTOLD, Upload

PATH = "/v1/assets"


class AssetRoutes:
    def __init__(self, assets: Assets) -> None:
        self._assets = assets

    def put(self, request: Request, name: str) -> Response:
        """Stores the body: 201 where it is new, 200 where it was there."""
        media_type = media_type_of(request.head.headers.get("content-type", ""))
        claimed = None if media_type in UNTOLD else media_type
        format = recognise(request.body, media_type=claimed)
        header = None if format.selects else probe(request.body, media_type=claimed)
        said = request.head.headers.get("content-digest")
        if said is not None and "sha-256=" in said and said.strip() != content_digest(request.body):
            raise Refusal(400, "digest-mismatch", "The body is not what it was", "Content-Digest names other bytes.")
        size = memoryview(request.body).nbytes
        quota = request.caller.asset_bytes if isinstance(request.caller, Caller) else 0
        largest = min(quota or self._assets.capacity, self._assets.capacity)
        if size > largest:
            raise _too_large(largest, size)
        try:
            stored, new = self._assets.put(request.body)
        except Full:
            raise _no_room("Everything that is stored is in use.") from None
        except OSError as failure:
            log.error("an asset could not be kept", reason=str(failure))
            raise _no_room("It could not be written to the disk.") from None
        body = {
            "id": stored,
            "bytes": size,
            "media_type": format.media_type,
        }
        if header is not None:  # of data: it has many sizes
            body |= {"width": header.width, "height": header.height, "channels": header.channels}
        response = momentary(201 if new else 200, body)
        response.headers["Location"] = f"{PATH}/{stored}"
        response.log = {"asset": stored}
        return response

    def get(self, request: Request, name: str) -> Response:
        data = self._read(name)
        headers = {"Cache-Control": "private, max-age=31536000, immutable"}
        return respond(request.head, data, recognise(data).media_type, f'"{name}"', headers)

    def delete(self, request: Request, name: str) -> Response:
        try:
            if not is_id(name) or not self._assets.delete(name):
                raise _missing(name)
        except InUse:
            raise Refusal(
                409,
                "in-use",
                "The asset is in use",
                "A request or a job works with it; it can be deleted afterwards.",
                headers={"Retry-After": RETRY_AFTER},
                retryable=True,
            ) from None
        return Response(204)

    def _read(self, name: str) -> bytes:
        data = self._assets.read(name) if is_id(name) else None
        if data is None:
            raise _missing(name)
        return data


def resolve(assets: Assets, named: Mapping[str, str]) -> tuple[dict[str, Upload], list[Flaw]]:
    """The assets that a query names, by input, and what is wrong with the names."""
    found: dict[str, Upload] = {}
    flaws = []
    for name, each in named.items():
        data = assets.read(each)
        if data is None:
            flaws.append(Flaw(f"/inputs/{name}", f"there is no asset {each}"))
        else:
            found[name] = Upload(data, None)
    return found, flaws


def _missing(name: str) -> Refusal:
    detail = "Nothing is stored under this name." if is_id(name) else "An asset is named sha256: and 64 digits."
    return Refusal(404, "unknown-asset", "There is no such asset", detail)


def _too_large(limit: int, actual: int) -> Refusal:
    title = "A limit on size was crossed"
    return Refusal(413, "too-large", title, "The asset is larger than you may store.", limit=limit, actual=actual)


def _no_room(detail: str) -> Refusal:
    return Refusal(507, "no-room", "There is no room for the asset", detail, retryable=True)
