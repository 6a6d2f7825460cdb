"""Examples of shadow, and scenes that break naive shadow maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {"light_eye": [0.5, 0.5, 1.5], "light_target": [0.4, 0.6, 0], "filter": 3, "light_far": 4},
    {"light_eye": [2, 3, 1], "light_target": [0.5, 0.5, 0.5], "light_extent": 2.5, "light_far": 9, "outside": "dark"},
    {
        "light_eye": [0.5, 1.5, 0.5], "light_target": [0.5, 0.5, 0.4], "kind": "pcss", "filter": 5, "source": 0.1,
        "map_kind": "window", "light_near": 0.5, "light_far": 5,
    },
    {"light_eye": [0, 2, 0], "light_target": [0.5, 0, -0.5], "kind": "variance", "filter": 4.5, "slope": 0},
)  # fmt: skip


def _lamp(size: int, depth: float, *points: tuple[float, float, float]) -> Callable[[], Mapping[str, Any]]:
    """A map of one depth, and points."""
    position = np.array([points], np.float32)
    return lambda: {"depth": position, "map": np.full((size, size, 1), depth, np.float32)}


def _is(*expected: float, within: float = 1e-6) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, expected, rtol=0, atol=within, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


def _slope() -> Mapping[str, Any]:
    """A plane of slope 5 seen by a map of 8 x 8 texels which holds its depth at their middles, with points on it."""
    size, extent = 8, 2.0
    middle = ((np.arange(size) + 0.5) / size - 0.5) * extent
    depth = np.broadcast_to(10 + 5 * middle, (size, size))
    x, y = np.meshgrid(np.linspace(-0.99, 0.99, 41), np.linspace(-0.99, 0.99, 5))
    position = np.stack([x, y, -(10 + 5 * x)], axis=-1)
    normal = np.broadcast_to([-5.0, 0.0, -1.0], position.shape) * -1.0
    return {
        "depth": position.astype(np.float32),
        "map": depth[..., None].astype(np.float32),
        "normal": normal.astype(np.float32),
    }


def _all_lit(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    dark = int(np.count_nonzero(pixels != 1))
    return f"{dark} points of a plane shadow it" if dark else None


DOWN: Mapping[str, Any] = {"light_eye": [0, 0, 0], "light_target": [0, 0, -1], "light_fov": 90}

CASES = (
    HardCase(
        name="behind the light, in its plane, and beyond the map",
        why="u / w for w <= 0 mirrors what lies behind the light; at 0 it is infinite",
        inputs=_lamp(4, 2.0, (0, 0, 3), (1, 0, 0), (0, 0, 0), (9, 0, -3), (0, 0, -3), (0, 0, -1)),
        parameters={**DOWN, "slope": 0},
        holds=_is(1, 1, 1, 1, 0, 1),
    ),
    HardCase(
        name="the same without light outside",
        why="a beam has an edge",
        inputs=_lamp(4, 2.0, (0, 0, 3), (1, 0, 0), (9, 0, -3), (0, 0, -1)),
        parameters={**DOWN, "slope": 0, "outside": "dark", "filter": 1},
        holds=_is(0, 0, 0, 1),
    ),
    HardCase(
        name="nowhere, and no number",
        why="inf - inf is NaN, and what compares with NaN is in shadow without a word",
        inputs=_lamp(2, np.nan, (np.inf, 0, 0), (np.nan, 0, -1), (0, 0, -1)),
        parameters=DOWN,
        holds=_is(1, np.nan, np.nan),
    ),
    HardCase(
        name="a steep plane does not shadow itself",
        why="a texel holds one depth of a slope: half of it shadows the other half, or a bias detaches shadows",
        inputs=_slope,
        parameters={**DOWN, "light_extent": 2.0, "filter": 3},
        holds=_all_lit,
    ),
    HardCase(
        name="a map of nothing",
        why="an infinite depth times a slope of 0 is NaN",
        inputs=_lamp(2, math.inf, (0, 0, -1), (0.1, 0.2, -1e6)),
        parameters={**DOWN, "filter": 2, "kind": "variance"},
        holds=_is(1, 1),
    ),
)
