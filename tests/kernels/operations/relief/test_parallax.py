"""Parallax against SciPy's interpolation, against rays that are solved for, and against what cannot be seen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage, optimize

import lichen


def scene(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A smooth picture and a smooth relief."""
    rng = np.random.default_rng(seed)
    noise = [ndimage.gaussian_filter(rng.random((40, 50)), 4, mode="wrap") for _ in range(2)]
    image, height = ((each - each.min()) / np.ptp(each) for each in noise)
    return image[..., None].astype(np.float32), height[..., None].astype(np.float32)


@pytest.mark.parametrize("mode", ["limited", "divided"])
def test_every_pixel_comes_from_where_its_height_says(mode: str) -> None:
    image, height = scene(1)
    x, y, z = 0.8, -0.5, 0.9
    over = 7 / (z if mode == "divided" else np.sqrt(x * x + y * y + z * z))
    found = lichen.evaluate_truth(
        "parallax", image, height=height, mode=mode, view=[x, y, z], scale=7, reference=0.25, border="clamp"
    )
    rows, columns = np.indices(image.shape[:2], float)
    rise = height[..., 0].astype(float) - 0.25
    places = [rows - rise * over * y, columns + rise * over * x]
    expected = ndimage.map_coordinates(image[..., 0].astype(float), places, order=1, mode="nearest")
    assert np.allclose(found[..., 0], expected, atol=1e-9)


def test_rays_end_where_the_relief_is() -> None:
    """On a gentle relief a ray meets it once: at the root of h(p + z s) - z."""
    image, height = scene(2)
    found = lichen.evaluate_truth("parallax", image, height=height, view=[0.4, 0.3, 1], scale=5, border="wrap")
    relief, picture = (each[..., 0].astype(float) for each in (height, image))

    def at(array: np.ndarray, z: float, y: int, x: int) -> float:
        place = [[y - z * 1.5], [x + z * 2.0]]
        return float(ndimage.map_coordinates(array, place, order=1, mode="grid-wrap")[0])

    for y, x in ((3, 4), (20, 31), (39, 49), (11, 17)):
        z = optimize.brentq(lambda z, y=y, x=x: at(relief, z, y, x) - z, -0.01, 1.01)
        assert found[y, x, 0] == pytest.approx(at(picture, z, y, x), abs=2e-4)


def test_more_levels_come_nearer() -> None:
    image, height = scene(3)
    exact = lichen.evaluate_truth("parallax", image, height=height, scale=20)
    apart = [
        float(np.abs(lichen.run("parallax", image, height=height, scale=20, levels=n).image.pixels - exact).mean())
        for n in (2, 8, 64)
    ]
    assert apart[0] > 2 * apart[1] > 4 * apart[2]


def test_flat_surfaces_move_as_one() -> None:
    """Every mode moves an even relief by the same for the same cosine."""
    image, _ = scene(4)
    height = np.full_like(image, 0.5)
    whole = lichen.evaluate_truth(
        "parallax", image, height=height, mode="divided", view=[2, 0, 1], scale=4, border="wrap"
    )
    assert np.allclose(whole, np.roll(image, -4, axis=1), atol=1e-7)
    marched = lichen.evaluate_truth("parallax", image, height=height, view=[2, 0, 1], scale=4, border="wrap")
    assert np.allclose(marched, whole, atol=1e-7)
