"""Motion blur against integrals by scipy, closed forms, and the bound of its samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.integrate import quad

import lichen

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(5)


@BOTH
def test_means_along_paths_are_the_integrals_of_what_lies_between_pixels(backend: str) -> None:
    image = RNG.random((17, 19, 1)).astype(np.float32)
    motion = RNG.normal(0, 4, (17, 19, 2)).astype(np.float32)
    found = lichen.run("motion_blur", image, motion=motion, device=backend, method="exact").image.pixels
    plane = np.pad(image[..., 0].astype(np.float64), 40, mode="edge")
    for row, column in ((0, 0), (8, 9), (16, 3), (5, 18), (11, 11)):
        x, y = motion[row, column].astype(np.float64)

        def value(t: float, at: tuple[float, ...] = (row, column, x, y)) -> float:
            place = [[at[0] + 40 - at[3] * t], [at[1] + 40 - at[2] * t]]
            return float(ndimage.map_coordinates(plane, place, order=1)[0])

        kinks = sorted({t for at, m in ((column, x), (row, y)) for t in (at - np.arange(-60, 60)) / m if abs(t) < 0.5})
        expected = quad(value, -0.5, 0.5, limit=500, epsabs=1e-7, points=kinks)[0]
        assert found[row, column, 0] == pytest.approx(expected, abs=2e-6)


@BOTH
def test_whole_pixels_along_a_row_are_a_trapezoid(backend: str) -> None:
    image = RNG.random((3, 40, 3)).astype(np.float32)
    motion = np.full((3, 40, 2), (6.0, 0.0), np.float32)
    found = lichen.run("motion_blur", image, motion=motion, start=0.0, device=backend, method="exact").image.pixels
    weights = np.array([0.5, 1, 1, 1, 1, 1, 0.5]) / 6
    expected = ndimage.correlate1d(image.astype(np.float64), weights, axis=1, mode="nearest", origin=3)
    assert np.abs(found - expected).max() < 1e-6


@BOTH
def test_the_exposure_looks_back_along_the_motion(backend: str) -> None:
    image = np.zeros((1, 21, 1), np.float32)
    image[0, 10] = 1
    motion = np.full((1, 21, 2), (4.0, 0.0), np.float32)
    given = {"motion": motion, "start": 0.0, "device": backend, "method": "exact"}
    later = lichen.run("motion_blur", image, **given).image.pixels[0, :, 0]
    assert (later[:10] == 0).all()
    assert later[10:16] == pytest.approx([0.125, 0.25, 0.25, 0.25, 0.125, 0], abs=1e-6)


def test_more_samples_come_nearer_and_keep_their_bound() -> None:
    image = RNG.random((40, 40, 1)).astype(np.float32)
    motion = RNG.normal(0, 5, (40, 40, 2)).astype(np.float32)
    exact = lichen.run("motion_blur", image, motion=motion, method="exact").image.pixels
    last = np.inf
    for samples in (4, 16, 64):
        result = lichen.run("motion_blur", image, motion=motion, method="sampled", samples=samples)
        apart = np.abs(result.image.pixels - exact)
        assert apart.max() <= result.error.value + 1e-6
        rms = float(np.sqrt(np.mean(apart**2)))
        assert rms < last / 2
        last = rms


@BOTH
def test_one_spoilt_vector_spoils_one_pixel(backend: str) -> None:
    motion = np.full((9, 9, 2), 2.0, np.float32)
    motion[4, 4, 1] = np.nan
    found = lichen.run("motion_blur", np.ones((9, 9, 1), np.float32), motion=motion, device=backend).image.pixels
    assert np.argwhere(np.isnan(found[..., 0])).tolist() == [[4, 4]]
