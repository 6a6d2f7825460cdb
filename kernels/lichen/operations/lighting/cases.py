"""Examples of lighting, and the pixels that break naive lighting."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

EXAMPLES: tuple[Mapping[str, Any], ...] = (
    {
        "lights": [
            {"kind": "directional", "direction": [-1, -1, -2], "intensity": 0.9},
            {"kind": "directional", "direction": [2, -0.5, -1], "colour": [0.3, 0.4, 0.6], "intensity": 0.5},
        ]
    },
    {
        "lights": [{"kind": "directional", "direction": [1, -1, -1]}],
        "model": "blinn_phong",
        "diffuse": [0.5, 0.2, 0.1],
        "highlight": [0.3, 0.3, 0.3],
        "exponent": 60,
    },
    {
        "lights": [
            {"kind": "point", "position": [1, 2, 1], "intensity": 6, "radius": 0.2},
            {
                "kind": "spot",
                "position": [-2, 2, 0],
                "direction": [1, -1, -3],
                "intensity": 9,
                "inner": 10,
                "outer": 25,
            },
            {"kind": "area", "position": [0, 3, -2], "direction": [0, -1, -0.2], "size": [2, 1], "intensity": 3},
            {"kind": "projector", "position": [0, 0, 2], "direction": [0, 0, -1], "intensity": 8, "fov": 40},
            {"kind": "slab", "position": [0.5, 0.2, 1], "size": [0.6, 0.4], "cells": [3, 2], "distance": 3, "fov": 70},
        ],
        "model": "ward",
        "facet_roughness": 0.5,
        "stretch": 1.5,
    },
)
UP = {"kind": "directional", "direction": [0, 0, -1]}


def _row(*vectors: tuple[float, ...]) -> Array:
    return np.array(vectors, np.float32).reshape(1, len(vectors), -1)


def _gives(*expected: float, within: float = 1e-6) -> Callable[[Mapping[str, Any], Array], str | None]:
    """The first channel of each pixel."""

    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels[0, :, 0]
        same = np.allclose(got, np.array(expected), rtol=within, atol=within, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


def _sound(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    if not np.isfinite(pixels).all():
        return f"not finite: {pixels.tolist()}"
    return None if pixels.min() >= 0 else "darker than nothing"


def _grazing() -> dict[str, Array]:
    """A normal turned by so little from across the view, and a lamp opposite."""
    turns = np.array([0.0, 1e-8, 1e-6, 1e-4, 1e-2, -1e-6], np.float32)
    return {"normal": np.stack([np.ones_like(turns), 0 * turns, turns], axis=-1)[None]}


CASES = (
    HardCase(
        "normals of any length and none",
        "x / 0, and squares that overflow or underflow",
        lambda: {"normal": _row((0, 0, 2), (0, 0, 1e-30), (0, 0, 1e30), (0, 0, 1e-44), (0, 0, 0), (0, 0, np.nan))},
        {"lights": [UP], "model": "lambert", "diffuse": [0.5, 0.5, 0.5]},
        _gives(0.5, 0.5, 0.5, 0.5, 0, np.nan),
    ),
    HardCase(
        "a lamp on the surface, in its plane and behind it",
        "1 / r^2 has a pole, and so have directions",
        lambda: {
            "normal": _row(*[(0, 0, 1)] * 4),
            "position": _row((0, 0, -2), (1, 0, -2), (0, 0, -3), (0, 0, -1)),
        },
        {
            "lights": [{"kind": "point", "position": [0, 0, -2], "radius": 0.1}],
            "diffuse": [1, 1, 1],
            "highlight": [0, 0, 0],
        },
        _gives(0, 0, 1 / (1.01**1.5), 0),
    ),
    HardCase(
        "a lamp far out, seen in float32",
        "light minus position loses what a lamp's place has beyond seven digits",
        lambda: {"normal": _row((0, 0, 1)), "position": _row((0, 0, -10000))},
        {
            "lights": [{"kind": "point", "position": [0, 0, -9999.99987], "radius": 0.001, "falloff": [1, 0, 0]}],
            "highlight": [0, 0, 0],
            "diffuse": [1, 1, 1],
        },
        _gives(1.3e-4 / np.hypot(1.3e-4, 1e-3), within=1e-5),
    ),
    HardCase(
        "so far from a lamp that squares of distances are infinite",
        "0 r^2 is not a number where r^2 has overflown, although that part of the falloff is none",
        lambda: {"normal": _row(*[(0, 0, 1)] * 3), "position": _row((0, 0, -1e17), (0, 0, -1e25), (0, 0, -3e38))},
        {
            "lights": [{"kind": "point", "falloff": [2, 0, 0]}, {"kind": "point"}],
            "diffuse": [1, 1, 1],
            "highlight": [0, 0, 0],
        },
        _gives(0.5, 0.5, 0.5),
    ),
    HardCase(
        "the lamp straight behind, and grazing view",
        "l + v = 0 has no direction; G / cos is 0 / 0",
        _grazing,
        {"lights": [{"direction": [0, 0, 1]}, {"direction": [1e-4, 0, 1]}, {"direction": [-1, 0, 1e-3]}]},
        _sound,
    ),
    HardCase(
        "grazing view into v-grooves",
        "1 / cos overflows before the smaller term is taken",
        _grazing,
        {
            "lights": [{"direction": [0, 0, 1]}, {"direction": [-1, 0, -1e-3]}],
            "masking": "v_groove",
            "facet_roughness": 0.05,
        },
        _sound,
    ),
    *(
        HardCase(
            f"the exponent {exponent:g} of {model}, at its peak, beside it, and with the lamp's mirror image behind",
            "powers of negative numbers; the cosine of a small angle in float32 to the power of 1e5",
            lambda: {"normal": _row((0, 0, 2), (1e-3, 0, 1), (1, 0, 0.5), (0, 0, -1), (0, np.nan, 1))},
            {"lights": [UP], "model": model, "diffuse": [0, 0, 0], "highlight": [1, 1, 1], "exponent": exponent},
            _gives(*expected, np.nan, within=2e-3 * expected[0]),
        )
        for model, exponent, expected in (
            ("phong", 1, (1, 1, 0, 0)),
            ("phong", 1e5, (1, math.exp(-0.2), 0, 0)),
            ("blinn_phong", 1e5, (12500.75, 12500.75 * math.exp(-0.05), 0, 0)),
        )
    ),
    HardCase(
        "roughness 0 and 1, and far outside",
        "a facet distribution without width is a division by 0",
        lambda: {"normal": _row(*[(0, 0, 1)] * 5), "roughness": _row((0,), (0.05,), (1,), (-3,), (7,))},
        {"lights": [UP], "diffuse": [0, 0, 0], "index": None, "distribution": "beckmann"},
        _gives(0.25 / 0.05**4, 0.25 / 0.05**4, 0.25, 0.25 / 0.05**4, 0.25, within=1e-5),
    ),
    HardCase(
        "what is spoilt stays in its pixel",
        "a comparison with NaN turns it into black",
        lambda: {
            "normal": _row(*[(0, 0, 1)] * 5),
            "position": _row((0, 0, -1), (np.nan, 0, -1), (0, 0, -np.inf), (0, 0, -1), (0, 0, -1)),
            "albedo": _row((1,), (1,), (1,), (np.nan,), (1,)),
            "roughness": _row((0.5,), (0.5,), (0.5,), (0.5,), (np.nan,)),
        },
        {"lights": [UP], "diffuse": [1, 1, 1], "index": None},
        _gives(1 + 0.25 / 0.0625, np.nan, 0, np.nan, np.nan),
    ),
    HardCase(
        "beside and behind a projector",
        "x / w shows the slide a second time where w < 0",
        lambda: {
            "normal": _row(*[(0, 0, 1)] * 3),
            "position": _row((0, 0, -1), (3, 0, -1), (0, 0, 1)),
            "slide": np.full((2, 3, 3), 0.5, np.float32),
        },
        {
            "lights": [{"kind": "projector", "falloff": [1, 0, 0], "radius": 1e-6}],
            "diffuse": [1, 1, 1],
            "highlight": [0, 0, 0],
        },
        _gives(0.5, 0, 0),
    ),
    HardCase(
        "on the plane of a slab, behind it, and where its pictures end",
        "x / w where w is 0 or less; a neighbour's picture in the margin of a cell",
        lambda: {
            "normal": _row(*[(0, 0, 1)] * 4),
            "position": _row((0.3, 0, 0), (0.3, 0, 1), (0, 0, -1), (0.75, 0, -1)),
            "slab": np.repeat(np.array([[[0.0], [1.0], [5.0]]], np.float32), 3, axis=0),
        },
        {
            "lights": [{"kind": "slab", "cells": [3, 1], "size": [0.3, 1e-6], "fov": 90, "falloff": [1, 0, 0]}],
            "diffuse": [1, 1, 1],
            "highlight": [0, 0, 0],
        },
        _sound,
    ),
    HardCase(
        "fibres towards the lamp, and none",
        "the normal of a fibre that lies along l is 0 / 0; roots of small negative numbers",
        lambda: {"normal": _row(*[(0, 0, 1)] * 3), "tangent": _row((0, 0, 1), (2, 0, 0), (0, 0, 0))},
        {"lights": [UP], "model": "banks", "diffuse": [1, 1, 1], "highlight": [0.5, 0.5, 0.5], "exponent": 9},
        _gives(0, 1.5, 1),
    ),
)
