"""Laplacians against OpenCV and SciPy, and on surfaces whose curvature is known."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.image import Alpha, Image, Space, as_image
from lichen.operation import Border
from lichen.operations.convolution.laplacian import Mask, laplacian, profiles, terms

PIXELS = np.random.default_rng(7).random((31, 37))
SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


def exact(**given: object) -> np.ndarray:
    return laplacian.evaluate_truth({"image": as_image(PIXELS)}, laplacian.validate(given))[..., 0]


def test_masks_agree_with_opencv_and_scipy() -> None:
    expected = cv2.Laplacian(PIXELS, cv2.CV_64F, ksize=1, borderType=cv2.BORDER_REFLECT_101)
    np.testing.assert_allclose(exact(border="reflect101"), expected, atol=1e-13)
    for border in Border:
        expected = ndimage.laplace(PIXELS, mode=SCIPY[border], cval=0.3)
        np.testing.assert_allclose(exact(border=border, value=0.3), expected, atol=1e-13)


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("sigma", [2.0, 4.5])
def test_gaussian_agrees_with_scipy(sigma: float, border: Border) -> None:
    """SciPy leaves the sampled second derivative as it is; at these sigmas that matters little.

    Its constant comes anew before the second pass; here the continued image is what is differentiated.
    """
    around = np.pad(PIXELS, 50, constant_values=0.3) if border is Border.CONSTANT else PIXELS
    expected = ndimage.gaussian_laplace(around, sigma, mode=SCIPY[border], cval=0.3, truncate=8)
    expected = expected[50:-50, 50:-50] if border is Border.CONSTANT else expected
    made = exact(mask="gaussian", sigma=sigma, border=border, value=0.3)
    np.testing.assert_allclose(made, expected, atol=1e-6)


@pytest.mark.parametrize("sigma", [0.5, 1.0, 7.3, 60.0])
def test_profiles_have_the_moments_of_derivatives(sigma: float) -> None:
    smooth, second = profiles(sigma)
    at = np.arange(len(smooth)) - len(smooth) // 2
    assert smooth.sum() == pytest.approx(1)
    assert second.sum() == pytest.approx(0, abs=1e-14)
    assert second @ at**2 == pytest.approx(2)


@pytest.mark.parametrize("mask", list(Mask))
@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_bowls_curve_by_four_and_planes_do_not(mask: Mask, backend: str) -> None:
    y, x = np.mgrid[-20:21, -20:21] / np.float32(8)
    for surface, expected in ((x * x + y * y, 4 / 64), (x * x - y * y, 0), (3 * x - y + 2, 0)):
        made = lichen.run("laplacian", surface.astype(np.float32), mask=mask, sigma=1.2, device=backend).image.pixels
        np.testing.assert_allclose(made[10:-10, 10:-10], expected, atol=2e-5)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_coverage_is_kept_and_corners_carry_no_nan(backend: str) -> None:
    pixels = np.random.default_rng(1).random((9, 9, 4), dtype=np.float32)
    pixels[4, 4, 0] = np.nan
    made = lichen.run("laplacian", Image(pixels, Space.LINEAR, Alpha.ASSOCIATED), device=backend).image.pixels
    assert np.array_equal(made[..., 3], pixels[..., 3])
    assert np.count_nonzero(np.isnan(made)) == 5


def test_point_shows_the_mask() -> None:
    point = np.zeros((5, 5), np.float32)
    point[2, 2] = 1
    for mask in (Mask.FOUR, Mask.EIGHT, Mask.ISOTROPIC):
        made = lichen.run("laplacian", point, mask=mask).image.pixels[1:4, 1:4, 0]
        np.testing.assert_allclose(made, terms(mask, 1.0, 1.0)[0][0].taps, atol=1e-6)
