"""Reflection against skies known in closed form, Fresnel against the law in high precision, charts by one another."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.environment.fresnel import algebraic, reflectance, schlick, schlick_error, schlick_least

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(11)
SIZES = {"latlong": (512, 256), "cube": (384, 256), "cube_cross": (512, 384), "cube_pages": (128, 768)} | {
    "paraboloid": (512, 256),
    "mirror_ball": (512, 512),
}


def sky(d: np.ndarray) -> np.ndarray:
    """Three smooth functions of the direction, x right, y up, z towards the viewer."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([0.5 + 0.4 * y, 0.5 + 0.3 * x + 0.2 * z, 0.4 + 0.3 * x * y - 0.2 * z * z], axis=-1)


def latlong(width: int = 512, height: int = 256) -> np.ndarray:
    """The sky by the definition of the chart: longitude across, from behind over the left; latitude down."""
    longitude = ((np.arange(width) + 0.5) / width * 2 - 1)[None, :] * math.pi
    latitude = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * math.pi
    d = np.stack(
        [np.cos(latitude) * np.sin(longitude), np.sin(latitude) + 0 * longitude, -np.cos(latitude) * np.cos(longitude)],
        axis=-1,
    )
    return sky(d).astype(np.float32)


def ball(side: int = 64) -> np.ndarray:
    """Normals of a ball seen from the front; 0 around it."""
    y, x = (0.5 - (np.mgrid[0:side, 0:side] + 0.5) / side) * 2
    x, flat = -x, x * x + y * y
    made = np.stack([x, y, np.sqrt(np.maximum(1 - flat, 0))], axis=-1)
    made[flat >= 0.98] = 0
    return made.astype(np.float32)


def as_chart(chart: str) -> np.ndarray:
    width, height = SIZES[chart]
    image = latlong(1024, 512)
    return lichen.run("panorama", image, source="latlong", target=chart, width=width, height=height).image.pixels


@BOTH
@pytest.mark.parametrize("chart", list(SIZES))
def test_mirrors_show_the_sky_of_every_chart(chart: str, backend: str) -> None:
    normal = ball()
    environment = latlong() if chart == "latlong" else as_chart(chart)
    given = {"environment": environment, "chart": chart, "device": backend}
    found = lichen.run("reflection", normal, **given).image.pixels
    n = normal.astype(np.float64)
    there = np.linalg.norm(n, axis=-1) > 0
    r = 2 * n[..., 2:3] * n - np.array([0, 0, 1.0])
    apart = np.abs(found - sky(r))[there]
    # The rim of a mirror ball is stretched without end, and the sky straight ahead is seen there.
    ahead = r[there][:, 2] < -0.9 if chart == "mirror_ball" else np.zeros(len(apart), bool)
    assert apart[~ahead].max() < 2e-3
    assert (found[~there] == 0).all()


@BOTH
def test_view_of_a_camera_and_of_positions_agree(backend: str) -> None:
    height, width, fov = 33, 47, 50.0
    normal = RNG.standard_normal((height, width, 3)).astype(np.float32)
    scale = math.tan(math.radians(fov / 2)) / (height / 2)
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    depth = RNG.uniform(1, 9, (height, width))
    rays = np.stack([(columns - width / 2) * scale, (height / 2 - rows) * scale, -np.ones((height, width))], axis=-1)
    eye = np.array([0.5, -1.0, 2.0])
    place = (rays * depth[..., None] + eye).astype(np.float32)
    given = {"environment": latlong(), "mode": "glass", "fresnel": "dielectric", "device": backend}
    camera = lichen.run("reflection", normal, fov=fov, **given).image.pixels
    local = lichen.run("reflection", normal, position=place, eye=eye.tolist(), **given).image.pixels
    assert np.abs(camera - local).max() < 1e-4


