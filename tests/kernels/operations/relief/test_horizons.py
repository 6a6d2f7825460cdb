"""Horizons and ambient occlusion against view factors in closed form, and against a walk from pixel to pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lichen


def heights(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((14, 17, 1)).astype(np.float32)


def test_horizons_are_found_by_walking_there() -> None:
    given, found = heights(1), lichen.evaluate_truth("horizon_map", heights(1), radius=5, scale=7, directions=6)
    for y, x in ((0, 0), (6, 9), (13, 16)):
        for k in range(6):
            turn, highest = 2 * math.pi * k / 6, 0.0
            for far in range(1, 6):
                i, j = (
                    round(abs(way) + 1e-9) * (1 if way > 0 else -1)
                    for way in (far * math.cos(turn), -far * math.sin(turn))
                )
                there = given[min(max(y + j, 0), 13), min(max(x + i, 0), 16), 0]
                highest = max(highest, 7 * (float(there) - float(given[y, x, 0])) / math.hypot(i, j))
            assert found[y, x, k] == pytest.approx(math.degrees(math.atan(highest)))


def test_a_trench_sees_the_cosine_of_its_walls_elevation() -> None:
    """An endless trench, from the middle of its floor: cos of the elevation straight across (Johnson, Watson 1984)."""
    given = np.ones((1, 161, 1), np.float32)
    given[:, 74:87] = 0
    for scale, elevation in ((7, 45), (7 * math.tan(math.radians(70)), 70)):
        found = lichen.evaluate_truth("ambient_occlusion", given, scale=scale, directions=64, radius=80)
        assert found[0, 80, 0] == pytest.approx(math.cos(math.radians(elevation)), abs=0.02)


@pytest.mark.parametrize("tilt", [0, 30, 60, 85])
def test_a_slope_on_a_plane_sees_as_much_as_the_view_factor_says(tilt: float) -> None:
    """(1 + cos tilt) / 2 of the sky is above a plane that is tilted."""
    angle = math.radians(tilt)
    normal = np.broadcast_to(np.float32([0.6 * math.sin(angle), 0.8 * math.sin(angle), math.cos(angle)]), (3, 4, 3))
    found = lichen.evaluate_truth(
        "ambient_occlusion", height=np.zeros((3, 4, 1), np.float32), normal=normal, directions=64
    )
    assert np.allclose(found, (1 + math.cos(angle)) / 2, atol=2e-3)


def test_depths_hide_as_the_heights_that_they_are() -> None:
    """A step towards the viewer, small against the distance, seen in perspective."""
    rise, pixel = np.zeros((9, 20, 1)), 0.002
    rise[:, 10:] = 0.01
    near = lichen.evaluate_truth("ambient_occlusion", (2 - rise).astype(np.float32), source="depth", pixel_size=pixel)
    flat = lichen.evaluate_truth("ambient_occlusion", rise.astype(np.float32), scale=1 / (2 * pixel))
    assert np.allclose(near, flat, atol=1e-4)


def test_strength_takes_its_share() -> None:
    whole = lichen.evaluate_truth("ambient_occlusion", heights(2))
    half = lichen.evaluate_truth("ambient_occlusion", heights(2), strength=0.5)
    assert np.allclose(half, 1 - (1 - whole) / 2)


def test_wider_spacing_sees_less_of_the_horizon() -> None:
    given = heights(3)
    exact = lichen.evaluate_truth("horizon_map", given, radius=12)
    for spacing in (2.0, 3.0):
        found = lichen.run("horizon_map", given, radius=12, method="march", spacing=spacing).image.pixels
        assert (found <= exact + 1e-4).all()
        assert (found < exact - 1).any()
