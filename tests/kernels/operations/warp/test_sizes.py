"""Resize, arrange and pyramid against Pillow, OpenCV and NumPy."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image as Pillow

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, Space, as_image
from lichen.operation import Border
from lichen.operations.warp.kernels import LANCZOS3
from lichen.operations.warp.pyramid import Halving, taps
from lichen.operations.warp.resize import METHODS, apart, table
from lichen.operations.warp.separable import Axis, axis

NOISE = np.random.default_rng(5).random((48, 64), dtype=np.float32)
PILLOW = {
    "triangle": Pillow.Resampling.BILINEAR,
    "lanczos3": Pillow.Resampling.LANCZOS,
}


@pytest.mark.parametrize("method", list(PILLOW))
@pytest.mark.parametrize("size", [(32, 21), (150, 111), (64, 24)])
def test_resize_is_pillows_inside(method: str, size: tuple[int, int]) -> None:
    """Which leaves out what lies beyond the image, where we go on by the border."""
    expected = np.asarray(Pillow.fromarray(NOISE).resize(size, PILLOW[method]))
    found = lichen.run("resize", NOISE, width=size[0], height=size[1], method=method).image.pixels[..., 0]
    margin = [3 * max(1, after // before) + 3 for before, after in zip((48, 64), size[::-1], strict=True)]
    inside = tuple(slice(m, -m or None) for m in margin)
    np.testing.assert_allclose(found[inside], expected[inside], atol=2e-5)


@pytest.mark.parametrize("size", [(16, 12), (20, 13), (63, 47)])
def test_box_is_opencvs_area(size: tuple[int, int]) -> None:
    expected = cv2.resize(NOISE, size, interpolation=cv2.INTER_AREA)
    found = lichen.run("resize", NOISE, width=size[0], height=size[1], method="box").image.pixels[..., 0]
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_resize_has_half_pixels_where_opencv_has_them() -> None:
    expected = cv2.resize(NOISE, (160, 120), interpolation=cv2.INTER_LINEAR)
    found = lichen.run("resize", NOISE, scale=2.5, method="triangle").image.pixels[..., 0]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("method", ["box", "triangle", "bicubic", "mitchell", "lanczos2", "lanczos3"])
def test_a_checkerboard_has_the_light_of_its_mean(method: str) -> None:
    """Display values 0 and 255: the mean of their light shows as 187.5, the mean of the values as 127.5."""
    y, x = np.mgrid[0:512, 0:512]
    board = Image(((x + y) % 2).astype(np.float32)[..., None].repeat(3, axis=2), Space.SRGB)
    found = lichen.run("resize", board, width=32, method=method, border="wrap").image.pixels * 255
    np.testing.assert_allclose(found, 187.5, atol=0.05)


def test_sizes_keep_proportions() -> None:
    assert lichen.run("resize", NOISE, width=32).image.pixels.shape == (24, 32, 1)
    assert lichen.run("resize", NOISE, height=96).image.pixels.shape == (96, 128, 1)
    assert lichen.run("resize", NOISE, scale=[0.5, 2]).image.pixels.shape == (96, 32, 1)
    with pytest.raises(InvalidRequest):
        lichen.run("resize", NOISE, scale=2, width=5)


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("sizes", [(7, 50), (50, 7), (1, 9), (9, 1), (1000, 3)])
def test_weights_of_an_axis_sum_to_one(border: Border, sizes: tuple[int, int]) -> None:
    made = axis(*sizes, LANCZOS3, border)
    np.testing.assert_allclose(made.weights.sum(axis=1) + made.constant, 1, atol=1e-12)
    assert made.index.min() >= 0
    assert made.index.max() < sizes[0]


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("sizes", [(1, 5), (6, 2), (9, 40), (40, 9), (33, 57), (400, 11)])
def test_kernels_are_as_far_apart_as_their_matrices(border: Border, sizes: tuple[int, int]) -> None:
    """The stated error of a resize is a sum over windows; here it is one over whole rows, with the constant's."""
    before, after = sizes

    def matrix(method: str) -> np.ndarray:
        made = table(before, after, method, border)
        whole = np.zeros((after, before + 1))
        np.add.at(whole, (np.arange(after)[:, None], made.index), made.weights)
        whole[:, before] = made.constant
        return whole

    for method in METHODS:
        off = matrix(method) - matrix("lanczos3")
        expected = np.abs(off).sum(axis=1).max(), np.sqrt(np.square(off).sum() / after)
        assert apart(before, after, method, border) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("channels", [1, 3, 4, 5])
