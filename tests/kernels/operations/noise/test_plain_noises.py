"""White and spectral noise, and the hashes that all noises stand on."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

import lichen
from lichen.errors import InvalidRequest
from lichen.hashing import keyed, pcg, pcg2d

from . import by_hand


def test_hashes_are_those_of_plain_integers() -> None:
    rng = np.random.default_rng(3)
    x, a, b = (rng.integers(0, 2**32, 50, dtype=np.uint64).astype(np.uint32) for _ in range(3))
    keys = pcg2d(x, a)
    for i in range(50):
        assert pcg(x)[i] == by_hand.pcg(int(x[i]))
        assert (keys[0][i], keys[1][i]) == by_hand.pcg2d(int(x[i]), int(a[i]))
    state = by_hand.point((int(a[0]), int(b[0])), (int(x[0]),))
    assert keyed(x[0], a[0], b[0])[0] == state


def test_words_of_a_lattice_are_evenly_spread_and_alike_in_nothing() -> None:
    """Every byte of 2^18 words by chi square; neighbours, rows and rows shifted by correlation; one bit flips half."""
    rows = pcg2d(np.arange(512)[:, None] + np.uint32(77), 12345)
    words = keyed(np.arange(512), *rows)
    for shift in (0, 8, 16, 24):
        counts = np.bincount(((words >> np.uint32(shift)) & np.uint32(255)).ravel(), minlength=256)
        assert stats.chisquare(counts).pvalue > 1e-4
    values = words.astype(np.float64) / 2**32 - 0.5
    for down, across in ((0, 1), (1, 0), (1, 1), (1, 3), (2, -1), (0, 16)):
        moved = np.roll(values, (down, across), (0, 1))
        assert abs((values * moved).mean() * 12) < 4 / 512
    for bit in range(16):
        turned = keyed(np.arange(512) ^ (1 << bit), *rows) ^ words
        flips = np.unpackbits(turned.view(np.uint8)).mean()
        assert flips == pytest.approx(0.5, abs=0.01)


def test_uniform_white_noise_is_the_texture_of_line_integrals() -> None:
    field = np.stack(np.meshgrid(np.arange(37.0), np.arange(21.0)[::-1]), axis=-1).astype(np.float32)
    for device in ("opencl", "numpy"):
        pixels = lichen.run("white_noise", width=37, height=21, seed=9, device=device).image.pixels
        own = lichen.run("lic", field, seed=9, length=4.0, device=device).image.pixels
        given = lichen.run("lic", field, texture=pixels, length=4.0, device=device).image.pixels
        assert np.array_equal(own, given)


@pytest.mark.parametrize("distribution", ["uniform", "triangular"])
def test_white_noise_is_the_same_bit_for_bit(distribution: str) -> None:
    values = {"width": 101, "height": 33, "channels": 3, "x": -50, "y": 2**31 - 5, "distribution": distribution}
    one, two = (lichen.run("white_noise", **values, device=device).image.pixels for device in ("opencl", "numpy"))
    assert np.array_equal(one, two)


@pytest.mark.parametrize(
    ("distribution", "expected"),
    [
        ("uniform", stats.uniform(-1, 2)),
        ("triangular", stats.triang(0.5, -1, 2)),
        ("normal", stats.norm(0, 1 / 6)),
    ],
)
def test_white_noise_is_distributed_as_it_says(distribution: str, expected: stats.rv_continuous) -> None:
    pixels = lichen.run("white_noise", width=300, height=300, distribution=distribution, low=-1).image.pixels
    assert stats.kstest(pixels.ravel(), expected.cdf).pvalue > 1e-3
    assert np.abs(pixels).max() <= 1


def test_channels_have_nothing_in_common() -> None:
    pixels = lichen.run("white_noise", width=200, height=200, channels=4).image.pixels.reshape(-1, 4)
    assert np.abs(np.corrcoef(pixels.T) - np.eye(4)).max() < 0.02


@pytest.mark.parametrize("beta", [-1.0, 0.0, 1.0, 2.5])
def test_spectra_fall_as_asked(beta: float) -> None:
    size = 256
    pixels = lichen.run("spectral_noise", width=size, height=size, beta=beta, low=-1).image.pixels[..., 0]
    power = np.abs(np.fft.fft2(pixels)) ** 2
    f = np.fft.fftfreq(size)
    length = np.hypot(f[:, None], f)
    rings = np.geomspace(4 / size, 0.5, 12)
    means = [power[(length >= a) & (length < b)].mean() for a, b in pairwise(rings)]
    slope = np.polyfit(np.log((rings[:-1] * rings[1:]) ** 0.5), np.log(means), 1)[0]
    assert slope == pytest.approx(-beta, abs=0.12)
    assert pixels.mean() == pytest.approx(0, abs=1e-5)


def test_spectral_noise_keeps_to_its_band_and_variance() -> None:
    pixels = lichen.run("spectral_noise", width=128, height=96, beta=0, low_cut=0.1, high_cut=0.3, low=-1).image.pixels
    power = np.abs(np.fft.fft2(pixels[..., 0])) ** 2
    length = np.hypot(np.fft.fftfreq(96)[:, None], np.fft.fftfreq(128))
    assert power[(length < 0.1) | (length > 0.3)].max() < 1e-8 * power.max()
    assert pixels.std() == pytest.approx(0.25, rel=0.05)
    with pytest.raises(InvalidRequest, match="low_cut"):
        lichen.run("spectral_noise", width=8, height=8, low_cut=0.5, high_cut=0.2)
