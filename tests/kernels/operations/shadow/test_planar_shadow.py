"""Shadows of flat things against the matrix that flattens them onto a floor; penumbras against their closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skimage.measure import points_in_poly

import lichen
from lichen.memory import Array


def floor(side: int = 41) -> Array:
    """Points of the floor y = 0, (side, side, 3)."""
    x, z = np.meshgrid(np.linspace(-4, 4, side), np.linspace(-4, 4, side))
    return np.stack([x, np.zeros_like(x), z], axis=-1).astype(np.float32)


@pytest.mark.parametrize("light", [(1.0, 5.0, 2.0), (0.5, 2.5, -0.5)])
@pytest.mark.parametrize("parallel", [False, True])
def test_the_shadow_is_where_the_matrix_flattens_the_thing(light: tuple[float, ...], *, parallel: bool) -> None:
    """Blinn's matrix (G L) I - L G of the plane G = (0, 1, 0, 0), on the corners of a leaning rectangle below the
    light."""
    centre, size = np.array([0.3, 1.0, -0.2]), (1.6, 1.0)
    thing: dict[str, Any] = {"centre": list(centre), "direction": [0.2, 1, 0.3], "up": [0, 0, -1], "size": size}
    across = np.array(thing["direction"]) / np.linalg.norm(thing["direction"])
    right = np.cross(thing["up"], across)
    right /= np.linalg.norm(right)
    up = np.cross(across, right)
    lamp, plane = np.array([*light, 0.0 if parallel else 1.0]), np.array([0.0, 1.0, 0.0, 0.0])
    matrix = (plane @ lamp) * np.eye(4) - np.outer(lamp, plane)
    corners = [centre + i * size[0] / 2 * right + j * size[1] / 2 * up for i, j in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    flat = np.array([matrix @ [*corner, 1] for corner in corners])
    assert (flat[:, 3] > 0).all()
    outline = flat[:, [0, 2]] / flat[:, 3:]
    points = floor()
    expected = points_in_poly(  # type: ignore[no-untyped-call]
        points[..., [0, 2]].reshape(-1, 2), outline
    ).reshape(points.shape[:2])
    matte = np.ones((64, 64, 1), np.float32)
    found = lichen.evaluate_truth("planar_shadow", matte, depth=points, light=light, parallel=parallel, **thing)[..., 0]
    sure = (found == 0) | (found == 1)
    assert sure.mean() > 0.95  # between are the outer halves of the outermost texels
    assert np.array_equal(found[sure] == 0, expected[sure])
    assert 10 < expected.sum() < expected.size / 2


@pytest.mark.parametrize("device", ["opencl", "numpy"])
def test_the_penumbra_of_an_edge_is_the_share_of_the_light_over_it(device: str) -> None:
    """An edge at height 1 below a light of width 2 at height 3: over the floor its shadow grows in a width of 1."""
    points = floor(81)[40:41]
    wish: dict[str, Any] = {
        "light": [0, 3, 0], "samples": 64, "centre": [0, 1, 0], "direction": [0, 1, 0], "up": [0, 0, -1],
        "size": [20, 20],
    }  # fmt: skip
    x = points[0, :, 0].astype(float)
    matte = np.repeat(np.repeat(np.float32([[[0], [1]]]), 512, axis=1), 8, axis=0)
    soft = [
        lichen.run("planar_shadow", matte, depth=points, **{**wish, "extent": extent}, device=device)
        for extent in ([2.0, 0.0], [0.0, 2.0])
    ]
    expected = np.clip(0.5 - x, 0, 1)
    apart = [np.abs(each.image.pixels[0, :, 0] - expected).max() for each in soft]
    assert min(apart) < 0.03  # one of them lies across the edge, the other along
    few = lichen.run(
        "planar_shadow", matte, depth=points, **{**wish, "extent": [2.0, 2.0]}, method="sparse", share=1 / 16,
        device=device,
    )  # fmt: skip
    exact = lichen.evaluate_truth("planar_shadow", matte, depth=points, **{**wish, "extent": [2.0, 2.0]})
    assert 0.01 < np.abs(few.image.pixels - exact).max() <= few.error.value


def test_coloured_things_throw_coloured_light_and_depths_stand_for_places() -> None:
    rng = np.random.default_rng(8)
    glass = rng.random((6, 9, 3)).astype(np.float32)
    camera: dict[str, Any] = {"fov": 60}
    depth = rng.uniform(2, 6, (12, 16, 1)).astype(np.float32)
    wish: dict[str, Any] = {"light": [0.3, 0.2, 0.5], "centre": [0, 0, -1], "size": [1.5, 1]}
    by_depth = lichen.evaluate_truth("planar_shadow", glass, depth=depth, **camera, **wish)
    places = lichen.run("deproject", depth, **camera).image
    by_place = lichen.evaluate_truth("planar_shadow", glass, depth=places, **wish)
    assert np.allclose(by_depth, by_place, atol=1e-5)
    assert np.ptp(by_depth, axis=-1).max() > 0.3
