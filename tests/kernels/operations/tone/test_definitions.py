"""The table of transfer curves against colour-science, and what holds for every curve of several pieces."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Extent, Image
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.tone.curves import WHOLE, Curve, Direction
from lichen.operations.tone.definitions import LOGC3, TABLE
from lichen.operations.tone.transfer import transfer
from lichen.operations.tone.transfer_parameters import Parameters, shape

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from colour.models.rgb import transfer_functions as colour
    from colour.models.rgb.transfer_functions import canon, itur_bt_1361, itur_bt_2020, red, rimm_romm_rgb

BACKENDS = ("opencl", "numpy")
PIECED = [curve for curve in Curve if curve not in WHOLE]
WAYS = [(curve, way) for curve in PIECED for way in Direction]
IDS = [f"{curve}-{way}" for curve, way in WAYS]


def named(stem: str) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    return getattr(colour, f"log_encoding_{stem}"), getattr(colour, f"log_decoding_{stem}")


PRECISE = {"constants": itur_bt_2020.CONSTANTS_BT2020_PRECISE}
COLOUR: dict[Curve, tuple[Callable[[Any], Any], Callable[[Any], Any] | None]] = {
    Curve.BT2020: (partial(colour.oetf_BT2020, **PRECISE), partial(colour.oetf_inverse_BT2020, **PRECISE)),
    Curve.BT2020_12: (
        partial(colour.oetf_BT2020, is_12_bits_system=True),
        partial(colour.oetf_inverse_BT2020, is_12_bits_system=True),
    ),
    Curve.BT1361: (itur_bt_1361.oetf_BT1361, itur_bt_1361.oetf_inverse_BT1361),
    Curve.SMPTE_240M: (colour.oetf_SMPTE240M, colour.eotf_SMPTE240M),
    Curve.ARIB_B67: (colour.oetf_ARIBSTDB67, colour.oetf_inverse_ARIBSTDB67),
    Curve.H273_LOG: (colour.oetf_H273_Log, colour.oetf_inverse_H273_Log),
    Curve.H273_LOG_SQRT: (colour.oetf_H273_LogSqrt, colour.oetf_inverse_H273_LogSqrt),
    Curve.ST428: (colour.eotf_inverse_H273_ST428_1, colour.eotf_H273_ST428_1),
    Curve.DICOM_GSDF: (colour.eotf_inverse_DICOMGSDF, colour.eotf_DICOMGSDF),
    Curve.ADOBE_RGB: (lambda x: x ** (256 / 563), lambda x: x ** (563 / 256)),
    Curve.ROMM: (rimm_romm_rgb.cctf_encoding_ROMMRGB, rimm_romm_rgb.cctf_decoding_ROMMRGB),
    Curve.RIMM: (rimm_romm_rgb.cctf_encoding_RIMMRGB, rimm_romm_rgb.cctf_decoding_RIMMRGB),
    Curve.ERIMM: named("ERIMMRGB"),
    Curve.ACESCC: named("ACEScc"),
    Curve.ACESCCT: named("ACEScct"),
    Curve.APPLE_LOG: named("AppleLogProfile"),
    Curve.ARRI_LOGC3: named("ARRILogC3"),
    Curve.ARRI_LOGC4: named("ARRILogC4"),
    Curve.BLACKMAGIC_FILM_5: (colour.oetf_BlackmagicFilmGeneration5, colour.oetf_inverse_BlackmagicFilmGeneration5),
    Curve.CANON_LOG: named("CanonLog"),
    Curve.CANON_LOG_V1: (canon.log_encoding_CanonLog_v1, canon.log_decoding_CanonLog_v1),
    Curve.CANON_LOG2: named("CanonLog2"),
    Curve.CANON_LOG2_V1: (canon.log_encoding_CanonLog2_v1, canon.log_decoding_CanonLog2_v1),
    Curve.CANON_LOG3: named("CanonLog3"),
    Curve.CANON_LOG3_V1: (canon.log_encoding_CanonLog3_v1, canon.log_decoding_CanonLog3_v1),
    Curve.CINEON: named("Cineon"),
    Curve.DAVINCI_INTERMEDIATE: (colour.oetf_DaVinciIntermediate, colour.oetf_inverse_DaVinciIntermediate),
    Curve.DJI_DLOG: named("DJIDLog"),
    Curve.FILMIC_PRO6: (colour.log_encoding_FilmicPro6, None),
    Curve.FILMLIGHT_TLOG: named("FilmLightTLog"),
    Curve.FLOG: named("FLog"),
    Curve.FLOG2: named("FLog2"),
    Curve.GOPRO_PROTUNE: named("Protune"),
    Curve.LEICA_LLOG: named("LLog"),
    Curve.LOG2: named("Log2"),
    Curve.MI_LOG: named("MiLog"),
    Curve.NIKON_NLOG: named("NLog"),
    Curve.PANALOG: named("Panalog"),
    Curve.PLOG: named("PivotedLog"),
    Curve.RED_LOG: named("REDLog"),
    Curve.RED_LOGFILM: named("REDLogFilm"),
    Curve.RED_LOG3G10: named("Log3G10"),
    Curve.RED_LOG3G10_V1: (red.log_encoding_Log3G10_v1, red.log_decoding_Log3G10_v1),
    Curve.RED_LOG3G10_V2: (red.log_encoding_Log3G10_v2, red.log_decoding_Log3G10_v2),
    Curve.RED_LOG3G12: named("Log3G12"),
    Curve.SLOG: named("SLog"),
    Curve.SLOG2: named("SLog2"),
    Curve.SLOG3: named("SLog3"),
    Curve.VIPER_LOG: named("ViperLog"),
    Curve.VLOG: named("VLog"),
}
FROM_ZERO = {
    Curve.BT2020, Curve.BT2020_12, Curve.SMPTE_240M, Curve.RIMM, Curve.ROMM, Curve.ERIMM, Curve.ST428, Curve.ADOBE_RGB,
    Curve.CINEON, Curve.PANALOG, Curve.RED_LOG, Curve.RED_LOGFILM, Curve.GOPRO_PROTUNE, Curve.LOG2, Curve.PLOG,
    Curve.VIPER_LOG, Curve.FILMIC_PRO6,
}  # fmt: skip
"""Curves of which the publisher says nothing, or colour-science something of its own, for negative light."""
GAPS = {Curve.BT1361: 0.0811, Curve.RIMM: 0.0579, Curve.SMPTE_240M: 0.0912}
"""Signals, give or take 3e-4, that no light gives: we take them to the knee, colour-science to one of the formulas."""


def own(curve: Curve) -> dict[str, Any]:
    """Light in cd/m2, as colour-science has it."""
    return {"white": 1} if curve is Curve.DICOM_GSDF else {}


def truth(p: Parameters, x: np.ndarray) -> np.ndarray:
    return transfer.evaluate_truth({"image": Image(x.astype(np.float64).reshape(1, -1, 1))}, p).reshape(-1)


def places(curve: Curve, way: Direction) -> np.ndarray:
    """Light from -0.3 (or 0) to 30, signals over the range of those."""
    random = np.random.default_rng(2)
    if curve is Curve.DICOM_GSDF:
        light = np.geomspace(0.051, 3990, 800)
    else:
        top = 30.0 if curve not in (Curve.RIMM, Curve.H273_LOG, Curve.H273_LOG_SQRT) else 1.0
        light = np.concatenate([np.geomspace(1e-9, top, 400), random.uniform(1e-3, 1, 400)])
        if curve not in FROM_ZERO:
            light = np.concatenate([light, -np.geomspace(1e-9, 0.3, 100)])
    if way is Direction.ENCODE:
        return light
    return truth(Parameters(curve=curve, direction=Direction.ENCODE, **own(curve)), light)


def test_every_curve_of_the_table_is_tried() -> None:
    assert set(COLOUR) == set(PIECED)
    assert set(TABLE) | {Curve.ARRI_LOGC3, Curve.ST428, Curve.DICOM_GSDF} == set(PIECED)


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_truth_agrees_with_colour_science(curve: Curve, way: Direction) -> None:
    """To 1e-12 of the value, or of 1. Signals at which colour-science has the other formula are few and told apart."""
    function = COLOUR[curve][way is Direction.DECODE]
    if function is None:
        pytest.skip("colour-science interpolates this inverse; the round trip is tested")
    x = places(curve, way)
    if way is Direction.DECODE and curve in GAPS:
        x = x[np.abs(x - GAPS[curve]) > 3e-4]
    with np.errstate(all="ignore"):
        expected = function(x)
    np.testing.assert_allclose(
        truth(Parameters(curve=curve, direction=way, **own(curve)), x), expected, rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("index", list(LOGC3))
def test_every_exposure_index_agrees_with_colour_science(index: int) -> None:
    light = np.concatenate([np.linspace(-0.1, 1, 200), np.geomspace(1, 40, 50)])
    p = Parameters(curve=Curve.ARRI_LOGC3, direction=Direction.ENCODE, exposure_index=index)
    np.testing.assert_allclose(truth(p, light), colour.log_encoding_ARRILogC3(light, EI=index), rtol=1e-12)
    signal = np.linspace(-0.1, 1, 300)
    back = Parameters(curve=Curve.ARRI_LOGC3, exposure_index=index)
    expected = colour.log_decoding_ARRILogC3(signal, EI=index)
    np.testing.assert_allclose(truth(back, signal), expected, rtol=1e-12, atol=1e-12)


def test_filmic_pro_is_inverted_to_fifty_digits() -> None:
    signal = np.concatenate([np.linspace(-3, 1.3, 40), [30.0, 300.0]])
    found = truth(Parameters(curve=Curve.FILMIC_PRO6), signal)
    with mpmath.workdps(50):
        for y, light in zip(signal, found, strict=True):
            z = (mpmath.mpf(float(y)) - mpmath.mpf("0.371") * mpmath.mpf("1.69542")) / mpmath.mpf("0.371")
            k = 2 * mpmath.mpf("0.28257")
            root = k * mpmath.lambertw(mpmath.exp(z / k) / k)
            assert abs(float(root**2) / light - 1) < 3e-14 * (1 + abs(float(z)))


def test_mid_grey_is_where_the_publishers_put_it() -> None:
    """Codes of 10 bits that the white papers print for 0.18."""
    printed = {
        Curve.ARRI_LOGC3: 400, Curve.ARRI_LOGC4: 285, Curve.SLOG3: 420, Curve.VLOG: 433, Curve.CANON_LOG3: 351,
        Curve.FLOG2: 400, Curve.NIKON_NLOG: 372, Curve.RED_LOG3G10: 341, Curve.APPLE_LOG: 499,
    }  # fmt: skip
    for curve, code in printed.items():
        found = truth(Parameters(curve=curve, direction=Direction.ENCODE), np.array([0.18]))[0] * 1023
        assert abs(found - code) < 1.0, f"{curve}: {found}"


# ------------------------------------------------------------------------------------------------------- float32


def compute(p: Parameters, x: np.ndarray, backend: str) -> np.ndarray:
    image = Image(np.ascontiguousarray(x.astype(np.float32).reshape(1, -1, 1)))
    implementation = transfer.methods["exact"].implementation
    if backend == "numpy":
        return implementation.numpy({"image": image}, p, 0.0).reshape(-1)
    device = default_device()
    assert device is not None
    return implementation.opencl(device, {"image": image}, p, 0.0).reshape(-1)


def knees(p: Parameters) -> np.ndarray:
    """The float32 neighbours of the places where the curve changes its formula, and of its centre."""
    curve = shape(p).curve  # type: ignore[attr-defined]
    centre = curve.centre[0] if curve.centre else 0.0
    places = [0.0, centre, *(s * piece.start + centre for piece in curve.pieces[1:] for s in (1, -1))]
    near = [np.nextafter(np.float32(x), np.float32(way)) for x in places for way in (-np.inf, np.inf)]
    return np.array([*map(np.float32, places), *near], np.float32)


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_float32_keeps_what_it_states_where_it_is_hard(curve: Curve, way: Direction, backend: str) -> None:
    """Beside every knee and the centre, over twelve decades, and to 1e-5 of a nominal picture's range."""
    p = Parameters(curve=curve, direction=way)
    random = np.random.default_rng(4)
    wide = np.geomspace(1e-9, 100 if way is Direction.ENCODE else 1.5, 500)
    nominal = random.uniform(0, 1, 2000)
    for x in (knees(p), np.concatenate([wide, -wide]), nominal):
        x = x.astype(np.float32)
        facts = Facts(1, x.size, 1, extent=Extent(float(x.min()), float(x.max()), 0))
        stated = transfer.methods["exact"].error(p, 0.0, {"image": facts}).value
        found = np.abs(compute(p, x, backend) - truth(p, x))
        assert found.max() <= stated + np.finfo(np.float32).tiny, f"at {x[found.argmax()]}"
    # N-Log's two formulas miss each other by 1.3e-4, and which one holds is decided by a rounded distance.
    usual = {Curve.NIKON_NLOG: 4e-4}.get(curve, 2e-5)
    assert stated <= usual * max(1.0, float(np.abs(truth(p, nominal)).max()))


