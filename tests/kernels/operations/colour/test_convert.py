"""Conversions against colour-science, pair by pair, and what holds in float32."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import colour
import numpy as np
import pytest
import skimage.color
from colour.models.rgb.transfer_functions.itur_bt_2020 import CONSTANTS_BT2020_PRECISE

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image, Space
from lichen.operations.colour.primaries import CHROMATICITIES, RESPONSES, Adaptation, Primaries, White, to_xyz
from lichen.operations.colour.spaces import RODS, Model, oklab, path, yiq

BACKENDS = ("opencl", "numpy")
RGB = np.random.default_rng(11).uniform(0.02, 0.98, (17, 31, 3))
RGBS: dict[Model, tuple[str, Callable[[Any], Any] | None]] = {
    Model.LINEAR_BT709: ("sRGB", None), Model.SRGB: ("sRGB", colour.models.eotf_sRGB),
    Model.LINEAR_BT2020: ("ITU-R BT.2020", None), Model.BT2020: ("ITU-R BT.2020", None),
    Model.BT2100_PQ: ("ITU-R BT.2020", None),
    Model.LINEAR_P3: ("Display P3", None), Model.DISPLAY_P3: ("Display P3", colour.models.eotf_sRGB),
    Model.LINEAR_DCI_P3: ("DCI-P3", None), Model.DCI_P3: ("DCI-P3", lambda x: x**2.6),
    Model.LINEAR_ADOBE_RGB: ("Adobe RGB (1998)", None),
    Model.ADOBE_RGB: ("Adobe RGB (1998)", lambda x: x ** (563 / 256)),
    Model.ACES2065_1: ("ACES2065-1", None), Model.ACESCG: ("ACEScg", None),
}  # fmt: skip
NAMES = {Adaptation.BRADFORD: "Bradford", Adaptation.CAT16: "CAT16", Adaptation.VON_KRIES: "Von Kries"}


def convert(values: np.ndarray, source: Model | str, target: Model | str, **more: Any) -> np.ndarray:
    """In float64, by the truth."""
    return lichen.evaluate_truth("convert", values, source=str(source), target=str(target), **more)


def adapted(
    xyz: np.ndarray, source: np.ndarray, target: np.ndarray, how: Adaptation = Adaptation.BRADFORD
) -> np.ndarray:
    matrix = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        colour.xy_to_XYZ(source), colour.xy_to_XYZ(target), transform=NAMES[how]
    )
    return xyz @ matrix.T


D65 = np.array([0.3127, 0.3290])


def reference(xyz: np.ndarray, model: Model) -> np.ndarray:
    """colour-science's values of XYZ (D65), hues in degrees."""
    if model in RGBS:
        name, decode = RGBS[model]
        space = colour.RGB_COLOURSPACES[name]
        matrix = colour.normalised_primary_matrix(space.primaries, space.whitepoint)
        light = adapted(xyz, D65, space.whitepoint) @ np.linalg.inv(matrix).T
        if model is Model.BT2020:
            return colour.models.oetf_BT2020(light, is_12_bits_system=False, constants=CONSTANTS_BT2020_PRECISE)
        if model is Model.BT2100_PQ:
            return colour.models.eotf_inverse_ST2084(203 * light)
        if decode is None:
            return light
        return {
            "sRGB": colour.models.eotf_inverse_sRGB, "Display P3": colour.models.eotf_inverse_sRGB,
            "DCI-P3": lambda x: x ** (1 / 2.6), "Adobe RGB (1998)": lambda x: x ** (256 / 563),
        }[name](light)  # fmt: skip
    turn = np.array([360.0, 1, 1])
    srgb = lambda: reference(xyz, Model.SRGB)  # noqa: E731
    luma = colour.WEIGHTS_YCBCR
    return {
        Model.XYZ: lambda: xyz,
        Model.XYY: lambda: colour.XYZ_to_xyY(xyz),
        Model.LAB: lambda: colour.XYZ_to_Lab(xyz, D65),
        Model.LCH: lambda: colour.models.Lab_to_LCHab(colour.XYZ_to_Lab(xyz, D65)),
        Model.LUV: lambda: colour.XYZ_to_Luv(xyz, D65),
        Model.HSV: lambda: colour.RGB_to_HSV(srgb()) * turn,
        Model.HSL: lambda: colour.RGB_to_HSL(srgb()) * turn,
        Model.CMY: lambda: colour.RGB_to_CMY(srgb()),
        Model.CMYK: lambda: colour.CMY_to_CMYK(colour.RGB_to_CMY(srgb())),
        Model.LUMINANCE: lambda: xyz[..., 1:2],
        Model.LUMINANCE_SCOTOPIC: lambda: (xyz @ RODS / (RODS @ colour.xy_to_XYZ(D65)))[..., np.newaxis],
        Model.YCBCR_601: lambda: colour.RGB_to_YCbCr(srgb(), K=luma["ITU-R BT.601"], in_legal=False, out_legal=False),
        Model.YCBCR_709: lambda: colour.RGB_to_YCbCr(srgb(), K=luma["ITU-R BT.709"], in_legal=False, out_legal=False),
        Model.YCBCR_2020: lambda: colour.RGB_to_YCbCr(
            reference(xyz, Model.BT2020), K=luma["ITU-R BT.2020"], in_legal=False, out_legal=False
        ),
        Model.YCBCR_601_NARROW: lambda: colour.RGB_to_YCbCr(srgb(), K=luma["ITU-R BT.601"], out_legal=True),
        Model.YCBCR_709_NARROW: lambda: colour.RGB_to_YCbCr(srgb(), K=luma["ITU-R BT.709"], out_legal=True),
        Model.YCBCR_2020_NARROW: lambda: colour.RGB_to_YCbCr(
            reference(xyz, Model.BT2020), K=luma["ITU-R BT.2020"], out_legal=True
        ),
    }[model]()  # fmt: skip


