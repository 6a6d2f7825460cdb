"""`lichen scene SCENE OUT`: a picture of a scene, computed here or by a service, with the same bytes.

SCENE is a file of JSON, `-` for standard input; the pictures that it names come from `--input NAME=FILE`. The picture
goes to OUT, the report to standard error as a line or, with --json, to standard output. `lichen run --scene SCENE OUT`
says the same.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lichen_cli import files, remote
from lichen_cli.main import INVALID, Parser, Usage

if TYPE_CHECKING:
    from lichen_client import Result

_EPILOG = """SCENE is JSON: camera, objects or buffers, lights, fog ... (docs/samples/scene.json). A file called - is
standard input or output. The suffix of OUT names its format; standard output gets PNG where no --format is given."""


def main(arguments: Sequence[str]) -> int:
    from lichen_cli.options import joined

    parser = build()
    url, rest = remote.taken(arguments)
    given = vars(parser.parse_intermixed_args(joined(_bare(rest), parser)))
    paths, as_json, mapped = given.pop("files"), given.pop("json"), given.pop("map")
    sources = files.named(given.pop("input"), "input")
    explain = given.pop("explain", False)
    if not paths:
        parser.print_help()
        return INVALID
    scene, output = paths[0], (paths[1] if len(paths) == 2 else None)
    if len(paths) > 2 or (output is None and not explain and not mapped):
        raise Usage("the order is SCENE OUT; pictures that the scene names come from --input NAME=FILE")
    if as_json and output == "-":
        raise Usage("standard output can hold the picture or, with --json, the report, not both")
    format = given.pop("format", None) or ("png" if output in (None, "-") else files.format_of(str(output)))
    began = time.perf_counter()
    said = files.read(scene).decode("utf-8", "replace")
    images = {name: files.read(path) for name, path in sources.items()}
    wishes = {name: str(value).lower() if isinstance(value, bool) else value for name, value in given.items()}
    from lichen_client import LichenClientError

    try:
        with remote.opened(url) as client:
            if explain:
                files.print_json(client.explain_scene(said, images=images, format=format, **wishes))
                return 0
            if mapped:
                wishes["explain"] = "map"
            result = client.render(said, images=images, format=format, **wishes)
    except LichenClientError as wrong:
        return remote.told(wrong, _place)
    if output is not None:
        files.write(output, result.content)
    seconds = time.perf_counter() - began
    if mapped:
        _report_map(result, seconds, as_json=as_json or output is None)
    else:
        _report(result, output, seconds, as_json=as_json)
    return 0


def build() -> Parser:
    from lichen_cli.options import add_wishes

    parser = Parser(
        prog="lichen scene",
        usage="lichen scene SCENE OUT [options]",
        description="Computes the picture of a scene.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("files", nargs="*", default=[], help=argparse.SUPPRESS)
    parser.add_argument(
        "--input", action="append", default=[], metavar="NAME=FILE", help="a picture that the scene names; repeatable"
    )
    lamps = "write the map of the lamps looked at in each tile, instead of the picture; without OUT print it as JSON"
    parser.add_argument("--map", action="store_true", default=False, help=lamps)
    group = parser.add_argument_group("how to compute and to store")
    add_wishes(group, {"method", "explain"})
    group.add_argument("--explain", action="store_true", help="print the plan and compute nothing")
    group.add_argument("--json", action="store_true", default=False, help="print the report as JSON")
    group.add_argument("--url", metavar="URL", help="let a service compute")  # taken off before the rest is read
    return parser


def _bare(arguments: Sequence[str]) -> list[str]:
    """The command line without the name of an option that says what SCENE is."""
    rest: list[str] = []
    for token in arguments:
        name, equals, value = token.partition("=")
        if name != "--scene":
            rest.append(token)
        elif equals:
            rest.append(value)
    return rest


def _place(pointer: str) -> str:
    """/camera/fov is camera fov; /query/max_error is --max-error, and /inputs/sky is sky."""
    kind, _, rest = pointer.lstrip("/").partition("/")
    if kind in ("inputs", "query", "parameters"):
        return remote.place(pointer)
    return " ".join([kind, *rest.split("/")]).strip() or "scene"


def _report(result: Result, output: str | None, seconds: float, *, as_json: bool) -> None:
    if not as_json:
        remote.say(result, seconds)
        return
    report = result.report
    files.print_json(
        {
            **remote.account(result, output),
            "seconds": {**report.timing, "whole": seconds},
            "skipped": report.skipped,
        }
    )


def _report_map(result: Result, seconds: float, *, as_json: bool) -> None:
    found = result.findings
    if as_json:
        files.print_json({**found, "seconds": seconds})
        return
    lamps, tile = ", ".join(found["effects"]), found["tile"]
    print(f"which of {lamps} each {tile} px tile looks at ({seconds * 1e3:.1f} ms)", file=sys.stderr)
