"""Fog against quadrature along the rays themselves, and what it must not do."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.fog.column import Column

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
HEIGHTS, DENSITIES = [0.0, 0.5, 2.0, 2.5, 4.0], [0.9, 0.0, 0.0, 0.7, 0.1]
POINTS = np.array(
    [[3, 1, -4], [0, 6, -1], [2, -3, 1], [5, 1.2, 0], [9, 1.2 + 1e-6, -3], [0.1, 3.9, 0], [40, 1.5, -30]], np.float32
)


def through(backend: str, **parameters: object) -> np.ndarray:
    """What comes through fog on the way to `POINTS`."""
    points = POINTS[None]
    white = np.ones((1, len(POINTS), 1), np.float32)
    return lichen.run("fog", white, depth=points, colour=0.0, device=backend, **parameters).image.pixels.ravel()


def expected(density: object, eye: np.ndarray, points: np.ndarray) -> list[float]:
    made = []
    for point in points.astype(np.float64):
        ray = point - eye
        length = np.linalg.norm(ray)
        breaks = [(h - eye[1]) / ray[1] for h in HEIGHTS if ray[1]]
        inner = sorted(each for each in breaks if 0 < each < 1)
        ends = [0.0, *inner, 1.0]
        depth = sum(
            quad(lambda t: density(eye[1] + t * ray[1]), a, b, epsabs=1e-13)[0]  # noqa: B023
            for a, b in pairwise(ends)
        )
        made.append(float(np.exp(-length * depth)))
    return made


@BOTH
def test_layers_are_what_quadrature_along_the_ray_gives(backend: str) -> None:
    eye = np.array([0.5, 1.2, 1.0])
    got = through(backend, kind="layered", density=0.8, heights=HEIGHTS, densities=DENSITIES, eye=eye.tolist())
    wanted = expected(lambda h: 0.8 * np.interp(h, HEIGHTS, DENSITIES), eye, POINTS)
    np.testing.assert_allclose(got, wanted, atol=2e-6)


@BOTH
def test_height_fog_is_what_quadrature_along_the_ray_gives(backend: str) -> None:
    eye = np.array([0.5, 1.2, 1.0])
    got = through(backend, kind="height", density=0.3, base=0.5, falloff=1.7, eye=eye.tolist())
    wanted = expected(lambda h: 0.3 * np.exp(-(h - 0.5) / 1.7), eye, POINTS)
    np.testing.assert_allclose(got, wanted, atol=2e-6)


def test_a_mean_is_continuous_where_heights_agree() -> None:
    column = Column.around(1.0, [0.0, 1.5, 3.0], [0.2, 0.9, 0.4])
    rises = np.concatenate([-np.logspace(-300, -1, 40), [0.0], np.logspace(-300, -1, 40)])
    here = np.interp(1.0, [0.0, 1.5], [0.2, 0.9])
    np.testing.assert_allclose(column.mean(rises), here + rises * (0.7 / 1.5) / 2, rtol=1e-14)


@BOTH
def test_depth_and_positions_are_the_same_fog(backend: str) -> None:
    height, width, fov = 21, 33, 70.0
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 20, (height, width, 1)).astype(np.float32)
    t = np.tan(np.radians(fov) / 2)
    x = ((2 * (np.arange(width) + 0.5) / width - 1) * t * width / height)[None, :, None]
    y = ((1 - 2 * (np.arange(height) + 0.5) / height) * t)[:, None, None]
    points = np.concatenate([depth * x, depth * y, -depth + 0 * x], axis=-1).astype(np.float32)
    picture = rng.random((height, width, 3), np.float32)
    for further in ({}, {"distance": "planar"}, {"kind": "layered", "heights": [-2, 3], "densities": [0.2, 0.0]}):
        a, b = (
            lichen.run("fog", picture, depth=each, fov=fov, density=0.1, device=backend, **further).image.pixels
            for each in (depth, points)
        )
        np.testing.assert_allclose(a, b, atol=3e-6)
    near, far = 0.5, 40.0
    for kind, window in (
        ("window", far * (depth - near) / (depth * (far - near))),
        ("reversed", near * (far - depth) / (depth * (far - near))),
    ):
        stored = lichen.run(
            "fog", picture, depth=window, fov=fov, density=0.1, depth_kind=kind, near=near, far=far, device=backend
        )
        plain = lichen.run("fog", picture, depth=depth, fov=fov, density=0.1, device=backend)
        np.testing.assert_allclose(stored.image.pixels, plain.image.pixels, atol=2e-5)


def test_true_distance_leaves_no_seam_between_two_views_and_planar_depth_does() -> None:
    """One point, seen at the right edge of a view and, after a turn of the head, at the left edge of another."""
    point = np.array([3.0, 0.0, -4.0])
    turned = np.array([-1.0, 0.0, -np.sqrt(24.0)])
    seen = np.array([[point, turned]], np.float32)
    white = np.ones((1, 2, 1), np.float32)
    first, second = lichen.run("fog", white, depth=seen, density=0.2, colour=0.0).image.pixels.ravel()
    assert abs(first - second) < 1e-6
    first, second = lichen.run(
        "fog", white, depth=seen, density=0.2, colour=0.0, distance="planar"
    ).image.pixels.ravel()
    assert abs(first - second) > 0.05


@BOTH
def test_what_shines_is_not_hidden_and_coverage_stays(backend: str) -> None:
    picture = lichen.Image(np.array([[[0.5, 0.25, 0.1, 0.5]] * 3], np.float32), alpha=lichen.Alpha.ASSOCIATED)
    shine = np.array([[[0.0], [0.5], [1.0]]], np.float32)
    depth = np.full((1, 3, 1), np.inf, np.float32)
    made = lichen.run("fog", picture, depth=depth, emissive=shine, colour=[1.0, 0.5, 0.0], device=backend).image.pixels
    fog = np.array([0.5, 0.25, 0.0, 0.5])
    wanted = [fog, (fog + picture.pixels[0, 0]) / 2, picture.pixels[0, 0]]
    np.testing.assert_allclose(made[0], wanted, atol=1e-6)


def test_no_fog_is_left_out_and_unseen_fog_too() -> None:
    picture, depth = np.random.default_rng(1).random((9, 9, 3)), np.ones((9, 9, 1))
    none = lichen.explain("fog", picture, depth=depth, density=0.0)
    assert none.method == "identity"
    assert not none.nodes
    thin = lichen.explain("fog", picture, depth=depth, density=1e-5, max_error=1e-3)
    assert not thin.nodes
    assert thin.error.value < 1e-3
    thick = lichen.explain("fog", picture, depth=depth, density=1e-2, max_error=1e-3)
    assert thick.nodes


def test_flaws_are_named_together() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run(
            "fog", np.ones((4, 4, 3)), depth=np.ones((4, 5, 1)), kind="layered", heights=[1, 1], densities=[1],
            colour=[1.0, 2.0], up=[0, 0, 0], near=2, far=2, distance="planar",
        )  # fmt: skip
    pointers = {each.pointer for each in caught.value.flaws}
    named = {f"/parameters/{name}" for name in ("far", "colour", "heights", "densities", "up", "distance")}
    assert pointers == named | {"/inputs/depth"}
    with pytest.raises(InvalidRequest, match="/parameters/end"):
        lichen.run("fog", np.ones((4, 4, 3)), depth=np.ones((4, 4, 1)), kind="linear", start=2, end=2)
