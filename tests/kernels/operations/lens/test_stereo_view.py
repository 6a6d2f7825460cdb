"""Stereo views against a painter who draws every pair of neighbours, and cameras that see planes and steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage

import lichen

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(17)


def painted(image: np.ndarray, depth: np.ndarray, scale: float, tear: float) -> tuple[np.ndarray, int]:
    """Row by row and pair by pair, as one would draw it."""
    height, width, _ = image.shape
    out, hidden = np.zeros_like(image, np.float64), 0
    for row in range(height):
        near = scale / depth[row, :, 0].astype(np.float64)
        seen = np.full(width, -np.inf)
        for q in range(-60, width + 60):
            i, j = min(max(q, 0), width - 1), min(max(q + 1, 0), width - 1)
            a, b = q + near[i] / 2, q + 1 + near[j] / 2
            parts = [(a, b, None)]
            if abs(near[j] - near[i]) / 2 > tear:
                parts = [(a, a + 0.5, 0.0), (b - 0.5, b, 1.0)]
            for start, end, whole in parts:
                for x in range(max(math.ceil(start), 0), min(math.ceil(end), width)):
                    t = (x - a) / (b - a) if whole is None else whole
                    value = (1 - t) * near[i] + t * near[j]
                    if value > seen[x]:
                        seen[x], out[row, x] = value, (1 - t) * image[row, i] + t * image[row, j]
        covered = np.flatnonzero(seen > -np.inf)
        for x in np.flatnonzero(seen == -np.inf):
            hidden += 1
            sides = [covered[covered < x][-1:], covered[covered > x][:1]]
            out[row, x] = out[row, min((each[0] for each in sides if len(each)), key=lambda at: seen[at])]
    return out, hidden


@BOTH
def test_every_pair_is_drawn_and_the_nearest_shown(backend: str) -> None:
    image = RNG.random((6, 40, 3)).astype(np.float32)
    depth = ndimage.gaussian_filter(RNG.uniform(0.5, 4, (6, 40)), (0, 2))
    depth[:, 15:25] *= 0.5
    depth = depth[..., None].astype(np.float32)
    result = lichen.run("stereo_view", image, depth=depth, baseline=3.0, fov=90, device=backend, method="search")
    expected, hidden = painted(image, depth, 9.0, 1.0)
    assert np.abs(result.image.pixels - expected).max() < 1e-6
    assert result.findings["hidden"] == hidden > 0


@BOTH
def test_a_plane_moves_as_a_whole(backend: str) -> None:
    image, depth = RNG.random((10, 30, 3)).astype(np.float32), np.full((10, 30, 1), 2.0, np.float32)
    given = {"depth": depth, "baseline": 2.0, "fov": 90, "device": backend}
    for method in ("search", "iterated"):
        left = lichen.run("stereo_view", image, method=method, **given).image.pixels
        right = lichen.run("stereo_view", image, eye="right", method=method, **given).image.pixels
        # Half of baseline x focal length / depth: 2.5 px, half way between two pixels.
        assert np.abs(left[:, 3:] - (image[:, :-3] + image[:, 1:-2]) / 2).max() < 1e-6
        assert np.abs(right[:, :-3] - (image[:, 2:-1] + image[:, 3:]) / 2).max() < 1e-6


def test_looking_back_is_right_where_surfaces_are_smooth() -> None:
    x = np.mgrid[0:24, 0:96][1]
    image = np.sin(x / 7)[..., None].astype(np.float32)
    depth = (2 + 0.5 * np.sin(x / 15))[..., None].astype(np.float32)
    given = {"depth": depth, "baseline": 1.0, "fov": 90}
    exact = lichen.run("stereo_view", image, method="search", **given).image.pixels

    def off_by(steps: int) -> float:
        found = lichen.run("stereo_view", image, method="iterated", steps=steps, **given).image.pixels
        return float(np.abs(found - exact)[:, 8:-8].max())

    off = [off_by(steps) for steps in (1, 2, 4, 8)]
    assert off[0] > 3 * off[1] > 9 * off[2]
    assert off[3] < 1e-4
