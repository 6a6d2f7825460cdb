"""Gaussian blur against SciPy, and what its bounds and its choice of method promise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

import lichen
from lichen.errors import InvalidRequest
from lichen.image import as_image
from lichen.opencl.device import default_device
from lichen.operation import Border, Facts
from lichen.operations.convolution import gaussian_turned, lowrank, multirate
from lichen.operations.convolution.gaussian import Parameters, gaussian
from lichen.operations.convolution.gaussian_weights import (
    dct_bases,
    dct_modes,
    eigenvalues,
    fir_radius,
    fir_weights,
    half_kernel,
    middle,
    modes_about,
)
from lichen.operations.convolution.passes import folded

SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("sigma", [0.3, 1.0, 4.0, 15.0, 60.0])
def test_truth_agrees_with_scipy(border: Border, sigma: float) -> None:
    """SciPy cuts its kernel at a chosen distance; at nine sigma that is nothing."""
    pixels = np.random.default_rng(3).random((41, 58, 2))
    truth = gaussian.evaluate_truth({"image": as_image(pixels)}, Parameters(sigma=sigma, border=border, value=0.3))
    mode = SCIPY[border]
    expected = ndimage.gaussian_filter(pixels, sigma, mode=mode, cval=0.3, truncate=9.0, axes=(0, 1))
    np.testing.assert_allclose(truth, expected, atol=1e-13)


@pytest.mark.parametrize("sigma", [1e-6, 0.2, 1.0, 7.3, 100.0])
def test_kernel_sums_to_one_and_loses_what_it_says(sigma: float) -> None:
    half = half_kernel(sigma)
    assert half[0] + 2 * half[1:].sum() == pytest.approx(1, abs=1e-14)
    for tail in (1e-2, 1e-5):
        radius, outside = fir_radius(sigma, tail)
        weights = fir_weights(sigma, tail)
        assert len(weights) == 2 * radius + 1
        assert 2 * half[radius + 1 :].sum() * (1 - 1e-9) <= outside <= tail
        assert radius == 0 or 2 * half[radius:].sum() > tail  # one tap less would lose too much
        whole = np.concatenate([half[:0:-1], half])
        cut = np.zeros_like(whole)
        cut[len(half) - 1 - radius : len(half) + radius] = weights
        assert np.abs(whole - cut).sum() <= 2 * tail * (1 + 1e-9)


@given(st.floats(1.4, 400), st.floats(1e-9, 0.4))
def test_of_wide_kernels_what_is_cut_off_is_known_without_their_weights(sigma: float, tail: float) -> None:
    """No less than what is cut off, and hardly more; by a tap more than are needed at most."""
    half, (radius, outside) = half_kernel(sigma), fir_radius(sigma, tail)
    assert half[0] == pytest.approx(middle(sigma), rel=1e-14)
    left = 2 * np.cumsum(half[::-1])[::-1]  # at distances >= 0, 1, 2 ...
    steep = 1 if sigma < 8 else 1.04
    assert left[radius + 1] * (1 - 1e-9) <= outside <= min(steep * left[radius + 1] * (1 + 1e-9), tail)
    assert radius == 0 or left[radius - 1] > tail


@given(st.floats(0.5, 30), st.floats(0.5, 30), st.floats(0, 180), st.floats(1e-8, 0.4))
@settings(max_examples=40)
def test_what_is_said_of_a_turned_kernel_holds_when_it_is_taken_apart(
    along: float, across: float, angle: float, tail: float
) -> None:
    """No error is larger, and no rounding much smaller; the work is about what it takes."""
    turned = gaussian_turned.Turned(along, across, angle)
    (taps, outside), (terms, left) = (each(turned, tail) for each in (gaussian_turned.cut, gaussian_turned.taken_apart))
    stated, rounding = gaussian_turned.error(turned, tail, 1.0, 1.0), lowrank.rounding(terms, 1.0, 0.0)
    assert rounding <= stated.rounding <= 15 * rounding
    assert outside + lowrank.dropped(left, -1.0, 1.0) <= (stated.value - stated.rounding) * (1 + 1e-9) + 1e-15
    assert all(
        side <= most <= side + 4 for side, most in zip(taps.shape, gaussian_turned.sides(turned, tail), strict=True)
    )
    work = (30000 + gaussian_turned.FEW) * len(terms) * (sum(taps.shape) + gaussian_turned.MOVED)
    assert 0.4 * work <= gaussian_turned.work(turned, tail, Facts(100, 100, 3)) <= 2.5 * work


@pytest.mark.parametrize("size", [16, 300, 4000])
@pytest.mark.parametrize("sigma", [0.3, 1.0, 5.0, 60.0, 700.0])
def test_how_many_modes_are_kept_is_about_known_at_once(size: int, sigma: float) -> None:
    for tail in (1e-2, 1e-4, 1e-7):
        assert modes_about(sigma, size, tail) == pytest.approx(dct_modes(sigma, size, tail)[0], rel=0.03, abs=1)


@pytest.mark.parametrize("size", [1, 2, 17, 64])
@pytest.mark.parametrize("sigma", [0.4, 1.9, 2.1, 30.0])
def test_cosine_modes_diagonalise_the_pass(size: int, sigma: float) -> None:
    half = half_kernel(sigma)
    matrix, _ = folded(np.concatenate([half[:0:-1], half]), size, Border.REFLECT)
    modes = np.cos(np.pi / size * np.outer(np.arange(size) + 0.5, np.arange(size)))
    np.testing.assert_allclose(matrix @ modes, modes * eigenvalues(sigma, size, np.arange(size)), atol=1e-8)
    forward, inverse = dct_bases(sigma, size, 1e-9)
    np.testing.assert_allclose(inverse @ forward, matrix, atol=2e-6)


@settings(max_examples=60, deadline=None)
@given(
    sigma=st.floats(0.05, 80),
    border=st.sampled_from(list(Border)),
    tail=st.sampled_from([1e-1, 1e-2, 1e-4]),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40), st.integers(1, 3)),
    seed=st.integers(0, 2**31),
)
def test_no_image_breaks_the_bound(
    sigma: float, border: Border, tail: float, shape: tuple[int, int, int], seed: int
) -> None:
    """Signs that follow the kernel's error are the worst input; random extremes come close."""
    pixels = np.sign(np.random.default_rng(seed).standard_normal(shape)).astype(np.float32)
    parameters = Parameters(sigma=sigma, border=border, value=-1.0)
    inputs = {"image": as_image(pixels)}
    facts = {"image": Facts.of(inputs["image"])}
    truth = gaussian.evaluate_truth(inputs, parameters)
    for method in gaussian.methods.values():
        if method.unfit(parameters, facts) is None:
            knob = tail if method.knob.name == "tail" else method.knob.values[0]
            made = method.implementation.numpy(inputs, parameters, knob)
            assert np.abs(made - truth).max() <= method.error(parameters, knob, facts).value


