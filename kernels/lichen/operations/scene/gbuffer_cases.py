"""Scenes that show what gbuffer does, and scenes that break naive ray casters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

STILL_LIFE: tuple[Mapping[str, Any], ...] = (
    {"shape": "plane", "point": [0, -1, 0], "albedo": [0.7, 0.7, 0.7], "checker": [0.2, 0.25, 0.3], "roughness": 0.8},
    {"shape": "sphere", "centre": [-1.2, 0, -5], "radius": 1, "albedo": [0.8, 0.2, 0.1], "id": 2, "roughness": 0.2},
    {"shape": "box", "centre": [1.1, -0.25, -4.5], "size": [1, 1.5, 1], "turn": 30, "id": 3, "velocity": [0.1, 0, 0]},
    {
        "shape": "blob", "balls": [[0, 0.5, -6, 0.6], [0.6, 1.2, -6, 0.5], [-0.2, 1.6, -6.2, 0.4]], "smooth": 0.5,
        "id": 4, "albedo": [0.2, 0.5, 0.3], "emissive": 0.5,
    },
)  # fmt: skip
HILLS: Mapping[str, Any] = {
    "shape": "terrain", "corner": [-3, -1, -8], "size": [6, 5], "albedo": [0.4, 0.5, 0.2],
    "heights": [[0, 0.2, 0.1, 0], [0.3, 1.2, 0.4, 0.1], [0.1, 0.5, 0.9, 0.2], [0, 0.1, 0.2, 0.4]],
}  # fmt: skip
EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {"objects": STILL_LIFE, "eye": [0.5, 0.5, 1], "target": [0, 0, -5]},
    {"objects": STILL_LIFE, "buffer": "normal", "frame": "world", "eye": [6, 8, 2], "target": [0, 0, -5], "extent": 9},
    {"objects": [*STILL_LIFE, HILLS], "buffer": "albedo", "fov": 80},
    {"objects": STILL_LIFE, "buffer": "motion", "eye": [0.5, 0.5, 1]},
)


def _is(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, expected, rtol=1e-6, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


CASES = (
    HardCase(
        name="a level ray over a floor, and one straight down a wall",
        why="a direction along a plane or a slab is 0: the quotient is infinite, or 0 / 0 on it",
        inputs=dict,
        parameters={
            "width": 1, "height": 3, "fov": 90,
            "objects": [{"shape": "plane", "point": [0, -1, 0]},
                        {"shape": "box", "centre": [0.5, 0, -3], "size": [1, 0.5, 1]}],
        },
        holds=_is(math.inf, 2.5, 1.5),
    ),
    HardCase(
        name="inside a sphere, and inside a box",
        why="the nearer root lies behind the eye",
        inputs=dict,
        parameters={
            "width": 1, "height": 1, "buffer": "normal",
            "objects": [{"shape": "sphere", "radius": 3}, {"shape": "box", "size": [8, 8, 8]}],
        },
        holds=_is(0, 0, 1),
    ),
    HardCase(
        name="a small sphere far away",
        why="b^2 - a c cancels: of a radius of 0.01 at 1e5 nothing is left in float32",
        inputs=dict,
        parameters={
            "width": 1, "height": 1, "far": 1e6,
            "objects": [{"shape": "sphere", "centre": [0.005, 0, -1e5], "radius": 0.01}],
        },
        holds=_is(1e5),
    ),
    HardCase(
        name="nothing at all",
        why="no objects is no crash",
        inputs=dict,
        parameters={"width": 2, "height": 1},
        holds=_is(math.inf, math.inf),
    ),
)  # fmt: skip
