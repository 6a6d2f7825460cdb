"""Examples and hard cases of reflection."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

Given = Mapping[str, Any]
Holds = Callable[[Given, Array], str | None]
GREY = 0.7
EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {"fresnel": "dielectric", "mode": "glass", "fov": 40},
    {"chart": "paraboloid", "fresnel": "dielectric", "yaw": 30, "pitch": -20},
    {"fresnel": "dielectric", "index": 1.33, "mode": "refraction", "encoding": "unit", "convention": "directx"},
)


def _normals(*rows: tuple[float, float, float]) -> Array:
    return np.array(rows, np.float32).reshape(1, -1, 3)


def _seen(height: int, width: int, *normals: tuple[float, float, float]) -> Callable[[], Given]:
    """Normals before an environment of one value."""
    return lambda: {"normal": _normals(*normals), "environment": np.full((height, width, 3), GREY, np.float32)}


def _expect(*expected: float, within: float = 1e-6) -> Holds:
    """Of every channel, pixel by pixel."""

    def holds(inputs: Given, pixels: Array) -> str | None:
        good = np.allclose(pixels[0], np.array(expected)[:, np.newaxis], rtol=0, atol=within, equal_nan=True)
        return None if good else f"expected {list(expected)}, got {pixels[0, :, 0].tolist()}"

    return holds


def _halves() -> Given:
    """Cubes of six greys, seen in their edges and corners, and in poles."""
    edges = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (0, 1, 0), (1, 1, 0), (-1, -1, 0), (0, -1, 0), (1, 0, 0)]
    return {"normal": _normals(*edges), "environment": np.full((16, 24, 1), GREY, np.float32)}


SOME = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0), (-1.0, 2.0, 0.5), (1e-20, 0.0, 1e-20), (0.0, -3e4, 1e4))
CASES = (
    HardCase(
        name="normals of no length and of any",
        why="0 / 0, and squares that overflow or vanish in float32",
        inputs=_seen(16, 32, (0, 0, 0), (1e-30, 0, 1e-30), (1e30, 0, 1e30), (np.nan, 0, 1), (0, np.inf, 0)),
        parameters={},
        holds=_expect(0.0, GREY, GREY, np.nan, np.nan),
    ),
    HardCase(
        name="poles and wrap of lat-long",
        why="a longitude of nothing, and columns that end where they begin",
        inputs=_seen(8, 16, (0, 1, 1), (0, -1, 1), (0, 0, 1), (1, 0, 1), (1e-12, 1, 1)),
        parameters={},
        holds=_expect(*(GREY,) * 5),
    ),
    HardCase(
        name="edges and corners of a cube",
        why="components that tie choose a face twice, or none",
        inputs=_halves,
        parameters={"chart": "cube"},
        holds=_expect(*(GREY,) * 9),
    ),
    HardCase(
        name="rim and pole of paraboloids",
        why="1 + z is 0 at the other half's middle; beyond the rim lies nothing",
        inputs=_seen(8, 16, (0, 0, 1), (1, 0, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1)),
        parameters={"chart": "paraboloid"},
        holds=_expect(*(GREY,) * 5),
    ),
    HardCase(
        name="rim of a mirror ball",
        why="straight ahead is all of the rim, at once",
        inputs=_seen(9, 9, (1, 0, 0), (0, 1, 0), (1, 1e-8, 1e-9), (0, 0, 1)),
        parameters={"chart": "mirror_ball"},
        holds=_expect(*(GREY,) * 4),
    ),
    HardCase(
        name="total reflection within glass",
        why="the root of a negative number",
        inputs=_seen(8, 16, *SOME),
        parameters={"mode": "glass", "fresnel": "dielectric", "index": 0.4},
        holds=_expect(*(GREY,) * 6),
    ),
    HardCase(
        name="index 1 reflects nothing",
        why="0 / 0 at grazing view, and a difference without digits beside it",
        inputs=_seen(8, 16, *SOME),
        parameters={"fresnel": "dielectric", "index": 1},
        holds=_expect(*(0.0,) * 6),
    ),
    HardCase(
        name="grazing view",
        why="everything is reflected there, whatever the index",
        inputs=_seen(8, 16, (1, 0, 0), (0, -2, 0)),
        parameters={"fresnel": "dielectric", "index": 1.0001},
        holds=_expect(GREY, GREY),
    ),
    HardCase(
        name="no surface at infinity",
        why="inf - inf, and a NaN that a comparison makes a colour",
        inputs=lambda: {
            "normal": _normals((0, 0, 1), (0, 0, 1), (0, 0, 1)),
            "position": _normals((0, 0, -1), (0, 0, -np.inf), (np.nan, 0, -1)),
            "environment": np.full((4, 8, 1), GREY, np.float32),
            "base": np.full((1, 3, 1), 0.25, np.float32),
        },
        parameters={"reflectance": 0.5},
        holds=_expect(0.25 + GREY / 2, 0.25, np.nan),
    ),
)