@pytest.mark.parametrize("sigma", [1.0, 2.2, 5.0, 17.3, 56.0])
@pytest.mark.parametrize("tail", [1e-1, 1e-3, 1e-5, 1e-7])
def test_two_narrower_gaussians_are_as_near_to_one_as_they_say(sigma: float, tail: float) -> None:
    filters, half = multirate.filters(sigma, tail), half_kernel(sigma)
    made = filters.rates
    assert made.step > 1 or sigma < 3
    truth = np.concatenate([half[:0:-1], half])
    furthest = 0.0
    for phase, weights in enumerate(filters.synthesis):
        apart = np.zeros((made.taps - 1) * made.step + 1)
        apart[:: made.step] = weights
        response = np.convolve(apart, filters.analysis)
        first = -made.before * made.step - made.radius - phase  # of the row that it is summed for
        whole = np.zeros(2 * max(len(truth), len(response)) + 1)
        middle = len(whole) // 2
        whole[middle - len(half) + 1 : middle + len(half)] = -truth
        whole[middle + first : middle + first + len(response)] += response
        furthest = max(furthest, np.abs(whole).sum() / 2)
    assert made.distance / 20 < furthest <= made.distance * (1 + 1e-9) + 1e-15
    assert made.distance <= 1.2 * tail or made.step == 1


