"""Transfer functions against mpmath at 50 digits and against colour-science, and what only this operation promises."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Extent, Image, Space
from lichen.opencl.device import default_device
from lichen.operation import Facts
from lichen.operations.tone import tables
from lichen.operations.tone.curves import WHOLE, Curve, Direction
from lichen.operations.tone.transfer import transfer
from lichen.operations.tone.transfer_parameters import Parameters, form

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from colour.models.rgb import transfer_functions as colour

BACKENDS = ("opencl", "numpy")
WAYS = [(curve, way) for curve in WHOLE for way in Direction]
IDS = [f"{curve}-{way}" for curve, way in WAYS]
DIGITS = 50


def number(text: str) -> mpf:
    return mpf(text)


def rational(above: int, below: int) -> mpf:
    return mpf(above) / below


# ------------------------------------------------------------------------------------------------------ the oracle
# The standards once more, in 50 digits, one function per direction, for x >= 0. Display curves give cd/m2.


def srgb_decode(x: mpf) -> mpf:
    return x / number("12.92") if x <= number("0.04045") else ((x + number("0.055")) / number("1.055")) ** number("2.4")


def srgb_encode(x: mpf) -> mpf:
    if x <= number("0.0031308"):
        return number("12.92") * x
    return number("1.055") * x ** (1 / number("2.4")) - number("0.055")


def bt709_encode(x: mpf) -> mpf:
    return number("4.5") * x if x < number("0.018") else number("1.099") * x ** number("0.45") - number("0.099")


def bt709_decode(x: mpf) -> mpf:
    if x <= number("0.081"):
        return x / number("4.5")
    return max(((x + number("0.099")) / number("1.099")) ** (1 / number("0.45")), number("0.018"))


def hlg_constants() -> tuple[mpf, mpf, mpf]:
    a = number("0.17883277")
    return a, 1 - 4 * a, number("0.5") - a * mpmath.log(4 * a)


def hlg_encode(x: mpf) -> mpf:
    a, b, c = hlg_constants()
    return mpmath.sqrt(3 * x) if x <= rational(1, 12) else a * mpmath.log(12 * x - b) + c


def hlg_decode(x: mpf) -> mpf:
    a, b, c = hlg_constants()
    return x**2 / 3 if x <= rational(1, 2) else (mpmath.exp((x - c) / a) + b) / 12


def pq_constants() -> tuple[mpf, mpf, mpf, mpf, mpf]:
    return rational(2610, 16384), rational(2523, 32), rational(3424, 4096), rational(2413, 128), rational(2392, 128)


def pq_encode(x: mpf) -> mpf:
    m1, m2, c1, c2, c3 = pq_constants()
    y = (x / 10000) ** m1
    return ((c1 + c2 * y) / (1 + c3 * y)) ** m2


def pq_decode(x: mpf) -> mpf:
    m1, m2, c1, c2, c3 = pq_constants()
    root = x ** (1 / m2)
    if root >= c2 / c3:
        return mpf(10) ** 10
    return min(10000 * (max(root - c1, mpf(0)) / (c2 - c3 * root)) ** (1 / m1), mpf(10) ** 10)


def bt1886(x: mpf, p: Parameters) -> mpf:
    gamma, white, black = number("2.4"), mpf(p.nominal_white), mpf(p.black)
    span = white ** (1 / gamma) - black ** (1 / gamma)
    a, b = span**gamma, black ** (1 / gamma) / span
    if p.direction is Direction.DECODE:
        return a * (x + b) ** gamma / white
    return (x * white / a) ** (1 / gamma) - b


def oracle(p: Parameters) -> Callable[[mpf], mpf]:
    """The parameters' curve for x >= 0, light in units of `white`."""
    decode = p.direction is Direction.DECODE
    white = mpf(p.nominal_white)
    if p.curve is Curve.GAMMA:
        return lambda x: x ** (mpf(p.gamma) if decode else 1 / mpf(p.gamma))
    if p.curve is Curve.BT1886:
        return lambda x: bt1886(x, p)
    if p.curve is Curve.PQ:
        return (lambda x: pq_decode(x) / white) if decode else (lambda x: pq_encode(x * white))
    functions = {
        Curve.SRGB: (srgb_decode, srgb_encode),
        Curve.BT709: (bt709_decode, bt709_encode),
        Curve.HLG: (hlg_decode, hlg_encode),
    }
    return functions[p.curve][0 if decode else 1]


