"""Noises that sum octaves of a lattice: their definitions evaluated by hand, and what every one of them must keep."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest

from . import by_hand

NAMES = tuple(by_hand.BASES)
SMOOTH = tuple(name for name in NAMES if name != "worley_noise")
RAW = {"antialias": False, "low": -1, "high": 1}


def truth(name: str, **values: Any) -> np.ndarray:
    return lichen.evaluate_truth(name, **values)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dimensions", [2, 3, 4])
@pytest.mark.parametrize("place", [(0.0, 0.0), (-37.25, 1e7 + 0.375), (2.0**31 * 11 + 0.3, -(2.0**39) - 0.7)])
def test_pictures_are_what_the_definition_says(name: str, dimensions: int, place: tuple[float, float]) -> None:
    values: dict[str, Any] = {
        "width": 4, "height": 2, "cell": [11.3, 7.7], "x": place[0], "y": place[1], "seed": 2**32 - 5, "octaves": 2,
        "lacunarity": 1.93, "gain": 0.7, "fractal": "fbm", "dimensions": dimensions, **RAW,
    }  # fmt: skip
    values |= {"z": -12345.6} if dimensions > 2 else {}
    values |= {"w": 0.4} if dimensions > 3 else {}
    values |= {"impulses": 2} if name in ("spot_noise", "gabor_noise") else {}
    p = lichen.operations()[name].validate(values)
    found = truth(name, **values)[..., 0]
    columns = (0, 3) if dimensions < 4 else (3,)
    for column in columns:
        assert found[1, column] == pytest.approx(by_hand.fbm(name, p, column, 1), abs=1e-9)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("perlin_noise", {"fade": "cubic"}),
        ("value_noise", {"fade": "cubic"}),
        ("worley_noise", {"metric": "manhattan", "feature": "f2"}),
        ("worley_noise", {"metric": "chebyshev", "feature": "f2-f1", "jitter": 0.4}),
        ("worley_noise", {"metric": "manhattan", "feature": "f2-f1"}),
        ("spot_noise", {"stretch": 3.5, "angle": 40}),
        ("gabor_noise", {"spread": 25, "angle": -70, "waves": 3.3}),
    ],
)
def test_choices_are_what_the_definition_says(name: str, values: dict[str, Any]) -> None:
    given = {"width": 6, "height": 5, "cell": 2.7, "octaves": 1, "fractal": "fbm", **RAW, **values}
    p = lichen.operations()[name].validate(given)
    found = truth(name, **given)[..., 0]
    for row, column in np.ndindex(found.shape):
        assert found[row, column] == pytest.approx(by_hand.fbm(name, p, column, row), abs=1e-9)


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_values_and_derivatives_are_continuous_over_cell_borders(name: str, dimensions: int) -> None:
    values = {"width": 24, "height": 24, "cell": 1, "octaves": 1, "output": "derivatives", "dimensions": dimensions}
    for axis in ("x", "y"):
        other = {"y": 0.3} if axis == "x" else {"x": 0.3}
        before, after = (truth(name, **values, **RAW, **other, **{axis: -12.5 + step}) for step in (-2e-9, 2e-9))
        assert np.abs(before - after).max() < 1e-6


def test_worley_is_continuous_over_cell_borders() -> None:
    for feature in ("f1", "f2", "f2-f1"):
        values = {"width": 64, "height": 64, "cell": 1, "octaves": 1, "feature": feature}
        before, after = (truth("worley_noise", **values, **RAW, x=-12.5 + step) for step in (-1e-8, 1e-8))
        assert np.abs(before - after).max() < 1e-6


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("warp", [0.0, 6.0])
def test_derivatives_are_those_of_the_values(name: str, warp: float) -> None:
    values = {"width": 20, "height": 16, "cell": 16, "octaves": 2, "fractal": "fbm", "warp": warp, **RAW}
    found = truth(name, **values, output="derivatives")
    for channel, axis in enumerate(("x", "y"), start=1):
        ahead, behind = (truth(name, **values, **{axis: step})[..., 0] for step in (1e-4, -1e-4))
        assert np.abs(found[..., channel] - (ahead - behind) / 2e-4).max() < 1e-6


@pytest.mark.parametrize("fractal", ["turbulence", "billow", "ridged"])
def test_derivatives_of_folded_octaves(fractal: str) -> None:
    values = {"width": 40, "height": 30, "cell": 24, "octaves": 3, "fractal": fractal, **RAW}
    found = truth("perlin_noise", **values, output="derivatives")
    ahead, behind = (truth("perlin_noise", **values, x=step)[..., 0] for step in (1e-5, -1e-5))
    apart = np.abs(found[..., 1] - (ahead - behind) / 2e-5)
    assert np.quantile(apart, 0.99) < 1e-5  # beside a crease the difference straddles it


def test_fractals_by_hand() -> None:
    values = {"width": 5, "height": 4, "cell": 9, "octaves": 3, "gain": 0.6, **RAW}
    p = lichen.operations()["perlin_noise"].validate(values)
    amplitudes = np.array([1, 0.6, 0.36]) / 1.96
    n = np.array([[[by_hand.octave("perlin_noise", p, k, x, y) for k in range(3)] for x in range(5)] for y in range(4)])
    weight, ridged = np.ones((4, 5)), np.zeros((4, 5))
    for k in range(3):
        signal = weight * (1 - np.abs(n[..., k])) ** 2
        ridged += amplitudes[k] * signal
        weight = np.clip(2 * signal, 0, 1)
    expected = {
        "none": n[..., 0],
        "fbm": n @ amplitudes,
        "turbulence": np.abs(n) @ amplitudes,
        "billow": (2 * np.abs(n) - 1) @ amplitudes,
        "ridged": 2 * ridged - 1,
    }
    for fractal, wanted in expected.items():
        assert np.abs(truth("perlin_noise", **values, fractal=fractal)[..., 0] - wanted).max() < 1e-12, fractal


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("cell", [8.0, 36.0], ids=["cells", "one cell"])
def test_tiles_repeat(name: str, cell: float) -> None:
    for dimensions in (2, 3):
        values = {"width": 36, "height": 30, "cell": cell, "octaves": 3, "fractal": "fbm", "lacunarity": 1.9}
        values |= {"tile": True, "dimensions": dimensions, "warp": 5, "method": "single", "tail": 0, "device": "numpy"}
        here, there = (lichen.run(name, **values, x=x, y=y).image.pixels for x, y in ((0, 0), (36, -30)))
        assert np.abs(here - there).max() < 1e-5
        assert np.ptp(here) > 1e-3


def test_time_comes_round() -> None:
    values = {"width": 32, "height": 32, "cell": 16, "octaves": 3, "dimensions": 3, "loop": 3, "lacunarity": 1.7}
    first, again, between = (truth("perlin_noise", **values, z=z) for z in (0.4, 3.4, 1.4))
    assert np.abs(first - again).max() < 1e-12
    assert np.abs(first - between).max() > 0.1


@pytest.mark.parametrize("name", NAMES)
def test_octaves_that_pixels_cannot_show_are_left_out(name: str) -> None:
    values = {"width": 48, "height": 48, "cell": 12, "fractal": "fbm"}
    result = lichen.run(name, **values, octaves=12, method="single", tail=0, device="numpy")
    octaves = result.findings["octaves"]
    assert octaves["asked"] == 12
    assert octaves["beyond_nyquist"] == 12 - octaves["computed"] > 5
    assert sorted(octaves["kept"], reverse=True) == octaves["kept"]
    everything = truth(name, **values, octaves=12, antialias=False)
    apart = float(np.abs(result.image.pixels - everything).max())
    assert 0 < apart <= octaves["left_out_at_most"]


def test_what_is_left_out_goes_in_by_its_mean() -> None:
    """A turbulence does not darken where its octaves are too fine to show."""
    values = {"width": 256, "height": 256, "octaves": 5, "fractal": "turbulence", "gain": 0.8}
    coarse, fine = (truth("perlin_noise", **values, cell=cell, antialias=cell < 10).mean() for cell in (64, 4))
    assert coarse == pytest.approx(fine, abs=0.01)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dimensions", [2, 3, 4])
def test_values_stay_in_the_range_that_is_proved(name: str, dimensions: int) -> None:
    """The first octave over many cells, and sums of the others."""
    size = {2: 220, 3: 90, 4: 40}[dimensions]
    values = {"width": size, "height": size, "cell": 2.3, "dimensions": dimensions, "octaves": 1, **RAW}
    values |= {"impulses": 1} if name in ("spot_noise", "gabor_noise") else {}
    for fractal in ("none", "ridged"):
        result = lichen.run(name, **values, fractal=fractal, device="numpy", method="single")
        low, high = result.findings["range"]
        assert low - 1e-5 <= result.image.pixels.min() < result.image.pixels.max() <= high + 1e-5


@pytest.mark.parametrize(
    ("name", "own"),
    [
        ("spot_noise", {"impulses": 3}),
        ("gabor_noise", {"impulses": 3}),
        ("wavelet_noise", {"octaves": 1}),
        ("wavelet_noise", {"octaves": 1, "depth": "solid"}),
    ],
)
@pytest.mark.parametrize("dimensions", [2, 3])
def test_sums_have_the_variance_that_follows(name: str, own: dict[str, Any], dimensions: int) -> None:
    """A sixteenth; a slice of a solid has that only over many slices."""
    size = 200 if dimensions == 2 else 110
    values = {"width": size, "height": size, "cell": 1.37, "dimensions": dimensions, **own, **RAW}
    pixels = lichen.run(name, **values, device="numpy", method="single").image.pixels
    assert pixels.var() == pytest.approx(1 / 16, rel=0.2 if "depth" in own else 0.06)
    assert abs(pixels.mean()) < 0.01


def test_every_flaw_is_named() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("perlin_noise", width=8, height=8, z=1, w=2, octaves=30, antialias=False)
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/z", "/parameters/w"]
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("perlin_noise", width=8, height=8, octaves=30, lacunarity=8, antialias=False)
    assert "/parameters/octaves" in {flaw.pointer for flaw in caught.value.flaws}