def test_the_widest_blur_by_few_rows_has_room_at_its_finest() -> None:
    device = default_device()
    if device is None:
        pytest.skip("there is no OpenCL device")
    pixels = np.random.default_rng(2).random((130, 90, 3), np.float32)
    inputs, parameters = {"image": as_image(pixels)}, Parameters(sigma=multirate.WIDEST)
    method = gaussian.methods["multirate"]
    made = method.implementation.opencl(device, inputs, parameters, method.knob.low)
    assert np.abs(made - gaussian.evaluate_truth(inputs, parameters)).max() <= 1e-6
    wider = Parameters(sigma=1.0, sigma_y=multirate.WIDEST + 1)
    assert "more rows" in method.unfit(wider, {"image": Facts.of(inputs["image"])})


@pytest.mark.parametrize("border", list(Border))
@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 3), (400, 150, 2)])
def test_few_rows_blur_all_borders_on_a_device_in_any_number_of_bands(
    border: Border, shape: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    device = default_device()
    if device is None:
        pytest.skip("there is no OpenCL device")
    pixels = np.sign(np.random.default_rng(2).standard_normal(shape)).astype(np.float32)
    parameters = Parameters(sigma=5.0, sigma_x=2.0, border=border, value=-1.0)
    inputs = {"image": as_image(pixels)}
    method, truth = gaussian.methods["multirate"], gaussian.evaluate_truth(inputs, parameters)
    whole = method.implementation.opencl(device, inputs, parameters, 1e-5)
    bound = method.error(parameters, 1e-5, {"image": Facts.of(inputs["image"])}).value
    assert np.abs(whole - truth).max() <= bound
    monkeypatch.setattr(multirate, "HELD", 1)
    assert multirate.in_bands(400, 300, multirate.rates(5.0, 1e-5))[0] == 3
    assert method.implementation.opencl(device, inputs, parameters, 1e-5).tobytes() == whole.tobytes()


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_zero_sigma_returns_the_input_bit_for_bit(backend: str) -> None:
    pixels = np.random.default_rng(1).standard_normal((9, 7, 3)).astype(np.float32)
    pixels[2, 3] = [np.nan, np.inf, -0.0]
    result = lichen.run("gaussian", pixels, sigma=0, device=backend)
    assert result.image.pixels.tobytes() == pixels.tobytes()
    assert result.method == "identity"
    assert [decision.action for decision in result.decisions] == ["dropped"]


def test_wide_kernels_take_the_transform_or_a_recursion_and_narrow_ones_do_not() -> None:
    pixels = np.random.default_rng(1).random((512, 512, 1), dtype=np.float32)
    assert lichen.explain("gaussian", pixels, sigma=1.0, max_error=1e-4).method.startswith("fir")
    assert lichen.explain("gaussian", pixels, sigma=60.0, max_error=1e-4).method.startswith(("dct", "deriche"))
    assert lichen.explain("gaussian", pixels, sigma=200.0, max_error=1e-5).method.startswith("dct")
    assert lichen.explain("gaussian", pixels, sigma=20.0, border="clamp", max_error=1e-3).method.startswith("deriche")
    assert dct_modes(60.0, 512, 1e-4)[0] < dct_modes(10.0, 512, 1e-4)[0]


def test_nonfinite_input_leaves_the_transform() -> None:
    pixels = np.random.default_rng(1).random((512, 512, 1), dtype=np.float32)
    pixels[100, 100] = np.nan
    plan = lichen.explain("gaussian", pixels, sigma=60.0, max_error=1e-4)
    assert plan.method.startswith("fir")
    offers = plan.to_json()["nodes"][0]["alternatives"]
    for method, reason in (("dct", "spread NaN"), ("deriche", "never forgets"), ("box3", "never forgets")):
        assert any(reason in offer["verdict"] for offer in offers if offer["method"] == method)


def test_constant_images_stay_constant() -> None:
    for border in (Border.REFLECT, Border.CLAMP, Border.WRAP, Border.REFLECT101):
        for sigma in (0.7, 5.0, 200.0):
            result = lichen.run("gaussian", np.full((40, 50, 3), 0.3, np.float32), sigma=sigma, border=border)
            np.testing.assert_allclose(result.image.pixels, 0.3, atol=1e-6)


def test_two_widths_and_their_axes() -> None:
    pixels = np.random.default_rng(3).random((31, 44))
    inputs = {"image": as_image(pixels)}
    expected = ndimage.gaussian_filter(pixels, (1.5, 4.0), mode="reflect", truncate=9.0)
    for given_ in ({"sigma_x": 4.0}, {"sigma_x": 1.5, "sigma_y": 4.0, "angle": 90}, {"sigma_x": 4.0, "angle": -180}):
        truth = gaussian.evaluate_truth(inputs, Parameters(sigma=1.5, **given_))
        np.testing.assert_allclose(truth[..., 0], expected, atol=1e-13)


@pytest.mark.parametrize("border", list(Border))
def test_turned_truth_agrees_with_scipy(border: Border) -> None:
    pixels = np.random.default_rng(3).random((23, 35))
    y, x = np.mgrid[-40:41, -40:41]
    c, s = np.cos(np.radians(25)), np.sin(np.radians(25))
    kernel = np.exp(-0.5 * (((c * x + s * y) / 4) ** 2 + ((c * y - s * x) / 1.2) ** 2))
    expected = ndimage.correlate(pixels, kernel / kernel.sum(), mode=SCIPY[border], cval=0.3)
    p = Parameters(sigma=1.2, sigma_x=4, angle=25, border=border, value=0.3)
    truth = gaussian.evaluate_truth({"image": as_image(pixels)}, p)
    np.testing.assert_allclose(truth[..., 0], expected, atol=1e-12)


@pytest.mark.parametrize("border", Border)
@pytest.mark.parametrize("bits", [24.0, 53.0])
def test_products_of_spectra_are_the_turned_blur(border: Border, bits: float) -> None:
    """Also where the kernel is longer than the image, and of values far from 0."""
    image, method = as_image(np.random.default_rng(5).random((21, 34, 2), np.float32) + 3), gaussian.methods["fft"]
    for along, across in ((6.0, 0.8), (3.0, 20.0)):
        p = Parameters(sigma=1, sigma_x=along, sigma_y=across, angle=65, border=border, value=0.3)
        made = method.implementation.numpy({"image": image}, p, bits)
        stated = method.error(p, bits, {"image": Facts.of(image)}).value
        assert np.abs(made - gaussian.evaluate_truth({"image": image}, p)).max() <= stated <= (9e-6, 4e-7)[bits > 24]


def test_a_line_turned_lies_where_its_angle_says() -> None:
    point = np.zeros((61, 61), np.float32)
    point[30, 30] = 1
    made = lichen.run("gaussian", point, sigma=1.5, sigma_x=6, angle=30, max_error=1e-4).image.pixels[..., 0]
    y, x = np.mgrid[-30:31, -30:31]
    axis = np.degrees(0.5 * np.arctan2(2 * (made * x * y).sum(), (made * (x * x - y * y)).sum()))
    assert axis == pytest.approx(30, abs=0.1)


def test_what_a_turned_kernel_cannot_have_is_named() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gaussian", np.ones((9, 9), np.float32), sigma=0.1, sigma_x=70, angle=10, missing="skip")
    pointers = [flaw.pointer for flaw in caught.value.flaws]
    assert pointers == ["/parameters/sigma_x", "/parameters/sigma_y", "/parameters/angle"]
