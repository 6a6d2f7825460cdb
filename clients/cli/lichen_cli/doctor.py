"""`lichen doctor`: what works on this machine, what does not, and why.

Nothing is taken for granted: the device builds and runs kernels, every format writes and reads a tiny picture in every
storage it claims, and every method of every operation runs on every device and is held to the exact result. The exit
status is 0 when all of it works.
"""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from lichen_cli.main import FAILED, Parser

if TYPE_CHECKING:
    from rich.console import Console

    from lichen.files import Format
    from lichen.image import Image, Storage
    from lichen.operation import Operation

LOSSY = 0.1
"""What a lossy format may change a smooth picture by; more means that it is broken, not that it compresses."""
SLACK = 1e-6
"""Share of a stated error that printing and comparing it may cost."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was tried. `works` is None where there is nothing to try, only something to know."""

    area: str
    name: str
    works: bool | None
    detail: str


def main(arguments: Sequence[str]) -> int:
    says = "Find out what works on this machine, and why the rest does not."
    parser = Parser(prog="lichen doctor", description=says, allow_abbrev=False)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--url", help="examine a running service instead of this machine")
    parser.add_argument("--key", help="the key to send to it (default: LICHEN_KEY)")
    given = parser.parse_args(arguments)

    from rich.console import Console

    with Console(stderr=True).status("examining"):  # shown on a terminal only
        if given.url:
            from lichen_cli.doctor_url import examine

            checks = list(examine(given.url, given.key or os.environ.get("LICHEN_KEY")))
        else:
            checks = [*_versions(), _device(), *_formats(), *_operations()]
    failed = [check for check in checks if check.works is False]
    if given.json:
        print(json.dumps({"sound": not failed, "checks": [asdict(check) for check in checks]}, indent=2))
    else:
        _print(Console(), checks, failed)
    return FAILED if failed else 0


def _print(console: Console, checks: Sequence[Check], failed: Sequence[Check]) -> None:
    from rich.table import Table

    marks = {True: "works", False: "FAILS", None: ""}
    table = Table("", "", "", "", box=None, show_header=False)
    area = ""
    for check in checks:
        table.add_row("" if check.area == area else check.area, check.name, marks[check.works], check.detail)
        area = check.area
    console.print(table, markup=False)
    tried = sum(check.works is not None for check in checks)
    console.print(f"\n{tried - len(failed)} of {tried} checks passed.")


# ------------------------------------------------------------------------------------------------------------- checks


def _versions() -> Iterator[Check]:
    """Python, the engine and what it stands on, as the installed distribution names it."""
    from importlib.metadata import PackageNotFoundError, requires, version

    import lichen

    yield Check("versions", "python", None, f"{platform.python_version()} on {platform.machine()}")
    yield Check("versions", "lichen", None, lichen.__version__)
    try:
        needed = requires("lichen") or []
    except PackageNotFoundError:
        yield Check("versions", "libraries", None, "unknown: lichen runs from its source tree, not installed")
        return
    unconditional = {_bare(requirement) for requirement in needed if "extra ==" not in requirement}
    for name in sorted(unconditional, key=str.lower):
        try:
            yield Check("versions", name, None, version(name))
        except PackageNotFoundError:
            yield Check("versions", name, False, "is required but not installed")


def _bare(requirement: str) -> str:
    """The name in a requirement such as `numpy>=2.0; extra == "x"`."""
    return re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]


def _device() -> Check:
    from lichen.opencl.device import status

    found = status()
    if found.name is not None:
        units = f"{found.compute_units} compute units, {found.vector_width} floats wide"
        return Check("device", "opencl", True, f"{found.name} ({found.runtime}), {units}; kernels in {found.cache}")
    asked_for = found.wanted.lower() == "numpy"
    return Check("device", "opencl", None if asked_for else False, f"NumPy serves: {found.reason}")


def _formats() -> Iterator[Check]:
    from lichen.files import READABLE

    for format in READABLE.values():
        if format.selects:
            there = all(find_spec(each.partition(".")[0]) for each in format.modules)
            told = "read, not written" if there else "not read without pip install 'lichen[fields]'"
            yield Check("formats", format.name, there or None, told)
        for storage in format.storages:
            try:
                wrong = _round_trip(format, storage)
            except Exception as failure:  # whatever a codec raises is what we want to know
                wrong = f"{type(failure).__name__}: {failure}"
            yield Check("formats", f"{format.name} {storage}", wrong is None, wrong or "written and read back")


def _round_trip(format: Format, storage: Storage) -> str | None:
    """What a format does to a tiny smooth picture beyond what its storage must; None if nothing."""
    import numpy as np

    from lichen.files import decode, encode
    from lichen.image import Image

    ramp = np.linspace(0.2, 0.8, 16 * 16 * 3).reshape(16, 16, 3)
    levels = storage.levels if storage.integer else 1 << 10  # sixteenth bits of a half are exact
    picture = (np.round(ramp * levels) / levels).astype(np.float64 if storage == "float64" else np.float32)
    again = decode(encode(Image(picture, format.natural_space(storage), storage=storage), format.name).data)
    if again.pixels.shape != picture.shape:
        return f"came back with shape {again.pixels.shape} instead of {picture.shape}"
    change = float(np.abs(again.pixels - picture.astype(np.float64)).max())
    allowed = LOSSY if format.lossy and storage.integer else 1e-7
    return None if change <= allowed else f"came back changed by {change:.3g}"


def _operations() -> Iterator[Check]:
    from lichen.catalogue import operations
    from lichen.opencl.device import default_device
    from lichen_service.readiness import example

    devices = ("numpy",) if default_device() is None else ("opencl", "numpy")
    for operation in operations().values():
        made = example(operation)
        if made is None:
            yield Check("operations", operation.name, False, "declares no case to try it on")
        else:
            yield from _compared(operation, devices, *made)


def _compared(
    operation: Operation[Any], devices: Sequence[str], inputs: dict[str, Image], parameters: dict[str, Any]
) -> Iterator[Check]:
    """Every method on every device against the exact result."""
    import lichen

    images = list(inputs.items())
    first = images[0][1] if images else None
    call: dict[str, Any] = {**dict(images[1:]), **parameters, "prune": False}
    try:
        exact = lichen.evaluate_truth(operation.name, first, **call)
    except Exception as failure:  # a defect, and finding it is what this command is for
        yield Check("operations", operation.name, False, f"its exact result fails: {type(failure).__name__}: {failure}")
        return
    for device in devices:
        for method in operation.methods:
            yield _held(operation.name, first, {**call, "method": method, "device": device}, exact)


def _held(operation: str, first: Image | None, call: dict[str, Any], exact: Any) -> Check:
    """One method on one device."""
    import lichen
    from lichen.accuracy.metrics import difference
    from lichen.errors import InvalidRequest, LichenError, Unattainable

    name = f"{operation} {call['method']}, {call['device']}"
    try:
        result = lichen.run(operation, first, **call)
    except (InvalidRequest, Unattainable) as unfit:
        return Check("operations", name, None, f"does not take the trial case: {unfit}")
    except LichenError as failure:
        return Check("operations", name, False, str(failure))
    except Exception as failure:
        return Check("operations", name, False, f"{type(failure).__name__}: {failure}")
    found = difference(result.image.pixels, exact)
    works = found.largest <= result.error.value * (1 + SLACK) and not found.mismatched
    amiss = f", {found.mismatched} samples finite on one side alone" if found.mismatched else ""
    return Check("operations", name, works, f"error {found.largest:.2g}, stated {result.error}{amiss}")
