"""Mixing against OpenCV, scikit-image and SciPy, and what its presets promise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scipy.ndimage
from skimage.color import rgb2gray

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.operation import Facts
from lichen.operations.tone.mix import mix
from lichen.operations.tone.mix_base import Parameters, average

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(2)
NOISE, OTHER = (RNG.random((31, 45, 3), dtype=np.float32) for _ in range(2))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("amount", [-1.0, 0.0, 0.3, 1.0, 2.5])
def test_two_pictures_as_opencv_weighs_them(backend: str, amount: float) -> None:
    got = lichen.run("mix", NOISE, base=OTHER, amount=amount, device=backend).image.pixels
    np.testing.assert_allclose(got, cv2.addWeighted(OTHER, 1 - amount, NOISE, amount, 0), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_saturation_ends_in_scikit_images_grey(backend: str) -> None:
    weights = (0.2125, 0.7154, 0.0721)
    got = lichen.run("mix", NOISE, preset="saturation", amount=0, weights=weights, device=backend).image.pixels
    np.testing.assert_allclose(got, np.repeat(rgb2gray(NOISE)[..., None], 3, 2), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_sharpen_is_an_unsharp_mask(backend: str) -> None:
    got = lichen.run("mix", NOISE, preset="sharpen", amount=2.5, sigma=2, max_error=1e-4, device=backend).image.pixels
    wide = NOISE.astype(np.float64)
    blurred = scipy.ndimage.gaussian_filter(wide, 2, axes=(0, 1), mode="reflect", truncate=8)
    np.testing.assert_allclose(got, wide + 1.5 * (wide - blurred), atol=2e-4)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("preset", ["brightness", "contrast", "saturation"])
@pytest.mark.parametrize("alpha", [Alpha.STRAIGHT, Alpha.ASSOCIATED])
def test_coverage_stays_and_what_it_hides_takes_no_part(backend: str, preset: str, alpha: Alpha) -> None:
    pixels = np.concatenate([NOISE, np.float32(0.5) * OTHER[..., :1] + np.float32(0.5)], axis=2)
    pixels[:, 20:] = 0
    image = Image(pixels, Space.LINEAR, alpha)
    got = lichen.run("mix", image, preset=preset, amount=1.5, device=backend).image
    np.testing.assert_array_equal(got.pixels[..., 3], pixels[..., 3])
    cropped = Image(pixels[:, :20].copy(), Space.LINEAR, alpha)
    np.testing.assert_allclose(
        got.pixels[:, :20],
        lichen.run("mix", cropped, preset=preset, amount=1.5, device=backend).image.pixels,
        atol=2e-6,
    )


def test_average_passes_over_what_is_not_finite_and_is_limited() -> None:
    spoilt = NOISE.copy()
    spoilt[3, 4, 1] = np.nan
    weights = (0.2126, 0.7152, 0.0722)
    assert average(Image(spoilt), weights) == pytest.approx(average(Image(NOISE), weights), rel=2e-3)
    bare = np.full((4, 4, 4), 1e-3, np.float32)
    bare[..., 3] = 1e-9
    assert average(Image(bare, alpha=Alpha.ASSOCIATED), weights) == pytest.approx(0.016)
    assert average(Image(0 * bare, alpha=Alpha.ASSOCIATED), weights) == 0
    assert average(Image(np.full((2, 2, 3), np.nan, np.float32)), weights) == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_contrast_with_coverage_keeps_its_error(backend: str) -> None:
    pixels = RNG.random((33, 29, 4), dtype=np.float32)
    pixels[..., :3] *= pixels[..., 3:]
    image = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED)
    result = lichen.run("mix", image, preset="contrast", amount=3, device=backend)
    truth = mix.evaluate_truth({"image": image}, Parameters(preset="contrast", amount=3))
    assert np.abs(result.image.pixels - truth).max() <= result.error.value < 1e-4


def test_contrast_of_a_wide_picture_averages_all_of_it() -> None:
    ramp = np.linspace(0, 1, 3001 * 700, dtype=np.float32).reshape(700, 3001)
    got = lichen.run("mix", ramp, preset="contrast", amount=0).image.pixels
    np.testing.assert_allclose(got, 0.5, atol=1e-6)


@pytest.mark.parametrize(
    ("values", "pointer"),
    [
        ({}, "/inputs/base"),
        ({"base": OTHER[:, :9]}, "/inputs/base"),
        ({"base": OTHER, "preset": "contrast"}, "/inputs/base"),
        ({"preset": "saturation", "weights": [0.5, 0.5, 0.5]}, "/parameters/weights"),
    ],
)
def test_what_cannot_be_mixed_is_refused(values: dict[str, object], pointer: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("mix", NOISE, **values)
    assert pointer in {flaw.pointer for flaw in caught.value.flaws}


def test_facts_hold_the_result() -> None:
    for amount in (-3.0, 0.0, 0.4, 2.0):
        for preset in ("brightness", "contrast", "saturation", "sharpen"):
            parameters = Parameters(preset=preset, amount=amount)
            facts = mix.result(parameters, {"image": Facts.of(Image(NOISE))})
            truth = mix.evaluate_truth({"image": Image(NOISE)}, parameters)
            assert facts.extent.low <= truth.min()
            assert truth.max() <= facts.extent.high