@pytest.mark.parametrize("size", [(37, 150), (70, 9), (300, 200)])
def test_both_axes_at_once_have_the_bits_of_one_after_the_other(
    channels: int, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """NaN included; rows that are skipped, rows that come twice, and strips and bands that are not full."""
    pixels = np.random.default_rng(8).random((83, 190, channels), dtype=np.float32)
    pixels[40, 77] = np.nan
    for method in ("nearest", "box", "lanczos3"):
        given = {"width": size[0], "height": size[1], "border": "reflect", "method": method, "device": "opencl"}
        at_once = lichen.run("resize", pixels, **given).image.pixels
        with monkeypatch.context() as only:
            only.setattr(Axis, "slots", lambda self: None)
            after = lichen.run("resize", pixels, **given).image.pixels
        np.testing.assert_array_equal(at_once, after)


@pytest.mark.parametrize("border", list(Border))
def test_samples_kept_in_order_are_those_that_are_taken(border: Border) -> None:
    made = axis(300, 70, LANCZOS3, border)
    low, high = made.reach
    assert (made.slots() is None) == (border is Border.WRAP)
    if made.slots() is not None:
        assert (made.index >= low[:, None]).all()
        assert (made.index < high[:, None]).all()
        assert made.slots() == 32
    each = made.spans(128)
    if each is not None:
        count, spans = each
        assert all(
            (made.index[n * count : (n + 1) * count] >= first).all() and end - first <= 128
            for n, (first, end) in enumerate(spans)
        )


def test_arrange_is_numpys() -> None:
    pixels = np.random.default_rng(0).random((7, 9, 3), dtype=np.float32)
    found = lichen.run("arrange", pixels, left=2, top=1, right=3, bottom=4, border="reflect101").image.pixels
    np.testing.assert_array_equal(found, np.pad(pixels, ((1, 4), (2, 3), (0, 0)), mode="reflect"))
    found = lichen.run("arrange", pixels, left=-2, bottom=-3).image.pixels
    np.testing.assert_array_equal(found, pixels[:4, 2:])
    found = lichen.run("arrange", pixels, transpose=True, flip="horizontal", tile=[2, 1]).image.pixels
    np.testing.assert_array_equal(found, np.tile(np.rot90(pixels, -1), (1, 2, 1)))
    with pytest.raises(InvalidRequest):
        lichen.run("arrange", pixels, left=-9)


def test_box_and_binomial_levels() -> None:
    found = lichen.run("pyramid", NOISE, kernel="box", level=3).image.pixels[..., 0]
    np.testing.assert_allclose(found, NOISE.reshape(6, 8, 8, 8).mean(axis=(1, 3)), atol=1e-6)
    found = lichen.run("pyramid", NOISE, border="reflect").image.pixels[..., 0]
    filtered = cv2.sepFilter2D(
        NOISE,
        -1,
        np.array([1, 3, 3, 1.0]) / 8,
        np.array([1, 3, 3, 1.0]) / 8,
        anchor=(1, 1),
        borderType=cv2.BORDER_REFLECT,
    )
    np.testing.assert_allclose(found, filtered[::2, ::2], atol=1e-6)


def test_an_atlas_holds_all_levels() -> None:
    atlas = lichen.run("pyramid", NOISE, level=3, layout="atlas", kernel="kaiser").image.pixels
    assert atlas.shape == (48, 96, 1)
    np.testing.assert_array_equal(atlas[:, :64, 0], NOISE)
    second = lichen.run("pyramid", NOISE, level=2, kernel="kaiser").image.pixels
    np.testing.assert_array_equal(atlas[24:36, 64:80], second)
    assert not atlas[:24, 96:].any()


def test_kaiser_is_sharper_than_binomial() -> None:
    """A wave of an eighth of a cycle keeps more of its size."""
    wave = np.cos(2 * np.pi / 8 * np.arange(-4, 4) + np.pi / 8)
    strength = {kernel: abs(float(taps(kernel) @ wave[: len(taps(kernel))])) for kernel in Halving}
    assert as_image(NOISE).height == 48
    kept = {
        k: abs(np.sum(taps(k) * np.cos(2 * np.pi / 8 * (np.arange(len(taps(k))) - (len(taps(k)) - 1) / 2))))
        for k in Halving
    }
    assert kept[Halving.KAISER] > kept[Halving.BOX] > kept[Halving.BINOMIAL], strength
