"""Box mean against SciPy, and what must not happen to running sums."""

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
from lichen.operations.convolution.box import box

SCIPY = {
    Border.REFLECT: "reflect",
    Border.REFLECT101: "mirror",
    Border.CLAMP: "nearest",
    Border.WRAP: "wrap",
    Border.CONSTANT: "constant",
}


@pytest.mark.parametrize("border", list(Border))
def test_truth_agrees_with_scipy(border: Border) -> None:
    pixels = np.random.default_rng(3).random((23, 31))
    for width, height in ((1, 3), (5, 4), (60, 2), (7, 51)):
        p = box.validate({"width": width, "height": height, "border": border, "value": 0.3})
        expected = ndimage.uniform_filter(pixels, (height, width), mode=SCIPY[border], cval=0.3)
        truth = box.evaluate_truth({"image": as_image(pixels)}, p)
        np.testing.assert_allclose(truth[..., 0], expected, atol=1e-12)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
@settings(max_examples=30, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 80), st.integers(1, 80), st.integers(1, 9)),
    width=st.integers(1, 120),
    height=st.sampled_from([1, 2, 3, 17, 64, 255, 256, 257, 300]),
    border=st.sampled_from(list(Border)),
    seed=st.integers(0, 2**31),
)
def test_no_image_breaks_the_bound(
    backend: str, shape: tuple[int, int, int], width: int, height: int, border: Border, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    inputs = {"image": as_image(np.where(rng.random(shape) > 0.9, 1e4, rng.random(shape)).astype(np.float32))}
    anchor = [int(rng.integers(width)), int(rng.integers(height))]
    p = box.validate({"width": width, "height": height, "anchor": anchor, "border": border, "value": 2})
    facts = {"image": Facts.of(inputs["image"])}
    truth = box.evaluate_truth(inputs, p)
    for method in box.methods.values():
        for knob in method.knob.values if method.knob else (0.0,):
            device = default_device()
            assert device is not None
            if backend == "opencl":
                made = method.implementation.opencl(device, inputs, p, knob)
            else:
                made = method.implementation.numpy(inputs, p, knob)
            assert np.abs(made - truth).max() <= method.error(p, knob, facts).value, (method.name, knob)


@pytest.mark.parametrize("backend", ["opencl", "numpy"])
def test_result_of_what_is_not_negative_is_not_negative(backend: str) -> None:
    rng = np.random.default_rng(5)
    pixels = np.where(rng.random((200, 300)) > 0.98, 1e7, 0).astype(np.float32)
    result = lichen.run("box", pixels, width=5, height=5, device=backend, method="running").image.pixels
    assert result.min() == 0
    assert np.array_equal(result == 0, ndimage.maximum_filter(pixels, 5)[..., None] == 0)


def test_time_is_promised_not_to_grow_and_table_is_second() -> None:
    pixels = np.random.default_rng(1).random((512, 512, 1), dtype=np.float32)
    small, large = (lichen.explain("box", pixels, width=n, height=n) for n in (5, 101))
    assert small.method == large.method == "running"
    offers = {each["method"] for each in large.to_json()["nodes"][0]["alternatives"]}
    assert {"running"} < offers


def test_anchor_outside_is_named() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("box", np.ones((4, 4), np.float32), width=3, height=2, anchor=[1, 2])
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/anchor"]


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize(("width", "height"), [(6, 5), (41, 17), (130, 9)])
def test_pixels_of_several_channels_have_the_windows_of_each(channels: int, width: int, height: int) -> None:
    """Rows that are done abreast, on tiles whose edges cut pixels, against channels that are done by halves."""
    pixels = np.random.default_rng(7).random((70, 401, channels), dtype=np.float32)
    pixels[33, 170, 1], pixels[50, 399, 2] = np.nan, np.inf
    for operation, values in (("box", {"method": "running"}), ("morphology", {"step": "dilate"})):
        asked = {"width": width, "height": height, "border": "reflect101", "device": "opencl", **values}
        found = lichen.run(operation, pixels, **asked).image.pixels
        for channel in range(channels):
            single = lichen.run(operation, np.ascontiguousarray(pixels[..., channel]), **asked).image.pixels
            rounding = 1e-6 if operation == "box" else 0.0
            np.testing.assert_allclose(found[..., channel], single[..., 0], atol=rounding, rtol=0)
