"""What runs on files share: reading and writing them, their formats, and the account of a result."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_cli.main import Usage

if TYPE_CHECKING:
    import lichen
    from lichen.files import Data, Encoded
    from lichen.image import Image
    from lichen.operation import Operation


def read(path: str) -> bytes:
    return sys.stdin.buffer.read() if path == "-" else Path(path).read_bytes()


def write(path: str, data: Data) -> None:
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


def named(given: Sequence[str], option: str) -> dict[str, str]:
    """Files by the names that an option gives them: NAME=FILE."""
    found = {}
    for each in given:
        name, equals, path = each.partition("=")
        if not equals or not name or not path:
            raise Usage(f"--{option} takes NAME=FILE (got {each!r})")
        found[name] = path
    return found


def format_of(path: str) -> str:
    """The name of the format that a suffix stands for."""
    from lichen.errors import LichenError
    from lichen.files import format_for_path

    try:
        found = format_for_path(path)
    except LichenError:
        found = None
    if found is None:
        raise Usage(f"{path}: the suffix names no format; give one with --format")
    return found.name


def decoded(data: Mapping[str, bytes], select: str) -> dict[str, Image]:
    """The images of files by their names, and of those of data what is selected."""
    from lichen.coding import decode
    from lichen.errors import Flaw, InvalidRequest
    from lichen.files import recognise, selection

    if select and not any(recognise(each).selects for each in data.values()):
        raise InvalidRequest("There is nothing to select from.", [Flaw("/query/select", "no input is a file of data")])
    return {name: decode(each, select=selection.for_input(select, name, list(data))) for name, each in data.items()}


def format_held(data: bytes) -> str:
    """The name of a file's format, or of the one that its numbers could be written in."""
    from lichen.files import FORMATS, recognise

    name = recognise(data).name
    return name if name in FORMATS else "npy"


def found(operation: Operation[Any], findings: Mapping[str, Any], form: str) -> bytes:
    """What an operation found, as JSON or as a table."""
    from lichen_service.documents import canonical
    from lichen_service.reports import table_of

    return table_of(operation, findings) if form == "npy" else canonical(findings)


def picture_of(result: lichen.Result, encoded: Encoded) -> dict[str, Any]:
    """What was written."""
    return {
        "media_type": encoded.media_type,
        "clipped": encoded.clipped,
        "width": result.image.width,
        "height": result.image.height,
        "channels": result.image.channels,
    }


def say(method: str, result: lichen.Result, timing: Mapping[str, float], encoded: Encoded) -> None:
    """The account of a result as a line on standard error."""
    stages = ", ".join(f"{name} {seconds * 1e3:.1f} ms" for name, seconds in timing.items() if "." not in name)
    spoilt = f", {result.nonfinite} values are not finite" if result.nonfinite else ""
    spoilt += f", {encoded.clipped} values were clipped" if encoded.clipped else ""
    print(
        f"{method} on {result.device}, error at most {result.error}{_measured(result)}{spoilt} ({stages})",
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


def print_json(value: Any) -> None:
    from lichen_service.documents import plain

    print(json.dumps(plain(value), indent=2, ensure_ascii=False))
