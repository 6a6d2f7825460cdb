"""Shadows of a ball on a floor against the rays from the floor to the light, and maps in few bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest

BALL, RADIUS = np.array([0.0, 1.0, 0.0]), 0.6
LAMP = {"light_eye": [1.0, 4.0, 0.5], "light_target": [0, 0.5, 0], "light_fov": 60.0}
FLAT = {"light_eye": [2.0, 6.0, 1.0], "light_target": [0, 0.5, 0], "light_extent": 5.0}
OBJECTS = [{"shape": "sphere", "centre": BALL.tolist(), "radius": RADIUS}, {"shape": "plane"}]


def scene(light: dict[str, object], texels: int = 256) -> dict[str, np.ndarray]:
    """The light's map, and the floor with its normals as positions."""
    seen = {key.removeprefix("light_"): value for key, value in light.items()}
    depths = lichen.run("gbuffer", width=texels, height=texels, objects=OBJECTS, **seen).image.pixels
    x, z = np.meshgrid(np.linspace(-1.5, 1.5, 121), np.linspace(-1.2, 1.2, 97))
    floor = np.stack([x, 0 * x, z], axis=-1).astype(np.float32)
    up = np.broadcast_to(np.float32([0, 2, 0]), floor.shape).copy()
    return {"map": depths, "depth": floor, "normal": up}


def clearance(floor: np.ndarray, light: dict[str, object]) -> np.ndarray:
    """How far the ray from every point to the light passes by the ball: below 0 it is in shadow."""
    eye = np.array(light["light_eye"])
    way = eye - np.array(light["light_target"]) if "light_extent" in light else eye - floor
    way = way / np.linalg.norm(way, axis=-1, keepdims=True)
    to = BALL - floor
    nearest = to - (to * way).sum(-1, keepdims=True) * way
    return np.linalg.norm(nearest, axis=-1) - RADIUS


@pytest.mark.parametrize("light", [LAMP, FLAT], ids=["perspective", "parallel"])
def test_shadow_is_where_the_ray_to_the_light_is_stopped(light: dict[str, object]) -> None:
    inputs = scene(light)
    share = lichen.run("shadow", **inputs, **light).image.pixels[..., 0]
    away = clearance(inputs["depth"].astype(np.float64), light)
    clear = np.abs(away) > 0.03
    assert np.count_nonzero(away < -0.03) > 300
    assert np.array_equal(share[clear], (away > 0)[clear].astype(np.float32))
    soft = lichen.run("shadow", **inputs, **light, filter=4).image.pixels[..., 0]
    wide = np.abs(away) > 0.1
    assert np.array_equal(soft[wide], (away > 0)[wide].astype(np.float32))
    assert np.any((soft > 0.05) & (soft < 0.95))


@pytest.mark.parametrize("light", [LAMP, FLAT], ids=["perspective", "parallel"])
def test_single_texels_are_compared_as_in_doubles(light: dict[str, object]) -> None:
    """In shadow, at its edge, where the map shows nothing, behind the lamp, and beside numbers that are none."""
    inputs = scene(light, 96)
    wide = inputs["depth"] * np.float32([1, 1, 40])
    wide[::9, ::7, 1] += np.float32(9)
    normal = inputs["normal"].copy()
    normal[5::11, 3::13] = [np.inf, 0, 1]
    normal[2::11, 5::13] = [0, -1, 0]
    wide[40, 50], wide[41, 50], wide[42, 50] = np.nan, np.inf, 1e30
    hole = inputs["map"].copy()
    hole[::8, ::5] = np.nan
    for outside in ("lit", "dark"):
        for given in ({"map": hole, "depth": wide, "normal": normal}, {"map": hole, "depth": wide}):
            first, second = (
                lichen.run("shadow", **given, **light, outside=outside, device=device).image.pixels
                for device in ("opencl", "numpy")
            )
            assert np.array_equal(first, second, equal_nan=True)


@pytest.mark.parametrize("seed", range(24))
def test_floats_decide_nothing_that_doubles_would_find_otherwise(seed: int) -> None:
    """Lights of any size, receivers at edges of texels and as deep as what the map holds but for some roundings."""
    rng = np.random.default_rng(seed)
    unit, size = 10.0 ** rng.uniform(-2, 3), int(rng.choice([1, 3, 64, 1024]))
    eye = rng.normal(0, unit, 3)
    light: dict[str, object] = {"light_eye": eye.tolist(), "light_target": (eye + rng.normal(0, unit, 3)).tolist()}
    light |= {"light_extent": 2 * unit} if seed % 3 == 0 else {"light_fov": float(rng.uniform(1, 150))}
    camera = lichen.operations()["shadow"].validate(light).light
    matrix = camera.to_pixels(size, size)
    u, v = (rng.uniform(-0.1, 1.1, (64, 131)) * size for _ in range(2))
    u[::2] = np.rint(u[::2]) + rng.normal(0, 1e-4, u[::2].shape)
    deep = unit * np.exp(rng.normal(0, 0.5, u.shape))
    w = np.ones_like(deep) if "light_extent" in light else deep
    rows = np.stack([matrix[0], matrix[1], matrix[2], [0, 0, 0, 1]])
    points = np.linalg.solve(rows, np.stack([u * w, v * w, deep, np.ones_like(u)]).reshape(4, -1))[:3]
    where = points.T.reshape(*u.shape, 3).astype(np.float32)
    off = rng.choice([0, 1e-7, 1e-6, 1e-5, 1e-3], u.shape) * rng.normal(0, 1, u.shape)
    depths = np.full((size, size, 1), np.inf, np.float32)
    row, column = (np.clip(np.floor(each), 0, size - 1).astype(int) for each in (v, u))
    depths[row, column, 0] = (where @ matrix[2, :3] + matrix[2, 3]) * (1 + off)
    to = eye - where
    normal = (to / np.linalg.norm(to, axis=-1, keepdims=True) + rng.normal(0, 1, to.shape)).astype(np.float32)
    for given in ({}, {"normal": normal * np.float32(unit)}):
        first, second = (
            lichen.run("shadow", depths, depth=where, **given, **light, device=device, method="exact").image.pixels
            for device in ("opencl", "numpy")
        )
        assert np.array_equal(first, second)
        assert size < 64 or 0 < first.mean() < 1