OURS = (Model.OKLAB, Model.OKLCH, Model.YIQ)
"""Whose numbers differ from colour-science's by intent."""
XYZ = RGB @ to_xyz(Primaries.BT709).T
VALUES = {model: reference(XYZ, model) for model in Model if model not in OURS}
VALUES |= {model: convert(XYZ, Model.XYZ, model) for model in OURS}


@pytest.mark.parametrize("source", list(Model))
def test_truth_agrees_with_colour_science_for_every_pair(source: Model) -> None:
    """Relative to the largest value of the target; conversions from luminance alone have no colour to compare."""
    for target in Model:
        found = convert(VALUES[source], source, target)
        if source.channels == 1:
            assert np.isfinite(found).all()
            continue
        expected = VALUES[target]
        worst = np.abs(found - expected).max() / max(1, np.abs(expected).max())
        assert worst < 1e-12, f"{source} to {target}: {worst:.2g}"


def test_oklab_differs_from_the_printed_one_by_little_and_follows_its_matrices() -> None:
    printed = colour.XYZ_to_Oklab(XYZ)
    assert np.abs(VALUES[Model.OKLAB] - printed).max() < 3e-4
    cones, rows = oklab()
    assert np.abs(VALUES[Model.OKLAB] - np.cbrt(XYZ @ cones.T) @ rows.T).max() < 1e-15
    white = convert(np.ones((1, 1, 3)), "srgb", "oklab")[0, 0]
    assert np.abs(white - [1, 0, 0]).max() < 1e-12


