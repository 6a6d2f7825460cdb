"""POST, QUERY and GET on an operation: images in, its result out, with an account of how it was made.

GET runs an operation where the query names all images it needs among the stored ones, or it needs none and the query
asks for something; otherwise it describes the operation. An
operation that reports findings gives them as JSON where `Accept` prefers that, and beside the picture in a form of
several parts.

The road of a request: query and body are read and every flaw is collected; images are decoded within the limits; a
format is agreed on; the engine runs; the result is encoded. Each step is timed, and none begins after the deadline.
An entity tag stands for all that decides the bytes of the answer, so a request that names it is answered
without computing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from enum import StrEnum
from typing import Any, TypeVar

from lichen import catalogue, engine
from lichen.coding import encode
from lichen.engine import Result
from lichen.errors import Flaw, InvalidRequest, LichenError
from lichen.files import FORMATS, Encoded, Limits, probe, recognise, selection
from lichen.image import Image
from lichen.operation import Facts, Operation
from lichen.order import Nonfinite, read_order
from lichen.planning.pipeline import INPUT
from lichen.sharing import Shared, Sharing
from lichen_service import mixed, queries, uploads
from lichen_service.addresses import canonical_of, link_to
from lichen_service.assets import Assets
from lichen_service.cache import Answers
from lichen_service.decoding.pool import Decoders
from lichen_service.documents import canonical, content_digest, momentary, unchanged
from lichen_service.formats import NOWHERE, Delivery, Origin, agree, readable
from lichen_service.http.message import Body, Head, Request, Response
from lichen_service.memory import reserve, to_decode, to_run
from lichen_service.negotiation import prefers
from lichen_service.queries import Options, Query
from lichen_service.refusals import relocated
from lichen_service.reports import SKIPPING, report, table_of
from lichen_service.routes.assets import resolve
from lichen_service.routes.system import versions
from lichen_service.settings import Settings
from lichen_service.stages import Stages
from lichen_service.uploads import Upload

Uploads = Mapping[str, Upload]
Made = TypeVar("Made")
JSON = "application/json"


class Running:
    def __init__(self, settings: Settings, assets: Assets, decoders: Decoders, answers: Answers) -> None:
        self._settings = settings
        self._decoders = decoders
        self._assets = assets
        self._answers = answers
        self._limits = Limits(
            pixels=settings.max_pixels,
            side=settings.max_side,
            channels=settings.max_channels,
            bytes=settings.max_decoded,
        )
        self._sharing = Sharing()
        # Hashing releases the interpreter, so the digests of large inputs are found while their pixels are computed.
        self._hashing = ThreadPoolExecutor(settings.threads, thread_name_prefix="hash")

    def run(self, request: Request, name: str) -> Response:
        """One run of the operation `name`."""
        stages = Stages(request.head, self._settings.request_timeout)
        operation = catalogue.operation(name)
        query, given = self._read(operation, request)
        given = self.plain(given, query.options.select)
        digests = self.digests(given)
        with stages.stage("decode"):
            images = self.decode(given)
        with relocated():
            facts = _expected(operation, query, images)
            reserve(to_run(facts))
            accept, origin = request.head.headers.get("accept"), _origin(operation, given, images)
            shape = _shape(operation, query, accept)
            if query.options.findings is not None:
                accept = None
            elif shape is not Shape.PICTURE:
                accept = mixed.of_the_result(accept) if shape is Shape.PARTS else None
            delivery = agree(query.options, accept, facts, origin)
            response = self._answer(request, operation, query, images, delivery, shape, digests, stages)
        if request.head.method in ("GET", "HEAD"):  # the address is all there is of the request
            response.headers |= link_to(canonical_of(operation, query))
        if (seed := operation.parameters.model_fields.get("seed")) is not None:
            response.headers["Lichen-Seed"] = str(query.values.get("seed", seed.default))
        return response

    def check(self, request: Request, name: str) -> None:
        """Raises all that can be seen to be wrong with a run before anything is decoded."""
        self._read(catalogue.operation(name), request)

    def _answer(
        self,
        request: Request,
        operation: Operation[Any],
        query: Query,
        images: Mapping[str, Image],
        delivery: Delivery,
        shape: Shape,
        digests: Future[dict[str, str]],
        stages: Stages,
    ) -> Response:
        head, options = request.head, query.options
        first, arguments = _arguments(operation, query, images, delivery, self._settings)
        with stages.stage("plan"):
            prepared = engine.prepare(operation.name, first, **arguments)
        if options.explain:
            return _plan_document(prepared.plan.to_json(), delivery, stages)
        tag = entity_tag(digests.result(), prepared.plan.digest, [form_of(delivery), shape])
        if not options.verify and unchanged(head, tag):
            return Response(304, headers={"ETag": tag, "Cache-Control": "no-cache", "Vary": "Accept"})
        stages.afford(prepared.plan.seconds)

        def compute() -> Response:
            with stages.stage("run"):
                made = prepared.run(shared=self.shared(digests, options), before=stages.go_on, stored=True)
                (result,) = made.values()
            stages.split("run", {name: taken for name, taken in result.timing.items() if name != "plan"})
            with stages.stage("encode"):
                encoded = None
                if shape in (Shape.PICTURE, Shape.PARTS):
                    encoded = encode(result.image, delivery.format.name, storage=delivery.storage)
                content_type, body = _body(operation, result, encoded, delivery, shape)
            with stages.stage("digest"):
                headers = {
                    "Content-Type": content_type,
                    "Content-Digest": content_digest(body),
                    # Without a tag where the measurement is what was asked for: an answer of 304 would hold none.
                    **({} if options.verify else {"ETag": tag}),
                    "Cache-Control": "no-cache",
                    "Vary": "Accept",
                    **report(result, delivery.storage, encoded),
                }
            return Response(200, body, headers, _log(operation, images, result))

        return self.kept(compute, tag, head, stages, keep=not options.verify)

    def kept(
        self, compute: Callable[[], Response], tag: str, head: Head, stages: Stages, *, keep: bool = True
    ) -> Response:
        """The answer with this tag: one that was kept, or what `compute` gives. Its timing is that of this request."""
        response, found = self._answers.answer(tag, compute, head.deadline) if keep else (compute(), False)
        response.headers["Server-Timing"] = stages.header()
        response.log |= {"kept": found, "stages_ms": {name: round(s * 1e3, 3) for name, s in stages.seconds.items()}}
        return response

    def stored(self, named: Mapping[str, str]) -> tuple[dict[str, Upload], list[Flaw]]:
        """The stored images of these names, by input, and what is wrong with the names."""
        return resolve(self._assets, named)

    def digests(self, given: Uploads) -> Future[dict[str, str]]:
        """SHA-256 of all uploads by name, found in the background."""
        return self._hashing.submit(_digests, given)

    def shared(self, digests: Future[dict[str, str]], options: Options) -> Shared | None:
        """How a run takes over steps that another is at work on; none of those of pictures that are repaired first."""
        if not self._settings.cache or options.nonfinite is not Nonfinite.PROPAGATE:
            return None
        return Shared(self._sharing, {INPUT + name: each for name, each in digests.result().items()})

    def _read(self, operation: Operation[Any], request: Request) -> tuple[Query, Uploads]:
        """The query and the uploads. Raises what is wrong with either, all of it at once."""
        query, flaws = queries.read(operation, request.head.query)
        names = [each.name for each in operation.inputs]
        given, wrong = uploads.read(request.head, request.body, names, readable(), self._settings.max_images)
        flaws += wrong
        stored, missing = resolve(self._assets, query.assets)
        flaws += missing
        flaws += [Flaw(f"/inputs/{each}", "is given more than once") for each in stored if each in given]
        given |= stored
        flaws += [
            Flaw(f"/inputs/{each.name}", "is required and was not sent")
            for each in operation.inputs
            if each.required and each.name not in given and each.name not in query.assets
        ]
        if flaws:
            flaws += self.flaws_of_headers(given)
            raise InvalidRequest(f"The request for {operation.name} has {len(flaws)} flaw(s).", flaws)
        return query, given

    def flaws_of_headers(self, given: Uploads) -> list[Flaw]:
        """What the headers of images alone show to be wrong; nothing is decoded for a request that fails anyway."""
        flaws: list[Flaw] = []
        for name, upload in given.items():
            try:
                if not recognise(upload.data).selects:
                    probe(upload.data).check(self._limits)
            except LichenError as error:
                flaws += _flaws_of(name, error)
        return flaws

    def plain(self, given: Uploads, select: str) -> Uploads:
        """The uploads, of files of data what is selected as NPY. Raises as `decode`, but leaves to it what is no file
        of data, and `InvalidRequest` for a selection from none."""

        def made(name: str, upload: Upload) -> Upload:
            try:
                if not recognise(upload.data).selects:
                    return upload
            except LichenError:
                return upload
            part = selection.for_input(select, name, list(given))
            data = self._decoders.plain(upload.data, media_type=upload.media_type, select=part)
            return upload if data is upload.data else Upload(data, None)

        plain = _of_each(given, made)
        if select and all(plain[name] is given[name] for name in given):
            raise InvalidRequest(
                "There is nothing to select from.", [Flaw("/query/select", "no input is a file of data")]
            )
        return plain

    def decode(self, given: Uploads) -> dict[str, Image]:
        """All images. Raises the first error with a pointer to every image that has one."""

        def decoded(name: str, upload: Upload) -> Image:
            header = probe(upload.data)
            header.check(self._limits)
            reserve(to_decode(header))
            return self._decoders.decode(upload.data, limits=self._limits, media_type=upload.media_type)

        return _of_each(given, decoded)


def _of_each(given: Uploads, make: Callable[[str, Upload], Made]) -> dict[str, Made]:
    """What is made of each. Raises the first error with a pointer to every image that has one."""
    made: dict[str, Made] = {}
    failed: dict[str, LichenError] = {}
    for name, upload in given.items():
        try:
            made[name] = make(name, upload)
        except LichenError as error:
            failed[name] = error
    if failed:
        first = next(iter(failed.values()))
        flaws = [flaw for name, error in failed.items() for flaw in _flaws_of(name, error)]
        raise type(first)(first.detail, flaws, limit=first.limit, actual=first.actual)
    return made


def _flaws_of(name: str, error: LichenError) -> list[Flaw]:
    """What is wrong with an image, as flaws of the input `name`."""
    pointer = f"/inputs/{name}"
    if isinstance(error, InvalidRequest):  # of what was asked of a good file
        return list(error.flaws)
    below = [Flaw(pointer + flaw.pointer.removeprefix("/image"), flaw.detail) for flaw in error.flaws]
    return below or [Flaw(pointer, error.detail)]


def _origin(operation: Operation[Any], given: Uploads, images: Mapping[str, Image]) -> Origin:
    """The first input that was sent, as far as the choice of a format goes."""
    name = next((each.name for each in operation.inputs if each.name in images), None)
    if name is None:
        return NOWHERE
    image = images[name]
    return Origin(probe(given[name].data).format, image.storage, image.space, image.alpha)


def _expected(operation: Operation[Any], query: Query, images: Mapping[str, Image]) -> Facts:
    """Size, channels, space and alpha of the result. No pixel is looked at, so its extent means nothing.

    Raises `InvalidRequest` for images that the operation does not take.
    """
    (facts,) = read_order(operation.name, None, {**query.values, **images}, "numpy").expected().values()
    return facts


def _arguments(
    operation: Operation[Any], query: Query, images: Mapping[str, Image], delivery: Delivery, settings: Settings
) -> tuple[Image | None, dict[str, Any]]:
    """What the library is called with: the first input, and everything else by name."""
    options = query.options
    name = operation.inputs[0].name if operation.inputs else ""
    return images.get(name), {
        **query.values,
        **{key: image for key, image in images.items() if key != name},
        "method": options.method,
        **wishes_of(options, settings),
        "space": delivery.space,
        "alpha": delivery.alpha,
        "storage": delivery.storage,
    }


def wishes_of(options: Options, settings: Settings) -> dict[str, Any]:
    """What the library is asked beside operations, pictures and the form of what comes out."""
    names = ("max_error", "max_ms", "device", "nonfinite", "prune", "precision", "verify")
    return {name: getattr(options, name) for name in names} | {"max_bytes": settings.memory}


class Shape(StrEnum):
    """What an answer consists of."""

    PICTURE = "picture"
    FINDINGS = "findings"
    TABLE = "table"
    PARTS = "parts"


def _shape(operation: Operation[Any], query: Query, accept: str | None) -> Shape:
    if query.options.explain:
        return Shape.PICTURE
    if query.options.findings is not None:
        return Shape.TABLE if query.options.findings == "npy" else Shape.FINDINGS
    if (operation.finds or query.options.verify) and prefers(accept, mixed.MIXED):
        return Shape.PARTS
    return Shape.FINDINGS if operation.finds and prefers(accept, JSON) else Shape.PICTURE


def _body(
    operation: Operation[Any], result: Result, encoded: Encoded | None, delivery: Delivery, shape: Shape
) -> tuple[str, Body]:
    """Content type and body: the picture, the findings, or both and, where anything was measured, the map."""
    if shape is Shape.TABLE:
        return FORMATS["npy"].media_type, table_of(operation, result.findings)
    if encoded is None:
        return JSON, canonical(result.findings)
    if shape is Shape.PICTURE:
        return encoded.media_type, encoded.data
    parts: list[mixed.Part] = [({"Content-Type": encoded.media_type}, encoded.data)]
    if result.findings:
        parts.append(({"Content-Type": JSON}, canonical(result.findings)))
    if result.verification is not None and result.verification.map is not None:
        errors, scale = mixed.error_map(result.verification.map, delivery.format.name)
        parts.append(({"Content-Type": errors.media_type, "Lichen-Map": scale}, errors.data))
    return mixed.join(parts)


def _plan_document(plan: Mapping[str, Any], delivery: Delivery, stages: Stages) -> Response:
    response = momentary(200, {**plan, "format": delivery.format.name, "storage": delivery.storage})
    response.headers |= {"Server-Timing": stages.header(), "Vary": "Accept"}
    return response


def _digests(given: Uploads) -> dict[str, str]:
    return {name: hashlib.sha256(upload.data).hexdigest() for name, upload in given.items()}


def form_of(delivery: Delivery) -> list[str | None]:
    """All of a delivery that decides bytes."""
    return [delivery.format.name, delivery.storage, delivery.space, delivery.alpha]


def entity_tag(digests: Mapping[str, str], plan: str, form: object) -> str:
    """Stands for all that decides the bytes of an answer: inputs, plan, engine, libraries, device and format."""
    return f'"{hashlib.sha256(canonical([digests, plan, form, versions()])).hexdigest()[:32]}"'


def _log(operation: Operation[Any], images: Mapping[str, Image], result: Result) -> dict[str, object]:
    return {
        "operation": operation.name,
        "pixels": sum(image.height * image.width for image in images.values()),
        "method_used": result.method,
        "device": result.device,
        "skipped": sum(each.action in SKIPPING for each in result.decisions),
    }
