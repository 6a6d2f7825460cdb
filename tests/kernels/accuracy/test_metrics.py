"""Figures of difference: against hand counts, published vectors, colour-science, and the authors' FLIP."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lichen.accuracy import colour
from lichen.accuracy.metrics import difference, psnr, regions, steps, ulps
from lichen.image import Alpha, Image, Space, Storage
from lichen.operation import WHOLE, Footprint


def picture(pixels: np.ndarray, space: Space = Space.SRGB, alpha: Alpha = Alpha.NONE) -> Image:
    return Image(np.ascontiguousarray(pixels, np.float32), space, alpha)


# -------------------------------------------------------------------------------------------------------- differences


def test_largest_rms_and_one_in_a_thousand() -> None:
    truth = np.zeros((100, 100, 1))
    pixels = truth.copy()
    pixels.flat[:5], pixels.flat[5:20] = 4.0, 1.0
    found = difference(pixels, truth)
    assert (found.largest, found.p999) == (4.0, 1.0)
    assert found.rms == pytest.approx(math.sqrt((5 * 16 + 15) / 1e4))
    assert (found.mismatched, found.sampled) == (0, 1.0)


def test_nonfinite_samples_are_counted_and_not_measured() -> None:
    truth = np.array([[[np.nan], [np.inf], [-np.inf], [np.inf], [1.0], [2.0]]])
    pixels = np.array([[[np.nan], [np.inf], [np.inf], [3.0], [np.nan], [2.5]]])
    found = difference(pixels, truth)
    assert (found.mismatched, found.largest) == (3, 0.5)
    everywhere = difference(np.full((2, 2, 1), np.nan), np.zeros((2, 2, 1)))
    assert (everywhere.mismatched, everywhere.largest) == (4, 0.0)


def test_colour_of_straight_pictures_counts_as_it_shows() -> None:
    truth = np.array([[[1.0, 0.5], [9.0, 0.0]]])
    pixels = np.array([[[2.0, 0.5], [1e9, 0.0]]])
    assert difference(pixels, truth, Alpha.STRAIGHT).largest == 0.5
    assert difference(pixels, truth).largest > 1e8
    # Each side under its own coverage: what they are composited to is as far apart as their associated forms.
    thin = np.array([[[4.0, 0.25]]])
    assert difference(np.array([[[2.0, 0.5]]]), thin, Alpha.STRAIGHT).largest == 0.25


def test_borders_are_reported_apart() -> None:
    truth = np.zeros((10, 12, 2))
    pixels = truth.copy()
    pixels[0, 0, 0], pixels[5, 6, 1], pixels[2, 3, 0] = 3.0, 1.0, 2.0
    border, inside = regions(pixels, truth, Footprint(2, 3))
    assert border is not None
    assert inside is not None
    assert (border.largest, inside.largest) == (3.0, 2.0)
    assert regions(pixels, truth, Footprint(0, 0)).border is None
    assert regions(pixels, truth, WHOLE).inside is None
    assert regions(pixels, truth, Footprint(5, 1)).inside is None
    assert difference(pixels, truth).largest == 3.0


@pytest.mark.parametrize("storage", [Storage.UINT8, Storage.UINT16])
def test_steps_of_integers_are_code_values(storage: Storage) -> None:
    levels = storage.levels
    truth = np.array([[[10.0], [20.4], [-1.0], [np.nan]]]) / levels
    pixels = np.array([[[10.4], [23.0], [0.2], [np.nan]]]) / levels
    found = steps(pixels, truth, storage)
    assert (found.largest, found.differing, found.mismatched) == (3, 0.25, 0)


@pytest.mark.parametrize("storage", [Storage.FLOAT16, Storage.FLOAT32])
def test_steps_of_floats_count_neighbours_across_zero(storage: Storage) -> None:
    kind = np.dtype(str(storage)).type
    above = np.nextafter(kind(1), kind(2))
    tiny = np.nextafter(kind(0), kind(1))
    found = steps(np.array([[[above], [-tiny]]], np.float64), np.array([[[1.0], [tiny]]], np.float64), storage)
    assert (found.largest, found.differing) == (2, 1.0)
    assert steps(np.array([[[1.0], [np.inf]]]), np.array([[[1.0], [5.0]]]), storage).mismatched == 1


def test_units_in_the_last_place() -> None:
    truth = np.array([[[1.0], [-3.0], [1e-30], [0.0]]])
    pixels = truth * np.array([[[1 + 2.0**-23], [1.0], [1 + 2.0**-24], [1.0]]])
    assert ulps(pixels, truth) == 1.0
    assert ulps(np.full((1, 1, 1), np.finfo(np.float32).smallest_subnormal), np.zeros((1, 1, 1))) == 1.0


def test_psnr_by_definition_and_guarded() -> None:
    truth = np.zeros((4, 4, 1))
    assert psnr(truth + 0.01, truth, 1.0) == pytest.approx(40)
    assert psnr(truth + 0.01, truth, 10.0) == pytest.approx(60)
    assert psnr(truth, truth, 1.0) == math.inf
    assert math.isnan(psnr(np.full((4, 4, 1), np.nan), truth, 1.0))


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="shapes differ"):
        difference(np.zeros((2, 2, 1)), np.zeros((2, 2, 3)))


# ------------------------------------------------------------------------------------------------------------- colour

SHARMA = (
    (50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425),
    (50.0000, -1.1848, -84.8006, 50.0000, 0.0000, -82.7485, 1.0000),
    (50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792),
    (50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195),
    (50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045),
    (50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065),
    (50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492),
    (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
    (22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373),
    (2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082),
)
"""From the supplementary test data: pairs whose hues lie on either side of the discontinuities."""


@pytest.mark.parametrize("row", SHARMA)
def test_ciede2000_meets_the_published_pairs(row: tuple[float, ...]) -> None:
    first, second, expected = np.array(row[:3]), np.array(row[3:6]), row[6]
    assert float(colour.delta_e(first, second)) == pytest.approx(expected, abs=5e-5)
    assert float(colour.delta_e(second, first)) == pytest.approx(expected, abs=5e-5)


def test_ciede2000_agrees_with_colour_science() -> None:
    import colour as science

    rng = np.random.default_rng(1)
    first = rng.uniform([0, -120, -120], [100, 120, 120], (100_000, 3))
    second = first + rng.normal(0, 10, first.shape)
    assert np.abs(colour.delta_e(first, second) - science.delta_E(first, second, method="CIE 2000")).max() < 1e-10
    light = rng.random((1000, 3))
    expected = science.XYZ_to_Lab(light @ colour.TO_XYZ.T / colour.WHITE[1], science.XYZ_to_xy(colour.WHITE))
    assert np.abs(colour.lab(light) - expected).max() < 1e-9


def test_no_chroma_is_too_large_and_none_too_small() -> None:
    """C^7 overflows float32 from 3e5 on and float64 from 1e44; greys have no hue at all."""
    far = colour.delta_e(np.array([50.0, 1e50, 0.0]), np.array([50.0, -1e50, 0.0]))
    assert np.isfinite(far)
    assert colour.delta_e(np.array([40.0, 0.0, 0.0]), np.array([40.0, 0.0, 0.0])) == 0
    assert np.isfinite(colour.delta_e(np.array([40.0, 0.0, 0.0]), np.array([40.0, 1e-300, 0.0])))


FLIP = {"noise": (0.0560551, 0.30259362), "blur": (0.487212, 0.95384747), "exposure": (0.28568819, 0.4218699)}
"""Mean and largest of LDR-FLIP by the authors' evaluator (flip-evaluator 1.7) at 67 pixels per degree."""


