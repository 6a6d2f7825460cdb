"""Tone curves against their printed forms at 40 digits, and what only this operation promises."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.operation import Facts
from lichen.operations.tone.operators import HILL_INTO, HILL_OUT_OF, steepest
from lichen.operations.tone.tone_map import Parameters, tone_map

BACKENDS = ("opencl", "numpy")


def hable(x: mpf) -> mpf:
    a, b, c, d, e, f = (mpf(v) for v in ("0.15", "0.5", "0.1", "0.2", "0.02", "0.3"))
    return (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f


PRINTED = {
    "exposure": lambda x, w: x,
    "reinhard": lambda x, w: x / (1 + x),
    "reinhard_extended": lambda x, w: x * (1 + x / w**2) / (1 + x),
    "hable": lambda x, w: hable(x) / hable(w),
    "aces_narkowicz": lambda x, w: (
        x * (mpf("2.51") * x + mpf("0.03")) / (x * (mpf("2.43") * x + mpf("0.59")) + mpf("0.14"))
    ),
}


@pytest.mark.parametrize("operator", PRINTED)
def test_truth_is_the_printed_curve(operator: str) -> None:
    x = np.concatenate([np.geomspace(1e-8, 1e6, 40), [0.5, 1.0, 2.0]])
    white = 4.0
    with mpmath.workdps(40):
        expected = [float(PRINTED[operator](mpf(float(v)), mpf(white))) for v in x]
    image = Image(x.reshape(1, -1, 1))
    got = tone_map.evaluate_truth({"image": image}, Parameters(operator=operator, white=white, clamp=False))
    np.testing.assert_allclose(got.reshape(-1), expected, rtol=2e-14)


def test_the_fit_is_neutral_and_keeps_its_published_matrices() -> None:
    for matrix in (HILL_INTO, HILL_OUT_OF):
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=3e-5)
    grey = np.full((1, 5, 3), 0.18) * np.geomspace(0.1, 50, 5).reshape(1, 5, 1)
    got = tone_map.evaluate_truth({"image": Image(grey)}, Parameters(operator="aces_hill"))
    np.testing.assert_allclose(got - got[..., :1], 0, atol=3e-5)
    assert (np.diff(got[0, :, 0]) > 0).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("operator", ["reinhard_extended", "hable"])
def test_white_becomes_one(backend: str, operator: str) -> None:
    image = np.full((3, 5, 3), 6.0, np.float32)
    for on in ("channels", "luminance"):
        got = lichen.run("tone_map", image, operator=operator, white=6, on=on, clamp=False, device=backend)
        np.testing.assert_allclose(got.image.pixels, 1, atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_luminance_keeps_ratios(backend: str) -> None:
    image = np.random.default_rng(4).uniform(0.01, 20, (21, 33, 3)).astype(np.float32)
    got = lichen.run("tone_map", image, operator="reinhard", on="luminance", clamp=False, device=backend).image.pixels
    np.testing.assert_allclose(got[..., 1] / got[..., 0], image[..., 1] / image[..., 0], rtol=1e-5)
    light = image @ np.array([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(got @ np.array([0.2126, 0.7152, 0.0722]), light / (1 + light), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("alpha", [Alpha.STRAIGHT, Alpha.ASSOCIATED])
def test_half_covered_is_as_bright_as_covered(backend: str, alpha: Alpha) -> None:
    colour, coverage = np.float32([3.0, 0.5, 0.1]), np.float32(0.5)
    shown = colour * coverage if alpha is Alpha.ASSOCIATED else colour
    pixels = np.broadcast_to(np.append(shown, coverage), (4, 6, 4)).astype(np.float32)
    image = Image(pixels.copy(), Space.LINEAR, alpha)
    got = lichen.run("tone_map", image, operator="reinhard", device=backend).image
    expected = colour / (1 + colour) * (coverage if alpha is Alpha.ASSOCIATED else 1)
    np.testing.assert_allclose(got.pixels[..., :3], np.broadcast_to(expected, (4, 6, 3)), rtol=1e-6)
    np.testing.assert_array_equal(got.pixels[..., 3], 0.5)


def test_display_referred_pictures_are_mapped_in_linear_light() -> None:
    image = Image(np.full((2, 2, 3), 0.5, np.float32), Space.SRGB)
    got = lichen.run("tone_map", image, operator="exposure", exposure=-1).image
    assert got.space is Space.SRGB
    np.testing.assert_allclose(got.pixels, 1.055 * (0.21404114 / 2) ** (1 / 2.4) - 0.055, atol=1e-6)


@pytest.mark.parametrize("example", tone_map.examples, ids=str)
def test_an_error_of_the_input_is_carried_as_stated(example: dict[str, Any]) -> None:
    rng = np.random.default_rng(5)
    parameters = tone_map.validate(example)
    for low, high in ((0.0, 1.0), (-0.5, 8.0), (0.0, 1e3)):
        for change in (1e-6, 1e-2):
            first = rng.uniform(low, high, (20, 300, 3)) ** 2
            second = first + rng.choice([-change, change], first.shape)
            a, b = (tone_map.evaluate_truth({"image": Image(each)}, parameters) for each in (first, second))
            stated = tone_map.propagate(parameters, {"image": Facts.of(Image(first))}, change)
            assert np.abs(a - b).max() <= stated * (1 + 1e-6) + 1e-13


def test_steepest_slopes_are_those_of_the_curves() -> None:
    assert steepest("reinhard", 4.0)[0] == pytest.approx(1.02, rel=1e-4)
    assert steepest("exposure", 4.0) == pytest.approx((1.02, 0.0))


@pytest.mark.parametrize(
    ("values", "channels", "pointer"),
    [
        ({"operator": "aces_hill"}, 1, "operator"),
        ({"on": "luminance"}, 4, "on"),
        ({"operator": "aces_hill", "on": "luminance"}, 3, "on"),
        ({"operator": "reinhard", "white": 2}, 3, "white"),
        ({"weights": [1, 1, -1]}, 3, "weights"),
    ],
)
def test_what_has_no_meaning_is_refused(values: dict[str, Any], channels: int, pointer: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("tone_map", np.zeros((2, 2, channels), np.float32), **values)
    assert f"/parameters/{pointer}" in {flaw.pointer for flaw in caught.value.flaws}
