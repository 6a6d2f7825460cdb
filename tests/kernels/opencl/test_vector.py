"""Vectors of every width against float64, at lengths from denormals to the largest float; Fresnel against mpmath."""

from __future__ import annotations

from pathlib import Path

import mpmath
import numpy as np
import numpy.typing as npt
import pytest

from lichen.memory import aligned_empty
from lichen.opencl.device import Device

SOURCE = str(Path(__file__).with_name("vector_trial.cl"))
COUNT = 1 << 16
WIDTHS = (1, 4, 8, 16)
ULP = 2.0**-24
Floats = npt.NDArray[np.float64]


def evaluate(device: Device, function: str, a: Floats, b: Floats | None = None, s: Floats | None = None) -> Floats:
    """Rows x, y, z (or one row of numbers) as float64; every width gives the same bits."""
    count = -(-a.shape[1] // 16) * 16
    held = []
    for rows in (a, a if b is None else b, np.ones((1, a.shape[1])) if s is None else s.reshape(1, -1)):
        wide = aligned_empty((len(rows), count))
        wide[:, : a.shape[1]], wide[:, a.shape[1] :] = rows, 1
        held.append(wide)
    single = function in ("dot", "length", "fresnel", "schlick")
    found = []
    for width in WIDTHS:
        out = aligned_empty((1 if single else 3, count))
        with device.session() as session:
            items = count // width
            session.launch(
                SOURCE, f"{function}_trial", (items,), *held, session.write(out), np.int32(items),
                defines={"WIDTH": width},
            )  # fmt: skip
        found.append(out[:, : a.shape[1]])
    for other in found[1:]:
        assert np.array_equal(np.isnan(other), np.isnan(found[0]))
        assert np.array_equal(np.nan_to_num(other), np.nan_to_num(found[0]))
    return found[0].astype(np.float64)


def directions(seed: int) -> Floats:
    """Float32 vectors, of every direction and about every length, as float64."""
    rng = np.random.default_rng(seed)
    long = rng.standard_normal((3, COUNT)) * 10.0 ** rng.uniform(-8, 8, COUNT)
    return long.astype(np.float32).astype(np.float64)


def units(seed: int) -> Floats:
    made = directions(seed)
    return (made / np.linalg.norm(made, axis=0)).astype(np.float32).astype(np.float64)


def lengths(a: Floats) -> Floats:
    return np.asarray(np.linalg.norm(a, axis=0))


def test_products_are_off_by_few_roundings_of_the_lengths(device: Device) -> None:
    a, b = directions(1), directions(2)
    size = lengths(a) * lengths(b)
    assert (np.abs(evaluate(device, "dot", a, b)[0] - (a * b).sum(axis=0)) / size).max() < 2.5 * ULP
    assert (lengths(evaluate(device, "cross", a, b) - np.cross(a, b, axis=0)) / size).max() < 2.5 * ULP


def test_the_cross_product_of_nearly_parallel_vectors_keeps_its_digits(device: Device) -> None:
    a = units(3)
    b = (a + 1e-5 * units(4)).astype(np.float32).astype(np.float64)
    exact = np.cross(a, b, axis=0)
    apart = np.abs(evaluate(device, "cross", a, b) - exact)
    assert (apart <= 4 * ULP * np.abs(exact) + 1e-14).all()


@pytest.mark.parametrize("decade", [-45, -38, -30, -19, 0, 19, 30, 38])
def test_directions_are_found_at_any_length(device: Device, decade: int) -> None:
    with np.errstate(under="ignore"):
        a = (units(5) * 10.0**decade).astype(np.float32).astype(np.float64)
    exact = lengths(a)
    there = exact > 0
    unit = np.divide(a, exact, out=np.zeros_like(a), where=there)
    assert lengths(evaluate(device, "unit", a) - unit).max() < 3 * ULP
    representable = there & (exact < np.finfo(np.float32).max)
    apart = np.abs(evaluate(device, "length", a)[0] - exact)[representable]
    assert (apart <= np.maximum(3 * ULP * exact[representable], 2.0**-149)).all()


def test_no_length_is_no_direction_and_spoilt_vectors_are_not_a_number(device: Device) -> None:
    a = np.array([[0, -0.0, np.nan, np.inf, 1, 0], [0, 0, 1, 1, -np.inf, 0], [0, 0, 1, 1, 1, 1e-45]], np.float64)
    unit = evaluate(device, "unit", a)
    assert np.array_equal(unit[:, :2], np.zeros((3, 2)))
    assert np.isnan(unit[:, 2:5]).all()
    assert unit[2, 5] == pytest.approx(1)
    length = evaluate(device, "length", a)[0]
    assert np.isnan(length[2])
    assert np.array_equal(length[[0, 1, 3, 4]], [0, 0, np.inf, np.inf])


def test_sums(device: Device) -> None:
    """((a + b) - b) s + b, in steps of one rounding each."""
    a, b, s = units(6), units(7), np.random.default_rng(8).uniform(-2, 2, COUNT).astype(np.float32).astype(np.float64)
    assert lengths(evaluate(device, "sum", a, b, s) - (a * s + b)).max() < 6 * ULP


def test_mirrored_directions(device: Device) -> None:
    v, n = units(9), units(10)
    exact = 2 * (v * n).sum(axis=0) * n - v
    assert lengths(evaluate(device, "reflect", v, n) - exact).max() < 6 * ULP


def test_refracted_directions_obey_snell(device: Device) -> None:
    """Both sines in the ratio of the indices, in one plane, on the other side; none where all light is reflected."""
    v, n = units(11), units(12)
    v = np.where((v * n).sum(axis=0) < 0, -v, v)
    eta = np.random.default_rng(13).uniform(0.4, 2.5, COUNT).astype(np.float32).astype(np.float64)
    found = evaluate(device, "refract", v, n, eta)
    sine = lengths(np.cross(n, v, axis=0))
    total = eta * sine > 1
    clear = np.abs(eta * sine - 1) > 1e-6
    assert np.array_equal(lengths(found)[clear] == 0, total[clear])
    through = ~total & clear
    cosine = np.sqrt(1 - (eta * sine)[through] ** 2)
    exact = (
        -eta[through] * v[:, through] + (eta * (v * n).sum(axis=0))[through] * n[:, through] - cosine * n[:, through]
    )
    # The root is steep at the critical angle.
    assert (lengths(found[:, through] - exact) <= 8 * ULP + 8 * ULP / cosine).all()
    straight = evaluate(device, "refract", v, n, np.ones(COUNT))
    assert lengths(straight + v)[sine < 0.999].max() < 4e-6


def exact_fresnel(c: float, n: float) -> float:
    """The two polarisations by Snell's law, in 40 digits."""
    with mpmath.workdps(40):
        sine = mpmath.sqrt(1 - mpmath.mpf(c) ** 2) / n
        if sine >= 1:
            return 1.0
        cosine = mpmath.sqrt(1 - sine**2)
        across = (c - n * cosine) / (c + n * cosine)
        along = (n * c - cosine) / (n * c + cosine)
        return float((across**2 + along**2) / 2)


def test_reflectance_of_every_index(device: Device) -> None:
    rng = np.random.default_rng(14)
    count = 1500
    c = np.concatenate([rng.uniform(0, 1, count), 10.0 ** rng.uniform(-6, 0, count)])
    n = np.concatenate([1 + 10.0 ** rng.uniform(-7, 2, 2 * count)])
    c, n = (each.astype(np.float32).astype(np.float64) for each in (c, n))
    exact = np.array([exact_fresnel(*pair) for pair in zip(c, n, strict=True)])
    found = evaluate(device, "fresnel", np.stack([c, c, c]), s=n)[0]
    assert np.abs(found - exact).max() < 6e-7
    rare = 1 / n
    exact = np.array([exact_fresnel(*pair) for pair in zip(c, rare.astype(np.float32).astype(float), strict=True)])
    found = evaluate(device, "fresnel", np.stack([c, c, c]), s=rare)[0]
    assert np.median(np.abs(found - exact)) < 6e-7
    assert np.abs(found - exact).max() < 1e-3


def test_reflectance_at_its_ends(device: Device) -> None:
    """No contrast reflects nothing, not even grazing light, all of which is reflected otherwise; published values."""
    c = np.array([0.0, 0.5, 1.0, 0.0, 0.0, 1.0, *np.cos(np.radians([30, 45, 60, 75, 80, 85, 89])), np.nan])
    n = np.array([1.0, 1.0, 1.0, 1.5, 0.7, 5.0, *[1.5] * 7, 1.5])
    found = evaluate(device, "fresnel", np.stack([c, c, c]), s=n)[0]
    table = (0, 0, 0, 1, 1, 4 / 9, 0.041523, 0.050240, 0.089187, 0.253061, 0.387704, 0.612800, 0.904185)
    assert np.abs(found[:-1] - table).max() < 1e-6
    assert np.isnan(found[-1])
    schlick = evaluate(device, "schlick", np.stack([c, c, c]), s=np.full(c.size, 0.04))[0]
    assert np.abs(schlick[:-1] - (0.04 + 0.96 * (1 - c[:-1]) ** 5)).max() < 3e-7
