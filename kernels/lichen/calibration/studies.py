"""Studies as they are kept: checked in beside the error table, a line for each operation that declares one."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from lichen.operation import Operation
from lichen.study import Study

NAME = "studies.json"


@cache
def load() -> Mapping[str, Study]:
    """By the operation's name."""
    return parse((files("lichen.calibration") / NAME).read_text(encoding="utf-8"))


def parse(text: str) -> dict[str, Study]:
    return {name: Study.parse(values) for name, values in json.loads(text).items()}


def save(operations: Iterable[Operation[Any]], path: Path | None = None) -> Path:
    """Make the studies of these operations anew in the file of a checkout; others stay as they are."""
    path = path or Path(__file__).with_name(NAME)
    kept = parse(path.read_text(encoding="utf-8")) if path.exists() else {}
    for operation in operations:
        kept.pop(operation.name, None)
        if operation.study is not None:
            kept[operation.name] = operation.study()
    lines = [f"{json.dumps(name)}: {json.dumps(kept[name].to_json())}" for name in sorted(kept)]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    load.cache_clear()
    return path
