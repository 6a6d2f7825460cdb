"""The unsharp mask against SciPy and scikit-image."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage
from skimage import filters

import lichen
from lichen.image import Alpha, Image, Space, as_image
from lichen.operations.convolution.sharpen import sharpen

PIXELS = np.random.default_rng(7).random((31, 37))


def exact(**given: object) -> np.ndarray:
    return sharpen.evaluate_truth({"image": as_image(PIXELS)}, sharpen.validate(given))[..., 0]


def test_truth_agrees_with_scipy() -> None:
    blurred = ndimage.gaussian_filter(PIXELS, 1.7, truncate=9)
    detail = PIXELS - blurred
    np.testing.assert_allclose(exact(sigma=1.7, amount=1.4), PIXELS + 1.4 * detail, atol=1e-12)
    soft = np.sign(detail) * np.maximum(np.abs(detail) - 0.2, 0)
    np.testing.assert_allclose(exact(sigma=1.7, amount=1.4, threshold=0.2), PIXELS + 1.4 * soft, atol=1e-12)
    np.testing.assert_allclose(exact(sigma=1.7, amount=-1), blurred, atol=1e-12)


def test_agrees_with_scikit_image() -> None:
    """It cuts the blur at four sigma."""
    expected = filters.unsharp_mask(PIXELS, radius=2, amount=0.8, preserve_range=True)  # type: ignore[no-untyped-call]
    np.testing.assert_allclose(exact(sigma=2, amount=0.8), expected, atol=2e-4)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_coverage_is_kept_and_nothing_to_add_changes_nothing(backend: str) -> None:
    pixels = np.random.default_rng(1).random((19, 23, 4), dtype=np.float32)
    picture = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED)
    made = lichen.run("sharpen", picture, device=backend, amount=3).image.pixels
    assert np.array_equal(made[..., 3], pixels[..., 3])
    assert np.abs(made[..., :3] - pixels[..., :3]).max() > 0.5
    unchanging: list[dict[str, Any]] = [{"amount": 0}, {"sigma": 0}, {"threshold": 2}]
    for nothing in unchanging:
        assert lichen.run("sharpen", picture, device=backend, **nothing).method == "identity"
