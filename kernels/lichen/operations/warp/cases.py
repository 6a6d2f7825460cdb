"""Inputs of the family's hard cases, and what must hold of their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array

Given = Mapping[str, Any]
Holds = Callable[[Given, Array], str | None]


def constant() -> Given:
    return {"image": np.full((37, 29, 4), 0.7, np.float32)}


def stays_constant(inputs: Given, pixels: Array) -> str | None:
    wrong = float(np.abs(pixels - 0.7).max())
    return None if wrong <= 1e-6 else f"a constant became another by {wrong:g}"


def constant_or_background(inputs: Given, pixels: Array) -> str | None:
    """Every pixel is the image's constant or the background, 0, or between the two."""
    if not np.isfinite(pixels).all():
        return "not finite"
    outside = float(max(pixels.max() - 0.7, -pixels.min()))
    return None if outside <= 0.25 else f"beyond what there is by {outside:g}"


def ramp() -> Given:
    return {"image": np.broadcast_to(np.arange(24, dtype=np.float32)[None, :, None], (9, 24, 1)).copy()}


def shifted_ramp(by: float) -> Holds:
    def holds(inputs: Given, pixels: Array) -> str | None:
        inside = slice(6, 18)
        wrong = float(np.abs(pixels[:, inside, 0] - (np.arange(24, dtype=np.float64)[inside] - by)).max())
        return None if wrong <= 2e-4 else f"off by {wrong:g} px"

    return holds


def noise_with_nan() -> Given:
    pixels = np.random.default_rng(4).random((31, 23, 4), dtype=np.float32)
    pixels[11, 7, 1] = np.nan
    return {"image": pixels}


def unmoved(inputs: Given, pixels: Array) -> str | None:
    same = np.array_equal(pixels, inputs["image"], equal_nan=True)
    return None if same else "a map that moves nothing changed something"


def turned(inputs: Given, pixels: Array) -> str | None:
    same = np.array_equal(pixels, np.rot90(inputs["image"], -1), equal_nan=True)
    return None if same else "a quarter turn is not exact"


def nan_stays_near(inputs: Given, pixels: Array) -> str | None:
    spoilt = np.isnan(pixels)
    if spoilt[..., [0, 2, 3]].any():
        return "it left its channel"
    places = np.argwhere(spoilt[..., 1])
    if not len(places):
        return None
    rows, columns = places[:, 0], places[:, 1]
    near = abs(rows - 11).max() <= 3 and abs(columns - 7).max() <= 3
    return None if near else "it reached further than three samples"


def nothing_above(row: int, level: float) -> Holds:
    """Background, 0, down to that row; the constant below."""

    def holds(inputs: Given, pixels: Array) -> str | None:
        if np.abs(pixels[:row]).max() != 0:
            return "something is seen from behind"
        wrong = float(np.abs(pixels[row:] - level).max())
        return None if wrong <= 1e-6 else f"a constant became another by {wrong:g}"

    return holds


def constant_on_chart(chart: str) -> Holds:
    """The constant wherever the chart shows anything; the background around discs."""

    def holds(inputs: Given, pixels: Array) -> str | None:
        shown = np.ones(pixels.shape[:2], bool)
        if chart in ("mirror_ball", "paraboloid", "fisheye"):
            height, width = pixels.shape[0], pixels.shape[1]
            side = height
            y, x = np.mgrid[0:height, 0:width] + 0.5
            shown = np.hypot(x % side - side / 2, y - side / 2) <= side / 2
        wrong = float(np.abs(pixels[shown] - 0.7).max())
        if wrong > 1e-6:
            return f"a constant became another by {wrong:g}"
        return "something lies outside the discs" if pixels[~shown].any() else None

    return holds


def constant_of(across: int, down: int) -> Callable[[], Given]:
    """A constant image of so many sixteens of pixels."""
    return lambda: {"image": np.full((16 * down, 16 * across, 1), 0.7, np.float32)}
