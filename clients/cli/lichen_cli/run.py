"""`lichen run NAME IN OUT`: one operation on files, on the same road as a request to the service.

The query reader and the choice of a format are the service's own, so a command line and a URL with the same names
give the same bytes and refuse the same mistakes. The picture goes to OUT, the report to standard error as a line or,
with --json, to standard output. Without OUT the findings of an operation that reports some are printed; with --findings
they go to OUT instead of the picture.
"""

from __future__ import annotations

import dataclasses
import importlib
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lichen_cli import files
from lichen_cli.main import Usage

if TYPE_CHECKING:
    import lichen
    from lichen.files import Encoded
    from lichen.image import Image
    from lichen.operation import Operation
    from lichen_cli.options import Given
    from lichen_service.formats import Delivery

_HELP = """usage: lichen run OPERATION IN OUT [options]
       lichen run --pipeline TEXT IN OUT [options]
       lichen run --scene FILE OUT [options]

Runs an operation, a pipeline of them or a scene on files. `lichen operations`
lists the operations, `lichen run OPERATION --help` the options of one. A file
called - is standard input or output. With --url URL a service computes.
"""


def main(arguments: Sequence[str]) -> int:
    for name in ("pipeline", "scene"):
        if any(each == f"--{name}" or each.startswith(f"--{name}=") for each in arguments):
            return int(importlib.import_module(f"lichen_cli.{name}").main(arguments))
    if not arguments or arguments[0].startswith("-"):
        if arguments and arguments[0] not in ("-h", "--help"):
            raise Usage("the name of an operation comes first; see lichen run --help")
        print(_HELP, end="")
        return 0 if arguments else 2
    from lichen.catalogue import operation
    from lichen_cli import options, remote

    url, rest = remote.taken(arguments[1:])
    chosen = operation(arguments[0])
    given = options.read(chosen, rest)
    return _run(chosen, given) if url is None else remote.run(url, chosen.name, given)


def _run(operation: Operation[Any], given: Given) -> int:
    import lichen
    from lichen.coding import encode
    from lichen.errors import Flaw, InvalidRequest
    from lichen.operation import Facts
    from lichen_service import queries
    from lichen_service.formats import NOWHERE, Origin, agree

    query, flaws = queries.read(operation, _with_format(given))
    flaws += [
        Flaw(f"/inputs/{each.name}", "is required")
        for each in operation.inputs
        if each.required and each.name not in given.inputs
    ]
    if flaws:
        raise InvalidRequest(f"This command line for {operation.name} is not valid.", flaws)
    if given.json and given.output == "-":
        raise Usage("standard output can hold the picture or, with --json, the report, not both")
    started = time.perf_counter()
    data = {name: files.read(path) for name, path in given.inputs.items()}
    images = files.decoded(data, query.options.select)
    decoded = time.perf_counter()
    parameters = operation.validate({key: text for key, text in query.values.items() if key not in operation.knobs})
    facts = operation.result(parameters, {name: Facts.of(image) for name, image in images.items()})
    origin = NOWHERE
    for name, image in list(images.items())[:1]:
        origin = Origin(files.format_held(data[name]), image.storage, image.space, image.alpha)
    delivery = agree(query.options, None, facts, origin)
    first, keywords = _arguments(operation, query, images, delivery)
    if query.options.explain:
        files.print_json(lichen.explain(operation.name, first, **keywords).to_json())
        return 0
    result = lichen.run(operation.name, first, **keywords)
    computed = time.perf_counter()
    if query.options.findings is not None and given.output is not None:
        files.write(given.output, files.found(operation, result.findings, query.options.findings))
        return 0
    if given.output is None:  # of an operation that reports something else
        files.print_json(result.findings)
        return 0
    encoded = encode(result.image, delivery.format.name, storage=delivery.storage)
    files.write(given.output, encoded.data)
    timing = {"decode": decoded - started, **result.timing, "encode": time.perf_counter() - computed}
    _report(result, timing, given, encoded)
    return 0


def _with_format(given: Given) -> tuple[tuple[str, str], ...]:
    """The values, with the format that the suffix of the output names where no format is given."""
    if given.output in (None, "-") or any(name in ("format", "findings") for name, _ in given.values):
        return given.values
    return (*given.values, ("format", files.format_of(str(given.output))))


def _arguments(
    operation: Operation[Any], query: Any, images: dict[str, Image], delivery: Delivery
) -> tuple[Image | None, dict[str, Any]]:
    """What the library is called with: the first input, and everything else by name."""
    options = query.options
    further = dict(images)
    first = further.pop(operation.inputs[0].name, None) if operation.inputs else None
    names = ("method", "max_error", "max_ms", "device", "nonfinite", "prune", "precision", "verify")
    wishes = {name: getattr(options, name) for name in names}
    stored = {"space": delivery.space, "alpha": delivery.alpha, "storage": delivery.storage}
    return first, {**query.values, **further, **wishes, **stored}


def _report(result: lichen.Result, timing: dict[str, float], given: Given, encoded: Encoded) -> None:
    if given.json:
        files.print_json(
            {
                "method": result.method,
                "device": result.device,
                "error": {"value": result.error.value, "kind": result.error.kind, "metric": "max"},
                "measured": dataclasses.asdict(result.measured) if result.measured else None,
                "nonfinite": result.nonfinite,
                "findings": result.findings,
                "seconds": timing,
                "decisions": [decision.to_json() for decision in result.decisions],
                "output": {"path": given.output, **files.picture_of(result, encoded)},
            }
        )
        return
    files.say(result.method, result, timing, encoded)
