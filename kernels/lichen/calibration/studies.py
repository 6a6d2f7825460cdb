"""Studies as they are kept: checked in beside the error table, a line for each.

One that an operation declares goes by its name; one that is derived, by the name and the number of an example."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from lichen.calibration import by_value
from lichen.operation import Operation
from lichen.study import Study

NAME = "studies.json"


@cache
def load() -> Mapping[str, Study]:
    """By what they go by."""
    return parse((files("lichen.calibration") / NAME).read_text(encoding="utf-8"))


def of(operation: str, example: int) -> Study | None:
    """The study of an operation, that of an example if it has one."""
    return load().get(f"{operation} {example}") or load().get(operation)


def made(operation: Operation[Any]) -> Iterator[tuple[str, Study]]:
    """All studies of an operation, measured now."""
    if operation.study is not None:
        yield operation.name, operation.study()
        return
    for number, example in enumerate(operation.examples):
        if found := by_value.study(operation, operation.validate(example)):
            yield f"{operation.name} {number}", found


def parse(text: str) -> dict[str, Study]:
    return {name: Study.parse(values) for name, values in json.loads(text).items()}


def save(operations: Iterable[Operation[Any]], path: Path | None = None) -> Path:
    """Make the studies of these operations anew in the file of a checkout; others stay as they are."""
    path = path or Path(__file__).with_name(NAME)
    new = {operation.name: dict(made(operation)) for operation in operations}
    old = parse(path.read_text(encoding="utf-8")) if path.exists() else {}
    kept = {name: study for name, study in old.items() if name.partition(" ")[0] not in new}
    for studies in new.values():
        kept |= studies
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name].to_json())}" for name in sorted(kept)]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    load.cache_clear()
    return path
