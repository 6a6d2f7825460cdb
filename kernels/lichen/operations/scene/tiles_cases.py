"""Examples of tiles, and what must never be left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {
        "lights": [
            {"kind": "spot", "position": [0, 2, 0], "direction": [0, -1, -1], "inner": 5, "outer": 12, "intensity": 4},
            {"kind": "point", "position": [0.5, 0.5, 0.2], "intensity": 2},
        ],
        "fog": {"density": 2.0},
        "reflected": 1.0,
        "faint": 1e-3,
    },
)
DOWN = {"kind": "spot", "position": [0, 1, 0], "direction": [0, -1, 0], "inner": 5, "outer": 20}


def _plain(*points: tuple[float, float, float]) -> Callable[[], Mapping[str, Any]]:
    """A pixel for each point; their normals look up."""
    position = np.array(points, np.float32).reshape(1, -1, 3)
    return lambda: {"position": position, "normal": np.broadcast_to(np.array([0, 1, 0], np.float32), position.shape)}


def _says(*reasons: int) -> Callable[[Mapping[str, Any], Array], str | None]:
    """For the first tile and each lamp."""

    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        said = pixels[0, 0, : len(reasons)].tolist()
        return None if said == list(reasons) else f"expected {list(reasons)}, got {said}"

    return holds


INF, NAN = float("inf"), float("nan")
CASES = (
    HardCase(
        "one pixel without a number among others where there is nothing",
        "a minimum passes NaN over, and the pixel would turn black",
        _plain((INF, INF, INF), (NAN, 0, 0), (INF, INF, INF)),
        {"lights": [DOWN]},
        _says(0),
    ),
    HardCase(
        "nothing anywhere",
        "a box around nothing is inside out",
        _plain((INF, INF, INF), (INF, INF, INF)),
        {"lights": [DOWN, {"kind": "directional"}]},
        _says(1, 1),
    ),
    HardCase(
        "a lamp within the box of a tile, and one in its plane",
        "no direction leads from within",
        _plain((-2, 0, -2), (2, 2, 2)),
        {"lights": [{**DOWN, "direction": [1, 0, 0]}, {"kind": "point", "position": [9, 1, 9]}]},
        _says(0, 0),
    ),
    HardCase(
        "beside a cone, below the ground, and far in fog",
        "all four ways to give nothing",
        _plain((50, 0, 0), (51, 0, 1)),
        {
            "lights": [DOWN, {"kind": "point", "position": [50, -1, 0]}, {"kind": "point", "position": [50, 1, 0]}],
            "fog": {"kind": "linear", "start": 1, "end": 40},
        },
        _says(2, 3, 4),
    ),
    HardCase(
        "fog whose thin layer is that of the eye alone",
        "the densest layer hides nothing of a ray that does not meet it",
        _plain((0, 0, -30), (1, 0, -31)),
        {
            "lights": [{"kind": "point", "position": [0, 3, -30]}],
            "fog": {"kind": "layered", "heights": [1, 2], "densities": [0, 1], "density": 50},
            "reflected": 1,
            "faint": 1e-4,
        },
        _says(0),
    ),
)