@pytest.mark.parametrize("chart", ["latlong", "cube", "paraboloid", "mirror_ball"])
@pytest.mark.parametrize("view", ["orthographic", "camera", "positions"])
def test_the_nearest_texel_is_that_of_normals_of_any_length(chart: str, view: str) -> None:
    height, width = 61, 67
    normal = RNG.standard_normal((height, width, 3)) * 10.0 ** RNG.integers(-30, 30, (height, width, 1))
    normal[:2] = 0
    across, down = (64 * each // 128 for each in SIZES[chart])
    texels = np.arange(across * down, dtype=np.float32).reshape(down, across, 1)
    place = RNG.standard_normal((height, width, 3)).astype(np.float32)
    seen = {"camera": {"fov": 70.0}, "positions": {"position": place, "eye": [3.0, -2.0, 5.0]}}.get(view, {})
    given = {"environment": texels, "chart": chart, "method": "nearest", "background": "environment", **seen}
    found, expected = (
        lichen.run("reflection", normal.astype(np.float32), device=each, **given).image.pixels for each in BACKENDS
    )
    # Both round where a direction lies, and either side of a texel's edge is as near.
    assert (found == expected).mean() > 0.999


@BOTH
def test_refraction_obeys_snell(backend: str) -> None:
    tilt = np.radians(np.array([0, 10, 30, 45, 60, 80, 89.0]))
    normal = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=-1)[None].astype(np.float32)
    found = lichen.run("reflection", normal, environment=latlong(), mode="refraction", index=1.5, device=backend)
    inner = np.arcsin(np.sin(tilt) / 1.5)
    bent = inner - tilt  # from straight ahead, away from the side the surface faces
    expected = sky(np.stack([np.sin(bent), 0 * bent, -np.cos(bent)], axis=-1))
    assert np.abs(found.image.pixels[0] - expected).max() < 2e-3
    inside = lichen.run("reflection", -normal, environment=latlong(), mode="refraction", index=1.5, device=backend)
    sine = 1.5 * np.sin(tilt)
    whole = sine > 1
    outer = np.arcsin(np.minimum(sine, 1)) - tilt
    through = np.stack([np.sin(outer), 0 * outer, -np.cos(outer)], axis=-1)
    mirror = np.stack([np.sin(2 * tilt), 0 * tilt, np.cos(2 * tilt)], axis=-1)
    expected = sky(np.where(whole[:, None], mirror, through))
    assert np.abs(inside.image.pixels[0] - expected).max() < 2e-3


def test_fresnel_has_the_known_values() -> None:
    angles = np.radians([0, 30, 45, 60, 75, 80, 85, 89])
    known = [0.040000, 0.041523, 0.050240, 0.089187, 0.253061, 0.387704, 0.612800, 0.904185]
    for form in (reflectance, algebraic):
        assert np.allclose(form(np.cos(angles), np.array(1.5)), known, atol=6e-7)
    assert reflectance(np.array([1.0]), np.array(200.0))[0] == pytest.approx((199 / 201) ** 2)


@pytest.mark.parametrize("ratio", [0.1, 2 / 3, 0.9999, 1 + 2**-23, 1.0001, 1.33, 1.5, 5.0, 200.0, 1000.0])
def test_fresnel_keeps_its_digits_at_every_index(ratio: float) -> None:
    cosines = [1e-9, 1e-6, 1e-3, 0.01, 0.014, 0.1, 0.3, 0.7, 0.745, 0.9, 0.99999, 1.0]
    found = algebraic(np.array(cosines), np.array(ratio))
    with mpmath.workdps(60):
        for c, value in zip(cosines, found, strict=True):
            ci, n = mpmath.mpf(c), mpmath.mpf(ratio)
            k = 1 - (1 - ci * ci) / (n * n)
            if k < 0:
                assert value == 1
                continue
            ct = mpmath.sqrt(k)
            rs, rp = (ci - n * ct) / (ci + n * ct), (n * ci - ct) / (n * ci + ct)
            assert abs(value - float((rs * rs + rp * rp) / 2)) < 6e-7


@BOTH
def test_fresnel_of_a_picture_is_the_law(backend: str) -> None:
    c = np.linspace(0.001, 1, 500)
    normal = np.stack([np.sqrt(1 - c * c), 0 * c, c], axis=-1)[None].astype(np.float32)
    white = np.ones((8, 16, 1), np.float32)
    exact = normal[0].astype(np.float64)
    cosine = exact[:, 2] / np.linalg.norm(exact, axis=1)
    for index in (0.7, 1.0001, 1.5, 200.0):
        found = lichen.run(
            "reflection", normal, environment=white, fresnel="dielectric", index=index, device=backend, method="exact"
        )
        assert np.abs(found.image.pixels[0, :, 0] - reflectance(cosine, np.array(index))).max() < 6e-7