@pytest.mark.parametrize("kind", ["pcf", "pcss", "variance"])
def test_backends_give_the_same_bits(kind: str) -> None:
    inputs = scene(LAMP, 96)
    for further in ({}, {"outside": "dark", "slope": 0.5}):
        for given in (inputs, {key: value for key, value in inputs.items() if key != "normal"}):
            first, second = (
                lichen.run("shadow", **given, **LAMP, kind=kind, filter=5, device=device, **further).image.pixels
                for device in ("opencl", "numpy")
            )
            assert np.array_equal(first, second)


def test_penumbra_widens_with_the_distance_from_what_stands_before_it() -> None:
    """The lit share in the middle of the edge, over light sources of growing width."""
    inputs = scene(FLAT)
    widths = []
    for source in (0.05, 0.1, 0.2):
        share = lichen.run("shadow", **inputs, **FLAT, kind="pcss", filter=24, source=source).image.pixels
        widths.append(np.count_nonzero((share > 0.02) & (share < 0.98)))
    assert widths[0] * 1.5 < widths[1]
    assert widths[1] * 1.5 < widths[2]


def test_few_bits_move_shadows_and_many_do_not() -> None:
    inputs = scene(LAMP)
    wrong = {}
    exact = lichen.run("shadow", **inputs, **LAMP, light_near=0.1, light_far=600.0).image.pixels
    for method in ("linear", "window"):
        for bits in (8, 12, 16, 24):
            made = lichen.run(
                "shadow", **inputs, **LAMP, light_near=0.1, light_far=600.0, method=method, bits=bits
            ).image.pixels
            wrong[method, bits] = float(np.mean(made != exact))
    assert wrong["linear", 8] > 0.001
    assert wrong["linear", 16] <= wrong["linear", 12] <= wrong["linear", 8]
    assert wrong["linear", 24] == wrong["window", 24] == 0


@pytest.mark.parametrize("device", ["opencl", "numpy"])
@pytest.mark.parametrize("far", [None, 300.0])
def test_floats_tell_depths_apart_by_their_share(far: float | None, device: str) -> None:
    """Things a fiftieth of the way above what they shade, near the light and far from it: 5 digits do not tell them
    apart, 8 do, wherever they are; whole numbers of 8 bits only far enough apart."""
    depth = np.array([0.2, 1, 5, 20, 100], np.float32)
    points = np.stack([0 * depth, 0 * depth, -depth], axis=-1)
    light = {"light_eye": [0, 0, 0], "light_target": [0, 0, -1], "light_near": 0.1, "slope": 0, "device": device}
    ends: dict[str, Any] = {**light, "light_far": far}

    def shares(**wish: Any) -> list[float]:
        return [
            lichen.run("shadow", np.full((1, 1, 1), z * 0.98), depth=at[None, None], **ends, **wish).image.pixels.item()
            for z, at in zip(depth, points, strict=True)
        ]

    for method in ("float", "reversed"):
        assert shares(method=method, digits=5) == [1] * 5
        assert shares(method=method, digits=8) == [0] * 5
    if far is not None:
        assert shares(method="linear", bits=8) == [1, 1, 1, 1, 0]


def test_flaws_are_named_together() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run(
            "shadow", map=np.ones((4, 4, 1)), depth=np.ones((4, 5, 1)), normal=np.ones((4, 4, 3)), light_near=2,
            light_far=2, light_eye=[0, 0, 0], light_target=[0, 0, 0], kind="variance",
        )  # fmt: skip
    pointers = {each.pointer for each in caught.value.flaws}
    assert pointers == {
        "/inputs/normal", "/parameters/light_far", "/parameters/light_target", "/parameters/filter",
    }  # fmt: skip
    with pytest.raises(InvalidRequest) as caught:  # near times far would be 0, by which a reversed depth is divided
        lichen.operations()["shadow"].validate({"light_near": 5e-324, "light_far": 0.4})
    assert [each.pointer for each in caught.value.flaws] == ["/parameters/light_near"]
