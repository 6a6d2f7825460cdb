"""Means in which pixels take no part, against ratios of SciPy's filters over what takes part."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest
from lichen.image import as_image
from lichen.operation import Border

KERNEL = ((1.0, 2.0, 0.0), (0.5, 3.0, 1.0), (0.0, 0.0, 4.0))
RNG = np.random.default_rng(11)
PIXELS = RNG.normal(2, 1, (29, 37, 3)).astype(np.float32)
HOLES = RNG.random((29, 37, 1)) < 0.3
HOLES[3:17, 5:22] = True
MASK = np.where(HOLES, 0, RNG.uniform(0.1, 1, HOLES.shape)).astype(np.float32)

Filter = Callable[[np.ndarray, str, float], np.ndarray]


def _gaussian(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    return np.asarray(ndimage.gaussian_filter(values, 1.5, mode=mode, cval=beyond, radius=6, axes=(0, 1)))


def _box(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    return np.asarray(ndimage.uniform_filter(values, (3, 5), mode=mode, cval=beyond, axes=(0, 1)))


def _convolve(values: np.ndarray, mode: str, beyond: float) -> np.ndarray:
    kernel = np.array(KERNEL)[..., None] / np.sum(KERNEL)
    return np.asarray(ndimage.correlate(values, kernel, mode=mode, cval=beyond))


FILTERS: dict[str, tuple[Filter, dict[str, Any]]] = {
    "gaussian": (_gaussian, {"sigma": 1.5}),
    "box": (_box, {"width": 5, "height": 3}),
    "convolve": (_convolve, {"kernel": KERNEL, "mode": "correlation", "normalise": True}),
}
each = pytest.mark.parametrize("name", list(FILTERS))
backends = pytest.mark.parametrize("backend", ["opencl", "numpy"])


def expected(name: str, values: np.ndarray, weights: np.ndarray, border: str, beyond: float = 0.0) -> np.ndarray:
    """Where hardly any weight is left of SciPy's sums, which keep traces of running sums, there is no value."""
    counted = np.broadcast_to(weights, values.shape).astype(np.float64)
    filtered, _ = FILTERS[name]
    sums = filtered(np.where(counted > 0, values, 0) * counted, border, beyond)
    shares = filtered(counted, border, 1.0 if beyond else 0.0)
    return np.where(shares > 1e-9, sums / np.maximum(shares, 1e-9), np.nan)


@each
@backends
def test_masked_pixels_take_no_part(name: str, backend: str) -> None:
    spoilt = np.where(HOLES, np.float32(np.nan), PIXELS)
    made = lichen.run(name, spoilt, mask=MASK, device=backend, **FILTERS[name][1]).image.pixels
    np.testing.assert_allclose(made, expected(name, PIXELS, MASK, "reflect"), rtol=2e-5)
    assert np.isnan(made).any()  # the hole is larger than the kernels


@each
@backends
def test_samples_that_are_no_numbers_are_skipped_channel_by_channel(name: str, backend: str) -> None:
    bad = RNG.random(PIXELS.shape) < 0.2
    spoilt = np.where(bad, RNG.choice(np.float32([np.nan, np.inf, -np.inf]), PIXELS.shape), PIXELS)
    made = lichen.run(name, spoilt, missing="skip", border="wrap", device=backend, **FILTERS[name][1]).image.pixels
    np.testing.assert_allclose(made, expected(name, PIXELS, ~bad, "grid-wrap"), rtol=2e-5)


@each
@backends
def test_what_lies_beyond_the_edges_is_left_out_or_counted(name: str, backend: str) -> None:
    arguments = {"device": backend, **FILTERS[name][1]}
    inside = lichen.run(name, PIXELS, missing="inside", **arguments).image.pixels
    np.testing.assert_allclose(inside, expected(name, PIXELS, np.ones((29, 37, 1)), "constant"), rtol=2e-5)
    around = lichen.run(name, PIXELS, mask=MASK, border="constant", value=0.5, **arguments).image.pixels
    sums = FILTERS[name][0](PIXELS.astype(np.float64) * MASK, "constant", 0.5)
    shares = FILTERS[name][0](np.broadcast_to(MASK, PIXELS.shape).astype(np.float64), "constant", 1.0)
    there = shares > 1e-9
    np.testing.assert_allclose(around[there], sums[there] / shares[there], rtol=2e-5)


@each
@backends
def test_a_single_pixel_that_is_left_is_the_result_whatever_its_size(name: str, backend: str) -> None:
    """Its weight is small, its value huge or tiny: nothing overflows, nothing vanishes."""
    for value in (1e-30, 3.0, 1e37):
        pixels = np.full((11, 11), np.nan, np.float32)
        pixels[5, 5] = value
        mask = np.where(np.isnan(pixels), 0, 2e-6).astype(np.float32)
        made = lichen.run(name, pixels, mask=mask, device=backend, **FILTERS[name][1]).image.pixels
        found = made[np.isfinite(made)]
        assert len(found) >= 6
        np.testing.assert_allclose(found, np.float32(value), rtol=1e-5)


@each
def test_approximations_are_out_of_the_question(name: str) -> None:
    plan = lichen.explain(name, PIXELS, missing="skip", **FILTERS[name][1]).to_json()["nodes"][0]
    refused = [offer for offer in plan["alternatives"] if "left out" in offer["verdict"]]
    assert {offer["method"] for offer in refused} >= {"gaussian": {"dct", "deriche", "box3"}, "box": {"table"},
                                                      "convolve": {"fft"}}[name]  # fmt: skip


@each
def test_what_is_no_mask_is_named(name: str) -> None:
    for mask in (np.full((29, 37), -1, np.float32), np.ones((3, 3), np.float32)):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run(name, PIXELS, mask=mask, **FILTERS[name][1])
        assert [flaw.pointer for flaw in caught.value.flaws] == ["/inputs/mask"]


def test_definition_is_the_ratio() -> None:
    for name, (_, arguments) in FILTERS.items():
        operation = lichen.operations()[name]
        p = operation.validate({**arguments, "border": Border.REFLECT101})
        inputs = {"image": as_image(PIXELS.astype(np.float64)), "mask": as_image(MASK.astype(np.float64))}
        truth = operation.evaluate_truth(inputs, p)
        np.testing.assert_allclose(truth, expected(name, PIXELS, MASK.astype(np.float64), "mirror"), rtol=1e-9)


@backends
def test_a_narrow_gaussian_does_not_reach_its_neighbours(backend: str) -> None:
    """Their weights, 1e-235 here, are numbers in float64 and none in float32: undefined must mean the same in both."""
    values = {"sigma": 0.03, "mask": as_image(MASK)}
    made = lichen.run("gaussian", PIXELS, device=backend, **values).image.pixels
    np.testing.assert_array_equal(np.isnan(made[..., :1]), MASK == 0)
    np.testing.assert_array_equal(np.isnan(lichen.evaluate_truth("gaussian", PIXELS, **values)), np.isnan(made))