KNEES = {
    (Curve.SRGB, Direction.DECODE): 0.04045,
    (Curve.SRGB, Direction.ENCODE): 0.0031308,
    (Curve.BT709, Direction.DECODE): 0.081,
    (Curve.BT709, Direction.ENCODE): 0.018,
    (Curve.HLG, Direction.DECODE): 0.5,
    (Curve.HLG, Direction.ENCODE): 1 / 12,
}


def samples(p: Parameters) -> np.ndarray:
    """float32 values from 1e-12 to 1e4 (signals: to 4, where HLG's exponential is 1e7), with a knee's neighbours."""
    random = np.random.default_rng(11)
    top = 4 if p.direction is Direction.DECODE else 1e4
    parts = [np.geomspace(1e-12, top, 400), random.uniform(0, 1, 300), [0, 1]]
    knee = KNEES.get((p.curve, p.direction))
    if knee is not None:
        bits = int(np.float32(knee).view(np.int32)) + np.arange(-4, 5, dtype=np.int32)
        parts.append(bits.astype(np.int32).view(np.float32))
    return np.concatenate(parts).astype(np.float32)


def exact(p: Parameters, x: np.ndarray) -> np.ndarray:
    """The oracle as float64, rounded once."""
    function = oracle(p)
    with mpmath.workdps(DIGITS):
        return np.array([float(function(mpf(float(value)))) for value in x])


def truth(p: Parameters, x: np.ndarray) -> np.ndarray:
    pixels = x.astype(np.float64).reshape(1, -1, 1)
    return transfer.evaluate_truth({"image": Image(pixels)}, p).reshape(-1)


def body(image: Image, p: Parameters, backend: str, method: str, knob: float) -> np.ndarray:
    """A method's own result on a backend."""
    implementation = transfer.methods[method].implementation
    if backend == "numpy":
        return implementation.numpy({"image": image}, p, knob)
    device = default_device()
    assert device is not None, "these tests need OpenCL"
    return implementation.opencl(device, {"image": image}, p, knob)


def compute(p: Parameters, x: np.ndarray, backend: str, method: str = "exact", knob: float = 0) -> np.ndarray:
    return body(Image(x.astype(np.float32).reshape(1, -1, 1)), p, backend, method, knob).reshape(-1)


# ---------------------------------------------------------------------------------------------------------- truth


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_truth_is_the_standard(curve: Curve, way: Direction) -> None:
    """To float64 rounding, times PQ's exponents (78.84 and its pole), which the printed formula amplifies."""
    p = Parameters(curve=curve, direction=way)
    x = samples(p)
    if curve is Curve.PQ and way is Direction.DECODE:
        x = x[(x < 1.8) | (x > 1.9)]  # just below the ceiling the condition number exceeds 60
    expected = exact(p, x)
    tolerance = 2e-10 if curve is Curve.PQ else 2e-14
    np.testing.assert_allclose(truth(p, x), expected, rtol=tolerance, atol=1e-15)


@pytest.mark.parametrize("way", Direction)
def test_truth_of_a_display_with_a_black(way: Direction) -> None:
    p = Parameters(curve=Curve.BT1886, direction=way, white=120, black=0.05)
    np.testing.assert_allclose(truth(p, samples(p)), exact(p, samples(p)), rtol=2e-14, atol=1e-15)


COLOUR = {
    ("srgb", "decode"): colour.eotf_sRGB,
    ("srgb", "encode"): colour.eotf_inverse_sRGB,
    ("bt709", "encode"): colour.oetf_BT709,
    ("hlg", "decode"): colour.oetf_inverse_BT2100_HLG,
    ("hlg", "encode"): colour.oetf_BT2100_HLG,
    ("pq", "decode"): colour.eotf_ST2084,
    ("pq", "encode"): colour.eotf_inverse_ST2084,
}


@pytest.mark.parametrize(("curve", "way"), COLOUR, ids=["-".join(key) for key in COLOUR])
def test_truth_agrees_with_colour_science(curve: str, way: str) -> None:
    """Where it defines the same: 0 to 1 of signal and light (PQ in cd/m2, to its peak)."""
    p = Parameters(curve=curve, direction=way, white=1 if curve == "pq" else None)
    x = np.linspace(0, 10000 if (curve, way) == ("pq", "encode") else 1, 5001)
    expected = COLOUR[curve, way](x)
    np.testing.assert_allclose(truth(p, x), expected, rtol=1e-12, atol=1e-12)


