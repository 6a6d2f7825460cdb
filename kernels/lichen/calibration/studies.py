"""Studies as they are kept: checked in beside the error table, a line for each.

One that an operation declares goes by its name; one that is derived, by its name and the number of the example that
stands for it in reports. Those of other examples are made when they are asked for."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from lichen.calibration import by_value
from lichen.calibration.examples import default_example
from lichen.operation import Operation
from lichen.study import Study

NAME = "studies.json"


@cache
def load() -> Mapping[str, Study]:
    """All that are kept, by what they go by."""
    return parse((files("lichen.calibration") / NAME).read_text(encoding="utf-8"))


def of(operation: str, example: int | None) -> Study | None:
    """The kept study of an operation, by its name; else that of its example of this number. None where neither is."""
    return load().get(operation) or load().get(f"{operation} {example}")


def made(operation: Operation[Any]) -> dict[str, Study]:
    """What is to be kept of an operation, measured now: one study, or none."""
    if operation.study is not None:
        return {operation.name: operation.study()}
    number = default_example(operation)
    found = by_value.study(operation, operation.validate(operation.examples[number]))
    return {f"{operation.name} {number}": found} if found else {}


def parse(text: str) -> dict[str, Study]:
    """Of a file's text. Raises ValueError where it is no JSON, KeyError where a study lacks something."""
    return {name: Study.parse(values) for name, values in json.loads(text).items()}


def save(operations: Iterable[Operation[Any]], path: Path | None = None) -> Path:
    """Make the studies of these operations anew in the file at `path`, by default that of a checkout; others stay as
    they are. Returns its path; raises OSError where it cannot be written."""
    path = path or Path(__file__).with_name(NAME)
    new = {operation.name: made(operation) for operation in operations}
    old = parse(path.read_text(encoding="utf-8")) if path.exists() else {}
    kept = {name: study for name, study in old.items() if name.partition(" ")[0] not in new}
    for studies in new.values():
        kept |= studies
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name].to_json())}" for name in sorted(kept)]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    load.cache_clear()
    return path
