"""Depth of field against convolutions by scipy where depth is one, and what a lens must do where it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest

BACKENDS = ("opencl", "numpy")
BOTH = pytest.mark.parametrize("backend", BACKENDS)
RNG = np.random.default_rng(3)


def disc(radius: float) -> np.ndarray:
    reach = math.ceil(radius + 0.5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return np.clip(radius - np.hypot(x, y) + 0.5, 0, 1)


@BOTH
@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0, np.inf])
def test_one_depth_is_a_convolution(depth: float, backend: str) -> None:
    image = RNG.random((70, 90, 3)).astype(np.float32)
    planes = np.full((70, 90, 1), depth, np.float32)
    found = lichen.run("depth_of_field", image, depth=planes, blur=4.5, device=backend, method="gather").image.pixels
    kernel = disc(4.5 * abs(1 - 1 / depth))
    held = ndimage.correlate(np.ones((70, 90)), kernel, mode="constant")
    for c in range(3):
        expected = ndimage.correlate(image[..., c].astype(np.float64), kernel, mode="constant") / held
        assert np.abs(found[..., c] - expected).max() < 1e-6


@BOTH
def test_a_point_of_light_shows_the_aperture(backend: str) -> None:
    image = np.zeros((41, 41, 1), np.float32)
    image[20, 20] = 1e4
    depth = np.full((41, 41, 1), np.inf, np.float32)
    for blades, share in ((0, math.pi), (3, 1.5 * math.sin(2 * math.pi / 3)), (6, 3 * math.sin(math.pi / 3))):
        given = {"depth": depth, "blur": 12.0, "blades": blades, "device": backend, "method": "gather"}
        found = lichen.run("depth_of_field", image, **given).image.pixels[..., 0]
        # Discs are counted in pixels: 1 / (r^2 + 1/12) is their mean weight for a disc, and nearly so for a polygon.
        assert found.sum() == pytest.approx(1e4, rel=0.03)
        assert np.count_nonzero(found > found.max() / 2) == pytest.approx(share * 144, rel=0.06)


@BOTH
def test_layers_are_convolutions_and_lie_over_each_other(backend: str) -> None:
    """One layer is a convolution of all there is; of two, what is near covers what is far, and light does not leak."""
    image = RNG.random((40, 70, 3)).astype(np.float32)
    flat = {"depth": np.full((40, 70, 1), 3.0, np.float32), "blur": 4.5, "device": backend, "method": "layered"}
    found = lichen.run("depth_of_field", image, **flat, layers=4).image.pixels
    held = ndimage.correlate(np.ones((40, 70)), disc(3.0), mode="constant")
    for c in range(3):
        expected = ndimage.correlate(image[..., c].astype(np.float64), disc(3.0), mode="constant") / held
        assert np.abs(found[..., c] - expected).max() < 2e-6
    near = np.arange(70) < 35
    stripes = np.broadcast_to(np.where(near, 0.0, 1e4)[:, None], (40, 70, 1)).astype(np.float32)
    depth = np.broadcast_to(np.where(near, 1.0, 1e6)[:, None], (40, 70, 1)).astype(np.float32)
    sharp = lichen.run("depth_of_field", stripes, **{**flat, "depth": depth}, layers=2).image.pixels
    assert not sharp[:, :35].any()
    in_front = lichen.run("depth_of_field", stripes, **{**flat, "depth": depth}, focus=1e6, layers=2).image.pixels
    assert in_front[20, 60, 0] == 1e4
    assert 0 < in_front[20, 36, 0] < 1e4


@BOTH
def test_views_of_a_slanted_plane_come_near_to_the_definition(backend: str) -> None:
    y, x = np.mgrid[0:48, 0:64]
    image = (0.5 + 0.5 * np.sin(x / 3) * np.cos(y / 4))[..., None].astype(np.float32)
    depth = (1 / (0.4 + 0.02 * x))[..., None].astype(np.float32)
    given = {"depth": depth, "blur": 6.0, "largest": 6.0}
    truth = lichen.evaluate_truth("depth_of_field", image, **given)
    apart = []
    for method, knob in (("light_field", "views"), ("layered", "layers")):
        rough, fine = (
            lichen.run("depth_of_field", image, **given, device=backend, method=method, **{knob: each})
            for each in (2, 32)
        )
        apart += [np.sqrt(np.mean((each.image.pixels - truth)[8:-8, 8:-8] ** 2)) for each in (rough, fine)]
    assert apart[1] < 0.5 * apart[0]
    assert max(apart[2:]) < 0.05 * np.ptp(image)


@BOTH
def test_what_is_near_spreads_over_what_is_in_focus_behind_it(backend: str) -> None:
    near = np.arange(40) < 20
    image = np.broadcast_to(near[None, :, None], (9, 40, 1)).astype(np.float32)
    depth = np.where(image > 0, 0.5, 1.0).astype(np.float32)
    found = lichen.run("depth_of_field", image, depth=depth, blur=6.0, device=backend, method="gather").image.pixels
    assert found[4, 21, 0] > 0.01
    assert found[4, 30, 0] == 0


@BOTH
def test_samples_that_are_all_the_pixels_miss_nothing(backend: str) -> None:
    image, depth = RNG.random((33, 47, 3)).astype(np.float32), RNG.uniform(0.7, 2, (33, 47, 1)).astype(np.float32)
    given = {"depth": depth, "blur": 2.0, "largest": 2.0, "device": backend}
    exact = lichen.run("depth_of_field", image, method="gather", **given).image.pixels
    all_of_them = lichen.run("depth_of_field", image, method="sampled", samples=49, **given).image.pixels
    assert np.abs(exact - all_of_them).max() < 1e-5


def test_more_samples_come_nearer() -> None:
    y, x = np.mgrid[0:96, 0:96] / 96
    image = np.stack([np.sin(9 * x) * np.cos(7 * y), x, y], axis=-1).astype(np.float32)
    depth = (0.5 + 3 * x)[..., None].astype(np.float32)
    given = {"depth": depth, "blur": 9.0}
    exact = lichen.run("depth_of_field", image, method="gather", **given).image.pixels
    errors = [
        np.sqrt(
            np.mean(
                (lichen.run("depth_of_field", image, method="sampled", samples=n, **given).image.pixels - exact) ** 2
            )
        )
        for n in (16, 64, 256)
    ]
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]


def test_two_blades_are_no_aperture() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("depth_of_field", np.ones((3, 3, 1)), depth=np.ones((3, 3, 1)), blades=2)
    assert {flaw.pointer for flaw in caught.value.flaws} == {"/parameters/blades"}
