"""Name -> operation. The catalogue is what lies in `lichen.operations`; adding a file there adds an operation.

An operation called `name` is declared in `family/name.py`, or in `family/stem.py` where its name is `stem_family`: so
one is found without loading the others, which takes a second.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lichen.errors import UnknownOperation, nearest
from lichen.operation import Operation


@cache
def operations() -> Mapping[str, Operation[Any]]:
    """All operations by name, sorted by family, then name."""
    found = {each.name: each for each in loaded()}
    return MappingProxyType(dict(sorted(found.items(), key=lambda item: (item[1].family, item[0]))))


def loaded() -> Iterator[Operation[Any]]:
    """All operations, each as soon as it is loaded; some are met more than once."""
    for module in dict.fromkeys(module for modules in _homes().values() for module in modules):
        yield from _declared(module)


def known(name: str) -> Operation[Any] | None:
    """The operation called `name`, if there is one."""
    likely = (each for module in _homes().get(name, ()) for each in _declared(module) if each.name == name)
    return next(likely, None) or operations().get(name)


def operation(name: str) -> Operation[Any]:
    """The operation called `name`. Raises `UnknownOperation` with the nearest names."""
    found = known(name)
    if found is None:
        raise UnknownOperation(f"There is no operation {name!r}; {nearest(name, operations())}")
    return found


@cache
def _homes() -> Mapping[str, list[str]]:
    """Modules by what an operation that is declared there may be called; none is loaded."""
    home = importlib.import_module("lichen.operations")
    found: dict[str, list[str]] = {}
    for path in sorted(path for folder in home.__path__ for path in Path(folder).glob("*/*.py")):
        family, stem = path.parent.name, path.stem
        if stem != "__init__":
            for name in (stem, f"{stem}_{family}"):
                found.setdefault(name, []).append(f"{home.__name__}.{family}.{stem}")
    return found


@cache
def _declared(module: str) -> tuple[Operation[Any], ...]:
    values = vars(importlib.import_module(module)).values()
    return tuple([value for value in values if isinstance(value, Operation)])
