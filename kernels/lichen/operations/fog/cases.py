"""Examples of fog, and scenes that break naive fog."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

LAYERS: Mapping[str, Any] = {
    "kind": "layered",
    "density": 0.8,
    "heights": [0.0, 0.4, 0.5, 2.0, 2.2, 3.0],
    "densities": [1.0, 0.6, 0.0, 0.0, 0.5, 0.1],
    "eye": [0.0, 0.3, 0.0],
    "up": [0.0, 0.9, -0.3],
    "colour": 0.7,
}
EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {"density": 0.8, "colour": 0.6},
    LAYERS,
    {
        "kind": "height",
        "density": 1.5,
        "base": 0.2,
        "falloff": 0.6,
        "eye": [0, 0.5, 0],
        "fov": 75,
        "background": "keep",
    },
    {"kind": "squared", "density": 1.4, "depth_kind": "reversed", "near": 0.2, "far": 3.0, "distance": "planar"},
    {"kind": "linear", "start": 0.1, "end": 0.9, "depth_kind": "euclidean", "colour": 0.3},
)


def _scene(depths: tuple[float, ...], light: float = 1.0) -> Callable[[], Mapping[str, Any]]:
    depth = np.array(depths, np.float32).reshape(1, -1, 1)
    return lambda: {"image": np.full_like(depth, light), "depth": depth}


def _points(*points: tuple[float, float, float]) -> Callable[[], Mapping[str, Any]]:
    position = np.array([points], np.float32)
    return lambda: {"image": np.ones((1, len(points), 1), np.float32), "depth": position}


def _is(*expected: float, within: float = 2e-6) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, expected, rtol=0, atol=within, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


BLACK: Mapping[str, Any] = {"colour": 0.0}

CASES = (
    HardCase(
        name="nothing, behind, and no number",
        why="inf density 0 is NaN where nothing is hit; a negative depth brightens; NaN becomes a colour when clamped",
        inputs=_scene((np.inf, -3.0, np.nan, 0.0)),
        parameters={"kind": "linear", "start": 1, "end": 2, "colour": 0.25},
        holds=_is(0.25, 1, np.nan, 1),
    ),
    HardCase(
        name="level rays through layers",
        why="the integral over height is 0 / 0 where both heights are the same",
        inputs=_points((3, 0, -4), (3, 1e-30, -4), (0, 1e-20, 0), (0, 0, 0)),
        parameters={**BLACK, "kind": "layered", "density": 0.2, "heights": [-1, 1], "densities": [0.25, 0.75]},
        holds=_is(math.exp(-0.5), math.exp(-0.5), 1, 1),
    ),
    HardCase(
        name="inside a layer, over a gap, and to the end of the world",
        why="differences of the cumulative integral cancel; an endless ray through a finite layer is inf 0",
        inputs=_points((0, 0.5, 0), (0, 8, -6), (0, -8, -6), (np.inf, 0, 0)),
        parameters={
            **BLACK, "kind": "layered", "density": 1, "heights": [-0.5, 0.5, 1, 4, 5, 6], "densities": [1, 1, 0, 0, 1,
            0],
        },
        holds=_is(math.exp(-0.5), math.exp(-1.75 * 1.25), math.exp(-10), 0, within=1e-5),
    ),
    HardCase(
        name="a gap in which one looks level to the horizon",
        why="no fog, however far",
        inputs=_scene((np.inf,)),
        parameters={**BLACK, "kind": "layered", "heights": [-2, -1, 1, 2], "densities": [1, 0, 0, 1]},
        holds=_is(1),
    ),
    HardCase(
        name="height fog, level and steep",
        why="(1 - e^-u) / u is 0 / 0 where level, inf / inf where steep",
        inputs=_points((2, 0, 0), (2, 1e-12, 0), (0, 700, 0), (0, -700, 0), (0, 2, 0)),
        parameters={**BLACK, "kind": "height", "density": 0.3, "falloff": 1.0},
        holds=_is(math.exp(-0.6), math.exp(-0.6), math.exp(-0.3), 0, math.exp(-0.3 * (1 - math.exp(-2)))),
    ),
    HardCase(
        name="high above a bank of fog",
        why="the density at the eye underflows and what is below overflows: 0 inf",
        inputs=_points((0, -200, 0), (0, -150, 0), (200, 0, 0)),
        parameters={**BLACK, "kind": "height", "density": 0.1, "falloff": 1.0, "eye": [0, 0, 0], "base": -200},
        holds=_is(math.exp(-0.1), 1, 1),
    ),
    HardCase(
        name="infinite light behind thick fog",
        why="inf e^-1000 is NaN",
        inputs=_scene((1e6, 1.0), math.inf),
        parameters={"kind": "squared", "density": 1, "colour": 0.5, "fov": 0.01},
        holds=_is(0.5, math.inf),
        methods=("exact",),
    ),
)  # fmt: skip
