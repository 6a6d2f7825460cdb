"""Levels against scikit-image and against numbers worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from skimage import exposure

import lichen
from lichen.catalogue import operation
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operation import Facts
from lichen.operations.tone.levels import levels

BACKENDS = ("opencl", "numpy")
NOISE = np.random.default_rng(3).random((37, 29, 3)).astype(np.float32)


@pytest.mark.parametrize("backend", BACKENDS)
def test_agrees_with_scikit_image(backend: str) -> None:
    ours = lichen.run("levels", NOISE, black=0.2, white=0.7, out_black=0.1, out_white=0.6, clamp=True, device=backend)
    theirs = exposure.rescale_intensity(NOISE.astype(np.float64), (0.2, 0.7), (0.1, 0.6))
    np.testing.assert_allclose(ours.image.pixels, theirs, atol=3e-7)
    ours = lichen.run("levels", NOISE, gamma=2.2, device=backend)
    np.testing.assert_allclose(ours.image.pixels, exposure.adjust_gamma(NOISE.astype(np.float64), 1 / 2.2), atol=5e-7)


@pytest.mark.parametrize("backend", BACKENDS)
def test_each_channel_has_its_own_levels_and_coverage_none(backend: str) -> None:
    pixels = np.concatenate([NOISE, NOISE[..., :1]], axis=2)
    image = Image(pixels, alpha=Alpha.STRAIGHT)
    got = lichen.run("levels", image, black="[0, 0.5, -1]", white=[2, 1.5, 0], device=backend).image.pixels
    np.testing.assert_allclose(got[..., :3], (NOISE - [0, 0.5, -1]) / [2, 1, 1], atol=3e-7)
    np.testing.assert_array_equal(got[..., 3], pixels[..., 3])


def test_a_window_is_its_centre_and_width() -> None:
    by_window = lichen.run("levels", NOISE, centre=0.5, width=0.25)
    by_levels = lichen.run("levels", NOISE, black=0.375, white=0.625)
    np.testing.assert_array_equal(by_window.image.pixels, by_levels.image.pixels)


@pytest.mark.parametrize(
    ("values", "pointer"),
    [
        ({"black": 0.5, "white": 0.5}, "white"),
        ({"black": 1e8, "white": 1e8 + 1}, "white"),
        ({"centre": 0.5}, "width"),
        ({"centre": 0.5, "width": 1, "black": 0.1}, "black"),
        ({"black": [0.1, 0.2]}, "black"),
        ({"gamma": 0}, "gamma"),
    ],
)
def test_levels_that_mean_nothing_are_refused(values: dict[str, float], pointer: str) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("levels", NOISE, **values)
    assert any(flaw.pointer == f"/parameters/{pointer}" for flaw in caught.value.flaws)


@pytest.mark.parametrize("example", levels.examples, ids=str)
@pytest.mark.parametrize("change", [1e-6, 1e-3, 0.1])
def test_an_error_of_the_input_is_carried_as_stated(example: dict[str, float], change: float) -> None:
    rng = np.random.default_rng(5)
    first = np.concatenate([rng.uniform(-1, 2, (20, 500, 3)), rng.uniform(-change, change, (20, 500, 3))])
    second = first + rng.choice([-change, change], first.shape)
    parameters = levels.validate(example)
    a, b = (levels.evaluate_truth({"image": Image(each)}, parameters) for each in (first, second))
    facts = {"image": Facts.of(Image(first))}
    assert np.abs(a - b).max() <= levels.propagate(parameters, facts, change) * (1 + 1e-9)


def test_identity_is_found() -> None:
    assert levels.identity(levels.validate({}), {"image": Facts(4, 4, 3)})
    assert levels.identity(levels.validate({"clamp": True}), {"image": Facts(4, 4, 3)})
    wide = Facts.of(Image(NOISE * 3))
    assert not levels.identity(levels.validate({"clamp": True}), {"image": wide})


@pytest.mark.parametrize("alpha", [Alpha.STRAIGHT, Alpha.ASSOCIATED])
@pytest.mark.parametrize("name", ["levels", "curve", "tone_map"])
def test_what_limits_colour_does_something_under_coverage(name: str, alpha: Alpha) -> None:
    """A picture no brighter than 1 may be made of any colour under little coverage."""
    limiting: dict[str, Any] = {"levels": {"clamp": True}, "curve": {}, "tone_map": {"operator": "exposure"}}[name]
    chosen, covered = operation(name), {"image": Facts(4, 4, 4, alpha=alpha)}
    parameters = chosen.validate(limiting)
    assert chosen.identity(parameters, {"image": Facts(4, 4, 3)})
    assert not chosen.identity(parameters, covered)
    assert not chosen.departure(parameters, covered)


def test_a_line_departs_from_colour_under_little_coverage_by_no_more_than_it_says() -> None:
    rng = np.random.default_rng(8)
    coverage = rng.uniform(0.01, 1, (20, 500, 1))
    pixels = np.concatenate([rng.uniform(0, 1, (20, 500, 3)) / coverage, coverage], axis=-1)  # shows as 0 to 1
    parameters = levels.validate({"out_black": 0.1, "out_white": 0.9})
    made = levels.evaluate_truth({"image": Image(pixels, alpha=Alpha.STRAIGHT)}, parameters)
    apart = np.abs((made - pixels)[..., :3] * coverage).max()
    stated = levels.departure(parameters, {"image": Facts(20, 500, 4, alpha=Alpha.STRAIGHT)})["image"]
    assert 0.9 * stated <= apart <= stated * (1 + 1e-12)
