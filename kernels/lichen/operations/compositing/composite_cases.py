"""Pictures that break naive compositing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.image import Alpha, Image
from lichen.memory import Array
from lichen.operation import HardCase


def _covered(*pixels: tuple[float, float, float, float]) -> Image:
    return Image(np.array([pixels], np.float32), alpha=Alpha.ASSOCIATED)


def _near(*expected: tuple[float, ...]) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(len(expected), -1)
        same = np.allclose(got, np.array(expected), rtol=1e-6, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


def _nowhere() -> Mapping[str, Any]:
    return {"image": _covered((0, 0, 0, 0), (0.5, 0, 0, 0)), "base": _covered((0, 0, 0, 0), (0.25, 0.5, 0, 0))}


def _beyond() -> Mapping[str, Any]:
    return {
        "image": _covered((-0.01, 0, 0.2, -0.02), (1.04, 0.5, 0, 1.03)),
        "base": _covered((0.5, 0.25, 0, 1), (0.2, 0, 0.3, -0.01)),
    }


def _hidden() -> Mapping[str, Any]:
    return {"image": _covered((0.5, 0.25, 0, 1), (0.5, 0.25, 0, 0.5)), "base": _covered(*[(np.nan, 1, 0.5, 1)] * 2)}


def _bright() -> Mapping[str, Any]:
    return {
        "image": np.array([[[2.0, 2.0, 2.0], [9.0, 0.5, 0.0]]], np.float32),
        "base": np.array([[[3.0, 3.0, 3.0], [0.5, 0.5, 0.5]]], np.float32),
    }


def _grey(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    fine = (
        np.isfinite(pixels).all()
        and np.allclose(pixels[0, 0], 3)
        and abs(pixels[0, 1] @ [0.2126, 0.7152, 0.0722] - 0.5) < 1e-6
    )
    return None if fine else f"got {pixels.tolist()}"


def _nearly_covered() -> Mapping[str, Any]:
    return {"image": _covered((0.99999994, 0.5, 1e-30, 1)), "base": _covered((1e-6, 1e-30, 0.5, 1e-30))}


CASES = (
    HardCase(
        name="no coverage on either side",
        why="straight colour is divided by nothing; light without coverage must stay",
        inputs=_nowhere,
        parameters={"blend": "multiply"},
        holds=_near((0, 0, 0, 0), (0.875, 0.5, 0, 0)),
    ),
    HardCase(
        name="coverage outside [0, 1]",
        why="filters with negative lobes leave it; clamped, their rings become edges",
        inputs=_beyond,
        parameters={},
        holds=_near((0.5, 0.255, 0.2, 1), (1.034, 0.5, -0.009, 1.0303)),
    ),
    HardCase(
        name="opaque before what is not a number",
        why="0 x NaN is NaN, though nothing of it shows",
        inputs=_hidden,
        parameters={},
        holds=_near((0.5, 0.25, 0, 1), (np.nan, 0.75, 0.25, 1)),
    ),
    HardCase(
        name="luminosity beyond white",
        why="a grey beyond white is clipped by the distance from its own lightness, which is zero",
        inputs=_bright,
        parameters={"blend": "color"},
        holds=_grey,
    ),
    HardCase(
        name="dodge by what is nearly white, over what is hardly covered",
        why="1 / (1 - cs) and cb / b leave all range",
        inputs=_nearly_covered,
        parameters={"blend": "color_dodge"},
        holds=lambda inputs, pixels: None if np.isfinite(pixels).all() and pixels.max() <= 1 else f"got {pixels}",
    ),
)
