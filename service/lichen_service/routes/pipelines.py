"""POST and QUERY on /v1/pipelines: pictures in, everything that a graph of operations makes of them out.

The pipeline is the query's `pipeline`, as text or as JSON, or the JSON part `pipeline` of a form, or the whole body
where no picture is sent. Pictures are the other parts of the form by their names, the body, called `image`, or stored
ones that the query names.

One output leaves as a picture like any result; several leave as multipart/mixed, each part with a
`Content-Disposition` and a `Lichen-Output` that name it and with the account of its own error. The road is that of
`running`: every flaw is collected, and an entity tag stands for all that decides the bytes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from lichen import engine
from lichen.coding import encode
from lichen.engine import Prepared, Result
from lichen.errors import Flaw, InvalidRequest, nearest
from lichen.files import FORMATS, probe
from lichen.image import Alpha, Image, Space, Storage
from lichen.operation import Facts
from lichen.order import read_pipeline_order
from lichen.planning.pipeline import Pipeline, escaped, nodes_of, read
from lichen.planning.plan import planning_seconds
from lichen_service import mixed, queries, strict_json, uploads
from lichen_service.assets import is_id
from lichen_service.documents import canonical, content_digest, momentary, unchanged
from lichen_service.formats import NOWHERE, Delivery, Origin, agree, readable
from lichen_service.http.message import Head, Request, Response
from lichen_service.memory import reserve
from lichen_service.negotiation import parse_accept, prefers
from lichen_service.queries import Options
from lichen_service.refusals import Refusal, relocated
from lichen_service.reports import report
from lichen_service.routes.running import JSON, Running, Uploads, entity_tag, form_of, wishes_of
from lichen_service.settings import Settings
from lichen_service.stages import Stages

DOCUMENT = "pipeline"
"""The name of the pipeline in the query and among the parts of a form."""
PATH = "/v1/pipelines"
LARGEST = 8 << 20
"""Bytes of a document; tables are the largest part of any."""
OF_ONE = ("Lichen-Error", "Lichen-Nonfinite", "Lichen-Space", "Lichen-Clipped", "Lichen-Measured")
"""What of the account belongs to a single output."""


@dataclass(frozen=True, slots=True)
class Told:
    """A document as it was understood."""

    pipeline: Pipeline
    names: tuple[str, ...]
    """pictures that it may read"""
    prepare: Callable[[Mapping[str, Delivery], Mapping[str, Image], dict[str, Any]], Prepared]
    """the work for these forms, pictures and wishes"""
    relocated: Callable[[Iterable[Flaw]], list[Flaw]] = list
    """flaws of the pipeline, told as its author wrote the document"""
    shown: bool = False
    """whether its results are light, made to be looked at: as display values where a file holds whole numbers"""


class Pipelines:
    document = DOCUMENT
    """the name of the document in the query and among the parts of a form"""

    def __init__(self, settings: Settings, running: Running) -> None:
        self._settings = settings
        self._running = running

    def run(self, request: Request, name: str) -> Response:
        """One run of a pipeline."""
        stages = Stages(request.head, self._settings.request_timeout)
        told, options, given = self._read(request)
        pipeline = told.pipeline
        given = {name: each for name, each in given.items() if name in pipeline.inputs}
        given = self._running.plain(given, options.select)
        digests = self._running.digests(given)
        with stages.stage("decode"):
            images = self._running.decode(given)
        told, images = self._known(told, images, options)
        with relocated():
            deliveries = _deliveries(told, options, request.head, given, images, self._settings)
            wishes = wishes_of(options, self._settings)
            stages.afford(planning_seconds(len(pipeline.steps)))
            with stages.stage("plan"):
                prepared = told.prepare(deliveries, images, wishes)
            if options.explain:
                return self._explained(told, prepared, deliveries, request.head, options, stages)
            reserve(prepared.plan.peak_bytes)
            parts = len(deliveries) > 1 or prefers(request.head.headers.get("accept"), mixed.MIXED)
            forms = [parts, {name: form_of(each) for name, each in deliveries.items()}]
            tag = entity_tag(digests.result(), prepared.plan.digest, forms)
            if not options.verify and unchanged(request.head, tag):
                return Response(304, headers={"ETag": tag, "Cache-Control": "no-cache", "Vary": "Accept"})

            stages.afford(prepared.plan.seconds)

            def compute() -> Response:
                with stages.stage("run"):
                    shared = self._running.shared(digests, options)
                    results = prepared.run(shared=shared, before=stages.go_on, stored=True)
                timing = next(iter(results.values())).timing
                stages.split("run", {name: taken for name, taken in timing.items() if name != "plan"})
                with stages.stage("encode"):
                    response = _answer(self.document, results, deliveries, parts)
                response.headers |= {
                    "Content-Digest": content_digest(response.body),
                    "Cache-Control": "no-cache",
                    "Vary": "Accept",
                    **({} if options.verify else {"ETag": tag}),
                }
                response.log |= {"pixels": sum(each.height * each.width for each in images.values())}
                return response

            return self._running.kept(compute, tag, request.head, stages, keep=not options.verify)

    def check(self, request: Request, name: str) -> None:
        """Raises all that can be seen to be wrong with a run before anything is decoded."""
        self._read(request)

    def _understood(self, said: str | bytes | Mapping[str, Any], options: Options) -> Told:
        """The document. Raises `InvalidRequest` with all that is wrong with it."""
        pipeline = read(said)
        nodes_of(pipeline)
        flaws = _flaws_of_formats(pipeline)
        if flaws:
            raise InvalidRequest(f"The pipeline has {len(flaws)} flaw(s).", flaws)

        def prepare(forms: Mapping[str, Delivery], images: Mapping[str, Image], wishes: dict[str, Any]) -> Prepared:
            return engine.prepare_pipeline(_delivered(pipeline, forms), images=images, **wishes)

        return Told(pipeline, pipeline.inputs, prepare)

    def _known(self, told: Told, images: dict[str, Image], options: Options) -> tuple[Told, dict[str, Image]]:
        """The document and its pictures once these are decoded."""
        return told, images

    def _explained(
        self, told: Told, prepared: Prepared, deliveries: Mapping[str, Delivery], head: Head, options: Options,
        stages: Stages,
    ) -> Response:  # fmt: skip
        """The plan."""
        return _explained(prepared.plan.to_json(), deliveries, stages)

    def _read(self, request: Request) -> tuple[Told, Options, Uploads]:
        """Document, options and uploads. Raises what is wrong with any of them, all of it at once."""
        stored = {name: value for name, value in request.head.query if is_id(value)}
        said = [(name, value) for name, value in request.head.query if not is_id(value)]
        options, values, flaws = queries.read_options(said, (self.document,))
        document, given, wrong = uploads.read_with_document(
            request.head, request.body, self.document, readable(), self._settings.max_images + 1
        )
        flaws += wrong
        kept, missing = self._running.stored(stored)
        flaws += missing
        flaws += [Flaw(f"/inputs/{escaped(each)}", "is given more than once") for each in kept if each in given]
        given |= kept
        if options.method is not None:
            flaws.append(Flaw("/query/method", "is asked of a node: name it there"))
        if options.findings is not None:
            flaws.append(Flaw("/query/findings", "is asked of one operation; Accept: multipart/mixed has those of all"))
        told = None
        if document is not None and self.document in values:
            flaws.append(Flaw(f"/query/{self.document}", "is given in the body, too"))
        elif document is None and self.document not in values:
            flaws.append(Flaw(f"/query/{self.document}", "is required here or as a part of the body"))
        else:
            try:
                told = self._understood(_plain(values[self.document] if document is None else document), options)
                flaws += [
                    Flaw(f"/inputs/{escaped(each)}", f"is read by the {self.document} and was not sent")
                    for each in told.pipeline.inputs
                    if each not in given and each not in stored
                ]
                flaws += [
                    Flaw(f"/inputs/{escaped(each)}", f"is not read; {nearest(each, told.names)}")
                    for each in given
                    if each not in told.names
                ]
            except InvalidRequest as invalid:
                flaws += invalid.flaws
            except Refusal as refused:  # of JSON that two parsers could read differently
                if refused.status != 400:
                    raise
                flaws.append(Flaw(f"/{self.document}", refused.detail))
        if flaws or told is None:
            flaws += self._running.flaws_of_headers(given)
            raise InvalidRequest(f"The request for a {self.document} has {len(flaws)} flaw(s).", flaws)
        return told, options, given


def _flaws_of_formats(pipeline: Pipeline) -> list[Flaw]:
    known = {"format": FORMATS, "storage": list(Storage), "space": list(Space), "alpha": list(Alpha)}
    return [
        Flaw(f"/outputs/{escaped(name)}/{key}", f"{value!r} is not known; {nearest(value, names)}")
        for name, each in pipeline.outputs.items()
        for key, names in known.items()
        if (value := getattr(each, key)) is not None and value not in names
    ]


def _deliveries(
    told: Told, options: Options, head: Head, given: Uploads, images: Mapping[str, Image], settings: Settings
) -> dict[str, Delivery]:
    """How every output leaves. Raises `InvalidRequest` for pictures that an operation does not take."""
    pipeline = told.pipeline
    try:
        facts = read_pipeline_order(pipeline, images, {}, "numpy").expected()
    except InvalidRequest as invalid:
        raise InvalidRequest(invalid.detail, told.relocated(invalid.flaws)) from None
    accept = head.headers.get("accept")
    if len(pipeline.outputs) > 1 and not options.explain:
        _require_parts(accept)
    accept = None if options.explain else mixed.of_the_result(accept)
    origin = NOWHERE
    for name in [each for each in pipeline.inputs if each in given][:1]:
        image = images[name]
        origin = Origin(probe(given[name].data).format, image.storage, image.space, image.alpha)
    deliveries = {}
    for name, each in pipeline.outputs.items():
        said = {key: value for key in _FORMS if (value := getattr(each, key)) is not None}
        mine = Options.model_validate({**options.model_dump(), **said})
        deliveries[name] = (_to_be_seen if told.shown else agree)(mine, accept, facts[name], origin)
    return deliveries


def _to_be_seen(options: Options, accept: str | None, facts: Facts, origin: Origin) -> Delivery:
    """As a display has it, in eight bits, or as light where the format holds floats."""
    facts = dataclasses.replace(facts, space=Space.SRGB)
    made = agree(options, accept, facts, Origin("png", Storage.UINT8, Space.SRGB, Alpha.NONE))
    if options.storage is not None or Storage.FLOAT32 not in made.format.storages:
        return made
    wanted = {**options.model_dump(), "format": made.format.name, "storage": Storage.FLOAT32}
    return agree(Options.model_validate(wanted), accept, facts, Origin("", Storage.FLOAT32, Space.SRGB, Alpha.NONE))


_FORMS = ("format", "storage", "space", "alpha")


def _require_parts(accept: str | None) -> None:
    """Raises the 406 refusal where several outputs cannot leave: they need a body of several parts."""
    ranges = parse_accept(accept or "*/*")
    if any(each.quality > 0 and each.specificity(mixed.MIXED) for each in ranges) or not ranges:
        return
    raise Refusal(
        406,
        "not-acceptable",
        "The result cannot be sent in a format you accept",
        f"A pipeline with several outputs is answered as {mixed.MIXED}.",
        headers={"Vary": "Accept"},
    )


def _delivered(pipeline: Pipeline, deliveries: Mapping[str, Delivery]) -> Pipeline:
    """The pipeline with the forms that were agreed on."""
    outputs = {
        name: dataclasses.replace(each, storage=form.storage, space=form.space, alpha=form.alpha)
        for name, each in pipeline.outputs.items()
        for form in [deliveries[name]]
    }
    return dataclasses.replace(pipeline, outputs=outputs)


def _plain(said: str | bytes) -> str | bytes | Mapping[str, Any]:
    """What a document says where it is JSON; a pipeline's text as it is. Raises as `strict_json.read`."""
    raw = said.encode("utf-8", "replace") if isinstance(said, str) else said
    if raw.lstrip()[:1] != b"{":
        return said
    return cast("Mapping[str, Any]", strict_json.read(raw, LARGEST))


