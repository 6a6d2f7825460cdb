"""What is hard about bringing colours into a gamut, as declared cases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase


def _blue() -> dict[str, Any]:
    """A saturated blue out of the gamut, black, white, and next to black what would overflow."""
    values = [[0.1, -0.3, 2.0], [0, 0, 0], [1, 1, 1], [1e-38, -1e3, 0], [-1, -2, -0.5], [0.2, 0.4, 0.3]]
    return {"image": np.array(values, np.float32).reshape(1, -1, 3)}


def _tamed(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels.reshape(-1, 3)
    top = inputs["image"].reshape(-1, 3).max(axis=1)
    fine = np.isfinite(got).all() and np.allclose(got.max(axis=1), top, atol=1e-6)
    kept = np.allclose(got[[1, 2, 5]], inputs["image"].reshape(-1, 3)[[1, 2, 5]], atol=1e-6)
    inside = bool((got[0] >= -0.11 * 2).all()) and got[3].min() > -1e-30
    return None if fine and kept and inside else f"got {got.tolist()}"


def _spoilt(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels.reshape(-1, 3)
    return None if np.isnan(got[0]).all() and np.isfinite(got[1]).all() else f"got {got.tolist()}"


CASES = (
    HardCase(
        name="blue light outside, and black beside it",
        why="the distance from the largest channel is a quotient that black makes infinite",
        inputs=_blue,
        parameters={"action": "compress"},
        holds=_tamed,
    ),
    HardCase(
        name="NaN in one channel",
        why="a maximum that drops NaN makes the other channels colours of nothing",
        inputs=lambda: {"image": np.array([[[np.nan, 0.5, 0.1], [0.2, 0.1, -0.4]]], np.float32)},
        parameters={"action": "compress"},
        holds=_spoilt,
    ),
)
