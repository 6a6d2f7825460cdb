"""Quantisation against Pillow's and NumPy's, and the properties of the dithers."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.image import Alpha, Image
from lichen.operations.tone.quantise import Parameters, quantise
from lichen.operations.tone.thresholds import SIDE, WEIGHTS, bayer, blue_noise

BACKENDS = ("opencl", "numpy")
NOISE = np.random.default_rng(6).random((61, 83, 3), dtype=np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("levels", [2, 7, 256, 65536])
def test_without_dither_it_rounds(backend: str, levels: int) -> None:
    got = lichen.run("quantise", NOISE, levels=levels, dither="none", device=backend).image.pixels
    expected = np.floor(NOISE.astype(np.float64) * (levels - 1) + 0.5) / (levels - 1)
    np.testing.assert_allclose(got, expected, atol=1e-7)


@pytest.mark.parametrize("diffusion", list(WEIGHTS))
@pytest.mark.parametrize("backend", BACKENDS)
def test_error_diffusion_is_decided_alike(backend: str, diffusion: str) -> None:
    values = {"levels": 3, "dither": "error_diffusion", "diffusion": diffusion}
    got = lichen.run("quantise", NOISE, device=backend, **values).image.pixels
    truth = quantise.evaluate_truth({"image": Image(NOISE)}, Parameters(**values))
    np.testing.assert_array_equal(got, truth.astype(np.float32))


def pushed(picture: np.ndarray) -> np.ndarray:
    """Floyd and Steinberg's, as their paper tells it: errors are handed on, not fetched."""
    work, out = picture.astype(np.float64), np.zeros(picture.shape)
    height, width = picture.shape
    for y in range(height):
        for x in range(width):
            out[y, x] = work[y, x] >= 0.5
            lost = work[y, x] - out[y, x]
            for dx, dy, share in ((1, 0, 7), (-1, 1, 3), (0, 1, 5), (1, 1, 1)):
                if 0 <= x + dx < width and y + dy < height:
                    work[y + dy, x + dx] += lost * share / 16
    return out


def test_floyd_and_steinberg_as_they_tell_it() -> None:
    picture = NOISE[..., 0]
    got = lichen.run("quantise", picture, dither="error_diffusion").image.pixels[..., 0]
    assert np.mean(got != pushed(picture)) < 1e-3  # sums in another order meet a tie otherwise


def test_weights_sum_to_what_they_hand_on() -> None:
    sums = {name: rows[:, 2].sum() for name, rows in WEIGHTS.items()}
    assert sums == pytest.approx({"floyd_steinberg": 1, "jarvis": 1, "stucki": 1, "atkinson": 0.75})


def test_masks_hold_every_rank_once() -> None:
    for thresholds in (bayer(2), bayer(8), bayer(16), blue_noise()):
        count = thresholds.size
        np.testing.assert_array_equal(np.sort(thresholds.reshape(-1)), (np.arange(count) + 0.5) / count)
    np.testing.assert_array_equal(bayer(2) * 4 - 0.5, [[0, 2], [3, 1]])


@pytest.mark.parametrize("share", [0.1, 0.5, 0.8])
def test_blue_noise_has_no_low_frequencies(share: float) -> None:
    pattern = blue_noise() < share
    power = np.abs(np.fft.fft2(pattern - pattern.mean())) ** 2
    away = np.hypot(*np.meshgrid(np.fft.fftfreq(SIDE), np.fft.fftfreq(SIDE)))
    mean = power.mean()
    assert power[(away > 0) & (away < 0.12)].mean() < 0.1 * mean


@pytest.mark.parametrize("dither", ["bayer", "blue_noise", "error_diffusion"])
def test_dither_keeps_the_mean(dither: str) -> None:
    for grey in (0.11, 0.5, 0.77):
        got = lichen.run("quantise", np.full((128, 128), grey, np.float32), levels=3, dither=dither).image.pixels
        assert abs(float(got.mean()) - grey) < 6e-3


@pytest.mark.parametrize("dither", ["none", "bayer", "blue_noise", "error_diffusion"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_grey_stays_grey_and_coverage_as_it_is(backend: str, dither: str) -> None:
    pixels = np.repeat(NOISE[..., :1], 4, axis=2)
    got = lichen.run("quantise", Image(pixels, alpha=Alpha.STRAIGHT), dither=dither, device=backend).image.pixels
    np.testing.assert_array_equal(got[..., 0], got[..., 2])
    np.testing.assert_array_equal(got[..., 3], pixels[..., 3])
    assert set(np.unique(got[..., :3])) <= {0.0, 1.0}
