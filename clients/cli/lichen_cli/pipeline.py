"""`lichen pipeline TEXT IN OUT`: a graph of operations on files, on the same road as a request to the service.

`lichen run --pipeline TEXT IN OUT` says the same.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_cli import files
from lichen_cli.main import Parser, Usage

if TYPE_CHECKING:
    import lichen
    from lichen.files import Encoded
    from lichen.planning.pipeline import Pipeline
    from lichen_service.formats import Delivery
    from lichen_service.queries import Options

_RESULT = "result"
_EPILOG = """A pipeline is text such as "gaussian:sigma=5|levels:gamma=1.2", JSON, or @FILE that holds either.
IN is the picture it reads as input.image, OUT what comes out of it, if that is one picture; a file called - is standard
input or output."""


def main(arguments: Sequence[str]) -> int:
    import lichen
    from lichen.coding import encode
    from lichen.errors import Flaw, InvalidRequest
    from lichen.planning.pipeline import nodes_of, read
    from lichen_cli import remote
    from lichen_cli.options import joined
    from lichen_service import queries

    parser = build()
    url, rest = remote.taken(_led(arguments))
    given = vars(parser.parse_intermixed_args(joined(rest, parser)))
    text, paths, as_json = given.pop("pipeline"), given.pop("files"), given.pop("json")
    sources, targets = files.named(given.pop("input"), "input"), files.named(given.pop("output"), "output")
    pairs = tuple((name, str(value).lower() if isinstance(value, bool) else value) for name, value in given.items())
    options, _, flaws = queries.read_options(pairs, ())
    pipeline: Pipeline | None = None
    try:
        pipeline = read(Path(text[1:]).read_text() if text.startswith("@") else text)
        nodes_of(pipeline)
    except InvalidRequest as invalid:
        flaws += invalid.flaws
    if flaws or pipeline is None:
        raise InvalidRequest("This pipeline is not valid.", flaws)
    sources, targets = _distributed(pipeline, paths, sources, targets, bare=bool(options.explain))
    missing = [name for name in pipeline.inputs if name not in sources]
    if missing:
        raise InvalidRequest("A picture is missing.", [Flaw(f"/inputs/{name}", "is required") for name in missing])
    if url is not None:
        wishes = {name: value for name, value in pairs if name not in ("explain", "format")}
        ask = remote.Ask(_document(pipeline, targets, options.format), wishes, bool(options.explain), as_json)
        return remote.run_pipeline(url, ask, {name: sources[name] for name in pipeline.inputs}, targets)
    started = time.perf_counter()
    data = {name: files.read(path) for name, path in sources.items()}
    images = files.decoded(data, options.select)
    decoded = time.perf_counter()
    deliveries = _deliveries(pipeline, options, targets, data, images)
    wanted = _delivered(pipeline, deliveries)
    names = ("max_error", "max_ms", "device", "nonfinite", "prune", "precision", "verify")
    wishes = {name: getattr(options, name) for name in names}
    if options.explain:
        files.print_json(lichen.explain_pipeline(wanted, images=images, **wishes).to_json())
        return 0
    results = lichen.run_pipeline(wanted, images=images, **wishes)
    computed = time.perf_counter()
    written = {}
    for name, path in targets.items():
        form = deliveries[name]
        written[name] = encode(results[name].image, form.format.name, storage=form.storage)
        files.write(path, written[name].data)
    first = next(iter(results.values()))
    timing = {"decode": decoded - started, **first.timing, "encode": time.perf_counter() - computed}
    _report(results, timing, targets, written, as_json)
    return 0


def _led(arguments: Sequence[str]) -> list[str]:
    """The command line with the pipeline as an option, where it comes first instead."""
    if arguments and not arguments[0].startswith("-"):
        return [f"--pipeline={arguments[0]}", *arguments[1:]]
    return list(arguments)


def build() -> Parser:
    from lichen_cli.options import add_wishes

    parser = Parser(
        prog="lichen pipeline",
        usage="lichen pipeline TEXT IN OUT [options]",
        description="Runs a graph of operations on image files.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("--pipeline", metavar="TEXT", required=True, help="the pipeline, or @FILE")
    parser.add_argument("files", nargs="*", default=[], help=argparse.SUPPRESS)
    parser.add_argument("--input", action="append", default=[], metavar="NAME=FILE", help="a picture by its name")
    parser.add_argument("--output", action="append", default=[], metavar="NAME=FILE", help="where an output goes")
    add_wishes(parser.add_argument_group("how to compute and to store"), {"method", "findings"})
    parser.add_argument("--json", action="store_true", default=False, help="print the report as JSON")
    parser.add_argument("--url", metavar="URL", help="let a service compute")  # taken off before the rest is read
    return parser


def _document(pipeline: Pipeline, targets: Mapping[str, str], format: str | None) -> dict[str, Any]:
    """The pipeline as a service reads it, with the formats that the names of files say where nothing else does."""

    def said(value: Any) -> dict[str, Any]:
        return {name: each for name, each in dataclasses.asdict(value).items() if each not in (None, {})}

    outputs = {name: said(each) for name, each in pipeline.outputs.items()}
    for name, path in targets.items():
        if "format" not in outputs[name]:
            outputs[name]["format"] = format or (files.format_of(path) if path != "-" else "png")
    return {"nodes": {name: said(step) for name, step in pipeline.steps.items()}, "outputs": outputs}


def _distributed(
    pipeline: Pipeline, paths: Sequence[str], sources: dict[str, str], targets: dict[str, str], *, bare: bool
) -> tuple[dict[str, str], dict[str, str]]:
    """Files by the names of inputs and outputs: what was named, and IN and OUT for what is left."""
    waiting_in = [name for name in pipeline.inputs if name not in sources][:1]
    waiting_out = [name for name in pipeline.outputs if name not in targets]
    unknown = [name for name in targets if name not in pipeline.outputs]
    if unknown:
        raise Usage(f"there is no output {unknown[0]!r}; there are: {', '.join(pipeline.outputs)}")
    places = [*(("in", name) for name in waiting_in), *(("out", name) for name in waiting_out[:1])]
    if len(paths) > len(places):
        raise Usage(f"{paths[len(places)]}: there is nothing left to read or write there")
    for (kind, name), path in zip(places, paths, strict=False):
        (sources if kind == "in" else targets)[name] = path
    left = [name for name in pipeline.outputs if name not in targets]
    if left and not bare:
        raise Usage(f"nobody says where {left[0]!r} goes; name a file, or --output {left[0]}=FILE")
    return sources, {name: targets[name] for name in pipeline.outputs if name in targets}


def _deliveries(
    pipeline: Pipeline,
    options: Options,
    targets: Mapping[str, str],
    data: Mapping[str, bytes],
    images: Mapping[str, Any],
) -> dict[str, Delivery]:
    from lichen.order import read_pipeline_order
    from lichen_service.formats import NOWHERE, Origin, agree

    facts = read_pipeline_order(pipeline, images, {}, "numpy").expected()
    origin = NOWHERE
    for name in pipeline.inputs[:1]:
        image = images[name]
        origin = Origin(files.format_held(data[name]), image.storage, image.space, image.alpha)
    deliveries = {}
    for name, each in pipeline.outputs.items():
        said = {key: value for key in ("format", "storage", "space", "alpha") if (value := getattr(each, key))}
        if "format" not in said and options.format is None and targets.get(name, "-") != "-":
            said["format"] = files.format_of(targets[name])
        deliveries[name] = agree(
            type(options).model_validate({**options.model_dump(), **said}), None, facts[name], origin
        )
    return deliveries


def _delivered(pipeline: Pipeline, deliveries: Mapping[str, Delivery]) -> Pipeline:
    outputs = {
        name: dataclasses.replace(each, storage=form.storage, space=form.space, alpha=form.alpha)
        for name, each in pipeline.outputs.items()
        for form in [deliveries[name]]
    }
    return dataclasses.replace(pipeline, outputs=outputs)


def _report(
    results: Mapping[str, lichen.Result],
    timing: Mapping[str, float],
    targets: Mapping[str, str],
    written: Mapping[str, Encoded],
    as_json: bool,
) -> None:
    first = next(iter(results.values()))
    if as_json:
        outputs = {
            name: {
                "path": targets[name],
                "error": {"value": result.error.value, "kind": result.error.kind, "metric": "max"},
                "measured": dataclasses.asdict(result.measured) if result.measured else None,
                "nonfinite": result.nonfinite,
                **files.picture_of(result, written[name]),
            }
            for name, result in results.items()
        }
        files.print_json(
            {
                "method": first.method,
                "device": first.device,
                "outputs": outputs,
                "findings": first.findings,
                "seconds": timing,
                "decisions": [decision.to_json() for decision in first.decisions],
            }
        )
        return
    for name, result in results.items():
        called = "" if name == _RESULT else f"{name}: "
        files.say(called + result.method, result, timing, written[name])
