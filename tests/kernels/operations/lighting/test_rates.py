"""Fewer pixels lit than there are: coarse light between like pixels, and light before and after filtering."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.memory import Array

LAMPS = [{"kind": "point", "position": [0.5, 0.8, 0.5], "intensity": 2}, {"direction": [-1, -1, -1], "intensity": 0.3}]


def step_of_two_walls() -> dict[str, Array]:
    """A wall, and another nearer to the right of it, each with a picture on it."""
    y, x = np.meshgrid(np.linspace(0.7, -0.7, 29), np.linspace(-1, 1, 43), indexing="ij")
    near = x > 0.1
    position = np.stack([x, y, np.where(near, -1.0, -3.0)], axis=-1).astype(np.float32)
    normal = np.where(near[..., None], np.float32([0, 0, 2]), np.float32([0.2, 0, 1]))
    rng = np.random.default_rng(5)
    return {"position": position, "normal": normal, "albedo": rng.random((29, 43, 3), np.float32)}


@pytest.mark.parametrize("device", ["opencl", "numpy"])
def test_coarse_light_ends_at_edges_and_keeps_colours(device: str) -> None:
    """The light of two even walls is smooth, so that all that could go wrong is at the edge and in the colours."""
    images = step_of_two_walls()
    wish: dict[str, Any] = {"lights": LAMPS, "facet_roughness": 0.7, "device": device}
    exact = lichen.run("lighting", **images, **wish, method="exact").image.pixels
    apart = {}
    for step in (2, 4, 8):
        found = lichen.run("lighting", **images, **wish, method="coarse", step=step)
        apart[step] = np.abs(found.image.pixels - exact)
        assert apart[step].max() <= found.error.value
    assert apart[8].max() > apart[2].max() > 0
    assert apart[4].max() < 0.02 * exact.max()


@pytest.mark.parametrize("device", ["opencl", "numpy"])
def test_coarse_light_leaves_nan_where_it_is(device: str) -> None:
    images = step_of_two_walls()
    images["normal"][8, 8] = np.nan  # one that is lit for others
    images["albedo"][9, 13] = np.nan
    images["position"][20, 30] = np.inf
    found = lichen.run("lighting", **images, lights=LAMPS, method="coarse", step=4, device=device).image.pixels
    lost = np.isnan(found).any(axis=-1)
    assert set(zip(*np.nonzero(lost), strict=True)) == {(8, 8), (9, 13)}
    assert not found[20, 30].any()


def test_coarse_light_says_what_it_cannot_do() -> None:
    images = step_of_two_walls()
    with pytest.raises(InvalidRequest, match="finer than its pixels"):
        lichen.run("lighting", **images, lights=LAMPS, method="coarse", visibility=np.ones((29, 43, 2), np.float32))


def test_light_of_rough_ground_is_not_that_of_its_mean_normal() -> None:
    """A bumpy mirror seen from afar: lit first it is as dim as the few slopes that mirror the lamp make it."""
    rng = np.random.default_rng(6)
    slopes = 0.2 * rng.standard_normal((64, 64, 2))
    images = {"normal": np.concatenate([slopes, np.ones((64, 64, 1))], axis=-1).astype(np.float32)}
    wish: dict[str, Any] = {"lights": [{"direction": [0, 0, -1]}], "facet_roughness": 0.35, "diffuse": [0, 0, 0]}
    means = {
        name: lichen.run("reduced_lighting", **images, **wish, factor=16, method=name).image.pixels.mean()
        for name in ("lit_first", "widened", "filtered_first")
    }
    whole = lichen.evaluate_truth("lighting", **images, **wish)
    assert means["lit_first"] == pytest.approx(whole.mean(), rel=1e-5)
    assert means["filtered_first"] > 2 * means["lit_first"]
    assert abs(means["widened"] - means["lit_first"]) < 0.3 * means["lit_first"]