def distorted(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A picture and what became of it, float32 sRGB; made of sines, so that no generator's version matters."""
    y, x, c = np.meshgrid(np.arange(64), np.arange(80), np.arange(3), indexing="ij")
    truth = 0.5 + 0.25 * np.sin(0.7 * x + c) + 0.25 * np.cos(0.05 * y * (c + 1)) * np.sin(0.11 * x * y / 8)
    other = {
        "noise": truth + 0.1 * np.sin(12.9898 * x + 78.233 * y + 37.719 * c),
        "blur": (truth + np.roll(truth, 3, 0) + np.roll(truth, 5, 1)) / 3,
        "exposure": truth * 1.1,
    }[kind]
    return np.clip(other, 0, 1).astype(np.float32), np.clip(truth, 0, 1).astype(np.float32)


@pytest.mark.parametrize("kind", list(FLIP))
def test_flip_meets_the_authors_evaluator(kind: str) -> None:
    pixels, truth = distorted(kind)
    seen = colour.flip(picture(pixels), truth.astype(np.float64))
    mean, largest = FLIP[kind]
    assert seen.mean == pytest.approx(mean, abs=2e-5)
    assert seen.largest == pytest.approx(largest, abs=1e-4)


def test_equal_pictures_look_equal() -> None:
    pixels, _ = distorted("blur")
    for figure in (colour.flip, colour.ciede2000):
        seen = figure(picture(pixels), pixels.astype(np.float64))
        assert (seen.mean, seen.largest) == (0, 0)


@pytest.mark.parametrize("figure", [colour.flip, colour.ciede2000])
def test_what_cannot_be_seen_has_no_score(figure: object) -> None:
    assert callable(figure)
    pixels, truth = distorted("noise")
    spoilt = pixels.copy()
    spoilt[3, 3, 0] = np.nan
    assert figure(picture(spoilt), truth).mean is None
    assert figure(picture(spoilt), truth).refused == "NaN or infinity has no colour"
    assert figure(picture(pixels), spoilt).mean is None
    assert figure(picture(pixels, Space.DATA), truth).refused == "data has no colour"
    assert "2" in figure(picture(pixels[..., :2]), truth[..., :2]).refused


def test_grey_linear_and_covered_pictures_are_seen() -> None:
    pixels, truth = distorted("exposure")
    grey = colour.ciede2000(picture(pixels[..., :1]), truth[..., :1])
    three = colour.ciede2000(picture(np.repeat(pixels[..., :1], 3, 2)), np.repeat(truth[..., :1], 3, 2))
    assert grey == three
    bright = np.full((20, 20, 3), 1e4)
    assert colour.flip(picture(bright, Space.LINEAR), bright / 2).mean == 0  # both are white on a display
    hidden = np.concatenate([pixels, np.zeros((64, 80, 1), np.float32)], axis=2)
    other = np.concatenate([truth, np.zeros((64, 80, 1), np.float32)], axis=2)
    assert colour.flip(picture(hidden, alpha=Alpha.STRAIGHT), other).largest == 0