def test_rods_weights_are_the_regression_on_the_observers_curves() -> None:
    """And greys are seen to 1 % of their spectra; a red less, as three numbers tell rods little of it."""
    shape = colour.SpectralShape(380, 780, 5)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    rods = colour.colorimetry.SDS_LEFS_SCOTOPIC["CIE 1951 Scotopic Standard Observer"].copy().align(shape).values
    fitted = np.linalg.lstsq(observer, rods, rcond=None)[0]
    assert np.abs(fitted / RODS - 1).max() < 5e-3
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values
    for name, spectrum in colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].items():
        light = daylight * spectrum.copy().align(shape).values
        seen = light @ rods / (daylight @ rods)
        xyz = (light @ observer / (daylight @ observer[:, 1])).reshape(1, 1, 3)
        found = convert(xyz, "xyz", "luminance_scotopic")[0, 0, 0]
        assert abs(found - seen) < (0.01 * seen if "neutral" in name or "black" in name else 0.05), name


def test_yiq_is_that_of_scikit_image_to_its_digits() -> None:
    assert np.abs(VALUES[Model.YIQ] - skimage.color.rgb2yiq(VALUES[Model.SRGB])).max() < 2e-6
    assert np.abs(yiq()[1:].sum(axis=1)).max() < 1e-15


@pytest.mark.parametrize("adaptation", list(NAMES))
@pytest.mark.parametrize("white", list(White))
def test_adaptation_agrees_with_colour_science(adaptation: Adaptation, white: White) -> None:
    found = convert(RGB, "linear_bt709", "xyz", white=str(white), adaptation=str(adaptation))
    assert np.abs(found - adapted(XYZ, D65, np.array(white.xy), adaptation)).max() < 1e-13
    assert np.abs(convert(np.ones((1, 1, 3)), "linear_bt709", "xyz", white=str(white))[0, 0] - white.xyz).max() < 1e-13
    lab = convert(RGB, "srgb", "lab", white=str(white), adaptation=str(adaptation))
    light = colour.models.eotf_sRGB(RGB) @ to_xyz(Primaries.BT709).T
    expected = colour.XYZ_to_Lab(adapted(light, D65, np.array(white.xy), adaptation), np.array(white.xy))
    assert np.abs(lab - expected).max() < 1e-10


def test_primaries_and_whites_are_those_of_colour_science() -> None:
    names = dict(
        zip(
            Primaries,
            ("sRGB", "ITU-R BT.2020", "Display P3", "DCI-P3", "Adobe RGB (1998)", "ACES2065-1", "ACEScg"),
            strict=True,
        )
    )
    for primaries, name in names.items():
        space = colour.RGB_COLOURSPACES[name]
        assert np.array_equal(space.primaries, CHROMATICITIES[primaries])
        assert np.array_equal(space.whitepoint, primaries.white.xy)
        assert (
            np.abs(colour.normalised_primary_matrix(space.primaries, space.whitepoint) - to_xyz(primaries)).max()
            < 1e-14
        )
    for adaptation, name in NAMES.items():
        assert np.array_equal(colour.CHROMATIC_ADAPTATION_TRANSFORMS[name], RESPONSES[adaptation])


FLOATS = (
    "bt2100_pq",
    "srgb", "bt2020", "adobe_rgb", "dci_p3", "acescg", "xyz", "xyy", "lab", "lch", "luv", "oklab", "oklch", "hsv",
    "hsl", "yiq", "ycbcr_601", "ycbcr_2020_narrow", "cmy", "cmyk",
)  # fmt: skip


@pytest.mark.parametrize("target", FLOATS)
def test_round_trips_in_float32(target: str) -> None:
    """And back, on NumPy; every colour of a coarse cube, greys and black among them.

    Light comes back to a few roundings of white. sRGB's curve is 12.92 times as steep at black, and what was added for
    the other primaries is taken away again there, so its values come back with more.
    """
    levels = np.linspace(0, 1, 9, dtype=np.float32)
    cube = np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(27, 27, 3)
    for source, limit in (("linear_bt709", 3e-6), ("srgb", 3e-5)):
        there = lichen.run("convert", cube, source=source, target=target, method="single", device="numpy").image
        back = lichen.run("convert", there.pixels, source=target, target=source, method="single", device="numpy").image
        assert np.abs(back.pixels - cube).max() < limit, source


