"""Z composite, mask, dissolve and outline: what each is for, against plain NumPy and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operations.compositing.dissolve import noise

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(7)
BOTH = pytest.mark.parametrize("backend", BACKENDS)


def covered(shape: tuple[int, int]) -> Image:
    coverage = RNG.random((*shape, 1))
    return Image(
        np.concatenate([RNG.random((*shape, 3)) * coverage, coverage], -1).astype(np.float32), alpha=Alpha.ASSOCIATED
    )


@BOTH
def test_the_nearer_is_in_front(backend: str) -> None:
    first, second = covered((9, 21)), covered((9, 21))
    near, far = (RNG.random((9, 21, 1)).astype(np.float32) for _ in range(2))
    inputs = {"depth": near, "base": second, "base_depth": far, "device": backend}
    hard = lichen.run("z_composite", first, **inputs).image.pixels
    assert np.array_equal(hard, np.where(near < far, first.pixels, second.pixels))
    larger = lichen.run("z_composite", first, nearer="larger", **inputs).image.pixels
    assert np.array_equal(larger, np.where(near > far, first.pixels, second.pixels))
    depth = lichen.run("z_composite", first, output="depth", **inputs).image.pixels
    assert np.array_equal(depth, np.minimum(near, far))
    soft = lichen.run("z_composite", first, partial=True, **inputs).image.pixels
    orders = [lichen.run("composite", a, base=b).image.pixels for a, b in ((first, second), (second, first))]
    assert np.allclose(soft, np.where(near < far, *orders), atol=1e-6)


@BOTH
def test_coplanar_pictures_follow_the_rule(backend: str) -> None:
    first, second = (np.full((1, 4, 1), value, np.float32) for value in (1, 3))
    depths = np.array([0.5, 0.5, 0.6, 0.4], np.float32).reshape(1, 4, 1)
    inputs = {"depth": depths, "base": second, "base_depth": np.full((1, 4, 1), 0.5, np.float32), "device": backend}
    for rule, taken in (("image", 1), ("base", 3), ("mean", 2), ("over", 1)):
        found = lichen.run("z_composite", first, coplanar=rule, **inputs).image.pixels.reshape(-1)
        assert found.tolist() == [taken, taken, 3, 1]
    near = lichen.run("z_composite", first, coplanar="mean", tolerance=0.11, **inputs).image.pixels
    assert (near == 2).all()


@BOTH
@pytest.mark.parametrize("channels", [1, 2, 3, 4, 5])
def test_one_channel_is_masked(channels: int, backend: str) -> None:
    picture = RNG.random((5, 37, channels)).astype(np.float32)
    for channel in range(channels):
        found = lichen.run("mask", picture, channel=channel, device=backend).image.pixels
        assert np.array_equal(found[..., 0], picture[..., channel] >= 0.5)


@BOTH
def test_masks_do_logic(backend: str) -> None:
    first, second = (np.tile(each, (3, 1))[..., None].astype(np.float32) for each in ([0, 0, 1, 1], [0, 1, 0, 1]))
    steps = {"and": ("keep", "zero"), "or": ("replace", "keep"), "xor": ("invert", "keep"), "minus": ("zero", "keep")}
    expected = {"and": [0, 0, 0, 1], "or": [0, 1, 1, 1], "xor": [0, 1, 1, 0], "minus": [0, 1, 0, 0]}
    for name, (on_pass, on_fail) in steps.items():
        found = lichen.run("mask", first, counter=second, on_pass=on_pass, on_fail=on_fail, bits=1, device=backend)
        assert found.image.pixels[1, :, 0].tolist() == expected[name], name


@BOTH
def test_counters_count_layers_and_saturate(backend: str) -> None:
    count = np.zeros((2, 3, 1), np.float32)
    for _ in range(5):
        count = lichen.run(
            "mask", np.ones((2, 3, 1)), counter=count, on_pass="increment", bits=2, device=backend
        ).image.pixels
    assert (count == 3).all()
    for _ in range(5):
        count = lichen.run("mask", np.ones((2, 3, 1)), counter=count, on_pass="decrement", device=backend).image.pixels
    assert (count == 0).all()


@BOTH
def test_decals_come_by_priority_in_any_order(backend: str) -> None:
    decals = [np.where(RNG.random((6, 7, 1)) < 0.5, number, 99.0).astype(np.float32) for number in (1, 2, 4)]
    for order in ([0, 1, 2], [2, 0, 1]):
        stencil = np.full((6, 7, 1), 8, np.float32)
        for which in order:
            stencil = lichen.run(
                "mask", decals[which], counter=stencil, test="less", against="counter", write="image", device=backend
            ).image.pixels
        assert np.array_equal(stencil, np.minimum(np.min(decals, axis=0), 8))


@BOTH
def test_dissolving_is_monotone_and_even(backend: str) -> None:
    old, new = np.zeros((64, 80, 1), np.float32), np.ones((64, 80, 1), np.float32)
    before = old
    for amount in (0, 0.1, 0.35, 0.9, 1):
        now = lichen.run("dissolve", old, base=new, amount=amount, seed=3, device=backend).image.pixels
        assert (now >= before).all()
        assert now.mean() == pytest.approx(amount, abs=0.03)
        before = now
    assert (before == 1).all()
    assert np.array_equal(
        lichen.run("dissolve", old, base=new, amount=0.4, seed=9, device=backend).image.pixels,
        noise(64, 80, 9) < np.float32(0.4),
    )
    soft = [
        lichen.run("dissolve", old, base=new, amount=amount, softness=0.3, device=backend).image.pixels
        for amount in (0, 0.2, 0.5, 1)
    ]
    assert (np.diff(soft, axis=0) >= 0).all()
    assert (soft[0] == 0).all()
    assert (soft[-1] == 1).all()


@BOTH
def test_outlines_are_morphology_of_masks(backend: str) -> None:
    mask = ndimage.binary_opening(RNG.random((40, 51)) < 0.7, iterations=2)
    for width in (1, 2.5, 4):
        reach = int(width)
        y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        disc = x * x + y * y <= width * width
        grown = ndimage.grey_dilation(mask.astype(int), footprint=disc, mode="nearest").astype(bool)
        shrunk = ndimage.grey_erosion(mask.astype(int), footprint=disc, mode="nearest").astype(bool)
        expected = {"inside": mask & ~shrunk, "outside": grown & ~mask, "both": grown & ~shrunk}
        for side, drawn in expected.items():
            found = lichen.run("outline", mask.astype(np.float32), width=width, side=side, device=backend).image.pixels
            assert np.array_equal(found[..., 0], drawn), (width, side)


@BOTH
def test_a_slanted_surface_is_no_edge(backend: str) -> None:
    depth = np.broadcast_to(0.1 * np.arange(30, dtype=np.float32), (9, 30)).copy()
    depth[:, 20:] += 5
    found = lichen.run("outline", depth, front="smaller", jump=0.5, device=backend).image.pixels[..., 0]
    assert np.array_equal(np.flatnonzero(found[4]), [19])


def test_flaws_are_named() -> None:
    image, small = np.zeros((4, 5, 3)), np.zeros((3, 5, 1))
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("z_composite", image, depth=small, base=np.zeros((4, 5, 1)), base_depth=np.zeros((4, 5, 1)))
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/inputs/depth", "/inputs/base"}
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("dissolve", image, base=image, pattern=small, softness=1e-4)
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/inputs/pattern", "/parameters/softness"}
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("mask", image, counter=small, channel=3)
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/inputs/counter", "/parameters/channel"}
