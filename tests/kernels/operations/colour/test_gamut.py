"""Gamut against OpenColorIO's fixed function, which is the Academy's, and what only this operation promises."""

from __future__ import annotations

import numpy as np
import PyOpenColorIO as ocio
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operations.colour.gamut import BLOCK, FARTHEST, Parameters

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(9)
PIXELS = RNG.uniform(-0.6, 1.4, (31, 45, 3)).astype(np.float32)
PIXELS[0, :20] *= 1e-3
PIXELS[1, :20] *= 1e4


def academys(pixels: np.ndarray, direction: ocio.TransformDirection, p: Parameters) -> np.ndarray:
    values = [*p.limit, *p.threshold, p.power]
    function = ocio.FixedFunctionTransform(ocio.FIXED_FUNCTION_ACES_GAMUT_COMP_13, values, direction)
    processor = ocio.Config.CreateRaw().getProcessor(function)
    made = np.ascontiguousarray(pixels).copy()
    plain = processor.getOptimizedCPUProcessor(ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_F32, ocio.OPTIMIZATION_NONE)
    plain.apply(ocio.PackedImageDesc(made, made.shape[1], made.shape[0], 3))
    return made


def test_compress_is_the_academys() -> None:
    for values in ({}, {"power": 2.0, "threshold": [0.5, 0.6, 0.7], "limit": [1.5, 1.2, 2.0]}):
        found = lichen.evaluate_truth("gamut", PIXELS, **values)
        expected = academys(PIXELS, ocio.TRANSFORM_DIR_FORWARD, Parameters.model_validate(values))
        size = np.abs(PIXELS).max(axis=-1, keepdims=True)
        np.testing.assert_allclose(expected / size, found / size, rtol=2e-5, atol=2e-6)


def test_expand_is_the_academys_where_that_is_defined() -> None:
    inside = lichen.evaluate_truth("gamut", PIXELS).astype(np.float32)
    found = lichen.evaluate_truth("gamut", inside, action="expand")
    expected = academys(inside, ocio.TRANSFORM_DIR_INVERSE, Parameters())
    top = PIXELS.max(axis=-1, keepdims=True)
    near = ((top - PIXELS) / np.abs(top) < 3).all(axis=-1)
    np.testing.assert_allclose(expected[near], found[near], rtol=2e-3, atol=1e-3)


def test_expand_undoes_compress_up_to_its_distance() -> None:
    top = PIXELS.max(axis=-1, keepdims=True)
    near = ((top - PIXELS) / np.abs(top) < FARTHEST).all(axis=-1)
    assert near.mean() > 0.9
    there = lichen.evaluate_truth("gamut", PIXELS)
    back = lichen.evaluate_truth("gamut", there, action="expand")
    assert np.abs(back - PIXELS)[near].max() < 1e-10 * np.abs(PIXELS).max()


def test_expand_is_continuous_where_its_tangent_starts_and_at_black() -> None:
    ramp = np.stack([np.ones(4001), np.linspace(-0.5, 1, 4001), np.ones(4001)], axis=-1)[np.newaxis]
    made = lichen.evaluate_truth("gamut", ramp, action="expand")[0, :, 1]
    slopes = np.diff(made) / np.diff(ramp[0, :, 1])
    assert (slopes > 0).all()
    assert slopes.max() < 2.5e2
    black = np.array([[[0, -0.5, 0], [1e-30, -0.5, 0]]])
    both = lichen.evaluate_truth("gamut", black, action="expand")[0]
    np.testing.assert_allclose(both[0], both[1], atol=1e-12)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("action", ["clip", "compress"])
@pytest.mark.parametrize("source", ["bt709", "bt2020", "ap0"])
def test_colours_come_inside_and_those_inside_stay(action: str, source: str, backend: str) -> None:
    values = {"action": action, "source": source, "target": source, "device": backend}
    if action == "clip":
        assert lichen.run("gamut", PIXELS, **values).image.pixels.min() >= 0
    top = PIXELS.max(axis=-1, keepdims=True)
    kept = ((top - PIXELS) / np.abs(top) < 0.8).all(axis=-1) & (top[..., 0] > 0)
    made = lichen.run("gamut", PIXELS, **values).image.pixels
    np.testing.assert_allclose(made[kept], PIXELS[kept], rtol=1e-6)


