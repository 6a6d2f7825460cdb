"""Bent normals against the normals of surfaces that are raised in fact, and the bits that all methods share."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest

CAMERA: dict[str, Any] = {"eye": [0, 0, 3], "target": [0, 0, 0], "fov": 45, "width": 120, "height": 90}
SPHERE = [{"shape": "sphere", "centre": [0, 0, 0], "radius": 1}]


def seen() -> dict[str, np.ndarray]:
    """A ball, and a relief in its own longitudes and latitudes."""
    given = {
        name: lichen.run("gbuffer", objects=SPHERE, buffer=name, frame="world", **CAMERA).image.pixels
        for name in ("normal", "position")
    }
    with np.errstate(invalid="ignore"):
        given["height"] = relief(given["position"].astype(float))[0][..., None].astype(np.float32)
    return given


def relief(p: np.ndarray, high: float = 0.02, often: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """h = high sin(often x) cos(often y) of points p, and its gradient in space."""
    x, y = often * p[..., 0], often * p[..., 1]
    slopes = [np.cos(x) * np.cos(y), -np.sin(x) * np.sin(y), 0 * x]
    return high * np.sin(x) * np.cos(y), high * often * np.stack(slopes, axis=-1)


def test_normals_are_those_of_the_raised_ball() -> None:
    """What is left out of the gradient is its length, 0.12, by the height and the curvature, 0.02; and there are
    differences of pixels in place of derivatives."""
    given = seen()
    found = lichen.run("bump", **given).image.pixels
    p = given["position"].astype(float)
    with np.errstate(invalid="ignore"):
        height, slope = relief(p)
        across = slope - (slope * p).sum(axis=-1, keepdims=True) * p
        # The ball of radius 1 + h: its normal is n - gradient / (1 + h).
        expected = p - across / (1 + height[..., None])
        expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    facing = given["normal"][..., 2] > 0.6
    assert np.count_nonzero(facing) > 2000
    assert np.abs(found - expected)[facing].max() < 0.01
    assert np.abs(given["normal"] - expected)[facing].max() > 0.1, "there is something to be bent"
    nothing = ~np.isfinite(p).all(axis=-1)
    np.testing.assert_array_equal(found[nothing], given["normal"][nothing])


def test_backends_give_the_same_bits_and_single_digits_few_others() -> None:
    given = seen()
    given["normal"] = (given["normal"] * np.float32(2.5)).astype(np.float32)
    truth = lichen.evaluate_truth("bump", **given, scale=1.5)
    for device in ("opencl", "numpy"):
        found = lichen.run("bump", **given, scale=1.5, method="exact", device=device).image.pixels
        np.testing.assert_array_equal(found, truth)
        single = lichen.run("bump", **given, scale=1.5, method="single", device=device).image.pixels
        assert np.abs(single - truth).max() < 1e-4


def test_a_relief_the_other_way_round_is_its_dent() -> None:
    given = seen()
    pressed = lichen.run("bump", **given, scale=-1).image.pixels
    given["height"] = -given["height"]
    np.testing.assert_array_equal(lichen.run("bump", **given).image.pixels, pressed)


@pytest.mark.parametrize("jump", [1, 1e6])
def test_jumps_decide_between_one_side_and_both(jump: float) -> None:
    """Points on a line whose steps grow: the mean of both slopes, or that of the shorter step."""
    x = np.broadcast_to(np.float32([0, 1, 4]), (3, 3))
    position = np.stack([x, np.float32([[2], [1], [0]]) + 0 * x, 0 * x], axis=-1)
    height = np.broadcast_to(np.float32([0, 1, 7]), (3, 3))[..., None].copy()
    normal = np.broadcast_to(np.float32([0, 0, 1]), (3, 3, 3)).copy()
    found = lichen.run("bump", normal, position=position, height=height, jump=jump).image.pixels[1, 1]
    slope = 1 if jump == 1 else 7 / 4
    assert np.allclose(found, np.array([-slope, 0, 1]) / np.hypot(slope, 1), atol=1e-6)


def test_what_is_flat_is_not_computed_and_sizes_must_agree() -> None:
    given = seen()
    level = {**given, "height": np.full_like(given["height"], 0.3)}
    for values in ({**level}, {**level, "scale": 0}):
        made = lichen.run("bump", **values)
        assert made.plan.nodes == ()
        np.testing.assert_array_equal(made.image.pixels, given["normal"])
        whole = lichen.run("bump", **values, prune=False)
        assert whole.plan.nodes
        np.testing.assert_array_equal(whole.image.pixels, given["normal"])
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("bump", given["normal"], position=given["position"][:5], height=given["height"][:, :7])
    assert {each.pointer for each in refused.value.flaws} == {"/inputs/position", "/inputs/height"}
