"""Derivatives against OpenCV's Sobel and Scharr and SciPy's Gaussian, and their angles against known slopes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.image import Alpha, Image, Space, as_image
from lichen.operations.convolution.derivative import Mask, derivative, masks

PIXELS = np.random.default_rng(7).random((31, 37))


def exact(**given: object) -> np.ndarray:
    return derivative.evaluate_truth({"image": as_image(PIXELS)}, derivative.validate(given))[..., 0]


def test_masks_agree_with_opencv() -> None:
    for output, axis in (("x", (1, 0)), ("y", (0, 1))):
        sobel = cv2.Sobel(PIXELS, cv2.CV_64F, *axis, ksize=3, borderType=cv2.BORDER_REFLECT) / 8
        scharr = cv2.Scharr(PIXELS, cv2.CV_64F, *axis, borderType=cv2.BORDER_REFLECT) / 32
        np.testing.assert_allclose(exact(output=output), sobel, atol=1e-14)
        np.testing.assert_allclose(exact(output=output, mask="scharr"), scharr, atol=1e-14)
    x, y = exact(output="x"), exact(output="y")
    np.testing.assert_allclose(exact(output="l2"), np.sqrt(x * x + y * y), atol=1e-14)
    np.testing.assert_allclose(exact(output="l1"), np.abs(x) + np.abs(y), atol=1e-14)
    np.testing.assert_allclose(exact(output="direction"), np.degrees(np.arctan2(y, x)), atol=1e-12)


def test_prewitt_agrees_with_scipy() -> None:
    np.testing.assert_allclose(exact(mask="prewitt", output="x"), ndimage.prewitt(PIXELS, 1) / 6, atol=1e-14)


@pytest.mark.parametrize("sigma", [1.5, 4.0])
def test_gaussian_agrees_with_scipy(sigma: float) -> None:
    """SciPy leaves the slope of its cut kernel as it is; at these sigmas it is that of a ramp to 1e-6."""
    expected = ndimage.gaussian_filter(PIXELS, sigma, order=(0, 1), mode="reflect", truncate=8)
    np.testing.assert_allclose(exact(mask="gaussian", sigma=sigma, output="x"), expected, atol=1e-6)


@pytest.mark.parametrize("mask", list(Mask))
@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_ramps_keep_slope_and_direction(mask: Mask, backend: str) -> None:
    y, x = np.mgrid[0:60, 0:60].astype(np.float32)
    for angle in (0, 45, 90, 135, 180, -120):
        ramp = np.cos(np.radians(angle)) * x + np.sin(np.radians(angle)) * y
        middle = (30, 30, 0)
        found = {
            output: lichen.run(
                "derivative", ramp, mask=mask, output=output, angle=angle, device=backend, scale=0.5
            ).image.pixels[middle]
            for output in ("along", "l2", "direction")
        }
        assert found["along"] == pytest.approx(0.5, abs=1e-4)
        assert found["l2"] == pytest.approx(0.5, abs=1e-4)
        assert abs((found["direction"] - angle + 180) % 360 - 180) < 1e-2


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_direction_agrees_with_truth_where_there_is_a_slope(backend: str) -> None:
    pixels = PIXELS.astype(np.float32)
    made = lichen.run("derivative", pixels, output="direction", device=backend).image.pixels[..., 0]
    truth, steep = exact(output="direction"), exact(output="l2") > 0.02
    apart = np.abs((made - truth + 180) % 360 - 180)
    assert apart[steep].max() < 1e-3
    assert steep.mean() > 0.9


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_coverage_is_kept_and_zero_taps_carry_no_nan(backend: str) -> None:
    pixels = np.random.default_rng(1).random((9, 9, 4), dtype=np.float32)
    pixels[4, 4, 0] = np.nan
    picture = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED)
    made = lichen.run("derivative", picture, output="x", device=backend).image.pixels
    assert np.array_equal(made[..., 3], pixels[..., 3])
    assert np.argwhere(np.isnan(made)).tolist() == [[y, x, 0] for y in (3, 4, 5) for x in (3, 5)]


def test_masks_weigh_a_ramp_by_one() -> None:
    for mask in Mask:
        x, y = masks(mask, 2.0)
        at = np.arange(x.taps.shape[1]) - x.left
        assert (x.taps * at).sum() == pytest.approx(1)
        assert np.array_equal(x.taps.T, y.taps)
