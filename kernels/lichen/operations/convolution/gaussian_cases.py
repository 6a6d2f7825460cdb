"""Inputs that break naive blurs, and what must hold for ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase


def _one_nan() -> dict[str, Array]:
    pixels = np.full((33, 35, 1), 0.5, np.float32)
    pixels[16, 17] = np.nan
    return {"image": pixels}


def _contained(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    outside = np.ones(pixels.shape, bool)
    outside[10:23, 11:24] = False  # six sigma either way
    if np.isnan(pixels[outside]).any():
        return "NaN left the footprint"
    return None if np.isnan(pixels[16, 17]) else "NaN turned into a colour"


def _equal(expected: Array | float, tolerance: float) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        apart = float(np.abs(pixels[..., 0] - expected).max())
        return None if apart <= tolerance else f"off by {apart:.3g}"

    return holds


CASES = (
    HardCase(
        name="one NaN",
        why="running sums and transforms smear it over rows or the whole image",
        inputs=_one_nan,
        parameters={"sigma": 1.0},
        holds=_contained,
    ),
    HardCase(
        name="wider than the image",
        why="kernels longer than the image index far outside, or cost without bound",
        inputs=lambda: {"image": np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)},
        parameters={"sigma": 5000.0},
        holds=_equal(0.5, 1e-6),
    ),
    HardCase(
        name="nearly no blur",
        why="a kernel of one tap must not divide by zero or shift",
        inputs=lambda: {"image": np.eye(8, dtype=np.float32)},
        parameters={"sigma": 1e-6},
        holds=_equal(np.eye(8), 1e-6),
    ),
    HardCase(
        name="large beside small",
        why="a spectrum in float32 loses 1e-3 beside 1e4, and light turns negative",
        inputs=lambda: {"image": np.where(np.arange(256) < 8, 1e4, 1e-3).astype(np.float32).reshape(1, 256)},
        parameters={"sigma": 1.0},
        holds=lambda inputs, pixels: None if pixels.min() > 0 else "negative light",
        methods=("fir",),
    ),
)