@pytest.mark.parametrize("curve", PIECED)
@pytest.mark.parametrize("backend", BACKENDS)
def test_light_comes_back(curve: Curve, backend: str) -> None:
    """From 0.02 of the range on. DICOM's polynomials undo each other to their digits, and so do D-Log's constants."""
    light = np.linspace(0.02, 1, 4001).astype(np.float32)
    signal = compute(Parameters(curve=curve, direction=Direction.ENCODE), light, backend)
    back = compute(Parameters(curve=curve), signal, backend)
    allowed = {Curve.DJI_DLOG: 3e-5, Curve.NIKON_NLOG: 3e-3, Curve.DICOM_GSDF: 6e-3}.get(curve, 1e-5)
    assert np.abs(back / light - 1).max() < allowed


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_what_is_not_a_number_and_what_is_infinite(curve: Curve, way: Direction) -> None:
    x = np.array([np.nan, np.inf, -np.inf, 0.5], np.float32)
    for negative in ("mirror", "clamp"):
        p = Parameters(curve=curve, direction=way, negative=negative)
        expected = truth(p, x)
        assert np.isnan(expected[0])
        assert np.isfinite(expected[3])
        for backend in BACKENDS:
            np.testing.assert_allclose(compute(p, x, backend), expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_range_and_modulus_hold_every_pair(curve: Curve, way: Direction) -> None:
    random = np.random.default_rng(6)
    for negative in ("mirror", "clamp"):
        p = Parameters(curve=curve, direction=way, negative=negative)
        for low, high in ((0.0, 1.0), (-0.5, 1.5), (0.0, 1e-3)):
            facts = {"image": Facts(1, 1, 1, extent=Extent(low, high, 0))}
            near = np.clip(
                np.repeat(knees(p).astype(float), 30) + random.uniform(-1e-3, 1e-3, 30 * knees(p).size), low, high
            )
            x = np.concatenate([random.uniform(low, high, 2000), near])
            made, extent = truth(p, x), transfer.result(p, facts).extent
            assert extent.low <= made.min()
            assert extent.high >= made.max()
            for change in (1e-8, 1e-4, 0.1):
                moved = truth(p, x + random.uniform(-change, change, x.size))
                found = np.abs(made - moved).max()
                assert found <= transfer.propagate(p, facts, change) * (1 + 1e-9) + 1e-15


def test_clamped_light_is_never_negative() -> None:
    x = np.linspace(-1, 1, 301).astype(np.float32)
    for curve in PIECED:
        light = compute(Parameters(curve=curve, negative="clamp"), x, "opencl")
        assert light.min() >= 0
        signal = compute(Parameters(curve=curve, direction="encode", negative="clamp"), x, "numpy")
        np.testing.assert_array_equal(signal[:150], signal[150])


# ------------------------------------------------------------------------------------------- gamma for each channel


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("alpha", [Alpha.NONE, Alpha.STRAIGHT])
def test_gamma_for_each_channel(backend: str, alpha: Alpha) -> None:
    pixels = np.random.default_rng(3).uniform(-0.5, 2, (13, 21, 4)).astype(np.float32)
    gammas = (2.2, 0.5, 1.0, 3.1)[: 3 if alpha is Alpha.STRAIGHT else 4]
    result = lichen.run("transfer", Image(pixels, alpha=alpha), curve="gamma", gamma=list(gammas), device=backend)
    for channel, gamma in enumerate(gammas):
        plain = np.sign(pixels[..., channel]) * np.abs(pixels[..., channel].astype(float)) ** gamma
        np.testing.assert_allclose(result.image.pixels[..., channel], plain, rtol=2e-6, atol=1e-7)
    if alpha is Alpha.STRAIGHT:
        assert result.image.pixels[..., 3].tobytes() == pixels[..., 3].tobytes()
    assert result.method == "exact"
    back = lichen.run("gamma", Image(pixels, alpha=alpha), gamma=list(gammas), device=backend)
    assert back.image.pixels.tobytes() == result.image.pixels.tobytes()


def test_flaws_are_named_all_at_once() -> None:
    pixels = np.ones((2, 2, 3))
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("transfer", pixels, curve="vlog", gamma=[2.0, 2.0], exposure_index=400, white=90)
    assert {flaw.pointer for flaw in caught.value.flaws} == {
        "/parameters/gamma", "/parameters/exposure_index", "/parameters/white",
    }  # fmt: skip
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("transfer", pixels, curve="arri_logc3", exposure_index=700)
    assert "160, 200" in caught.value.flaws[0].detail
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gamma", pixels, gamma=[2.0, 2.0])
    assert caught.value.flaws[0].pointer == "/parameters/gamma"