def test_limits_land_on_the_wall() -> None:
    p = Parameters()
    wall = np.array([[[1 - p.limit[0], 1, 0.9], [1, 1 - p.limit[1], 0.9], [1, 0.9, 1 - p.limit[2]]]])
    made = lichen.evaluate_truth("gamut", wall)[0]
    assert np.abs(np.diag(made)).max() < 1e-12


@pytest.mark.parametrize("backend", BACKENDS)
def test_report_tells_the_share_outside(backend: str) -> None:
    picture = np.full((10, 10, 4), 0.5, np.float32)
    picture[0, :5, 0] = -0.25
    picture[1, :3, 2] = 1.5
    image = Image(picture, alpha=Alpha.STRAIGHT)
    result = lichen.run("gamut", image, action="report", peak=1.0, device=backend)
    assert result.findings["outside"] == pytest.approx(0.08)
    assert result.findings["outside_by_channel"] == pytest.approx([0.05, 0, 0.03])
    assert result.findings["distance"] == pytest.approx(1.5)
    assert result.image.pixels.shape == (10, 10, 1)
    assert result.image.pixels.sum() == 8
    open_ = lichen.run("gamut", image, action="clip", device=backend)
    assert open_.findings["outside"] == pytest.approx(0.05)


def test_a_display_p3_red_is_outside_bt709_and_not_the_other_way_round() -> None:
    red = np.zeros((1, 1, 3), np.float32)
    red[..., 0] = 1
    assert lichen.run("gamut", red, action="report", source="p3_d65").findings["outside"] == 1
    assert lichen.run("gamut", red, action="report", target="p3_d65").findings["outside"] == 0


def test_flaws_are_named_all_at_once() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gamut", PIXELS, action="expand", peak=1.0, power=5.0)
    assert {flaw.pointer for flaw in caught.value.flaws} == {"/parameters/peak", "/parameters/power"}


def test_findings_are_of_the_whole_picture() -> None:
    """However many blocks it is looked at in: what is farthest lies in the second, what is undefined in the third."""
    pixels = np.full((3, BLOCK, 3), 0.5, np.float32)
    pixels[0, 5] = [1, -0.25, 1]
    pixels[1, 7] = [-2, 2, 2]
    pixels[2, 0] = [np.nan, 1, 1]
    pixels[2, 1] = [np.inf, 1, -1]
    found = lichen.run("gamut", pixels, action="report").findings
    share = 1 / (3 * BLOCK)
    assert found["distance"] == 2
    assert found["outside"] == pytest.approx(3 * share)
    assert found["outside_by_channel"] == pytest.approx([share, share, share])


@pytest.mark.parametrize("channels", [3, 4, 5])
@pytest.mark.parametrize("values", [{}, {"source": "ap1"}, {"peak": 0.9}, {"source": "bt2020", "peak": 0.30000001}])
def test_a_device_finds_and_reports_the_same(values: dict[str, object], channels: int) -> None:
    """Bit for bit, of colours near the wall, of any bits, of black and of nothing."""
    near = RNG.uniform(-0.2, 1.2, (130, 131, channels)).astype(np.float32)
    black = np.where(RNG.random(near.shape) < 0.5, 0, near).astype(np.float32)
    black[:100] = 0
    spoilt = near.copy()
    spoilt[7, 40:45, :3] = [[np.nan, 1, -9], [1, np.nan, -9], [1, -9, np.nan], [np.inf, 1, -9], [-np.inf, 1, -9]]
    bits = RNG.integers(0, 1 << 32, near.shape, dtype=np.uint32).view(np.float32)
    for pixels in (near, black, spoilt, bits, np.full_like(near, np.nan), np.full_like(near, 0.5)):
        made, exact = (lichen.run("gamut", pixels, action="report", device=each, **values) for each in BACKENDS)
        assert made.findings == exact.findings
        assert np.array_equal(made.image.pixels, exact.image.pixels)


def test_a_peak_between_two_floats_is_stated() -> None:
    result = lichen.run("gamut", np.full((4, 4, 3), 50, np.float32), action="clip", peak=30.0000003)
    assert 0 < np.abs(result.image.pixels.astype(np.float64) - 30.0000003).max() <= result.error.value
