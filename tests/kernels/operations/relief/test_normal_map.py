"""Normal maps against the analytic normals of surfaces and against scikit-image's and SciPy's derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import lichen


def waves(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights of long waves, and their normals by calculus (y up)."""
    y, x = np.mgrid[0:size, 0:size].astype(float)
    heights = np.sin(0.05 * x) * np.cos(0.04 * y)
    p, q = 0.05 * np.cos(0.05 * x) * np.cos(0.04 * y), -0.04 * np.sin(0.05 * x) * np.sin(0.04 * y)
    normals = np.stack([-6 * p, 6 * q, np.ones_like(p)], axis=-1)
    return heights[..., None].astype(np.float32), normals / np.linalg.norm(normals, axis=-1, keepdims=True)


@pytest.mark.parametrize("mask", ["central", "sobel", "gaussian"])
def test_the_normals_of_a_wavy_surface(mask: str) -> None:
    heights, exact = waves(96)
    found = lichen.run("normal_map", heights, mask=mask, scale=6).image.pixels
    assert np.abs(found - exact)[4:-4, 4:-4].max() < (3e-3 if mask == "gaussian" else 1e-3)


@pytest.mark.parametrize(("mask", "weights"), [("central", (0, 1, 0)), ("sobel", (1, 2, 1))])
def test_slopes_are_those_of_scipy(mask: str, weights: tuple[int, ...]) -> None:
    heights = np.random.default_rng(1).random((20, 23, 1)).astype(np.float32)
    across = np.array(weights) / sum(weights)
    p, q = (
        ndimage.correlate1d(ndimage.correlate1d(heights[..., 0].astype(float), [-0.5, 0, 0.5], axis), across, 1 - axis)
        for axis in (1, 0)
    )
    expected = np.stack([-p, q, np.ones_like(p)], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    found = lichen.evaluate_truth("normal_map", heights, mask=mask, scale=1, border="reflect")
    assert np.allclose(found, expected, atol=1e-12)


def test_the_wide_mask_is_the_derivative_of_a_gaussian() -> None:
    """At a sigma that seven pixels hold, SciPy's own derivative of a Gaussian is the same to what they cut off."""
    heights = np.random.default_rng(2).random((30, 31, 1)).astype(np.float32)
    p, q = (
        ndimage.gaussian_filter(heights[..., 0].astype(float), 0.8, order, truncate=3 / 0.8)
        for order in ((0, 1), (1, 0))
    )
    found = lichen.evaluate_truth("normal_map", heights, mask="gaussian", sigma=0.8, scale=1, border="reflect")
    assert np.allclose(found[..., :2] / found[..., 2:], np.stack([-p, q], axis=-1), atol=2e-3)


def test_conventions_and_encodings() -> None:
    heights, _ = waves(24)
    plain = lichen.evaluate_truth("normal_map", heights)
    turned = lichen.evaluate_truth("normal_map", heights, convention="directx", encoding="unit")
    assert np.allclose(turned, (plain * [1, -1, 1] + 1) / 2)
    assert np.allclose(lichen.evaluate_truth("normal_map", heights, scale=-4), plain * [-1, -1, 1])
