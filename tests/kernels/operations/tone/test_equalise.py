"""Equalisation against scikit-image, and what it promises of its histogram."""

from __future__ import annotations

import numpy as np
import pytest
from skimage import exposure

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image

BACKENDS = ("opencl", "numpy")
PICTURE = (np.random.default_rng(9).random((67, 91, 3)) ** 2.5).astype(np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
def test_agrees_with_scikit_image_within_a_bin(backend: str) -> None:
    """Theirs joins the middles of the bins over the picture's own range; ours joins the edges."""
    grey = PICTURE[..., 0] ** np.float32(0.4)
    values = {"low": float(grey.min()), "high": float(grey.max()), "bins": 4096}
    got = lichen.run("equalise", grey, device=backend, **values).image.pixels[..., 0]
    share = (got - values["low"]) / (values["high"] - values["low"])
    np.testing.assert_allclose(share, exposure.equalize_hist(grey, nbins=4096), atol=2e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_agrees_with_numpys_histogram(backend: str) -> None:
    counts, edges = np.histogram(PICTURE, bins=64, range=(0, 1))
    cumulative = np.concatenate([[0], np.cumsum(counts)]) / PICTURE.size
    got = lichen.run("equalise", PICTURE, bins=64, device=backend).image.pixels
    np.testing.assert_allclose(got, np.interp(PICTURE, edges, cumulative), atol=1e-7)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("over", ["together", "each"])
def test_histogram_becomes_flat(backend: str, over: str) -> None:
    got = lichen.run("equalise", PICTURE, bins=4096, over=over, device=backend).image.pixels
    counts = np.histogram(got, bins=10, range=(0, 1))[0]
    np.testing.assert_allclose(counts / counts.sum(), 0.1, atol=5e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_not_covered_is_not_counted(backend: str) -> None:
    coverage = np.ones((67, 91, 1), np.float32)
    coverage[30:] = 0
    hidden = np.concatenate([PICTURE, coverage], axis=2)
    other = hidden.copy()
    other[30:, :, :3] = 7
    first, second = (
        lichen.run("equalise", Image(each, alpha=Alpha.STRAIGHT), device=backend).image.pixels
        for each in (hidden, other)
    )
    np.testing.assert_array_equal(first[:30], second[:30])
    np.testing.assert_array_equal(first[..., 3], hidden[..., 3])


@pytest.mark.parametrize("backend", BACKENDS)
def test_strength_goes_from_the_limited_value(backend: str) -> None:
    none = lichen.run("equalise", PICTURE * 2, strength=0, device=backend).image.pixels
    np.testing.assert_allclose(none, np.clip(PICTURE * 2, 0, 1), atol=1e-7)
    whole = lichen.run("equalise", PICTURE * 2, device=backend).image.pixels
    half = lichen.run("equalise", PICTURE * 2, strength=0.5, device=backend).image.pixels
    np.testing.assert_allclose(half, (none + whole) / 2, atol=1e-7)


def test_a_range_without_width_is_refused() -> None:
    with pytest.raises(InvalidRequest):
        lichen.run("equalise", PICTURE, low=0.5, high=0.5)
