"""`lichen run ... --url URL`: the same command line, computed by a service; and what is told of its answers."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lichen_cli import files
from lichen_cli.main import FAILED, INVALID, Usage

if TYPE_CHECKING:
    from lichen_cli.options import Given
    from lichen_client import Client, Result


def taken(arguments: Sequence[str]) -> tuple[str | None, list[str]]:
    """The value of --url, and the command line without it."""
    rest: list[str] = []
    url = None
    tokens = iter(arguments)
    for token in tokens:
        name, equals, value = token.partition("=")
        if name != "--url":
            rest.append(token)
            continue
        url = value if equals else next(tokens, None)
        if not url:
            raise Usage("--url takes the address of a service")
    return url, rest


def run(url: str, operation: str, given: Given) -> int:
    """One operation on files; the result goes where it would go without a service."""
    from lichen_client import Client, LichenClientError

    values: dict[str, Any] = dict(given.values)
    explain = values.pop("explain", "false") == "true"
    if given.json and given.output == "-":
        raise Usage("standard output can hold the picture or, with --json, the report, not both")
    named = given.output not in (None, "-") and "findings" not in values
    format = values.pop("format", None) or (files.format_of(str(given.output)) if named else None)
    began = time.perf_counter()
    images = {name: files.read(path) for name, path in given.inputs.items()}
    try:
        with Client(url) as client:
            if explain:
                files.print_json(client.explain(operation, images=images, format=format, **values))
                return 0
            if given.output is None:
                files.print_json(client.find(operation, images=images, **values))
                return 0
            result = client.run(operation, images=images, format=format or _own(images), **values)
    except LichenClientError as wrong:
        return told(wrong)
    files.write(given.output, result.content)
    _report(result, given, time.perf_counter() - began)
    return 0


@dataclass(frozen=True, slots=True)
class Ask:
    """A pipeline, and what is asked beside it."""

    pipeline: Mapping[str, Any]
    wishes: Mapping[str, Any]
    explain: bool
    json: bool


def run_pipeline(url: str, ask: Ask, sources: Mapping[str, str], targets: Mapping[str, str]) -> int:
    """A pipeline on files, by the names of its inputs and outputs."""
    from lichen_client import Client, LichenClientError

    if ask.json and "-" in targets.values():
        raise Usage("standard output can hold the picture or, with --json, the report, not both")
    began = time.perf_counter()
    images = {name: files.read(path) for name, path in sources.items()}
    try:
        with Client(url) as client:
            if ask.explain:
                files.print_json(client.explain_pipeline(ask.pipeline, images=images, **ask.wishes))
                return 0
            results = client.run_pipeline(ask.pipeline, images=images, **ask.wishes)
    except LichenClientError as wrong:
        return told(wrong)
    for name, path in targets.items():
        files.write(path, results[name].content)
    seconds = time.perf_counter() - began
    if ask.json:
        outputs = {name: account(results[name], path) for name, path in targets.items()}
        files.print_json({"outputs": outputs, "findings": results.findings, "seconds": {"whole": seconds}})
        return 0
    for name in targets:
        say(results[name], seconds, "" if len(targets) == 1 else f"{name}: ")
    return 0


def _own(images: Mapping[str, bytes]) -> str:
    """The format that a result goes to standard output in: that of the first picture."""
    from lichen.files import recognise

    return recognise(next(iter(images.values()))).name if images else "exr"


def _report(result: Result, given: Given, seconds: float) -> None:
    if not given.json:
        say(result, seconds)
        return
    told = account(result, given.output)
    output = {"path": told.pop("path"), "media_type": told.pop("media_type")}
    more = {"findings": result.findings, "seconds": {**result.report.timing, "whole": seconds}}
    files.print_json({**told, **more, "skipped": result.report.skipped, "output": output})


def account(result: Result, path: str | None) -> dict[str, Any]:
    report = result.report
    error = None if report.error is None else {"value": report.error.value, "kind": report.error.kind}
    told = {"method": report.method, "device": report.device, "error": error, "nonfinite": report.nonfinite}
    return {**told, "path": path, "media_type": result.media_type}


def say(result: Result, seconds: float, before: str = "") -> None:
    report = result.report
    stated = f", error at most {report.error.value:.3g} ({report.error.kind})" if report.error else ""
    way = f"({seconds * 1e3:.1f} ms with the way there)"
    print(f"{before}{report.method} on {report.device}{stated} {way}", file=sys.stderr)


def opened(url: str | None) -> Client:
    """A client of the service at an address, or of the one inside this process, which may take its time."""
    from lichen_client import Client

    return Client(local=True, timeout=1e9, retries=0) if url is None else Client(url)


def place(pointer: str) -> str:
    """What a pointer of the service's speaks of, as the command line calls it."""
    name = pointer.rpartition("/")[2]
    return name if "/inputs/" in pointer else "--" + name.replace("_", "-")


def told(wrong: Exception, place: Callable[[str], str] = place) -> int:
    """Prints what the service says against it, as the library would say it; returns the exit status."""
    from lichen_client import StatusError

    if not isinstance(wrong, StatusError):
        print(f"lichen: {wrong}", file=sys.stderr)
        return FAILED
    print(f"lichen: {wrong.detail or wrong.title or wrong}", file=sys.stderr)
    for flaw in wrong.errors:
        print(f"  {place(flaw.pointer)}: {flaw.detail}", file=sys.stderr)
    return INVALID if 400 <= wrong.status < 500 else FAILED
