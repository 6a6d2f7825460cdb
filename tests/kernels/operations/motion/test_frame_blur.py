"""Frame blur against plain means, and what running sums lose."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(8)


@BOTH
@pytest.mark.parametrize("method", ["summed", "running", "single"])
@pytest.mark.parametrize(("window", "stride"), [(None, 1), (4, 1), (3, 3), (2, 5), (1, 1)])
def test_pages_are_means_of_windows(window: int | None, stride: int, method: str, backend: str) -> None:
    frames = RNG.random((14, 6, 9, 3)).astype(np.float32)
    given = {"frames": 14, "stride": stride} | ({} if window is None else {"window": window})
    stacked = np.concatenate([frames.reshape(-1, 9, 3), np.full((5, 9, 3), 9, np.float32)])  # rows that remain
    result = lichen.run("frame_blur", stacked, device=backend, method=method, **given)
    length = window or 14
    expected = [frames[start : start + length].mean(axis=0, dtype=float) for start in range(0, 15 - length, stride)]
    assert result.image.pages == len(expected)
    assert np.abs(result.image.pixels - np.concatenate(expected)).max() < 2e-6


def test_a_moving_point_leaves_its_trace() -> None:
    frames = np.zeros((8, 1, 8, 1), np.float32)
    frames[np.arange(8), 0, np.arange(8)] = 1e4
    found = lichen.run("frame_blur", frames.reshape(8, 8, 1), frames=8).image.pixels
    assert (found == 1250).all()


@BOTH
def test_doubles_do_not_drift(backend: str) -> None:
    """4000 steps of a running sum that has held 1e6."""
    frames = RNG.random((4000, 1, 1)).astype(np.float32)
    frames[7] = 1e6
    given = {"frames": 4000, "window": 10, "device": backend}
    exact = lichen.run("frame_blur", frames, method="summed", **given).image.pixels
    running = lichen.run("frame_blur", frames, method="running", **given).image.pixels
    single = lichen.run("frame_blur", frames, method="single", **given)
    assert np.abs(running - exact).max() <= np.spacing(np.float32(1e5))
    assert np.abs(running[20:] - exact[20:]).max() < 1e-7
    drift = np.abs(single.image.pixels[20:] - exact[20:]).max()
    assert 1e-4 < drift <= single.error.value


def test_flaws_are_named() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("frame_blur", np.ones((4, 4, 1), np.float32), frames=5, window=6)
    assert {flaw.pointer for flaw in caught.value.flaws} == {"/parameters/frames", "/parameters/window"}
