"""`lichen batch tiles IN OUT`: an operation or a pipeline on an image larger than memory, tile by tile."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Any

from lichen_cli.main import Parser, Usage
from lichen_cli.progress import bar
from lichen_cli.sizes import bytes_of

_WISHES = ("max_error", "max_ms", "device", "nonfinite", "space", "alpha", "storage", "prune", "precision")


def main(arguments: Sequence[str]) -> int:
    parser = Parser(
        prog="lichen batch tiles",
        description="Computes an image larger than memory in tiles: TIFF, OpenEXR or Zarr (version 3) in and out.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "input", help="a TIFF or EXR, best in tiles, or a Zarr array; what the pipeline calls input.image"
    )
    parser.add_argument("output", help="a TIFF (.tif) or EXR (.exr), written in tiles, or a Zarr array")
    parser.add_argument("--operation", metavar="NAME")
    parser.add_argument("--pipeline", metavar="TEXT", help="a pipeline of one output")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a parameter, a knob or a wish"
    )
    parser.add_argument("--input", dest="further", action="append", default=[], metavar="NAME=PLACE")
    parser.add_argument("--memory", default="2GiB", metavar="SIZE", help="what the process may hold (2GiB)")
    parser.add_argument("--engine", default="local", metavar="ENGINE", help="local, or a cluster: dask://HOST:PORT")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="tiles at a time (2)")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    given = parser.parse_args(arguments)
    values, further = _pairs(given.set, "set"), _pairs(given.further, "input")
    if (given.operation is None) == (given.pipeline is None):
        raise Usage("name one of --operation and --pipeline")
    if given.workers < 1:
        raise Usage("--workers is at least 1")

    from lichen_batch import tiles

    wishes = {name: values.pop(name) for name in _WISHES if name in values}
    pipeline = _document(given.operation, given.pipeline, values)
    names = _inputs(pipeline)
    if not names:
        raise Usage("this reads no picture")
    inputs = {names[0]: given.input, **further}
    began = time.perf_counter()
    storage = _storage(wishes)
    with bar("tiles", shown=not given.quiet and sys.stderr.isatty()) as tell:
        account = tiles.run(
            pipeline,
            inputs,
            given.output,
            memory=bytes_of(given.memory),
            workers=given.workers,
            storage=storage,
            wishes=wishes,
            engine=given.engine,
            tell=tell,
        )
    print(json.dumps({**account, "seconds": round(time.perf_counter() - began, 3), "peak_bytes": _peak()}))
    return 0


def _pairs(given: Sequence[str], option: str) -> dict[str, str]:
    found = {}
    for each in given:
        name, equals, value = each.partition("=")
        if not name or not equals:
            raise Usage(f"--{option} takes NAME=VALUE (got {each!r})")
        found[name.replace("-", "_") if option == "set" else name] = value
    return found


def _document(operation: str | None, text: str | None, values: dict[str, str]) -> dict[str, Any]:
    """The pipeline as JSON."""
    from lichen.catalogue import operation as named
    from lichen.planning.pipeline import nodes_of, read
    from lichen_batch.checking import document

    if operation is not None:
        chosen = named(operation)
        knobs = {name: values.pop(name) for name in chosen.knobs if name in values}
        method = {"method": values.pop("method")} if "method" in values else {}
        said: Any = {"nodes": {operation: {"operation": operation, "parameters": values, "knobs": knobs, **method}}}
    elif values:
        raise Usage(f"--set {next(iter(values))}: parameters of a pipeline stand in it")
    else:
        said = text
    pipeline = read(said)
    nodes_of(pipeline)
    return document(pipeline, {})


def _inputs(pipeline: dict[str, Any]) -> tuple[str, ...]:
    from lichen.planning.pipeline import read

    return read(pipeline).inputs


def _storage(wishes: dict[str, str]) -> Any:
    from lichen.errors import Flaw, InvalidRequest, nearest
    from lichen.image import Storage

    said = wishes.get("storage")
    if said is not None and said not in list(Storage):
        raise InvalidRequest("The storage is not known.", [Flaw("/storage", nearest(said, list(Storage)))])
    return None if said is None else Storage(said)


def _peak() -> int:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
