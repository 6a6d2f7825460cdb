"""Lichen: image operations whose accuracy has a stated price. The kernel library; it knows no network.

>>> import lichen, numpy
>>> lichen.run("gaussian", numpy.eye(9), sigma=1.0).image.pixels.shape
(9, 9, 1)
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

importlib.import_module("lichen.operations")  # before the function below takes its name in this namespace

if TYPE_CHECKING:
    from lichen.engine import (
        Result,
        evaluate_truth,
        explain,
        explain_pipeline,
        explain_scene,
        map_scene,
        render,
        run,
        run_pipeline,
    )
    from lichen.image import Alpha, Image, Space, Storage
    from lichen.operation import Operation
    from lichen.planning.plan import Plan
    from lichen.presets import texture, textures

__version__ = "0.1.0"
__all__ = [
    "Alpha",
    "Image",
    "Plan",
    "Result",
    "Space",
    "Storage",
    "evaluate_truth",
    "explain",
    "explain_pipeline",
    "explain_scene",
    "map_scene",
    "operations",
    "render",
    "run",
    "run_pipeline",
    "texture",
    "textures",
]

_HOMES = {
    "lichen.engine": (
        "Result",
        "evaluate_truth",
        "explain",
        "explain_pipeline",
        "explain_scene",
        "map_scene",
        "render",
        "run",
        "run_pipeline",
    ),
    "lichen.image": ("Alpha", "Image", "Space", "Storage"),
    "lichen.planning.plan": ("Plan",),
    "lichen.presets": ("texture", "textures"),
}


def operations() -> Mapping[str, Operation[Any]]:
    """The catalogue: all operations by name, sorted by family, then name."""
    known: Mapping[str, Operation[Any]] = importlib.import_module("lichen.catalogue").operations()
    return known


def __getattr__(name: str) -> Any:
    """Names are loaded at first use, so that `import lichen` is quick and asking for a version loads nothing."""
    for home, names in _HOMES.items():
        if name in names:
            found = globals()[name] = getattr(importlib.import_module(home), name)
            return found
    raise AttributeError(f"module 'lichen' has no attribute {name!r}")
