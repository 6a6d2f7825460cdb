"""Wavelet noise: its filter, its band, its tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.operations.noise import bands
from lichen.operations.noise.octaves import Lattice

from . import by_hand

RAW = {"antialias": False, "low": -1, "high": 1, "octaves": 1}


def truth(**values: Any) -> np.ndarray:
    return lichen.evaluate_truth("wavelet_noise", **values, **RAW)[..., 0]


def test_the_filter_gives_the_nearest_coarse_spline() -> None:
    """Over the circle of 1024 cells least squares are a quotient for every frequency: products of splines at distances
    of whole cells are 66, 26 and 1 in 120. What lies beyond 32 numbers went into the outermost."""
    size = 1024
    w = 2 * np.pi * np.arange(size) / size
    refined = sum(weight * np.exp(-1j * w * k) for k, weight in enumerate((0.25, 0.75, 0.75, 0.25)))
    products = (66 + 52 * np.cos(w) + 2 * np.cos(2 * w)) / 120
    least = refined.conj() * products
    both = (
        np.abs(refined) ** 2 * products + np.abs(np.roll(refined, size // 2)) ** 2 * np.roll(products, size // 2)
    ) / 2
    exact = np.fft.ifft(least / both).real
    exact = np.roll(exact, 17)[:32]
    apart = np.abs(exact - np.array(bands.DOWN))
    assert apart[1:-1].max() < 1e-5
    assert apart[[0, -1]].max() < 6e-4


@pytest.mark.parametrize("values", [{}, {"dimensions": 3, "z": 0.4}, {"dimensions": 4, "z": 0.4, "w": 7.7}])
def test_a_slice_holds_one_band_of_frequencies(values: dict[str, Any]) -> None:
    size, cell = 256, 4
    pixels = truth(width=size, height=size, cell=cell, tile=True, fractal="none", **values)
    power = np.abs(np.fft.fft2(pixels)) ** 2
    f = np.fft.fftfreq(size) * cell
    largest = np.maximum(np.abs(f)[:, None], np.abs(f))
    assert power[largest < 0.15].sum() < 1e-3 * power.sum()
    assert power[largest > 0.85].sum() < 2e-3 * power.sum()


def test_octaves_share_next_to_nothing() -> None:
    """Of two octaves apart, the finer has little where the coarser has its power."""
    size = 256
    power = [
        np.abs(np.fft.fft2(truth(width=size, height=size, cell=cell, tile=True, fractal="none"))) ** 2
        for cell in (4, 16)
    ]
    shared = np.minimum(power[0] / power[0].sum(), power[1] / power[1].sum()).sum()
    assert shared < 0.01


def test_a_solid_is_what_the_definition_says() -> None:
    values = {"width": 3, "height": 2, "cell": 2.7, "dimensions": 3, "z": -7.6, "depth": "solid", "fractal": "fbm"}
    p = lichen.operations()["wavelet_noise"].validate({**values, **RAW})
    assert truth(**values)[1, 2] == pytest.approx(by_hand.fbm("wavelet_noise", p, 2, 1), abs=1e-9)


@pytest.mark.parametrize("cells", [1, 3, 128, 191, 200, 333, 1000, 4097])
def test_a_period_holds_whole_tables(cells: int) -> None:
    period = Lattice(0.6, side=bands.SIDE).fitted(cells)
    side = bands.side(period, bands.SIDE)
    assert period % side == 0
    assert side % 2 == 0
    assert side <= 192
    assert abs(period - cells) <= max(1, 0.02 * cells)