def test_truth_of_the_reference_display_agrees_with_colour_science() -> None:
    x = np.linspace(0, 1, 1001)
    p = Parameters(curve="bt1886", white=100, black=0.1)
    np.testing.assert_allclose(100 * truth(p, x), colour.eotf_BT1886(x, L_B=0.1, L_W=100), rtol=1e-12)
    back = Parameters(curve="bt1886", direction="encode", white=100, black=0.1)
    light = np.linspace(0, 1.2, 1001)
    np.testing.assert_allclose(
        truth(back, light), colour.eotf_inverse_BT1886(100 * light, L_B=0.1, L_W=100), rtol=1e-12, atol=1e-12
    )


def test_values_by_heart() -> None:
    """Published anchors: mid grey in sRGB, 100 and 1000 cd/m2 in PQ, HLG's reference points (ITU-R BT.2408)."""
    assert truth(Parameters(), np.array([0.5]))[0] == pytest.approx(0.21404114, abs=1e-8)
    pq = Parameters(curve="pq", direction="encode", white=100)
    assert truth(pq, np.array([1.0, 2.03, 10.0])) == pytest.approx([0.5081, 0.5807, 0.7518], abs=1e-4)
    hlg = Parameters(curve="hlg", direction="encode")
    assert truth(hlg, np.array([1 / 12, 0.26496256, 1.0])) == pytest.approx([0.5, 0.75, 1.0], abs=1e-6)


# ------------------------------------------------------------------------------------------------------- accuracy

RELATIVE = {
    (Curve.SRGB, Direction.DECODE): 6e-7,
    (Curve.SRGB, Direction.ENCODE): 8e-7,
    (Curve.GAMMA, Direction.DECODE): 5e-7,
    (Curve.GAMMA, Direction.ENCODE): 6e-7,
    (Curve.BT709, Direction.DECODE): 5e-7,
    (Curve.BT709, Direction.ENCODE): 6e-7,
    (Curve.BT1886, Direction.DECODE): 6e-7,
    (Curve.BT1886, Direction.ENCODE): 5e-7,
    (Curve.HLG, Direction.DECODE): 3e-6,
    (Curve.HLG, Direction.ENCODE): 4e-7,
}
"""Largest relative error of `exact` over all samples and both backends; PQ has its own test."""


@pytest.mark.parametrize(("curve", "way"), RELATIVE, ids=[f"{c}-{w}" for c, w in RELATIVE])
@pytest.mark.parametrize("backend", BACKENDS)
def test_exact_is_accurate_relative_to_the_result(curve: Curve, way: Direction, backend: str) -> None:
    p = Parameters(curve=curve, direction=way)
    x = samples(p)
    expected = exact(p, x)
    worst = np.abs(compute(p, x, backend) / np.where(expected == 0, 1, expected) - 1)[expected != 0].max()
    assert worst <= RELATIVE[curve, way]


@pytest.mark.parametrize("backend", BACKENDS)
def test_pq_is_accurate_to_its_steepness(backend: str) -> None:
    """Encoding to 3e-7 of a signal of 1; decoding to a few 1e-6 of the light, down to 0.005 cd/m2."""
    light = np.geomspace(1e-12, 10000, 20001)
    encode = Parameters(curve="pq", direction="encode", white=1)
    assert np.abs(compute(encode, light, backend) - truth(encode, light.astype(np.float32))).max() <= 3e-7
    decode = Parameters(curve="pq", white=1)
    signal = np.linspace(0.015, 1, 20001).astype(np.float32)
    expected = truth(decode, signal)
    assert expected[0] < 0.005
    assert np.abs(compute(decode, signal, backend) / expected - 1).max() <= {"opencl": 1.5e-6, "numpy": 2.5e-6}[backend]


