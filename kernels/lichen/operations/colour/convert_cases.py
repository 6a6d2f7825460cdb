"""Colours on which a careless conversion goes wrong, and the examples that tests and documentation run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.memory import Array
from lichen.operation import HardCase

Holds = Callable[[Mapping[str, Any], Array], str | None]
NAN, INF = math.nan, math.inf


def _row(*pixels: tuple[float, ...]) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.array([pixels], dtype=np.float32)}


def _close(*expected: tuple[float, ...], absolute: float = 1e-5) -> Holds:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        if np.allclose(pixels[0], np.array(expected), rtol=1e-5, atol=absolute, equal_nan=True):
            return None
        return f"expected {list(expected)}, got {pixels[0].tolist()}"

    return holds


def _greys() -> Mapping[str, Any]:
    """Every 8-bit grey with noise of 1e-7, on its channels by turns."""
    grey = np.repeat(np.arange(256, dtype=np.float64) / 255, 3).reshape(1, 256, 3)
    noise = np.random.default_rng(5).uniform(-1e-7, 1e-7, grey.shape)
    return {"image": (grey + noise).astype(np.float32)}


def _no_hue(channel: int) -> Holds:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        hues = pixels[..., channel]
        return None if not hues.any() else f"grey has hue {hues[hues != 0][:5].tolist()}"

    return holds


def _colourless(limit: float) -> Holds:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        worst = float(np.abs(pixels[..., 1:]).max())
        return None if worst <= limit else f"grey has colour {worst:.3g}"

    return holds


def _all_nan(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    return None if np.isnan(pixels).all() else f"NaN became {pixels.reshape(-1).tolist()}"


EXACT_GREYS = np.repeat(np.linspace(0, 1, 64, dtype=np.float32), 3).reshape(1, 64, 3)
SPOILT = _row((NAN, 0.5, 0.5), (0.5, NAN, 0.5), (0.5, 0.5, NAN), (NAN, NAN, NAN))


def _from(source: str, target: str, **more: str) -> dict[str, str]:
    return {"source": source, "target": target, **more}


CASES = (
    *(
        HardCase(
            f"near grey in {name}", "the hue of grey is noise, and must be 0 for all of it",
            _greys, _from("srgb", name), _no_hue(channel),
        )
        for name, channel in (("hsv", 0), ("hsl", 0), ("lch", 2), ("oklch", 2))
    ),
    HardCase(
        "white and grey in oklab", "the printed matrices give D65's white a tint of 1e-4",
        lambda: {"image": EXACT_GREYS}, _from("srgb", "oklab"), _colourless(3e-7),
    ),
    HardCase(
        "grey in lab", "a white point of four digits tints grey by 0.02",
        lambda: {"image": EXACT_GREYS}, _from("srgb", "lab"), _colourless(1e-4),
    ),
    HardCase(
        "hue wraps", "hues on either side of red are next to each other",
        _row((0, 1, 1), (360, 1, 1), (-120, 1, 1), (600, 1, 1), (359.99998, 1, 1)), _from("hsv", "srgb"),
        _close((1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1), (1, 0, 0)),
    ),
    HardCase(
        "all branches of hsv", "blue's branch is the one that is mistyped",
        _row((1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1), (1, 0, 1), (0.2, 0.1, 1), (0, 0, 0)),
        _from("srgb", "hsv"),
        _close(
            (0, 1, 1), (60, 1, 1), (120, 1, 1), (180, 1, 1), (240, 1, 1), (300, 1, 1), (246.66667, 0.9, 1), (0, 0, 0)
        ),
    ),
    HardCase(
        "bright light in lab", "a clipped or tabulated conversion ends at L = 100",
        _row((4, 2, 0.5), (1000, 1000, 1000)), _from("linear_bt709", "lab"),
        _close((137.4968, 24.4033, 84.8724), (1144, 0, 0), absolute=2e-2),
    ),
    HardCase(
        "NaN in lab", "a table makes a colour of NaN", SPOILT, _from("srgb", "lab"), _all_nan,
    ),
    HardCase(
        "NaN in hsv", "comparisons and maxima drop NaN", SPOILT, _from("srgb", "hsv"), _all_nan,
    ),
    HardCase(
        "NaN in oklch", "atan2 and clamps drop NaN", SPOILT, _from("linear_bt709", "oklch"), _all_nan,
    ),
    HardCase(
        "NaN of one ink", "a matrix with zeros carries a NaN into every channel",
        _row((NAN, 0.25, 1)), _from("srgb", "cmy"), _close((NAN, 0.75, 0)),
    ),
    HardCase(
        "black in cmyk", "0 / 0 in undercolour removal",
        _row((0, 0, 0), (1, 1, 1), (0.5, 0.25, 0), (1e-40, 0, 0)), _from("srgb", "cmyk"),
        _close((0, 0, 0, 1), (0, 0, 0, 0), (0, 0.5, 1, 0.5), (0, 0, 0, 1)),
    ),
    HardCase(
        "black has no chromaticity", "0 / 0", _row((0, 0, 0), (1e-40, 0, 0)), _from("linear_bt709", "xyy"),
        _close((0.3127, 0.329, 0), (0.3127, 0.329, 0)),
    ),
    HardCase(
        "black in luv", "0 / 0 in u' and v', both ways", _row((0, 0, 0), (0, 5, -5)), _from("luv", "luv", white="d50"),
        _close((0, 0, 0), (0, 5, -5)),
    ),
    HardCase(
        "luv without lightness", "dividing by 13 L", _row((0, 0, 0), (0, 5, -5)), _from("luv", "xyz"),
        _close((0, 0, 0), (0, 0, 0)),
    ),
    HardCase(
        "negative light", "a root of a negative number is NaN",
        _row((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), _from("linear_bt709", "adobe_rgb"),
        _close((-0.72967, -0.72967, -0.72967), (0.72967, 0.72967, 0.72967)),
    ),
    HardCase(
        "pq at no light, at its peak, of negative light and of NaN", "a quotient of infinities, and a power of NaN",
        _row((0, 10000 / 203, -10000 / 203), (NAN, INF, 1)), _from("linear_bt2020", "bt2100_pq"),
        _close((7.31e-7, 1, -1), (NAN, 1.99206, 0.58069)),
    ),
    HardCase(
        "light beyond float32's range on the way", "1e30 decodes to 1e72, whose lightness float32 can hold",
        _row((1e30, 1e30, 1e30)), _from("srgb", "xyy"), _close((0.3127, 0.329, INF)), methods=("double",),
    ),
)  # fmt: skip

_ONE = _from("luminance", "srgb")
_LISTED = (
    _from("srgb", "lab"), _from("srgb", "hsv"), _from("lab", "srgb"), _from("ycbcr_2020_narrow", "dci_p3"),
    _from("srgb", "oklch"), _from("linear_bt709", "xyy", white="d50"), _from("oklch", "srgb"), _from("cmyk", "srgb"),
    _from("srgb", "luv"), _from("srgb", "hsl"), _from("srgb", "cmyk"), _from("acescg", "display_p3"),
    _from("luv", "linear_bt709"), _from("hsl", "srgb"), _from("xyy", "acescg", adaptation="cat16"),
    _from("adobe_rgb", "lch", white="d50", adaptation="von_kries"),
)  # fmt: skip
EXAMPLES: tuple[Mapping[str, Any], ...] = tuple(
    example for at in range(0, len(_LISTED), 4) for example in (_ONE, _from("luminance", "lch"), *_LISTED[at : at + 4])
)
"""In sixes, the first two of one channel: tests draw pictures of 1, 2, 3, 4, 5 and 8 channels in turn."""