@pytest.mark.parametrize("target", ["lab", "oklch", "hsv", "cmyk", "luv", "bt2020", "luminance"])
def test_devices_agree(target: str) -> None:
    picture = RGB.astype(np.float32)
    first, second = (
        lichen.run("convert", picture, source="srgb", target=target, method="single", device=each).image.pixels
        for each in BACKENDS
    )
    assert np.abs(first - second).max() <= 5e-6 * max(1.0, float(np.abs(first).max()))


@pytest.mark.parametrize("backend", BACKENDS)
def test_lab_of_a_picture_to_one_part_in_a_hundred_thousand(backend: str) -> None:
    picture = RGB.astype(np.float32)
    result = lichen.run("convert", picture, source="srgb", target="lab", method="single", device=backend)
    expected = colour.XYZ_to_Lab(colour.models.eotf_sRGB(picture.astype(np.float64)) @ to_xyz(Primaries.BT709).T, D65)
    assert np.abs(result.image.pixels - expected).max() < 2e-4
    assert result.error.value < 2e-3


def test_source_and_space_come_from_the_picture() -> None:
    picture = Image(RGB.astype(np.float32), Space.SRGB)
    lab = lichen.run("convert", picture, target="lab").image
    assert lab.space is Space.DATA
    assert lichen.run("convert", picture, target="linear_bt709").image.space is Space.LINEAR
    back = lichen.run("convert", lab, source="lab", target="srgb").image
    assert back.space is Space.SRGB
    assert np.abs(back.pixels - picture.pixels).max() < 1e-5
    with pytest.raises(InvalidRequest) as refused:
        lichen.run("convert", RGB.astype(np.float32), target="lab")
    assert refused.value.flaws[0].pointer == "/parameters/source"


@pytest.mark.parametrize("backend", BACKENDS)
def test_channels_after_the_colours_pass(backend: str) -> None:
    picture = np.random.default_rng(2).random((5, 37, 4), dtype=np.float32)
    covered = Image(picture, Space.SRGB, Alpha.STRAIGHT)
    for target, channels in (("lab", 4), ("cmyk", 5), ("luminance", 2)):
        made = lichen.run("convert", covered, target=target, device=backend).image
        assert made.pixels.shape == (5, 37, channels)
        assert made.alpha is Alpha.STRAIGHT
        assert np.array_equal(made.pixels[..., -1], picture[..., 3])


def test_paths_take_no_detour() -> None:
    def names(source: str, target: str) -> list[str]:
        return [step.name for step in path(Model(source), Model(target), White.D65, Adaptation.BRADFORD)]

    assert names("srgb", "lab") == ["srgb_decode", "linear", "lightness", "linear"]
    assert names("srgb", "hsv") == ["to_hsv"]
    assert names("ycbcr_601", "ycbcr_709_narrow") == ["linear"]
    assert names("lch", "lab") == ["from_polar"]
    assert names("acescg", "aces2065_1") == ["linear"]
    assert all(not names(str(each), str(each)) for each in Model)


def test_luminance_of_grey_is_grey() -> None:
    light = np.linspace(0, 2, 12).reshape(1, 12, 1)
    for target, white in itertools.product(("linear_bt709", "acescg", "linear_dci_p3"), ("d65", "d50")):
        grey = convert(light, "luminance", target, white=white)
        assert np.abs(grey - light).max() < 1e-13


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("target", ["srgb", "bt2100_pq", "lab", "hsv"])
def test_grey_light_is_converted_as_three_channels_of_it(target: str, backend: str) -> None:
    """Whose curves are computed once for all three."""
    light = np.random.default_rng(4).random((9, 37, 1), dtype=np.float32)
    made, expected = (
        lichen.run("convert", pixels, source=source, target=target, method="single", device=backend).image.pixels
        for pixels, source in ((light, "luminance"), (np.repeat(light, 3, axis=2), "linear_bt709"))
    )
    np.testing.assert_allclose(made, expected, atol=2e-6 * np.abs(expected).max())
