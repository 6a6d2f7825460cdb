"""Embossing against SciPy's shift, and against the shading that it stands for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage

import lichen


@pytest.mark.parametrize(("angle", "distance"), [(0, 1), (45, 1.5), (200, 3.25), (-90, 2)])
def test_the_difference_to_a_shifted_relief(angle: float, distance: float) -> None:
    heights = np.random.default_rng(1).random((21, 19, 1)).astype(np.float32)
    way = distance * math.sin(math.radians(angle)), -distance * math.cos(math.radians(angle))
    shifted = ndimage.shift(heights[..., 0].astype(float), way, order=1, mode="grid-wrap")
    found = lichen.evaluate_truth(
        "emboss", heights, angle=angle, distance=distance, strength=2, bias=0.5, border="wrap"
    )
    assert np.allclose(found[..., 0], 0.5 + 2 * (heights[..., 0] - shifted), atol=1e-9)


def test_gentle_reliefs_are_shaded_as_by_a_lamp() -> None:
    """To first order in the slope: the lamp's horizontal part times the slope, relative to the light on a plane."""
    y, x = np.mgrid[0:40, 0:40].astype(float)
    heights = (0.02 * np.sin(0.2 * x) * np.cos(0.15 * y))[..., None].astype(np.float32)
    normal = lichen.evaluate_truth("normal_map", heights, scale=1, mask="central")
    lamp = {"direction": [-1.0, 0.0, -1.0]}
    lit = lichen.evaluate_truth(
        "lighting", normal=normal.astype(np.float32), lights=[lamp], highlight=[0, 0, 0], diffuse=[1, 1, 1]
    )[..., 0]
    embossed = lichen.evaluate_truth("emboss", heights, angle=0, distance=1, bias=0)[..., 0]
    # The lamp at 45 degrees gives a plane sqrt(1/2), and (1 + slope) times that to what leans towards it.
    shaded = lit / math.sqrt(0.5) - 1
    centred = (embossed + np.roll(embossed, 1, axis=1)) / 2
    assert np.abs(shaded - centred)[2:-2, 2:-2].max() < 3e-5
