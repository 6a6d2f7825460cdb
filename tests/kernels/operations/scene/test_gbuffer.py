"""What rays meet, against formulas of their own, and backends against each other bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.scene.camera import Camera
from lichen.operations.scene.gbuffer_cases import STILL_LIFE

VIEW = {"eye": [0.5, 0.8, 1.5], "target": [0, 0.2, -5], "width": 93, "height": 61}
BUFFERS = ("depth", "distance", "position", "normal", "albedo", "roughness", "mask", "height", "motion", "emissive")


def seen(buffer: str, device: str = "opencl", **changes: object) -> np.ndarray:
    values = {"objects": STILL_LIFE, **VIEW, **changes}
    return lichen.run("gbuffer", buffer=buffer, device=device, **values).image.pixels


@pytest.mark.parametrize("buffer", BUFFERS)
def test_backends_give_the_same_bits(buffer: str) -> None:
    for further in ({}, {"frame": "world", "extent": 8.0, "up": [0.3, 1, 0]}):
        assert np.array_equal(seen(buffer, **further), seen(buffer, "numpy", **further))


def test_points_lie_on_their_surfaces() -> None:
    position, number = seen("position", frame="world").astype(np.float64), seen("mask")[..., 0]
    normal = seen("normal", frame="world").astype(np.float64)
    floor, ball = number == 1, number == 2
    assert floor.sum() > 500
    assert ball.sum() > 100
    np.testing.assert_allclose(position[floor][:, 1], -1, atol=2e-5)
    off = position[ball] - [-1.2, 0, -5]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 1, atol=2e-6)
    np.testing.assert_allclose(normal[ball], off, atol=2e-6)
    blob = number == 4
    gaps = [np.linalg.norm(position[blob] - ball[:3], axis=1) - ball[3] for ball in STILL_LIFE[3]["balls"]]
    joined = gaps[0]
    for each in gaps[1:]:
        h = np.maximum(0.5 - np.abs(joined - each), 0) / 0.5
        joined = np.minimum(joined, each) - h * h * 0.5 / 4
    np.testing.assert_allclose(joined, 0, atol=2e-6)


def test_depth_distance_and_position_agree() -> None:
    depth, distance, position = seen("depth")[..., 0], seen("distance")[..., 0], seen("position")
    there = np.isfinite(depth)
    assert there.any()
    assert not there.all()
    assert np.array_equal(there, np.isfinite(distance))
    np.testing.assert_allclose(-position[there][:, 2], depth[there], rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(position[there].astype(float), axis=1), distance[there], rtol=1e-6)
    assert np.array_equal(seen("mask")[..., 0] > 0, there)


def test_motion_is_where_the_point_was_less_where_it_is() -> None:
    motion, number = seen("motion"), seen("mask")[..., 0]
    position = seen("position", frame="world").astype(np.float64)
    assert not motion[number != 3].any()
    camera = Camera(eye=(0.5, 0.8, 1.5), target=(0, 0.2, -5))
    matrix = camera.to_pixels(61, 93)

    def pixels(points: np.ndarray) -> np.ndarray:
        u, v, _, w = matrix @ np.concatenate([points, np.ones((len(points), 1))], axis=1).T
        return np.stack([u / w, v / w], axis=1)

    points = position[number == 3]
    np.testing.assert_allclose(motion[number == 3], pixels(points) - pixels(points - [0.1, 0, 0]), atol=1e-4)
    rows, columns = np.nonzero(number == 3)
    np.testing.assert_allclose(pixels(points), np.stack([columns, rows], axis=1) + 0.5, atol=1e-4)


def test_terrain_is_its_triangles_without_cracks() -> None:
    heights = np.random.default_rng(5).random((9, 7))
    land = {"shape": "terrain", "corner": [-2, 0.5, -3], "size": [4, 6], "heights": heights.tolist()}
    above = {"eye": [0.1, 4, 0.2], "target": [0, 0, 0], "fov": 70}
    for further in ({}, {"extent": 3.5, "eye": [1, 4, 1]}):
        view = {"objects": [land], "width": 121, "height": 91, **above, **further}
        point = lichen.run("gbuffer", buffer="position", frame="world", **view).image.pixels.astype(np.float64)
        middle = point[20:70, 40:80]
        assert np.isfinite(middle).all()
        g, h = (point[..., 0] + 2) / 4 * 6, (point[..., 2] + 3) / 6 * 8
        there = np.isfinite(point).all(axis=-1)
        i, j = (np.clip(np.floor(each[there]), 0, most).astype(int) for each, most in ((g, 5), (h, 7)))
        u, v = g[there] - i, h[there] - j
        near = heights[j, i] + u * (heights[j, i + 1] - heights[j, i]) + v * (heights[j + 1, i] - heights[j, i])
        last = heights[j + 1, i + 1]
        far = last + (1 - u) * (heights[j + 1, i] - last) + (1 - v) * (heights[j, i + 1] - last)
        np.testing.assert_allclose(point[there][:, 1], 0.5 + np.where(u + v < 1, near, far), atol=5e-6)


def test_errors_are_none_and_flaws_are_named() -> None:
    plan = lichen.explain("gbuffer", objects=STILL_LIFE, **VIEW)
    assert plan.error.value == 0
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gbuffer", eye=[1, 1, 1], target=[1, 1, 1], objects=[{"shape": "plane", "normal": [0, 0, 0]}])
    assert {each.pointer for each in caught.value.flaws} == {"/parameters/target", "/parameters/objects/0/normal"}
