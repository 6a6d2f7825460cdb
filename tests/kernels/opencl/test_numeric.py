"""Each elementary function within its stated error: 1e6 random inputs over all decades, specials, every vector width.

The references are extended-precision NumPy on the very float32 inputs; angles beyond what that reduces go to mpmath.
An error in ULP is in units of float32's spacing at the exact result; wrong infinities, NaN or numbers count as
infinitely wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import numpy.typing as npt
import pytest

from lichen.memory import aligned_empty
from lichen.opencl.device import Device

Floats = npt.NDArray[np.floating[Any]]

SOURCE = str(Path(__file__).with_name("numeric_trial.cl"))
COUNT = 1_000_000
WIDTHS = (1, 4, 8, 16)


def float32(values: Sequence[float]) -> npt.NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


LARGEST = float(np.finfo(np.float32).max)
SPECIAL = float32(
    [
        *(0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 4.0, 1e-45, -1e-45, 1.1754942e-38, 1.1754944e-38, LARGEST, -LARGEST),
        *(np.inf, -np.inf, np.nan, 127.99999, 128.0, -126.0, -126.5, -149.0, -149.5, -150.0, -151.0, 88.72, 88.73),
        *(-87.33, -87.34, -103.27, -103.97, -104.0, 1e30, -1e30, 8388607.5, 16777216.0, 51471.0, 51471.004),
    ]
)


def evaluate(device: Device, function: str, *inputs: Floats, width: int = 16) -> npt.NDArray[np.float32]:
    count = -(-inputs[0].size // 16) * 16
    held = []
    for values in inputs:
        padded = aligned_empty((count,))
        padded[: values.size], padded[values.size :] = values, 1
        held.append(padded)
    out = aligned_empty((count,))
    with device.session() as session:
        items = count // width
        session.launch(
            SOURCE, f"{function}_trial", (items,), *held, session.write(out), np.int32(items), defines={"WIDTH": width}
        )
    return out[: inputs[0].size]


def errors(got: npt.NDArray[np.float32], exact: Floats) -> Floats:
    """|got - exact| in ULP."""
    with np.errstate(all="ignore"):
        wide, found = exact.astype(np.float64), got.astype(np.float64)
        size = np.clip(np.abs(wide), 2.0**-126, LARGEST)
        error = np.abs((found - exact) / 2.0 ** (np.floor(np.log2(size)) - 23)).astype(np.float64)
        overflow = np.abs(wide) >= LARGEST * (1 + 2.0**-25)
        agree = np.where(np.isnan(wide), np.isnan(found), overflow & np.isinf(found) & (found * wide > 0))
    return np.where(agree, 0.0, np.where(np.isnan(error), np.inf, error))


def any_float(random: np.random.Generator, count: int) -> npt.NDArray[np.float32]:
    """Finite floats with every exponent equally often, denormals and both signs included."""
    values = random.integers(0, 1 << 32, count, dtype=np.uint32).view(np.float32)
    return np.where(np.isfinite(values), values, np.float32(1))


def hold(device: Device, function: str, inputs: tuple[Floats, ...], exact: Floats, stated: float) -> None:
    """The stated error for float16; the other widths give the same bits."""
    inputs = tuple(values.astype(np.float32) for values in inputs)
    got = evaluate(device, function, *inputs)
    error = errors(got, exact)
    worst = int(error.argmax())
    at = tuple(float(values[worst]) for values in inputs)
    assert error[worst] <= stated, f"{function}{at} = {got[worst]}, exactly {exact[worst]}: {error[worst]:.3f} ULP"
    for width in WIDTHS:
        same = evaluate(device, function, *inputs, width=width)
        assert np.array_equal(got.view(np.uint32)[~np.isnan(got)], same.view(np.uint32)[~np.isnan(got)]), width
        assert np.array_equal(np.isnan(got), np.isnan(same)), width


def quietly(function: Callable[..., Floats], *values: Floats) -> Floats:
    with np.errstate(all="ignore"):
        return function(*(value.astype(np.float32).astype(np.longdouble) for value in values))


@pytest.mark.parametrize(
    ("function", "exact", "span", "stated"),
    [
        ("num_exp2", np.exp2, (-152, 130), 0.86),
        ("num_exp", np.exp, (-105, 90), 1.0),
        ("num_log2", np.log2, (0.25, 4), 0.53),
        ("num_log", np.log, (0.25, 4), 0.52),
        ("num_cbrt", np.cbrt, (-8, 8), 0.51),
        ("num_sin", np.sin, (-1e5, 1e5), 1.5),
        ("num_cos", np.cos, (-1e5, 1e5), 1.5),
    ],
)
def test_functions_of_one_number(
    device: Device, function: str, exact: Callable[..., Floats], span: tuple[float, float], stated: float
) -> None:
    random = np.random.default_rng(1)
    decades = any_float(random, COUNT // 2)
    if function in ("num_sin", "num_cos"):  # beyond it extended precision does not reduce an angle well enough
        decades = decades[np.abs(decades) < 1e5]
    special = SPECIAL[~(np.abs(SPECIAL) >= 1e5) | ~np.isfinite(SPECIAL)]
    inputs = np.concatenate([special, decades, random.uniform(*span, COUNT // 2)])
    hold(device, function, (inputs,), quietly(exact, inputs), stated)


@pytest.mark.parametrize(("function", "exact"), [("num_sin", mpmath.sin), ("num_cos", mpmath.cos)])
def test_huge_angles(device: Device, function: str, exact: Callable[[Any], Any]) -> None:
    random = np.random.default_rng(2)
    inputs = any_float(random, 60_000)
    inputs = np.concatenate([inputs[np.abs(inputs) > 5e4][:4000], float32([LARGEST, -LARGEST, 51471.0, 51471.004])])
    with mpmath.workprec(260):
        wanted = np.array([float(exact(mpmath.mpf(float(value)))) for value in inputs])
    hold(device, function, (inputs,), wanted, 1.5)


@pytest.mark.parametrize(("function", "quarter"), [("num_sinpi", 0), ("num_cospi", 1)])
def test_angles_in_half_turns(device: Device, function: str, quarter: int) -> None:
    random = np.random.default_rng(3)
    inputs = np.concatenate([SPECIAL, any_float(random, COUNT // 2), random.uniform(-10, 10, COUNT // 2)])
    inputs = inputs.astype(np.float32)
    with np.errstate(invalid="ignore"):
        turned = np.fmod(inputs.astype(np.float64), 2.0)  # exact
    quarters = np.rint(2 * turned)
    angle = (turned - quarters / 2).astype(np.longdouble) * np.longdouble("3.14159265358979323846264338328")
    which = (np.nan_to_num(quarters).astype(int) + quarter) % 4
    wanted = np.choose(which, [np.sin(angle), np.cos(angle), -np.sin(angle), -np.cos(angle)])
    hold(device, function, (inputs,), wanted, 1.5)


def test_half_turns_are_exact(device: Device) -> None:
    whole = np.arange(-64, 64, dtype=np.float32)
    assert not evaluate(device, "num_sinpi", whole).any()
    assert not evaluate(device, "num_cospi", whole + np.float32(0.5)).any()


def test_pow(device: Device) -> None:
    random = np.random.default_rng(4)
    base = np.abs(any_float(random, COUNT // 2))
    base[base == 0] = 1
    near = random.uniform(0.5, 2, COUNT // 4)
    unit = random.uniform(0, 1, COUNT // 4)
    x = np.concatenate([base, near, unit]).astype(np.float32)
    logarithm = np.log2(x.astype(np.float64))
    target = random.uniform(-126, 126, x.size)
    y = np.where(np.abs(logarithm) > 1e-30, target / np.where(logarithm == 0, 1, logarithm), 1)
    y[-unit.size :] = random.choice([1 / 2.4, 2.4, 0.1593017578125, 78.84375, 1 / 78.84375], unit.size)
    hold(device, "num_pow", (x, y), quietly(np.power, x, y), 2.0)


@pytest.mark.parametrize("y", [1 / 2.4, 1 / 2.2, 0.1593017578125, 1.0, 2.0, 2.4, 4.0, 5.0, -0.2, -1 / 1.2, -1.0])
def test_fast_pow(device: Device, y: float) -> None:
    random = np.random.default_rng(5)
    far = min(30.0, 120 / abs(y))
    x = np.concatenate([2.0 ** random.uniform(-far, far, COUNT // 14), random.uniform(0, 2, COUNT // 14)])
    power = np.full(x.size, y)
    hold(device, "num_pow_fast", (x, power), quietly(np.power, x, power), 1.0 + abs(y))


@pytest.mark.parametrize(
    ("function", "y", "stated"),
    [("num_pow_12_5", 12 / 5, 2.6), ("num_pow_11_5", 11 / 5, 2.6), ("num_pow_5_12", 5 / 12, 2.1)],
)
def test_powers_of_displays(device: Device, function: str, y: float, stated: float) -> None:
    random = np.random.default_rng(5)
    x = np.concatenate([np.abs(any_float(random, COUNT // 2)), random.uniform(0, 2, COUNT // 2), SPECIAL[SPECIAL >= 0]])
    x = np.abs(x).astype(np.float32)
    x[(x < 1e-15) & (y > 1)] = 0  # the result would lie below 2^-126
    with np.errstate(over="ignore"):
        wanted = np.power(x.astype(np.longdouble), np.longdouble(y))
    hold(device, function, (x,), wanted, stated)
    assert evaluate(device, function, np.ones(1, np.float32)) == 1
    assert np.isnan(evaluate(device, function, float32([np.nan])))


def test_powers_at_the_edge(device: Device) -> None:
    bases = [0.0, 1e-45, 0.5, 1.0, 2.0, 3e38, np.inf]
    x, y = (axis.ravel().astype(np.float32) for axis in np.meshgrid(bases, [-200, -2, -1e-45, 0, 0.5, 2, 200]))
    hold(device, "num_pow", (x, y), quietly(np.power, x, y), 2.0)
    for undefined in ([np.nan, 2.0], [np.nan, 0.0], [-1.0, 2.0], [-0.5, 0.5], [2.0, np.nan], [-np.inf, 1.0]):
        assert np.isnan(evaluate(device, "num_pow", *float32(undefined).reshape(2, 1)))
    x = float32([0, 1e-45, 1e-38, np.inf, LARGEST, np.nan, -1, 1])
    found = evaluate(device, "num_pow_fast", x, np.full(x.size, 2.4, np.float32))
    assert np.array_equal(found, [0, 0, 0, np.inf, np.inf, np.nan, 0, 1], equal_nan=True)


def test_atan2(device: Device) -> None:
    random = np.random.default_rng(6)
    edge = float32([0.0, -0.0, 1, -1, 1e-45, -1e-45, LARGEST, np.inf, -np.inf, np.nan])
    edges = [axis.ravel() for axis in np.meshgrid(edge, edge)]
    y, x = (
        np.concatenate([special, any_float(random, COUNT // 2), random.normal(size=COUNT // 2)]) for special in edges
    )
    hold(device, "num_atan2", (y, x), quietly(np.arctan2, y, x), 1.5)
    got, wanted = evaluate(device, "num_atan2", *edges), quietly(np.arctan2, *edges)
    known = ~np.isnan(got)
    assert np.array_equal(np.signbit(got[known]), np.signbit(wanted[known]))


def test_selection_keeps_nan(device: Device) -> None:
    values = float32([np.nan, -np.inf, -1, -0.5, 0, 0.5, 1, 2, np.inf])
    a, b = (axis.ravel() for axis in np.meshgrid(values, values))
    for width in WIDTHS:
        assert np.array_equal(evaluate(device, "num_min", a, b, width=width), np.minimum(a, b), equal_nan=True)
        assert np.array_equal(evaluate(device, "num_max", a, b, width=width), np.maximum(a, b), equal_nan=True)
        clamped = evaluate(device, "clamp_to_unit", values, width=width)
        assert np.array_equal(clamped, np.clip(values, 0, 1), equal_nan=True)
