"""Colour differences against colour-science and what must hold of any of them."""

from __future__ import annotations

from typing import Any

import colour
import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, Space

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(8)
FIRST, SECOND = (RNG.uniform((0, -90, -90), (100, 90, 90), (23, 19, 3)).astype(np.float32) for _ in range(2))
METHODS = {"cie76": "CIE 1976", "ciede2000": "CIE 2000"}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("formula", list(METHODS))
def test_agrees_with_colour_science(formula: str, backend: str) -> None:
    found = lichen.run("difference", FIRST, reference=SECOND, source="lab", formula=formula, device=backend).image
    expected = colour.delta_E(FIRST.astype(np.float64), SECOND.astype(np.float64), method=METHODS[formula])
    assert found.pixels.shape == (23, 19, 1)
    assert np.abs(found.pixels[..., 0] - expected).max() < 2e-5


@pytest.mark.parametrize("backend", BACKENDS)
def test_cie94_agrees_with_colour_science(backend: str) -> None:
    """Whose first argument is the reference."""
    found = lichen.run("difference", FIRST, reference=SECOND, source="lab", formula="cie94", device=backend).image
    expected = colour.delta_E(SECOND.astype(np.float64), FIRST.astype(np.float64), method="CIE 1994", textiles=False)
    assert np.abs(found.pixels[..., 0] - expected).max() < 2e-5


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("formula", ["cie76", "cie94", "ciede2000"])
def test_of_pictures(formula: str, backend: str) -> None:
    """sRGB pictures are compared in the light they stand for; a picture does not differ from itself."""
    first, second = (Image(RNG.random((9, 11, 3), dtype=np.float32), Space.SRGB) for _ in range(2))
    found = lichen.run("difference", first, reference=second, formula=formula, device=backend).image.pixels
    labs = [lichen.evaluate_truth("convert", each, target="lab") for each in (first, second)]
    expected = lichen.evaluate_truth("difference", labs[0], reference=labs[1], source="lab", formula=formula)
    assert np.abs(found - expected).max() < 1e-3
    assert not lichen.run("difference", first, reference=first, formula=formula, device=backend).image.pixels.any()


def test_every_mean_hue() -> None:
    """All around the circle, half the hues' distance from nothing to half a turn to either side, opposite ones among
    them: the mean hue meets the ends of the blue region's turn, and 0 degrees from both sides."""
    middle, half = (each.reshape(-1) for each in np.radians(np.meshgrid(np.arange(360), np.arange(-90, 91, 6))))
    hues, chroma = np.stack([middle - half, middle + half]), np.array([[30.0], [80.0]])
    first, second = np.stack([np.full(hues.shape, 50), chroma * np.cos(hues), chroma * np.sin(hues)], -1)
    pair = {"image": first[np.newaxis].astype(np.float32), "reference": second[np.newaxis].astype(np.float32)}
    image = pair.pop("image")
    expected = lichen.evaluate_truth("difference", image, source="lab", **pair)
    found = lichen.run("difference", image, source="lab", device="opencl", **pair).image.pixels
    assert np.abs(found - expected).max() < 2e-5


def _opposite() -> tuple[np.ndarray, np.ndarray]:
    """Hues that are opposite but for less and less, of chromas from none to much."""
    hue, apart = RNG.uniform(0, 2 * np.pi, 4096), 10.0 ** RNG.uniform(-9, 0, 4096) * RNG.choice([-1, 1], 4096)
    first, second = 10.0 ** RNG.uniform(-6, 2.2, (2, 4096))
    angle = hue + apart + np.pi
    left = np.stack([RNG.uniform(0, 100, 4096), first * np.cos(hue), first * np.sin(hue)], -1)
    right = np.stack([RNG.uniform(0, 100, 4096), second * np.cos(angle), second * np.sin(angle)], -1)
    return left, right


def _grey_and_blue() -> tuple[np.ndarray, np.ndarray]:
    """The blue region's turn grows with the root of the lesser chroma, which float32 finds where there is none."""
    blue = RNG.random((4096, 3)) * (0.3, 0, 1)
    grey = 10.0 ** RNG.uniform(-6, 0, (4096, 1)) * np.ones(3)
    return grey + 10.0 ** RNG.uniform(-9, -2, grey.shape) * RNG.normal(size=blue.shape), blue


def _decades() -> tuple[np.ndarray, np.ndarray]:
    first, second = 10.0 ** RNG.uniform(-6, 3, (2, 4096, 3))
    return first, second


@pytest.mark.parametrize("formula", ["cie76", "cie94", "ciede2000"])
@pytest.mark.parametrize(("pairs", "source"), [
    (_opposite, "lab"), (_grey_and_blue, "linear_bt709"), (_decades, "linear_bt709"),
    (lambda: (RNG.random((4096, 3)), RNG.random((4096, 3))), "linear_bt709"),
])  # fmt: skip
def test_single_keeps_what_it_states(formula: str, pairs: Any, source: str) -> None:
    first, second = (each[np.newaxis].astype(np.float32) for each in pairs())
    values = {"reference": second, "source": source, "formula": formula}
    found = lichen.run("difference", first, method="single", device="opencl", **values)
    apart = np.abs(found.image.pixels - lichen.evaluate_truth("difference", first, **values))
    assert apart.max() <= found.error.value
    assert apart.max() > 0  # what is in doubt alone is done in doubles


def test_single_knows_what_leaves_the_range_of_floats() -> None:
    first = np.array([[[50, 1e30, 0], [50, np.nan, 0], [50, 20, 0]]], np.float32)
    second = np.array([[[50, 0, 1e30], [50, 0, 0], [50, 0, 20]]], np.float32)
    for formula in ("cie76", "cie94", "ciede2000"):
        values = {"reference": second, "source": "lab", "formula": formula}
        found = lichen.run("difference", first, method="single", device="opencl", **values).image.pixels
        np.testing.assert_allclose(found, lichen.evaluate_truth("difference", first, **values), rtol=1e-5)


def test_sizes_must_agree() -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("difference", FIRST, reference=SECOND[:-1])
    assert refused.value.flaws[0].pointer == "/inputs/reference"
