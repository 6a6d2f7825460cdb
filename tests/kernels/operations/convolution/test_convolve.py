"""Convolution with any kernel against SciPy, its separable parts, and which method is taken when."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage, signal

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space, as_image
from lichen.opencl.device import default_device
from lichen.operation import Border, Facts
from lichen.operations.convolution.convolve import convolve
from lichen.operations.convolution.convolve_base import stencil
from lichen.operations.convolution.kernels import Named, disc, line_segment, named, separated

SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


def test_truth_agrees_with_scipy() -> None:
    rng = np.random.default_rng(3)
    for border in Border:
        for shape, anchor in (((3, 3), (1, 1)), ((5, 4), (0, 4)), ((1, 7), (6, 0)), ((9, 30), (15, 4))):
            pixels, kernel = rng.random((17, 23)), rng.standard_normal(shape)
            given_ = {"kernel": kernel.tolist(), "anchor": anchor, "border": border, "value": 0.3}
            origin = [anchor[1] - shape[0] // 2, anchor[0] - shape[1] // 2]
            for mode in ("correlation", "convolution"):
                truth = convolve.evaluate_truth(
                    {"image": as_image(pixels)}, convolve.validate({**given_, "mode": mode})
                )
                if mode == "correlation":
                    expected = ndimage.correlate(pixels, kernel, mode=SCIPY[border], cval=0.3, origin=origin)
                else:
                    # SciPy turns the kernel about its own idea of the middle; turned here, only the anchor is left.
                    turned = [(shape[0] - 1 - anchor[1]) - shape[0] // 2, (shape[1] - 1 - anchor[0]) - shape[1] // 2]
                    expected = ndimage.correlate(
                        pixels, kernel[::-1, ::-1], mode=SCIPY[border], cval=0.3, origin=turned
                    )
                np.testing.assert_allclose(truth[..., 0], expected, atol=1e-12)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
@settings(max_examples=25, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 90), st.sampled_from([1, 2, 3, 4, 20])),
    size=st.tuples(st.integers(1, 63), st.integers(1, 63)),
    border=st.sampled_from(list(Border)),
    zeros=st.floats(0, 1),
    seed=st.integers(0, 2**31),
)
def test_no_kernel_breaks_the_bound(
    backend: str, shape: tuple[int, int, int], size: tuple[int, int], border: Border, zeros: float, seed: int
) -> None:
    """Also where a kernel is cut into parts, and where it is wider than the image."""
    rng = np.random.default_rng(seed)
    kernel = rng.standard_normal(size) * (rng.random(size) >= zeros)
    inputs = {"image": as_image(np.sign(rng.standard_normal(shape)).astype(np.float32))}
    p = convolve.validate({"kernel": kernel.tolist(), "border": border, "value": -1, "bias": 0.25})
    facts = {"image": Facts.of(inputs["image"])}
    truth = convolve.evaluate_truth(inputs, p)
    for method in convolve.methods.values():
        knobs = (0.3, 1e-3) if method.knob else (0.0,)
        if method.unfit(p, facts) is not None:
            continue
        for knob in knobs:
            device = default_device()
            assert device is not None
            if backend == "opencl":
                made = method.implementation.opencl(device, inputs, p, knob)
            else:
                made = method.implementation.numpy(inputs, p, knob)
            assert np.abs(made - truth).max() <= method.error(p, knob, facts).value, (method.name, knob)


def test_named_kernels_sum_to_what_they_must() -> None:
    edges = {Named.LAPLACIAN, Named.LAPLACIAN5, Named.SOBEL_X, Named.SOBEL_Y}
    edges |= {each for each in Named if each.startswith(("lines_", "compass_"))}
    for name in Named:
        kernel = named(name, 5, 3.3, 12.5, 35.0)
        assert kernel.sum() == pytest.approx(0.0 if name in edges else 1.0, abs=1e-12), name
        assert all(side % 2 for side in kernel.shape)


@pytest.mark.parametrize("radius", [0.2, 0.5, 1.0, 3.3, 12.0])
def test_disc_weighs_by_area(radius: float) -> None:
    fine, size = 200, 2 * int(np.ceil(radius + 0.5)) + 1
    at = (np.arange(size * fine) + 0.5) / fine - size / 2
    inside = at[:, None] ** 2 + at[None, :] ** 2 <= radius**2
    expected = inside.reshape(size, fine, size, fine).mean((1, 3))
    kernel = disc(radius)
    margin = (size - len(kernel)) // 2
    np.testing.assert_allclose(np.pad(kernel, margin), expected / expected.sum(), atol=2e-3 / radius**2)
    np.testing.assert_allclose(kernel, kernel.T, atol=1e-14)


def test_line_lies_where_its_angle_says() -> None:
    for angle in (0, 30, 90, 135):
        kernel = line_segment(11, angle)
        y, x = np.indices(kernel.shape) - np.array(kernel.shape)[:, None, None] // 2
        assert (kernel * x).sum() == pytest.approx(0, abs=1e-12)
        axis = np.degrees(0.5 * np.arctan2(2 * (kernel * x * y).sum(), (kernel * (x * x - y * y)).sum())) % 180
        assert axis == pytest.approx(angle % 180, abs=0.05)
    assert line_segment(1e-3, 20).max() > 0.99


def test_separation_is_exact_for_products_and_keeps_its_tolerance() -> None:
    binomial = named(Named.SMOOTH, 7, 1, 1, 0)
    assert len(separated(binomial, 1e-12)[0]) == 1
    for tolerance in (0.1, 1e-2, 1e-6):
        terms, left = separated(disc(7.5), tolerance)
        np.testing.assert_allclose(sum(down * across for down, across in terms) + left, disc(7.5), atol=1e-15)
        assert np.abs(left).sum() <= tolerance


def chosen(pixels: np.ndarray, **arguments: Any) -> str:
    return lichen.explain("convolve", pixels, **arguments).method


def test_method_follows_kernel_and_error() -> None:
    pixels = np.random.default_rng(1).random((256, 256, 1), dtype=np.float32)
    assert chosen(pixels, name="box", size=31).startswith("separable")
    assert chosen(pixels, name="disc", radius=15, max_error=1e-4).startswith("direct")
    assert chosen(pixels, name="disc", radius=15, max_error=5e-2).startswith("separable")
    assert chosen(pixels, name="disc", radius=100) == "fft"


def test_large_kernel_agrees_with_a_transform_of_scipy() -> None:
    pixels = np.random.default_rng(1).random((80, 90), dtype=np.float32)
    result = lichen.run("convolve", pixels, name="disc", radius=60, border="constant")
    expected = signal.fftconvolve(pixels.astype(np.float64), disc(60), mode="same")
    np.testing.assert_allclose(result.image.pixels[..., 0], expected, atol=1e-6)


def test_nonfinite_input_leaves_the_transform() -> None:
    pixels = np.random.default_rng(1).random((512, 512, 1), dtype=np.float32)
    clean, large = chosen(pixels, name="disc", radius=25, max_error=1e-5), {"name": "disc", "radius": 40}
    assert clean == chosen(pixels, **large) == "fft"
    pixels[9, 9] = np.inf
    assert chosen(pixels, name="disc", radius=25).startswith("direct")
    assert chosen(pixels, **large) == "fft"  # nothing else takes that; it sets them apart


@pytest.mark.parametrize("bad", [(np.nan,), (np.inf,), (-np.inf,), (np.inf, np.inf), (np.inf, -np.inf)])
def test_large_kernels_keep_what_is_not_finite_where_their_taps_meet_it(bad: tuple[float, ...]) -> None:
    rng = np.random.default_rng(1)
    pixels, kernel = (
        rng.random((50, 60, 2), dtype=np.float32),
        rng.standard_normal((1, 65)) * (rng.random((1, 65)) > 0.5),
    )
    for place, value in enumerate(bad):
        pixels[20, 11 + 9 * place, 0] = value
    for mode in ("convolution", "correlation"):
        values = {"kernel": kernel.tolist(), "mode": mode, "border": "wrap"}
        made = lichen.run("convolve", pixels, **values)
        assert made.method == "fft"
        with np.errstate(invalid="ignore"):
            truth = convolve.evaluate_truth({"image": as_image(pixels)}, convolve.validate(values))
        np.testing.assert_allclose(made.image.pixels, truth, atol=1e-5)


def test_each_channel_may_have_its_kernel() -> None:
    pixels = np.random.default_rng(2).random((20, 30, 3), dtype=np.float32)
    kernels = [[[0.5, 0.5]], [[1.0]], [[0, 1, 0], [1, -4, 1], [0, 1, 0]]]
    for backend in ("opencl", "numpy"):
        made = lichen.run("convolve", pixels, kernels=kernels, bias=0.1, device=backend).image.pixels
        for channel, kernel in enumerate(kernels):
            alone = lichen.run("convolve", pixels[..., channel], kernel=kernel, bias=0.1, device=backend).image.pixels
            np.testing.assert_allclose(made[..., channel], alone[..., 0], atol=1e-6)
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("convolve", pixels, kernels=kernels[:2])
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/kernels"]


def test_compass_masks_turn_by_an_eighth_and_pull_their_way() -> None:
    """As printed in the course for five of the eight; a ramp that rises away from the direction answers most."""
    printed = {
        Named.COMPASS_N: [[-1, -2, -1], [0, 0, 0], [1, 2, 1]],
        Named.COMPASS_NE: [[0, -1, -2], [1, 0, -1], [2, 1, 0]],
        Named.COMPASS_E: [[1, 0, -1], [2, 0, -2], [1, 0, -1]],
        Named.COMPASS_S: [[1, 2, 1], [0, 0, 0], [-1, -2, -1]],
        Named.COMPASS_W: [[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]],
    }
    for name, mask in printed.items():
        assert named(name, 3, 1, 1, 0).tolist() == mask
    every = [name for name in Named if name.startswith("compass_")]
    y, x = np.mgrid[-1:2, -1:2]
    for k, name in enumerate(every):
        ramp = -(np.sin(k * np.pi / 4) * x - np.cos(k * np.pi / 4) * y)
        answers = [(named(each, 3, 1, 1, 0) * ramp).sum() for each in every]
        assert np.argmax(answers) == k, name


def test_every_flaw_of_a_kernel_is_named() -> None:
    pixels = np.ones((4, 4), np.float32)
    for arguments, pointer in (
        ({"kernel": [[1, 2], [3]]}, "/parameters/kernel"),
        ({"name": "sobel_x", "normalise": True}, "/parameters/normalise"),
        ({"name": "box", "anchor": [3, 0]}, "/parameters/anchor"),
    ):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run("convolve", pixels, **arguments)
        assert [flaw.pointer for flaw in caught.value.flaws] == [pointer]


def test_coverage_can_be_kept_and_text_is_taken_for_a_kernel() -> None:
    pixels = np.random.default_rng(1).random((9, 9, 4), dtype=np.float32)
    picture = Image(pixels, Space.LINEAR, Alpha.ASSOCIATED)
    result = lichen.run("convolve", picture, kernel="[[0,1,0],[1,-4,1],[0,1,0]]", coverage="kept")
    assert np.array_equal(result.image.pixels[..., 3], pixels[..., 3])
    assert stencil(convolve.validate({"kernel": "[[1,2]]"})).taps.tolist() == [[2, 1]]


def test_single_one_is_the_identity_and_a_shifted_one_is_not() -> None:
    pixels = np.random.default_rng(1).random((5, 6, 1), dtype=np.float32)
    assert lichen.run("convolve", pixels, kernel=[[0, 1, 0]]).method == "identity"
    shifted = lichen.run("convolve", pixels, kernel=[[0, 0, 1]])
    assert np.array_equal(shifted.image.pixels[:, 1:], pixels[:, :-1])
