"""Accumulation against exact sums, and what compensation buys."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.arithmetic.accumulate import NAMES

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [1, 3, 16])
def test_is_the_weighted_sum(count: int, backend: str) -> None:
    images = dict(zip(NAMES, RNG.normal(size=(count, 9, 11, 3)).astype(np.float32), strict=False))
    weights = RNG.normal(size=count).tolist()
    expected = sum(weight * image.astype(np.float64) for weight, image in zip(weights, images.values(), strict=True))
    for method in ("compensated", "plain"):
        result = lichen.run("accumulate", **images, weights=weights, method=method, device=backend)
        assert np.abs(result.image.pixels - expected).max() <= result.error.value
    mean = lichen.run("accumulate", **images, device=backend).image.pixels
    assert np.abs(mean - np.mean(list(images.values()), axis=0, dtype=np.float64)).max() < 1e-6


@pytest.mark.parametrize("backend", BACKENDS)
def test_compensation_finds_what_is_left_of_large_terms(backend: str) -> None:
    """Terms of 1e6 that cancel to the size of 1: exact sums of float32 products against both methods."""
    parts = (RNG.normal(size=(7, 5, 33, 1)) * 1e6).astype(np.float32)
    weights = RNG.integers(-8, 9, 7).astype(float).tolist()
    weights[0] = 1.0
    products = [[float(w) * float(x) for w, x in zip(weights, pixel, strict=True)] for pixel in parts.reshape(7, -1).T]
    nearly = np.array([-math.fsum(each) for each in products], np.float32).reshape(5, 33, 1)
    small = RNG.random((5, 33, 1)).astype(np.float32)
    images = dict(zip(NAMES, [*parts, nearly, small], strict=False))
    exact = np.array(
        [
            math.fsum([*each, float(a), float(b)])
            for each, a, b in zip(products, nearly.reshape(-1), small.reshape(-1), strict=True)
        ]
    ).reshape(5, 33, 1)
    errors = {}
    for method in ("compensated", "plain"):
        result = lichen.run("accumulate", **images, weights=[*weights, 1.0, 1.0], method=method, device=backend)
        errors[method] = float(np.abs(result.image.pixels - exact).max())
    assert errors["compensated"] < 1e-5
    assert errors["plain"] > 0.05


def test_flaws_are_named() -> None:
    image = np.zeros((3, 4, 1))
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("accumulate", image, image_2=np.zeros((3, 4, 2)), weights=[1, 2, 3])
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/parameters/weights", "/inputs/image_2"}
