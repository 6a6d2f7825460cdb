"""Inputs that break naive convolution, and what must hold for ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase


def _one_bad(bad: float) -> Callable[[], dict[str, Array]]:
    def make() -> dict[str, Array]:
        pixels = np.full((64, 64, 1), 0.5, np.float32)
        pixels[31, 33] = bad
        return {"image": pixels}

    return make


def _exactly(count: int) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        spoilt = int(np.count_nonzero(~np.isfinite(pixels)))
        return None if spoilt == count else f"{spoilt} pixels are not finite, not {count}"

    return holds


def _mask_is_flipped(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    expected = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.float32)
    return None if np.abs(pixels[3:6, 3:6, 0] - expected).max() < 1e-5 else "a point does not show the kernel"


def _point() -> dict[str, Array]:
    pixels = np.zeros((9, 9, 1), np.float32)
    pixels[4, 4] = 1
    return {"image": pixels}


CASES = (
    HardCase(
        name="one NaN",
        why="a transform, or a zero tap that is multiplied, spreads it beyond the 25 pixels it touches",
        inputs=_one_bad(np.nan),
        parameters={"name": "box", "size": 5},
        holds=_exactly(25),
    ),
    HardCase(
        name="one infinity in a large window",
        why="libraries switch to a transform for large kernels and lose the whole image",
        inputs=_one_bad(np.inf),
        parameters={"name": "box", "size": 15},
        holds=_exactly(225),
    ),
    HardCase(
        name="NaN under a zero tap",
        why="0 x NaN is NaN: the Laplacian's corners must not count",
        inputs=_one_bad(np.nan),
        parameters={"name": "laplacian"},
        holds=_exactly(5),
    ),
    HardCase(
        name="the image of a point",
        why="correlation is often called convolution; only convolution shows the kernel as it is written",
        inputs=_point,
        parameters={"kernel": [[1, 2, 3], [4, 5, 6], [7, 8, 9]]},
        holds=_mask_is_flipped,
    ),
    HardCase(
        name="kernel wider than the image",
        why="borders must be continued more than once",
        inputs=lambda: {"image": np.full((2, 3, 1), 0.75, np.float32)},
        parameters={"name": "disc", "radius": 20},
        holds=lambda inputs, pixels: None if np.abs(pixels - 0.75).max() < 1e-5 else "a constant image changed",
    ),
)
