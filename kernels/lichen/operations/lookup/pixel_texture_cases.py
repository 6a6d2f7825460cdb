"""Examples of pixel_texture, and inputs that break naive lookups."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {
        "dimensions": 3, "depth": 3, "border": "wrap",
        "matrix": [[0.5, 0.2, 0, 0, 0.1], [-0.3, 0.9, 0, 0, 0.3], [0.6, -0.4, 0.2, 0, 0.5]],
        "before": [[0, 0.2, 0.7, 1]], "after": [[0, 0.6, 1], [0.1, 0.4, 0.9], [1, 0.5, 0]],
    },
    {"scale": 0.5, "bias": 0.5, "border": ["reflect", "wrap"]},
    {
        "filter": "cubic", "border": "constant", "background": 0.25, "projective": True,
        "matrix": [[0.4, 0, 0, 0, 0.5], [0, 0.4, 0, 0, 0.5], [0.3, 0.6, 0, 0, 0.8]],
    },
    {
        "dimensions": 4, "depth": 2, "fourth": 3, "border": "reflect101",
        "matrix": [[0.5, 0, 0, 0, 0.5], [0, 0.5, 0, 0, 0.5], [0.4, 0.4, 0.1, 0, 0.3], [0.3, -0.3, 0, 0.2, 0.6]],
    },
    {"filter": "nearest", "units": "texel", "scale": 9.7, "border": "wrap"},
)  # fmt: skip


def _row(*pixels: tuple[float, ...]) -> Array:
    return np.array([pixels], np.float32)


def _is(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, expected, rtol=1e-5, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


RAMP = np.arange(8, dtype=np.float32).reshape(1, 8, 1)

CASES = (
    HardCase(
        name="one texel in four dimensions",
        why="every neighbour is beyond the end, on both sides, along every axis",
        inputs=lambda: {"image": _row((0.5, 0.5, 0.5, 0.5), (-9, 1e30, 0, 7)), "texture": _row((3.0,))},
        parameters={"dimensions": 4, "filter": "cubic", "border": ["clamp", "wrap", "reflect", "reflect101"]},
        holds=_is(3, 3),
    ),
    HardCase(
        name="behind the projector, and at it",
        why="s / q for q <= 0 mirrors what lies behind; at 0 it is infinite",
        inputs=lambda: {"image": _row((1, 2), (1, -2), (1, 0), (0, 0), (1, np.nan)), "texture": RAMP},
        parameters={"dimensions": 1, "projective": True, "background": -1, "units": "texel", "scale": [3.0, 2.0]},
        holds=_is(0.25, -1, -1, -1, np.nan),
    ),
    HardCase(
        name="coordinates far away, infinite and NaN",
        why="as an integer they are any address",
        inputs=lambda: {"image": _row((np.inf,), (-np.inf,), (1e38,), (np.nan,), (0.5,)), "texture": RAMP},
        parameters={"dimensions": 1},
        holds=_is(7, 0, 7, np.nan, 3.5),
    ),
    HardCase(
        name="a constant beyond the end",
        why="a border of one value is half mixed in at the edge itself",
        inputs=lambda: {"image": _row((0.0,), (1.0,), (-0.5,), (2.0,)), "texture": RAMP + 1},
        parameters={"dimensions": 1, "border": "constant", "background": 10},
        holds=_is(5.5, 9, 10, 10),
    ),
)
