"""Name -> operation. The catalogue is what lies in `lichen.operations`; adding a file there adds an operation."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from lichen.errors import UnknownOperation, nearest
from lichen.operation import Operation


@cache
def operations() -> Mapping[str, Operation[Any]]:
    """All operations by name, sorted by family, then name."""
    home = importlib.import_module("lichen.operations")
    found: dict[str, Operation[Any]] = {}
    for module in pkgutil.walk_packages(home.__path__, home.__name__ + "."):
        if module.ispkg:
            continue
        for value in vars(importlib.import_module(module.name)).values():
            if isinstance(value, Operation):
                found[value.name] = value
    return MappingProxyType(dict(sorted(found.items(), key=lambda item: (item[1].family, item[0]))))


def operation(name: str) -> Operation[Any]:
    """The operation called `name`. Raises `UnknownOperation` with the nearest names."""
    known = operations()
    if name not in known:
        raise UnknownOperation(f"There is no operation {name!r}; {nearest(name, known)}")
    return known[name]