def _answer(document: str, results: Mapping[str, Result], deliveries: Mapping[str, Delivery], parts: bool) -> Response:
    """The picture, or all of them as parts, with findings and maps of errors behind them."""
    first = next(iter(results.values()))
    log: dict[str, object] = {"operation": document, "method_used": first.method, "device": first.device}
    pieces: list[mixed.Part] = []
    maps: list[mixed.Part] = []
    common: dict[str, str] = {}
    for name, result in results.items():
        form = deliveries[name]
        encoded = encode(result.image, form.format.name, storage=form.storage)
        account = report(result, form.storage, encoded)
        if not parts:
            return Response(200, encoded.data, {"Content-Type": encoded.media_type, **account}, log)
        named = {
            "Content-Disposition": f'attachment; filename="{name}.{form.format.name}"',
            "Lichen-Output": name,
        }
        own = {key: account[key] for key in OF_ONE if key in account}
        pieces.append(({"Content-Type": encoded.media_type, **named, **own}, encoded.data))
        common |= {key: value for key, value in account.items() if key not in OF_ONE}
        if result.verification is not None and result.verification.map is not None:
            errors, scale = mixed.error_map(result.verification.map, form.format.name)
            maps.append(({"Content-Type": errors.media_type, "Lichen-Map": scale, "Lichen-Output": name}, errors.data))
    if first.findings:
        pieces.append(({"Content-Type": JSON}, canonical(first.findings)))
    content_type, body = mixed.join([*pieces, *maps])
    return Response(200, body, {"Content-Type": content_type, **common}, log)


def _explained(plan: Mapping[str, Any], deliveries: Mapping[str, Delivery], stages: Stages) -> Response:
    outputs = {
        name: {**each, "format": deliveries[name].format.name, "storage": deliveries[name].storage}
        for name, each in plan["outputs"].items()
    }
    response = momentary(200, {**plan, "outputs": outputs})
    response.headers |= {"Server-Timing": stages.header(), "Vary": "Accept"}
    return response