@pytest.mark.parametrize("curve", WHOLE)
@pytest.mark.parametrize("backend", BACKENDS)
def test_round_trip(curve: Curve, backend: str) -> None:
    """decode(encode(x)), relative, 1e-3 to the nominal peak. In PQ the naive formulas lose 1.2e-4 here."""
    white = 10000 if curve is Curve.PQ else None
    x = np.geomspace(1e-3, 1, 20001).astype(np.float32)
    signal = compute(Parameters(curve=curve, direction="encode", white=white), x, backend)
    back = compute(Parameters(curve=curve, direction="decode", white=white), signal, backend)
    allowed = {Curve.PQ: 2.5e-6, Curve.HLG: 1.5e-6}.get(curve, 1e-6)
    assert np.abs(back / x.astype(np.float64) - 1).max() <= allowed


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
@pytest.mark.parametrize("size", [256, 1000, 4096])
def test_table_keeps_its_proved_bound_and_comes_near_it(curve: Curve, way: Direction, size: int) -> None:
    """Near it, so that the bound is worth something: at least a third of it occurs."""
    p = Parameters(curve=curve, direction=way)
    top = form(p).top
    random = np.random.default_rng(3)
    x = np.concatenate([random.uniform(0, top, 40000), top * 2.0 ** random.uniform(-80, 0, 40000)]).astype(np.float32)
    facts = {"image": Facts(1, x.size, 1, extent=Extent(0, top, 0))}
    stated = transfer.methods["table"].error(p, size, facts)
    assert stated.kind == "bound"
    for backend in BACKENDS:
        found = np.abs(compute(p, x, backend, "table", size) - truth(p, x)).max()
        assert stated.value / 3 - stated.rounding <= found <= stated.value


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_table_bound_covers_every_cell(curve: Curve, way: Direction) -> None:
    """The middle of each cell, where the chord is farthest off, and the first cells above zero."""
    shape = form(Parameters(curve=curve, direction=way))
    table = tables.tabulate(shape, 512)
    starts = table.first + (np.arange(len(table.columns[0]) - 1, dtype=np.int64) << table.shift)
    middle = (starts + (1 << (table.shift - 1))).astype(np.int32).view(np.float32).astype(np.float64)
    chord = table.columns[0][:-1] + 0.5 * table.columns[1][:-1].astype(np.float64)
    wrong = np.abs(chord - shape.upper(middle))[middle > shape.knee]
    assert wrong.max() <= table.bound + table.rounding


# ---------------------------------------------------------------------------------------------- declared behaviour


@pytest.mark.parametrize("backend", BACKENDS)
def test_table_does_not_depend_on_the_picture(backend: str) -> None:
    """A tile gives the bytes that the whole gives, whatever its range."""
    p = Parameters(curve="pq", direction="encode")
    x = np.geomspace(1e-6, 1000, 64).astype(np.float32)
    whole = compute(p, x, backend, "table", 1024)
    tiles = [compute(p, part, backend, "table", 1024) for part in np.split(x, 4)]
    np.testing.assert_array_equal(whole, np.concatenate(tiles))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("channels", [2, 3, 4, 5])
def test_coverage_passes_bit_for_bit(backend: str, channels: int) -> None:
    random = np.random.default_rng(channels)
    pixels = random.uniform(-1, 2, (9, 13, channels)).astype(np.float32)
    pixels[4, 5, -1] = np.nan
    image = Image(pixels, Space.SRGB, Alpha.STRAIGHT)
    plain = Image(np.ascontiguousarray(pixels[..., :-1]), Space.SRGB)
    held = [Parameters(negative="clamp")] if channels == 3 else []  # once is enough, since each is a program of its own
    for method, p in itertools.product(("exact", "table"), [Parameters(), *held]):
        result = body(image, p, backend, method, 512)
        assert result[..., -1].tobytes() == pixels[..., -1].tobytes()
        np.testing.assert_array_equal(result[..., :-1], body(plain, p, backend, method, 512))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("method", ["exact", "table"])
def test_light_below_a_display_black_continues(backend: str, method: str) -> None:
    """BT.1886 is mirrored about its own zero, so it is continuous there and a signal of 0 gives the black."""
    p = Parameters(curve="bt1886", white=100, black=0.1)
    x = np.linspace(-0.2, 0.2, 1001).astype(np.float32)
    got = compute(p, x, backend, method, 65536)
    np.testing.assert_allclose(got, truth(p, x), atol=2e-6)
    assert compute(p, np.zeros(1), backend, method, 65536)[0] == pytest.approx(0.001, abs=2e-6)
    clamped = compute(Parameters(curve="bt1886", white=100, black=0.1, negative="clamp"), x, backend, method, 65536)
    np.testing.assert_allclose(clamped, np.maximum(truth(p, x), 0), atol=2e-6)


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
def test_change_of_the_result_stays_below_the_modulus(curve: Curve, way: Direction) -> None:
    """Pairs of float64 values at every distance, knees and zero among them."""
    p = Parameters(curve=curve, direction=way)
    random = np.random.default_rng(5)
    for low, high in ((0.0, 1.0), (-0.5, 1.5), (0.2, 0.9), (0.0, 1e-3)):
        facts = {"image": Facts(1, 1, 1, extent=Extent(low, high, 0))}
        knee = KNEES.get((curve, way), 0.0)
        x = np.concatenate([random.uniform(low, high, 4000), [low, high], knee * np.linspace(0.99, 1.01, 200)])
        x = x[(x >= low) & (x <= high)]
        for change in (1e-9, 1e-6, 1e-3, 0.1):
            y = x + random.uniform(-change, change, x.size)
            found = np.abs(truth64(p, x) - truth64(p, y)).max()
            assert found <= transfer.propagate(p, facts, change) * (1 + 1e-9) + 1e-15


