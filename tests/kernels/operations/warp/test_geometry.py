"""Maps against OpenCV, SciPy and their own inverses."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.interpolate import RBFInterpolator

import lichen
from lichen.errors import InvalidRequest
from lichen.image import as_image
from lichen.operation import Facts
from lichen.operations.warp.affine import affine
from lichen.operations.warp.charts import Chart, Sphere
from lichen.operations.warp.composition import Link, compose
from lichen.operations.warp.displace import gradient_noise
from lichen.operations.warp.homography import homography
from lichen.operations.warp.lenses import Lens, Model
from lichen.operations.warp.mesh import Nodes, Patches
from lichen.operations.warp.thin_plate import Bending, merged, solve

PHOTO = cv2.GaussianBlur(np.random.default_rng(2).random((60, 80)), (0, 0), 2).astype(np.float32)


# ------------------------------------------------------------------------------------------------ given by numbers


def test_remap_is_opencvs() -> None:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:60, 0:80] + 0.5
    there = np.stack([x, y], axis=-1) + cv2.GaussianBlur(rng.normal(size=(60, 80, 2)) * 30, (0, 0), 4)
    there = there.astype(np.float32)
    found = lichen.run("remap", PHOTO, map=there, method="bilinear", border="clamp").image.pixels[..., 0]
    at = there - np.float32(0.5)
    expected = cv2.remap(PHOTO, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_units_and_origin_are_the_same_places() -> None:
    there = np.random.default_rng(1).random((20, 30, 2), dtype=np.float32) * [70, 50] + 5
    plain = lichen.run("remap", PHOTO, map=there.astype(np.float32), method="bicubic").image.pixels
    turned = np.stack([there[..., 0] / 80, 1 - there[..., 1] / 60], axis=-1).astype(np.float32)
    others = lichen.run("remap", PHOTO, map=turned, method="bicubic", units="unit", origin="bottom").image.pixels
    np.testing.assert_allclose(plain, others, atol=2e-5)


def test_displacement_by_a_constant_is_a_shift() -> None:
    found = lichen.run(
        "displace", PHOTO, map=np.full((60, 80, 2), 0.75, np.float32), bias=0.5, amplitude=8, method="nearest"
    ).image.pixels[..., 0]
    np.testing.assert_array_equal(found[:-2, :-2], PHOTO[2:, 2:])


def test_haze_moves_nothing_on_the_whole() -> None:
    x, y = np.meshgrid(np.arange(0, 64, 0.25), np.arange(0, 64, 0.25))
    noise = gradient_noise(x, y, 3)
    assert np.abs(noise).max() <= 1
    assert abs(noise.mean()) < 0.01
    assert (noise[::4, ::4] == 0).all()
    assert not np.array_equal(noise, gradient_noise(x, y, 4))


def test_missing_and_needless_maps_are_named() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("displace", PHOTO)
    assert caught.value.flaws[0].pointer == "/inputs/map"
    with pytest.raises(InvalidRequest):
        lichen.run("displace", PHOTO, pattern="swirl", map=np.zeros((60, 80, 2), np.float32))


# ----------------------------------------------------------------------------------------------------------- polar


@pytest.mark.parametrize("log", [False, True])
def test_polar_is_scipys_at_the_same_places(log: bool) -> None:
    found = lichen.run(
        "polar", PHOTO, log=log, inner=2, outer=28, start=30, width=90, height=64, method="bilinear"
    ).image.pixels[..., 0]
    angle = np.radians(30) + 2 * np.pi * (np.arange(90) + 0.5) / 90
    share = (np.arange(64)[:, None] + 0.5) / 64
    r = 2 * 14**share if log else 2 + 26 * share
    expected = ndimage.map_coordinates(PHOTO, [30 + r * np.sin(angle) - 0.5, 40 + r * np.cos(angle) - 0.5], order=1)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_linear_polar_is_opencvs() -> None:
    """Whose rows are angles and columns radii, and whose pixels stand at whole numbers: compared between them."""
    expected = cv2.warpPolar(PHOTO, (128, 360), (39.5, 29.5), 25.0, cv2.INTER_LINEAR | cv2.WARP_FILL_OUTLIERS)
    found = lichen.run("polar", PHOTO, outer=25, width=360, height=128, method="bilinear").image.pixels[..., 0]
    between = (expected[1:, 1:] + expected[:-1, :-1] + expected[1:, :-1] + expected[:-1, 1:]) / 4
    np.testing.assert_allclose(found[:-1, :-1].T, between, atol=5e-3)


@pytest.mark.parametrize("log", [False, True])
def test_polar_and_back(log: bool) -> None:
    there = lichen.run("polar", PHOTO, log=log, inner=2, outer=28, width=720, height=200, method="bicubic").image
    back = lichen.run(
        "polar", there, direction="inverse", log=log, inner=2, outer=28, width=80, height=60, value=-1, method="bicubic"
    ).image.pixels[..., 0]
    y, x = np.mgrid[0:60, 0:80] + 0.5
    r = np.hypot(x - 40, y - 30)
    np.testing.assert_allclose(back[(r > 3) & (r < 27)], PHOTO[(r > 3) & (r < 27)], atol=4e-3)
    assert (back[(r < 2) | (r > 28)] == -1).all()


# ----------------------------------------------------------------------------------------------------------- lenses

ROOMY = st.floats(-0.4, 0.4)


def test_brown_conrady_is_opencvs() -> None:
    lens = Lens(Model.BROWN_CONRADY, (-0.21, 0.07, -0.01), (0.003, -0.002))
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (200, 2))
    rays = np.concatenate([points, np.ones((200, 1))], axis=1)
    zero, eye = np.zeros(3), np.eye(3)
    expected, _ = cv2.projectPoints(rays, zero, zero, eye, np.array([-0.21, 0.07, 0.003, -0.002, -0.01]))
    x, y = lens.distort(points[:, 0], points[:, 1])
    np.testing.assert_allclose(np.stack([x, y], axis=-1), expected[:, 0], atol=1e-12)
    u, v = lens.undistort(x, y)
    np.testing.assert_allclose(np.stack([u, v], axis=-1), points, atol=1e-9)


def test_kannala_brandt_is_opencvs_fisheye() -> None:
    k = (0.04, -0.02, 0.006, -0.001)
    points = np.random.default_rng(1).uniform(-3, 3, (200, 1, 2))
    expected = cv2.fisheye.distortPoints(points, np.eye(3), np.array(k))[:, 0]
    lens = Lens(Model.KANNALA_BRANDT, k, (0, 0))
    x, y = lens.distort(points[:, 0, 0], points[:, 0, 1])
    np.testing.assert_allclose(np.stack([x, y], axis=-1), expected, atol=1e-12)
    u, v = lens.undistort(x, y)
    np.testing.assert_allclose(np.stack([u, v], axis=-1), points[:, 0], rtol=1e-9)


@settings(max_examples=60, deadline=None)
@given(model=st.sampled_from(list(Model)), k=st.lists(ROOMY, max_size=3), p=st.tuples(ROOMY, ROOMY))
@example(model=Model.DIVISION, k=[0.0, 1 / 3], p=(0.0, 0.0))  # ends at radius 1
def test_a_lens_that_answers_is_right(model: Model, k: list[float], p: tuple[float, float]) -> None:
    """Every place that has an answer goes back to where it came from, in both directions; the others are NaN. On the
    very end of a lens, where it turns back, rounding decides whether there is a way back."""
    lens = Lens(model, tuple(k), (p[0] / 20, p[1] / 20) if model is Model.BROWN_CONRADY else (0.0, 0.0))
    x, y = np.meshgrid(np.linspace(-1.4, 1.4, 15), np.linspace(-1, 1, 11))
    for there, back in ((lens.undistort, lens.distort), (lens.distort, lens.undistort)):
        u, v = there(x, y)
        answered = np.isfinite(u)
        assert answered[5, 7]
        if lens.p == (0, 0):
            told = lens.answers(np.hypot(x, y), distorts=there == lens.distort)
            np.testing.assert_array_equal(answered, told)
            answered &= lens.answers(np.hypot(x, y) * (1 + 1e-9), distorts=there == lens.distort)
        again = back(u[answered], v[answered])
        if model is Model.BROWN_CONRADY and there == lens.distort:
            continue  # a point of the lens may have a second one, beyond where tangential terms fold it
        np.testing.assert_allclose(again[0], x[answered], atol=1e-7)
        np.testing.assert_allclose(again[1], y[answered], atol=1e-7)


def test_an_inverse_without_end_is_background_and_counted() -> None:
    result = lichen.run(
        "lens_distort",
        np.ones((40, 60), np.float32),
        k=[-0.9],
        focal=20,
        direction="distort",
        value=-1,
        method="nearest",
    )
    background = int(np.count_nonzero(result.image.pixels == -1))
    end = math.sqrt(1 / 2.7)
    radius = 20 * end * (1 - 0.9 * end**2)
    assert result.findings["background"] == background
    assert background == pytest.approx(40 * 60 - math.pi * radius**2, rel=0.02)
    assert result.findings["end_of_lens"] == pytest.approx(end)


# --------------------------------------------------------------------------------------------------------- panorama


@pytest.mark.parametrize("chart", list(Chart))
def test_charts_undo_themselves(chart: Chart) -> None:
    sphere = Sphere(chart, 360.0)
    rng = np.random.default_rng(0)
    d = rng.normal(size=(3, 500))
    special = np.array(
        [[0, 0, 1], [0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 1, 1], [1, 0, -1e-12]]
    ).T
    d = np.concatenate([d, special.astype(float)], axis=1)
    d = d / np.linalg.norm(d, axis=0)
    x, y, z = d
    face = sphere.face((x, y, z))
    s, t = sphere.place((x, y, z), face)
    assert np.isfinite(s).all()
    assert np.isfinite(t).all()
    assert (np.abs(s) <= 1 + 1e-12).all()
    back = np.stack(sphere.direction(np.clip(s, -1, 1), np.clip(t, -1, 1), face))
    # The rim of the ball and of a whole fisheye is one direction; a float64 there is 1e-8 from it.
    np.testing.assert_allclose(back, d, atol=5e-8 if chart in (Chart.MIRROR_BALL, Chart.FISHEYE) else 1e-12)


def sky(width: int) -> np.ndarray:
    """A smooth lat-long image, the three coordinates of each direction as its colours."""
    u, v = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, (np.arange(width // 2) + 0.5) / width * 4 - 1)
    return np.stack(Sphere(Chart.LATLONG).direction(u, v, np.zeros(1)), axis=-1).astype(np.float32)


@pytest.mark.parametrize("chart", [Chart.CUBE, Chart.MIRROR_BALL, Chart.PARABOLOID, Chart.FISHEYE])
def test_there_and_back_again_shows_the_same_sky(chart: Chart) -> None:
    image = sky(128)
    size = {Chart.CUBE: (192, 128), Chart.PARABOLOID: (256, 128)}.get(chart, (256, 256))
    width, height = size
    options = {"view": 360, "method": "bicubic"}
    there = lichen.run("panorama", image, target=chart, width=width, height=height, **options).image
    back = lichen.run("panorama", there, source=chart, target="latlong", width=128, height=64, **options).image.pixels
    apart = np.abs(back - image).max(axis=-1)
    if chart in (Chart.MIRROR_BALL, Chart.FISHEYE):  # all their rim is one direction, straight ahead or behind
        ahead = image[..., 2] * (1 if chart is Chart.MIRROR_BALL else -1)
        apart = apart[ahead < 0.97]
    assert apart.max() < 0.02, apart.max()


def test_what_stands_around_a_photographed_ball_does_not_show() -> None:
    """Samples on its rim show both, by the share that each has of them."""
    y, x = np.mgrid[:64, :64] + 0.5
    cover = np.clip(32.5 - np.hypot(x - 32, y - 32), 0, 1)[..., None]
    ball = (0.8 * cover).astype(np.float32)
    for method in ("bilinear", "ewa"):
        sky = lichen.run("panorama", ball, source="mirror_ball", target="latlong", method=method).image.pixels
        np.testing.assert_allclose(sky, 0.8, atol=2e-6)


def test_looking_to_the_right_moves_the_sky_to_the_left() -> None:
    image = sky(64)
    turned = lichen.run("panorama", image, target="latlong", yaw=90, method="bilinear").image.pixels
    np.testing.assert_allclose(turned, np.roll(image, -16, axis=1), atol=1e-6)


def test_edges_of_a_cube_do_not_show() -> None:
    """Direction colours, from faces of the cube: the error beside an edge is no more than elsewhere."""
    cube = lichen.run("panorama", sky(256), target="cube", width=192, height=128, method="bicubic").image
    for method in ("bilinear", "ewa"):
        found = lichen.run(
            "panorama", cube, source="cube", target="latlong", width=200, height=100, method=method
        ).image.pixels
        u, v = np.meshgrid((np.arange(200) + 0.5) / 100 - 1, (np.arange(100) + 0.5) / 50 - 1)
        expected = np.stack(Sphere(Chart.LATLONG).direction(u, v, np.zeros(1)), axis=-1)
        assert np.abs(found - expected).max() < 0.004


# ------------------------------------------------------------------------------------------------- meshes and plates


def test_bilinear_patches_are_interpolated_nodes() -> None:
    nodes = np.random.default_rng(0).normal(size=(4, 6, 2)) * 10
    u, v = np.meshgrid(np.linspace(0, 50, 23), np.linspace(0, 30, 17))
    found = Nodes(nodes, (50, 30), Patches.BILINEAR).at(u, v)
    for channel in (0, 1):
        expected = ndimage.map_coordinates(nodes[..., channel], [v / 10, u / 10], order=1)
        np.testing.assert_allclose(found[channel], expected, atol=1e-12)


def test_bicubic_patches_meet_their_nodes_and_are_smooth() -> None:
    nodes = np.random.default_rng(1).normal(size=(5, 4, 2)) * 10
    bent = Nodes(nodes, (30, 40), Patches.BICUBIC)
    u, v = np.meshgrid(np.linspace(0, 30, 4), np.linspace(0, 40, 5))
    np.testing.assert_allclose(np.stack(bent.at(u, v), axis=-1), nodes, atol=1e-12)
    before, after = (np.array(bent.at(np.array(10.0 + side), np.array(17.0))) for side in (-1e-6, 1e-6))
    middle = np.array(bent.at(np.array(10.0), np.array(17.0)))
    np.testing.assert_allclose(after - middle, middle - before, atol=1e-10)


def test_thin_plates_are_scipys_whatever_the_unit() -> None:
    rng = np.random.default_rng(2)
    targets = rng.uniform(0, 100, (12, 2))
    sources = targets + rng.normal(size=(12, 2)) * 5
    at = rng.uniform(-20, 120, (50, 2))
    expected = RBFInterpolator(targets, sources, kernel="thin_plate_spline")(at)
    for unit in (1.0, 1e-3, 1e4):
        plate = solve(sources * unit, targets * unit, 0.0)
        x, y = Bending(plate).at(at[:, 0] * unit, at[:, 1] * unit)
        np.testing.assert_allclose(np.stack([x, y], axis=-1) / unit, expected, atol=1e-8)
        assert plate.miss < 1e-9 * unit


def test_the_derivative_of_a_plate_is_its_slope() -> None:
    rng = np.random.default_rng(3)
    targets = rng.uniform(0, 40, (8, 2))
    bent = Bending(solve(targets + rng.normal(size=(8, 2)), targets, 0.01))
    u, v = np.arange(40) + 0.5, np.arange(40) + 0.5
    at = bent.places(u, v)
    step = 1e-5
    for name, du, dv in (("u", step, 0), ("v", 0, step)):
        after = bent.at(u[None] + du, v[:, None] + dv)
        np.testing.assert_allclose((after[0] - at.x) / step, getattr(at, f"x{name}"), atol=1e-4)
        np.testing.assert_allclose((after[1] - at.y) / step, getattr(at, f"y{name}"), atol=1e-4)


def test_near_duplicates_are_one_point_or_refused() -> None:
    points = np.array([[0.0, 0], [50, 0], [0, 50], [50, 50], [50, 50 + 1e-9]])
    kept, _, torn = merged(points, points)
    assert len(kept) == 4
    assert not torn
    moved = points.copy()
    moved[4] += 7
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("thin_plate", PHOTO, source_points=moved.tolist(), target_points=points.tolist())
    assert caught.value.flaws[0].pointer == "/parameters/target_points"


# ------------------------------------------------------------------------------------------------------ composition


def test_two_warps_are_one() -> None:
    facts = {"image": Facts.of(as_image(PHOTO))}
    first = affine.validate({"matrix": [[1.2, 0.1, -3], [0.05, 1.3, -4]]})
    second = homography.validate({"matrix": [[1.5, 0.1, -20], [0.1, 1.6, -25], [1e-3, 5e-4, 1]]})
    one, other = affine.link(first, facts), homography.link(second, facts)
    assert isinstance(one, Link)
    assert isinstance(other, Link)
    both = compose(one, other)
    assert isinstance(both, Link), both
    halfway = lichen.run("affine", PHOTO, method="bspline", **first.model_dump()).image
    twice = lichen.run("homography", halfway, method="bspline", **second.model_dump()).image.pixels
    once = lichen.run("homography", PHOTO, matrix=both.map.array.tolist(), inverse=True, method="bspline").image.pixels
    np.testing.assert_allclose(once[5:-5, 5:-5], twice[5:-5, 5:-5], atol=2e-3)


def test_what_would_be_lost_between_is_not_composed() -> None:
    facts = {"image": Facts.of(as_image(PHOTO))}
    away = affine.link(affine.validate({"matrix": [[1, 0, 30], [0, 1, 0]]}), facts)
    back = affine.link(affine.validate({"matrix": [[1, 0, -30], [0, 1, 0]]}), facts)
    assert away is not None
    assert back is not None
    assert away.then(back) == "the second looks beyond what the first makes"
    resize = lichen.operations()["resize"]
    assert resize.link(resize.validate({"scale": 2}), facts) is None
