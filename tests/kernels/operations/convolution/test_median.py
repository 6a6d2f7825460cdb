"""Medians against SciPy and OpenCV, bit for bit."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

import lichen
from lichen.image import as_image
from lichen.opencl.device import default_device
from lichen.operation import Border, Facts
from lichen.operations.convolution.median import median

SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


@settings(max_examples=50, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 70), st.integers(1, 120), st.sampled_from([1, 2, 3, 4, 7, 64])),
    size=st.sampled_from([3, 5, 7, 15]),
    border=st.sampled_from(list(Border)),
    few=st.booleans(),
    seed=st.integers(0, 2**31),
)
def test_every_method_is_the_median(
    shape: tuple[int, int, int], size: int, border: Border, few: bool, seed: int
) -> None:
    """Of values of both signs, with and without many that are equal."""
    pixels = np.random.default_rng(seed).standard_normal(shape).astype(np.float32)
    pixels = np.round(pixels) + np.float32(0) if few else pixels
    expected = ndimage.median_filter(pixels, (size, size, 1), mode=SCIPY[border], cval=0.25)
    inputs, device = {"image": as_image(pixels)}, default_device()
    p = median.validate({"size": size, "border": border, "value": 0.25})
    facts = {"image": Facts.of(inputs["image"])}
    assert device is not None
    for method in median.methods.values():
        if method.unfit(p, facts) is None:
            assert np.array_equal(method.implementation.opencl(device, inputs, p, 0), expected), method.name
    assert np.array_equal(median.methods["bisect"].implementation.numpy(inputs, p, 0), expected)


@pytest.mark.parametrize("size", [3, 5])
def test_agrees_with_opencv(size: int) -> None:
    pixels = np.random.default_rng(1).random((150, 300, 3), dtype=np.float32)
    result = lichen.run("median", pixels, size=size, border="clamp")
    assert result.method == "network"
    assert np.array_equal(result.image.pixels, cv2.medianBlur(pixels, size))


@pytest.mark.parametrize("size", [3, 5, 7])
@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_nan_anywhere_in_the_window_is_the_result(size: int, backend: str) -> None:
    """Each place of the window in turn: exchanges must lose it in none."""
    for place in np.ndindex(size, size):
        pixels = np.random.default_rng(1).random((size, size), dtype=np.float32)
        pixels[place] = np.nan
        made = lichen.run("median", pixels, size=size, device=backend, border="constant").image.pixels
        assert np.isnan(made[size // 2, size // 2, 0]), place


def test_infinities_are_values_like_others() -> None:
    pixels = np.random.default_rng(1).random((40, 41), dtype=np.float32)
    pixels[::3, ::2], pixels[1::3, 1::2] = np.inf, -np.inf
    for size in (3, 5, 9):
        made = lichen.run("median", pixels, size=size).image.pixels[..., 0]
        assert np.array_equal(made, ndimage.median_filter(pixels, size))


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_what_lies_beyond_is_a_number_that_pixels_can_hold(backend: str) -> None:
    """Else choosing among pixels would round, and coverage of that size make much of it."""
    pixels = np.random.default_rng(3).random((13, 29, 2), dtype=np.float32)
    values = {"size": 15, "border": "constant", "value": 315.00914332331695, "alpha": "straight", "device": backend}
    result = lichen.run("median", pixels, **values)
    truth = lichen.evaluate_truth("median", pixels, **values)
    assert np.array_equal(result.image.pixels, truth)
    assert result.error.value == 0
