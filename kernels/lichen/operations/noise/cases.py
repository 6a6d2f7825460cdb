"""Parameters that break naive noise, and what must hold for the picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

SIZE = {"width": 48, "height": 40}


def _nothing() -> Mapping[str, Any]:
    return {}


def _inside(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Finite, within [0, 1], and not all the same."""
    if not np.isfinite(pixels).all():
        return "values are not finite"
    if pixels.min() < -1e-5 or pixels.max() > 1 + 1e-5:
        return f"values in [{pixels.min()}, {pixels.max()}] leave the range that is proved"
    return None if pixels.std() > 1e-4 else "the picture is plain"


def _constant(value: float) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        return (
            None if (pixels == np.float32(value)).all() else f"not {value} all over: {pixels.min()} to {pixels.max()}"
        )

    return holds


def zero_at_corners() -> HardCase:
    return HardCase(
        "pixels on corners",
        "gradient noise is 0 at lattice points, so sampling there gives one value",
        _nothing,
        {**SIZE, "cell": 1, "x": -7.5, "y": 3.5, "octaves": 1, "antialias": False},
        _constant(0.5),
    )


def lattice_cases() -> tuple[HardCase, ...]:
    """Hard cases of every noise that sums octaves."""
    return (
        HardCase(
            "far from the origin",
            "float32 has no fractions beyond 2^23, and float64 few at 2^50",
            _nothing,
            {**SIZE, "cell": 16, "x": 16e7 + 0.25, "y": -(2.0**39) - 3, "octaves": 4},
            _inside,
        ),
        HardCase(
            "across zero", "truncation is no floor", _nothing, {**SIZE, "cell": 7, "x": -20.5, "y": -20.5}, _inside
        ),
        HardCase("no octave", "an empty sum", _nothing, {**SIZE, "octaves": 0}, _constant(0.5)),
        HardCase(
            "thirty octaves",
            "most of them finer than any pixel, the last by 2^24",
            _nothing,
            {**SIZE, "cell": 30, "octaves": 30, "gain": 0.9},
            _inside,
        ),
        HardCase(
            "one cell",
            "the cell's neighbours are itself",
            _nothing,
            {**SIZE, "cell": 40, "tile": True, "octaves": 3, "lacunarity": 1.7},
            _inside,
        ),
        HardCase(
            "finer than pixels",
            "every octave is beyond the limit of sampling",
            _nothing,
            {**SIZE, "cell": 0.01, "octaves": 5},
            _plain,
        ),
        HardCase(
            "amplitudes that grow",
            "H = -1: the finest octave has the most weight",
            _nothing,
            {**SIZE, "cell": 32, "octaves": 3, "gain": 2.0, "fractal": "billow"},
            _inside,
        ),
    )


def _plain(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.ptp(pixels) == 0 and 0 <= pixels.flat[0] <= 1 else "not plain"
