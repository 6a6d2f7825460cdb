"""Compare against NumPy, scikit-image, the accuracy engine's own figures, and published colour differences."""

from __future__ import annotations

import math

import colour
import numpy as np
import pytest
from skimage.metrics import peak_signal_noise_ratio

import lichen
from lichen.accuracy.colour import flip
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.memory import Array
from lichen.operations.statistics import differences

BACKENDS = ("opencl", "numpy")
RNG = np.random.default_rng(9)
FIRST, SECOND = (RNG.random((40, 53, 3)).astype(np.float32) for _ in range(2))


@pytest.mark.parametrize("backend", BACKENDS)
def test_maps_are_differences(backend: str) -> None:
    apart = FIRST.astype(np.float64) - SECOND
    signed = lichen.run("compare", FIRST, reference=SECOND, map="signed", device=backend)
    absolute = lichen.run("compare", FIRST, reference=SECOND, device=backend)
    assert np.abs(signed.image.pixels - apart).max() < 1e-7
    assert np.abs(absolute.image.pixels - np.abs(apart)).max() < 1e-7
    found = absolute.findings
    assert found["largest"] == pytest.approx(np.abs(apart).max())
    assert found["rms"] == pytest.approx(math.sqrt(np.mean(apart**2)))
    assert found["mean"] == pytest.approx(np.abs(apart).mean())
    assert found["psnr_db"] == pytest.approx(peak_signal_noise_ratio(SECOND, FIRST, data_range=1.0), rel=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_straight_colour_counts_as_it_shows(backend: str) -> None:
    """Under no coverage no colour differs; the last channel is compared itself."""
    pictures = [Image(RNG.random((7, 23, 4)).astype(np.float32), Space.SRGB, Alpha.STRAIGHT) for _ in range(2)]
    result = lichen.run("compare", pictures[0], reference=pictures[1], map="signed", device=backend)
    shown = [
        each.pixels.astype(np.float64) * np.append(np.repeat(each.pixels[..., 3:], 3, -1), np.ones((7, 23, 1)), -1)
        for each in pictures
    ]
    assert result.image.alpha is Alpha.NONE
    assert np.abs(result.image.pixels - (shown[0] - shown[1])).max() < 2e-7


def test_colour_differences_agree_with_colour_science() -> None:
    images = [Image(each, Space.LINEAR) for each in (FIRST, SECOND)]
    result = lichen.run("compare", images[0], reference=images[1], map="ciede2000")
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    labs = [colour.XYZ_to_Lab(colour.RGB_to_XYZ(each.astype(np.float64), "sRGB"), white) for each in (FIRST, SECOND)]
    expected = colour.delta_E(*labs, method="CIE 2000")
    assert np.abs(result.image.pixels[..., 0] - expected).max() < 0.05  # whites differ in the fourth digit
    assert result.findings["ciede2000"]["mean"] == pytest.approx(float(result.image.pixels.mean()), rel=1e-5)


def test_flip_is_a_map_and_a_figure() -> None:
    images = [Image(each, Space.SRGB) for each in (FIRST, SECOND)]
    result = lichen.run("compare", images[0], reference=images[1], map="flip", pixels_per_degree=40)
    assert result.image.pixels.shape == (40, 53, 1)
    assert result.findings["flip"]["mean"] == pytest.approx(flip(images[0], SECOND, 40).mean)
    assert result.findings["flip"]["mean"] == pytest.approx(float(result.image.pixels.mean()), rel=1e-6)
    same = lichen.run("compare", images[0], reference=images[0], map="flip")
    assert same.image.pixels.max() == 0


def test_what_is_spoilt_is_told_and_has_no_colour() -> None:
    spoilt = FIRST.copy()
    spoilt[3, 4, 1] = np.nan
    named = ["codes", "ciede2000", "flip"]
    found = lichen.run("compare", Image(spoilt, Space.SRGB), reference=Image(FIRST, Space.SRGB), metrics=named).findings
    assert found["mismatched"] == 1
    assert found["largest"] == 0
    assert found["codes"]["uint8"] == {"largest": 0, "differing": 0.0, "mismatched": 1}
    assert "NaN" in found["flip"]["refused"]
    assert "NaN" in found["ciede2000"]["refused"]


def test_no_figure_is_found_that_nobody_asked_for() -> None:
    images = [Image(each, Space.SRGB) for each in (FIRST, SECOND)]
    always = {"largest", "p999", "rms", "mean", "mismatched", "psnr_db"}
    for asked, expected in (
        ({}, {"border", "inside", "codes", "ulps"}),
        ({"metrics": []}, set()),
        ({"metrics": ["flip", "ulps"]}, {"flip", "ulps"}),
        ({"metrics": [], "map": "ciede2000"}, {"ciede2000"}),
    ):
        assert lichen.run("compare", images[0], reference=images[1], **asked).findings.keys() == always | expected


def test_border_and_inside_are_told_apart() -> None:
    moved = FIRST.copy()
    moved[:2] += 0.5
    found = lichen.run("compare", moved, reference=FIRST, margin=2).findings
    assert found["border"]["largest"] == pytest.approx(0.5, rel=1e-6)
    assert found["inside"]["largest"] == 0
    assert lichen.run("compare", moved, reference=FIRST, margin=30).findings["inside"] is None


def test_flaws_are_named() -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("compare", FIRST, reference=SECOND[:-1, :, :1], map="flip")
    assert [flaw.pointer for flaw in refused.value.flaws] == [
        "/inputs/reference",
        "/inputs/reference",
        "/parameters/map",
    ]


def _codes(wide: int) -> Array:
    """Of 8 bits, so that many differences are alike."""
    return RNG.integers(100, 102, (400, wide, 3)).astype(np.float32) / np.float32(255)


def _spoilt() -> tuple[Array, Array]:
    first, second = RNG.random((2, 500, 203, 3), dtype=np.float32)
    first[5, 7, 1] = second[5, 7, 1] = np.nan
    first[499, 202, 2], second[9, 9, 0], second[0, 0, 0] = np.inf, -np.inf, 1e30
    first[4], second[3] = 1e-42, 0
    return first, second


def _apart_in_few_places() -> tuple[Array, Array]:
    """All in one corner, which a sample of the pixels takes for more or for fewer than there are."""
    first = np.full((600, 601, 1), 0.5, np.float32)
    second = first.copy()
    second[:19, :37, 0] += RNG.random((19, 37), dtype=np.float32) / 8
    return first, second


@pytest.mark.parametrize(
    ("pictures", "alpha"),
    [
        (tuple(RNG.random((2, 331, 401, 3), dtype=np.float32)), Alpha.NONE),
        ((_codes(301), _codes(301)), Alpha.NONE),
        (_spoilt(), Alpha.NONE),
        (_apart_in_few_places(), Alpha.NONE),
        (tuple(RNG.random((2, 3, 100003, 4), dtype=np.float32)), Alpha.STRAIGHT),
        ((FIRST.repeat(10, 0).repeat(10, 1),) * 2, Alpha.NONE),
    ],
    ids=["noise", "codes", "spoilt", "few", "straight", "alike"],
)
@pytest.mark.parametrize("margin", [0, 1, 40, 250])
def test_a_device_finds_the_same_figures(pictures: tuple[Array, Array], alpha: Alpha, margin: int) -> None:
    first, second = (Image(each, Space.SRGB, alpha) for each in pictures)
    made, exact = (
        lichen.run("compare", first, reference=second, margin=margin, device=backend).findings for backend in BACKENDS
    )
    assert made.keys() == exact.keys()
    for name, figure in exact.items():
        if name in ("border", "inside") and figure is not None:
            assert made[name] == pytest.approx(figure, rel=1e-12)
        elif name in ("rms", "mean", "psnr_db"):
            assert made[name] == pytest.approx(figure, rel=1e-12, nan_ok=True)
        else:
            assert made[name] == figure, name


@pytest.mark.parametrize("alpha", [Alpha.NONE, Alpha.STRAIGHT])
@pytest.mark.parametrize("kind", ["absolute", "signed"])
def test_the_map_beside_the_figures_is_the_same(kind: str, alpha: Alpha) -> None:
    """Of pictures from the size on that a device takes in one pass, whose rows begin anywhere in a cache line."""
    first, second = RNG.random((2, 521, 331, 4), dtype=np.float32)
    first[5, 7, 1] = second[5, 8, 2] = np.nan
    second[520, 330, 0], first[0, 0, 2] = np.inf, 1e30
    made, exact = (
        lichen.run(
            "compare",
            Image(first, Space.SRGB, alpha),
            reference=Image(second, Space.SRGB, alpha),
            map=kind,
            device=each,
        )
        for each in BACKENDS
    )
    assert first.size > differences.FEWEST
    np.testing.assert_allclose(made.image.pixels, exact.image.pixels, rtol=2e-7, atol=0, equal_nan=True)
    if alpha is Alpha.NONE:
        apart = first - second
        np.testing.assert_array_equal(made.image.pixels, apart if kind == "signed" else np.abs(apart))


def test_the_most_codes_apart_are_found_wherever_they_are() -> None:
    """Where each pixel is one more apart, where codes change, and where all are one apart or none."""
    places = np.arange(1 << 18).reshape(512, 512, 1)
    rising = ((places % 65536) / 65535).astype(np.float32)
    halves = ((places % 65535 + 0.5) / 65535).astype(np.float32)
    above = np.nextafter(halves, np.float32(2), dtype=np.float32)
    one = np.full_like(rising, 100 / 255)
    straddling = []
    for levels in (255, 65535):  # of samples that are hardly further apart than the others one is a code further
        codes = np.broadcast_to([100.0, 103.0], (512, 512, 2)).copy()
        codes[300, 7] = 100.49, 103.51
        first, second = np.moveaxis(codes[..., np.newaxis] / levels, 2, 0).astype(np.float32)
        straddling.append((first, second))
    for first, second in (
        (rising, np.zeros_like(rising)),
        (rising[::-1], np.ones_like(rising)),
        (halves, above),
        (one, one + np.float32(0.9 / 255)),
        (one, np.nextafter(one, np.float32(2), dtype=np.float32)),
        (one - 1, one + 1),
        (rising * 3 - 1, halves * 2),
        *straddling,
    ):
        made, exact = (
            lichen.run("compare", first, reference=second, metrics=["codes"], device=each).findings["codes"]
            for each in BACKENDS
        )
        assert made == exact


def test_the_most_units_apart_are_found_where_each_pixel_has_one_more() -> None:
    """Though others are further apart; the most are amid a row."""
    ahead = np.roll(np.arange(1 << 18, dtype=np.int32), 300).reshape(512, 512, 1)
    exact = np.where(ahead % 2, np.float32(1.0), np.float32(0.5)).view(np.int32)
    first, second = (exact + ahead).view(np.float32), exact.view(np.float32).copy()
    first[200:210], second[200:210] = 1e3, 1e3 + 0.1
    for turned in (slice(None), slice(None, None, -1)):
        found = lichen.run("compare", first[turned, turned], reference=second[turned, turned], device="opencl").findings
        assert found["ulps"] == (1 << 18) - 1


def test_what_the_device_keeps_is_ranked_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many differences that are the bound need no second pass either."""
    monkeypatch.setattr(differences, "whole_quantile", lambda *given: pytest.fail("all differences are ranked"))
    found = lichen.run("compare", _codes(301), reference=_codes(301), device="opencl").findings
    assert found["p999"] == found["largest"] > 0
