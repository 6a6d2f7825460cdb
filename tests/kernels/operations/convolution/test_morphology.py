"""Morphology against SciPy, value for value, and the laws of openings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

import lichen
from lichen.image import Alpha, Image, Space, as_image
from lichen.opencl.device import default_device
from lichen.operation import Border
from lichen.operations.convolution.morphology import Step, morphology

SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


def by_scipy(pixels: np.ndarray, step: Step, size: tuple[int, int], border: Border) -> np.ndarray:
    """Odd windows about their middle."""

    def erode(image: np.ndarray) -> np.ndarray:
        return np.asarray(ndimage.minimum_filter(image, (*size, 1), mode=SCIPY[border], cval=0.25))

    def dilate(image: np.ndarray) -> np.ndarray:
        return np.asarray(ndimage.maximum_filter(image, (*size, 1), mode=SCIPY[border], cval=0.25))

    made: dict[Step, Callable[[], np.ndarray]] = {
        Step.ERODE: lambda: erode(pixels),
        Step.DILATE: lambda: dilate(pixels),
        Step.OPEN: lambda: dilate(erode(pixels)),
        Step.CLOSE: lambda: erode(dilate(pixels)),
        Step.GRADIENT: lambda: dilate(pixels) - erode(pixels),
        Step.TOPHAT: lambda: pixels - dilate(erode(pixels)),
        Step.BLACKHAT: lambda: erode(dilate(pixels)) - pixels,
    }
    return made[step]()


@settings(max_examples=60, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 70), st.integers(1, 90), st.integers(1, 6)),
    size=st.tuples(st.integers(0, 20), st.integers(0, 60)),
    step=st.sampled_from(list(Step)),
    border=st.sampled_from(list(Border)),
    seed=st.integers(0, 2**31),
)
def test_agrees_with_scipy_value_for_value(
    shape: tuple[int, int, int], size: tuple[int, int], step: Step, border: Border, seed: int
) -> None:
    pixels = np.random.default_rng(seed).standard_normal(shape).astype(np.float32)
    height, width = (2 * each + 1 for each in size)
    p = morphology.validate({"step": step, "width": width, "height": height, "border": border, "value": 0.25})
    inputs, device = {"image": as_image(pixels)}, default_device()
    assert device is not None
    expected = by_scipy(pixels, step, (height, width), border)
    body = morphology.methods["blocks"].implementation
    assert np.array_equal(body.opencl(device, inputs, p, 0), expected)
    assert np.array_equal(body.numpy(inputs, p, 0), expected)


@pytest.mark.parametrize("anchor", [[0, 0], [3, 1], [2, 0]])
def test_openings_are_idempotent_and_dual_to_closings(anchor: list[int]) -> None:
    pixels = np.random.default_rng(1).random((30, 40, 1), dtype=np.float32)
    window: dict[str, Any] = {"width": 4, "height": 2, "anchor": anchor, "border": "wrap"}

    def run(step: str, image: np.ndarray) -> np.ndarray:
        return lichen.run("morphology", image, step=step, **window).image.pixels

    opened = run("open", pixels)
    assert (opened <= pixels).all()
    assert np.array_equal(run("open", opened), opened)
    turned = {**window, "anchor": [3 - anchor[0], 1 - anchor[1]]}
    closed = lichen.run("morphology", -pixels, step="close", **turned).image.pixels
    assert np.array_equal(run("open", pixels), -closed)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_differences_keep_coverage(backend: str) -> None:
    pixels = np.random.default_rng(1).random((9, 9, 4), dtype=np.float32)
    picture = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED)
    made = lichen.run("morphology", picture, step="gradient", device=backend).image.pixels
    assert np.array_equal(made[..., 3], pixels[..., 3])
    assert made[..., :3].min() >= 0
