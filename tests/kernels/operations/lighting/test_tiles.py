"""Lamps left out of tiles: not a bit changes where they give nothing, and no more than was allowed elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import lichen

SIZE = 70, 120


def ground() -> tuple[np.ndarray, np.ndarray]:
    """Waves seen from above, a corner of nothing, and one pixel of each buffer spoilt."""
    height, width = SIZE
    x, z = np.meshgrid(np.linspace(-8, 8, width), np.linspace(-6, 6, height))
    position = np.stack([x, 0.3 * np.sin(3 * x), z], axis=-1).astype(np.float32)
    position[:35, :50] = np.inf
    position[40, 50] = np.nan
    normal = np.broadcast_to(np.float32([0.1, 1, 0]), position.shape).copy()
    normal[66, 8] = np.nan
    return position, normal


def lights() -> list[dict]:
    rng = np.random.default_rng(4)
    spots = [
        {
            "kind": "spot", "position": [float(rng.uniform(-8, 8)), 3.0, float(rng.uniform(-6, 6))],
            "direction": [float(rng.uniform(-0.4, 0.4)), -1, 0], "inner": 9, "outer": float(rng.uniform(12, 40)),
        }
        for _ in range(21)
    ]  # fmt: skip
    upwards = {"kind": "area", "position": [0, 1, 0], "direction": [0, 1, 0], "up": [0, 0, 1], "samples": 4}
    return [{"kind": "point", "position": [0, -2, 0]}, *spots, {"kind": "directional"}, upwards]


@pytest.mark.parametrize("device", ["opencl", "numpy"])
@pytest.mark.parametrize("model", ["lambert", "torrance_sparrow"])
def test_lamps_that_give_nothing_are_left_out_without_a_trace(model: str, device: str) -> None:
    position, normal = ground()
    found = lichen.run("tiles", position, normal=normal, lights=lights(), device=device)
    said = {each["reason"] for each in found.findings["skipped"]}
    assert said == {"nothing is there", "it lies outside the lamp's cone", "it faces away from the lamp"}
    assert all(each["bound"] == 0 for each in found.findings["skipped"])
    albedo = np.ones((*SIZE, 3), np.float32)
    albedo[3, 100] = np.nan
    given = {"position": position, "lights": lights(), "model": model, "eye": [0, 9, 0], "albedo": albedo}
    first = lichen.run("lighting", normal, **given, tiles=found.image, device=device).image.pixels
    second = lichen.run("lighting", normal, **given, device=device).image.pixels
    assert np.array_equal(first, second, equal_nan=True)
    assert np.isnan(first[40, 50]).all()
    assert np.isnan(first[66, 8]).all()
    assert np.isnan(first[3, 100]).all()
    assert not first[:35, :50].any()


@pytest.mark.parametrize("kind", ["linear", "exponential", "squared", "layered", "height"])
def test_what_fog_and_distance_hide_is_no_more_than_was_allowed(kind: str) -> None:
    rng = np.random.default_rng(7)
    position, normal = ground()
    fog = {"kind": kind, "density": 0.8, "end": 9, "heights": [-1, 5], "densities": [1, 2], "falloff": 4, "base": 1}
    fog |= {"eye": [-8, 1, -2], "colour": [0, 0, 0]}
    lamps = [
        {"kind": "point", "position": rng.uniform([-8, 0.5, -6], [8, 2, 6]).tolist(), "intensity": 0.02}
        for _ in range(12)
    ]
    faint = 2e-3
    found = lichen.run("tiles", position, normal=normal, lights=lamps, fog=fog, reflected=0.8, faint=faint)
    said = {each["reason"]: each for each in found.findings["skipped"]}
    assert {"fog hides it", "the lamp is too far away"} <= said.keys()
    assert 0 < said["the lamp is too far away"]["bound"] <= faint
    given = {"position": position, "lights": lamps, "model": "lambert"}
    stated = lichen.run("lighting", normal, **given, tiles=found.image, faint=faint)
    lit = [stated.image, lichen.run("lighting", normal, **given).image]
    first, second = (lichen.run("fog", each, depth=position, **fog).image.pixels for each in lit)
    apart = np.abs(first - second)
    assert np.array_equal(np.isnan(first), np.isnan(second))
    assert 0 < np.nanmax(apart) <= faint
    assert stated.error.value >= faint


def test_a_shadow_is_not_looked_for_where_its_light_is_left_out() -> None:
    position, normal = ground()
    depths = np.full((16, 16, 1), 2.0, np.float32)
    tiles = np.zeros((3, 3, 2), np.float32)
    tiles[1, 1, 1] = 4
    given = {"map": depths, "depth": position, "normal": normal, "filter": 2, "light_eye": [0, 9, 0.1]}
    for device in ("opencl", "numpy"):
        made = lichen.run("shadow", **given, tiles=tiles, effect=1, device=device).image.pixels
        whole = lichen.run("shadow", **given, device=device).image.pixels
        assert not made[32:64, 32:64].any()
        whole[32:64, 32:64] = 0
        assert np.array_equal(made, whole, equal_nan=True)


def test_lists_that_would_not_pay_are_not_made() -> None:
    """Of 8 x 8 tiles the 4 that are looked at first decide; one in nine lamps misses them."""
    x, z = np.meshgrid(np.linspace(-4, 4, 256), np.linspace(-4, 4, 250))
    position = np.stack([x, 0 * x, z], axis=-1).astype(np.float32)
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), position.shape)
    above, below = ({"kind": "point", "position": [0, y, 0]} for y in (2, -2))
    for device in ("opencl", "numpy"):
        made = {
            (worth, count): lichen.run(
                "tiles", position, normal=normal, lights=[below, *[above] * count], worth=worth, device=device
            ).image.pixels
            for worth in (0.0, 0.1) for count in (8, 10)
        }  # fmt: skip
        assert (made[0.0, 10][..., 0] == 3).all()
        assert np.array_equal(made[0.1, 8], made[0.0, 8])
        assert not made[0.1, 10].any()
