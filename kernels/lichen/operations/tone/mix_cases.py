"""Inputs on which careless mixing goes wrong, and what must hold for every method on every backend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase


def _overflow(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.allclose(pixels, 3e38, rtol=1e-6) else f"expected 3e38, got {pixels.reshape(-1)[0]}"


def _same(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.array_equal(pixels, inputs["image"]) else "what has no weight came through"


def _complement(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    weights = np.array([0.2126, 0.7152, 0.0722])
    before, after = inputs["image"] @ weights, pixels @ weights
    return None if np.allclose(before, after, atol=2e-6) else "the luminance changed"


def _apart(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    before, after = np.ptp(inputs["image"]), np.ptp(pixels)
    return None if np.isclose(after, 0.5 * before, rtol=1e-4) else f"contrast went from {before} to {after}"


def _noise(*shape: int) -> Array:
    return np.random.default_rng(11).random(shape, dtype=np.float32)


CASES = (
    HardCase(
        name="extrapolation near the largest float",
        why="-2 base overflows before 3 image brings it back",
        inputs=lambda: {k: np.full((3, 7, 3), 3e38, np.float32) for k in ("image", "base")},
        parameters={"amount": 3.0},
        holds=_overflow,
    ),
    HardCase(
        name="a base of no weight that is NaN",
        why="0 times NaN is NaN",
        inputs=lambda: {"image": _noise(5, 9, 3), "base": np.full((5, 9, 3), np.nan, np.float32)},
        parameters={"amount": 1.0},
        holds=_same,
    ),
    HardCase(
        name="complement keeps luminance",
        why="weights for encoded colour, used on light, change it",
        inputs=lambda: {"image": _noise(9, 13, 3)},
        parameters={"preset": "saturation", "amount": -1.0},
        holds=_complement,
    ),
    HardCase(
        name="towards grey is less contrast",
        why="the source says the opposite",
        inputs=lambda: {"image": _noise(9, 13, 1)},
        parameters={"preset": "contrast", "amount": 0.5},
        holds=_apart,
    ),
)
