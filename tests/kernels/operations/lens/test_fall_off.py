"""Vignettes against geometry by hand, disparities against two cameras that project points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

import lichen
from lichen.operations.lens.vignette import Lens, Parameters, tabled

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(13)


@BOTH
def test_illumination_falls_as_the_fourth_power_of_the_cosine(backend: str) -> None:
    white = np.ones((30, 50, 3), np.float32)
    found = lichen.run("vignette", white, fov=70, device=backend, method="exact").image.pixels
    focal = 15 / math.tan(math.radians(35))
    y, x = np.mgrid[0:30, 0:50] + 0.5
    cosine = focal / np.sqrt(focal**2 + (x - 25) ** 2 + (y - 15) ** 2)
    assert np.abs(found - cosine[..., None] ** 4).max() < 1e-6


@BOTH
def test_rims_leave_what_two_discs_share(backend: str) -> None:
    white = np.ones((21, 31, 1), np.float32)
    found = lichen.run("vignette", white, power=0, mechanical=0.8, device=backend, method="exact").image.pixels
    for row, column in ((0, 0), (10, 15), (3, 28), (20, 7)):
        r = math.hypot(column + 0.5 - 15.5, row + 0.5 - 10.5) / (math.hypot(31, 21) / 2)
        d = 2 * 0.8 * r
        # Half of the lens lies beyond its chord, at d / 2 from each centre.
        area = 4 * quad(lambda x: math.sqrt(max(1 - x * x, 0)), d / 2, 1)[0]
        assert found[row, column, 0] == pytest.approx(area / math.pi, abs=1e-6)


@BOTH
def test_what_was_put_in_is_taken_out(backend: str) -> None:
    image = RNG.random((40, 60, 4)).astype(np.float32)
    given = {"fov": 60, "mechanical": 0.5, "device": backend, "method": "exact"}
    dark = lichen.run("vignette", image, **given).image.pixels
    back = lichen.run("vignette", dark, remove=True, **given).image.pixels
    assert dark.mean() < 0.9 * image.mean()
    assert np.abs(back - image).max() < 2e-6


def test_more_entries_cost_less_error() -> None:
    white = np.ones((64, 96, 1), np.float32)
    exact = lichen.run("vignette", white, mechanical=0.9, method="exact").image.pixels
    last = 1.0
    for entries in (8, 32, 128):
        result = lichen.run("vignette", white, mechanical=0.9, method="table", entries=entries)
        off = float(np.abs(result.image.pixels - exact).max())
        assert off <= result.error.value
        assert off < last / 6
        last = off


@pytest.mark.parametrize("entries", [5, 33, 128, 1024])
@pytest.mark.parametrize("mechanical", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("largest", [1.0, 3.0, 16.0])
def test_the_largest_error_of_a_table_is_found_wherever_it_is(entries: int, mechanical: float, largest: float) -> None:
    """Where the gain comes to its limit, say: looked for at all places here, and at the likely ones there."""
    for remove, centre in ((False, (0.5, 0.5)), (True, (0.1, 0.7))):
        p = Parameters(fov=80, mechanical=mechanical, remove=remove, largest=largest, centre=centre)
        lens = Lens(p, 123, 77)
        places = np.linspace(0, lens.farthest, (entries - 1) * 16 + 1)
        gains = lens.gain(places)
        expected = 1.1 * np.abs(np.interp(places, places[::16], gains[::16]) - gains).max()
        assert tabled(lens, entries)[0] == pytest.approx(expected, rel=1e-6, abs=1e-12)


@BOTH
def test_two_cameras_see_what_the_disparity_says(backend: str) -> None:
    depth = RNG.uniform(0.5, 20, (24, 30, 1)).astype(np.float32)
    found = lichen.run("disparity", depth, baseline=0.2, convergence=3.0, fov=50, device=backend).image.pixels
    focal = 12 / math.tan(math.radians(25))
    point = RNG.uniform(-1, 1, depth.shape)
    z = depth.astype(np.float64)
    left, right = focal * (point + 0.1) / z, focal * (point - 0.1) / z
    apart = left - right - focal * 0.2 / 3  # pictures are shifted until what lies at 3 coincides
    assert np.abs(found - apart).max() < 1e-5