@pytest.mark.parametrize("ratio", [0.2, 0.7, 1.0, 1.0003, 1.33, 1.5, 2.4, 9.0])
def test_schlick_errs_by_no_less_than_is_known_at_once(ratio: float) -> None:
    assert (schlick_least(ratio) > 0) == (ratio != 1)
    assert schlick_least(ratio) <= schlick_error(ratio)


def test_error_of_schlick_is_as_stated() -> None:
    c = RNG.random(20000)
    for ratio in (0.5, 0.99, 1.0, 1.001, 1.5, 3.0, 100.0):
        apart = np.abs(schlick(c, np.array(ratio)) - reflectance(c, np.array(ratio))).max()
        assert apart <= schlick_error(ratio)
    assert 0.03 < schlick_error(1.5) < 1  # from within glass it misses the rise to total reflection


@BOTH
def test_what_lies_under_a_mirror(backend: str) -> None:
    normal = RNG.standard_normal((9, 13, 3)).astype(np.float32)
    white, light = np.ones((8, 16, 3), np.float32), np.full((8, 16, 3), 0.5, np.float32)
    base = RNG.random((9, 13, 3)).astype(np.float32)
    given = {"environment": white, "reflectance": 0.25, "device": backend}
    plain = lichen.run("reflection", normal, base=base, **given).image.pixels
    assert np.allclose(plain, 0.25 + base, atol=1e-6)
    coated = lichen.run("reflection", normal, base=base, coated=True, **given).image.pixels
    assert np.allclose(coated, 0.25 + 0.75 * base, atol=1e-6)
    lit = lichen.run("reflection", normal, base=base, irradiance=light, **given).image.pixels
    assert np.allclose(lit, 0.25 + 0.5 * base, atol=1e-6)


@BOTH
def test_background_is_the_environment_straight_ahead(backend: str) -> None:
    nothing = np.zeros((32, 32, 3), np.float32)
    found = lichen.run(
        "reflection", nothing, environment=latlong(), fov=90, background="environment", yaw=90, device=backend
    ).image.pixels
    rows, columns = np.mgrid[0:32, 0:32] + 0.5
    d = np.stack([np.ones((32, 32)), 1 - rows / 16, columns / 16 - 1], axis=-1)
    assert np.abs(found - sky(d / np.linalg.norm(d, axis=-1, keepdims=True))).max() < 1e-3


@BOTH
def test_nothing_stored_around_discs_is_seen(backend: str) -> None:
    environment = as_chart("paraboloid").copy()
    y, x = np.mgrid[0:256, 0:512] + 0.5
    environment[np.hypot(x % 256 - 128, y - 128) > 128] = 1e6
    normal = RNG.standard_normal((64, 64, 3)).astype(np.float32)
    found = lichen.run("reflection", normal, environment=environment, chart="paraboloid", device=backend).image.pixels
    assert found.max() < 1.1


def test_flaws_are_named() -> None:
    normal, environment = np.ones((4, 4, 3), np.float32), np.ones((5, 7, 3), np.float32)
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("reflection", normal, environment=environment, base=environment[..., :1], chart="cube", coated=True)
    assert {"/inputs/environment", "/inputs/base"} <= {flaw.pointer for flaw in caught.value.flaws}


def test_six_pages_and_a_cross_are_cubes_of_the_same_faces() -> None:
    cube, cross, pages = (as_chart(chart) for chart in ("cube", "cube_cross", "cube_pages"))
    left, ahead, right = cube[:128, :128], cube[:128, 128:256], cube[:128, 256:]
    up, behind, down = cube[128:, :128], cube[128:, 128:256], cube[128:, 256:]
    assert np.array_equal(pages, np.concatenate([right, left, up, down, ahead, behind]))
    for row, column, face in ((1, 0, left), (1, 1, ahead), (1, 2, right), (1, 3, behind), (0, 1, up), (2, 1, down)):
        assert np.array_equal(cross[row * 128 : row * 128 + 128, column * 128 : column * 128 + 128], face)
    assert (cross[:128, :128] == 0).all()
    back = lichen.run("panorama", cross, source="cube_cross", target="latlong", width=128, height=64).image.pixels
    assert np.abs(back - latlong(128, 64)).max() < 2e-3
