"""Chromatic aberration against scipy's scaled planes, and against itself taken out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import lichen

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)


def smooth(height: int = 60, width: int = 80) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([0.5 + 0.4 * np.sin(x / 9 + k) * np.cos(y / 11 - k) for k in range(3)], axis=-1).astype(np.float32)


@BOTH
def test_planes_are_scaled_about_the_centre(backend: str) -> None:
    image, scales, centre = smooth(), (1.06, 1.0, 1.02), (0.4, 0.55)
    found = lichen.run(
        "chromatic_aberration", image, scales=scales, centre=centre, border="clamp", device=backend, method="lanczos3"
    ).image.pixels
    v, u = np.mgrid[0:60, 0:80] + 0.5
    for k, scale in enumerate(scales):
        x, y = 32 + (u - 32) / scale - 0.5, 33 + (v - 33) / scale - 0.5
        expected = ndimage.map_coordinates(image[..., k].astype(np.float64), [y, x], order=5, mode="nearest")
        assert np.abs(found[..., k] - expected)[4:-4, 4:-4].max() < 2e-3
    assert np.array_equal(found[..., 1], image[..., 1])


@BOTH
def test_what_was_put_in_is_taken_out(backend: str) -> None:
    image, scales = smooth(), (1.01, 1.0, 0.99)
    there = lichen.run("chromatic_aberration", image, scales=scales, border="clamp", device=backend).image.pixels
    back = lichen.run(
        "chromatic_aberration", there, scales=[1 / s for s in scales], border="clamp", device=backend
    ).image.pixels
    assert np.abs(there - image).max() > 0.01
    assert np.abs(back - image)[4:-4, 4:-4].max() < 4e-3