def test_change_of_light_is_largest_below_the_plateau_of_pq() -> None:
    """However far beyond it the codes of a picture reach."""
    p = Parameters(curve="pq", direction="decode")
    facts = {"image": Facts(1, 1, 1, extent=Extent(0, 1e4, 0))}
    x = np.linspace(1.83, 1.85, 400)
    found = np.abs(truth64(p, x) - truth64(p, x - 1e-3)).max()
    assert 1e6 < found <= transfer.propagate(p, facts, 1e-3)


def truth64(p: Parameters, x: np.ndarray) -> np.ndarray:
    return transfer.evaluate_truth({"image": Image(x.reshape(1, -1, 1))}, p).reshape(-1)


@pytest.mark.parametrize(("curve", "way"), WAYS, ids=IDS)
@pytest.mark.parametrize("negative", ["mirror", "clamp"])
def test_result_range_holds_every_value(curve: Curve, way: Direction, negative: str) -> None:
    p = Parameters(curve=curve, direction=way, negative=negative)
    for values in ([-0.7, 0.3, 3.0], [0.0, 1e-9], [-2.0, -0.1], [0.5, np.inf, np.nan, -np.inf], [1e30, -1e30]):
        image = Image(np.array(values, dtype=np.float32).reshape(1, -1, 1))
        extent = transfer.result(p, {"image": Facts.of(image)}).extent
        for backend in BACKENDS:
            got = compute(p, image.pixels.reshape(-1), backend)
            finite = got[np.isfinite(got)]
            assert ((finite >= extent.low) & (finite <= extent.high)).all()


def test_spaces() -> None:
    def space(before: Space, **values: Any) -> Space:
        return transfer.result(transfer.validate(values), {"image": Facts(4, 4, 3, before)}).space

    assert space(Space.SRGB) is Space.LINEAR
    assert space(Space.LINEAR, direction="encode") is Space.SRGB
    assert space(Space.LINEAR) is Space.DATA
    assert space(Space.SRGB, curve="gamma") is Space.DATA
    assert space(Space.SRGB, curve="gamma", gamma=1) is Space.SRGB
    assert space(Space.DATA, curve="pq") is Space.DATA


def test_gamma_of_one_is_the_identity() -> None:
    pixels = np.random.default_rng(1).normal(size=(5, 7, 3)).astype(np.float32)
    pixels[0, 0] = np.nan, np.inf, -0.0
    result = lichen.run("transfer", pixels, curve="gamma", gamma="1")
    assert result.image.pixels.tobytes() == pixels.tobytes()
    assert any(decision.reason == "gamma is 1" for decision in result.decisions)
    clamped = lichen.run("transfer", pixels, curve="gamma", gamma=1, negative="clamp")
    assert clamped.image.pixels[np.isfinite(pixels)].min() == 0


def test_inverse_undoes() -> None:
    x = np.geomspace(1e-3, 1, 500).astype(np.float32)
    for curve, way in WAYS:
        p = Parameters(curve=curve, direction=way)
        back = transfer.inverse(p)
        if back is None:
            assert (curve, way) in [(Curve.PQ, Direction.DECODE), (Curve.BT709, Direction.DECODE)]
            continue
        np.testing.assert_allclose(truth64(back, truth(p, x)), x, rtol=1e-6)
    assert transfer.inverse(Parameters(negative="clamp")) is None


def test_parameters_of_another_curve_are_refused_all_at_once() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("transfer", np.ones((2, 2, 3)), curve="srgb", gamma=1.9, white=100, black=0.1)
    assert {flaw.pointer for flaw in caught.value.flaws} == {
        "/parameters/gamma",
        "/parameters/white",
        "/parameters/black",
    }
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("transfer", np.ones((2, 2, 3)), curve="bt1886", white=10, black=10)
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/black"]
