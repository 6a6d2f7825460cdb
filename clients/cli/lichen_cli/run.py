"""`lichen run NAME IN OUT`: one operation on files, on the same road as a request to the service.

The query reader and the choice of a format are the service's own, so a command line and a URL with the same names
give the same bytes and refuse the same mistakes. The picture goes to OUT, the report to standard error as a line or,
with --json, to standard output. Without OUT the findings of an operation that reports some are printed.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_cli.main import Usage

if TYPE_CHECKING:
    import lichen
    from lichen.files import Encoded
    from lichen.image import Image
    from lichen.operation import Operation
    from lichen_cli.options import Given
    from lichen_service.formats import Delivery

_HELP = """usage: lichen run OPERATION IN OUT [options]

Runs an operation on an image file. `lichen operations` lists the operations,
`lichen run OPERATION --help` the options of one. A file called - is standard
input or output.
"""


def main(arguments: Sequence[str]) -> int:
    if not arguments or arguments[0].startswith("-"):
        if arguments and arguments[0] not in ("-h", "--help"):
            raise Usage("the name of an operation comes first; see lichen run --help")
        print(_HELP, end="")
        return 0 if arguments else 2
    from lichen.catalogue import operation
    from lichen_cli import options

    chosen = operation(arguments[0])
    return _run(chosen, options.read(chosen, arguments[1:]))


def _run(operation: Operation[Any], given: Given) -> int:
    import lichen
    from lichen.errors import Flaw, InvalidRequest
    from lichen.files import decode, encode, probe
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
    data = {name: _read(path) for name, path in given.inputs.items()}
    images = {name: decode(each) for name, each in data.items()}
    decoded = time.perf_counter()
    parameters = operation.validate({key: text for key, text in query.values.items() if key not in operation.knobs})
    facts = operation.result(parameters, {name: Facts.of(image) for name, image in images.items()})
    origin = NOWHERE
    for name, image in list(images.items())[:1]:
        origin = Origin(probe(data[name]).format, image.storage, image.space, image.alpha)
    delivery = agree(query.options, None, facts, origin)
    first, keywords = _arguments(operation, query, images, delivery)
    if query.options.explain:
        _print_json(lichen.explain(operation.name, first, **keywords).to_json())
        return 0
    result = lichen.run(operation.name, first, **keywords)
    computed = time.perf_counter()
    if given.output is None:  # of an operation that reports something else
        _print_json(result.findings)
        return 0
    encoded = encode(result.image, delivery.format.name, storage=delivery.storage)
    _write(given.output, encoded.data)
    timing = {"decode": decoded - started, **result.timing, "encode": time.perf_counter() - computed}
    _report(result, timing, given, encoded)
    return 0


def _with_format(given: Given) -> tuple[tuple[str, str], ...]:
    """The values, with the format that the suffix of the output names where no format is given."""
    from lichen.errors import LichenError
    from lichen.files import format_for_path

    if given.output in (None, "-") or any(name == "format" for name, _ in given.values):
        return given.values
    try:
        found = format_for_path(str(given.output))
    except LichenError:
        found = None
    if found is None:
        raise Usage(f"{given.output}: the suffix names no format; give one with --format")
    return (*given.values, ("format", found.name))


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


def _read(path: str) -> bytes:
    return sys.stdin.buffer.read() if path == "-" else Path(path).read_bytes()


def _write(path: str, data: bytes) -> None:
    """The whole file or none of it."""
    if path == "-":
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    target = Path(path)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


def _report(result: lichen.Result, timing: dict[str, float], given: Given, encoded: Encoded) -> None:
    if given.json:
        _print_json(
            {
                "method": result.method,
                "device": result.device,
                "error": {"value": result.error.value, "kind": result.error.kind, "metric": "max"},
                "measured": dataclasses.asdict(result.measured) if result.measured else None,
                "nonfinite": result.nonfinite,
                "findings": result.findings,
                "seconds": timing,
                "decisions": [decision.to_json() for decision in result.decisions],
                "output": {
                    "path": given.output,
                    "media_type": encoded.media_type,
                    "clipped": encoded.clipped,
                    "width": result.image.width,
                    "height": result.image.height,
                    "channels": result.image.channels,
                },
            }
        )
        return
    stages = ", ".join(f"{name} {seconds * 1e3:.1f} ms" for name, seconds in timing.items() if "." not in name)
    spoilt = f", {result.nonfinite} values are not finite" if result.nonfinite else ""
    spoilt += f", {encoded.clipped} values were clipped" if encoded.clipped else ""
    print(
        f"{result.method} on {result.device}, error at most {result.error}{_measured(result)}{spoilt} ({stages})",
        file=sys.stderr,
    )


def _measured(result: lichen.Result) -> str:
    """What was found where the result was to be verified."""
    if result.verification is None:
        return ""
    found = result.measured
    if found is None:
        return f", not measured: {result.verification.reason}"
    share = "" if found.sampled == 1 else f" on {found.sampled:.2g} of the pixels"
    return f", measured {found.largest:.3g}{share}"


def _print_json(value: Any) -> None:
    from lichen_service.documents import plain

    print(json.dumps(plain(value), indent=2, ensure_ascii=False))
