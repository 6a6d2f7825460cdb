"""Inputs on which a careless transfer function goes wrong, and what must hold for every method on every backend.

The tolerances leave room for the smallest table; how close each method comes is tested elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lichen.image import Alpha, Image
from lichen.memory import Array
from lichen.operation import HardCase

Holds = Callable[[Mapping[str, Any], Array], str | None]


def _row(*values: float) -> Callable[[], Mapping[str, Any]]:
    """A picture of one row and one channel."""
    return lambda: {"image": np.array(values, dtype=np.float32).reshape(1, -1, 1)}


def _around(value: float, steps: int = 8) -> Callable[[], Mapping[str, Any]]:
    """The float32 neighbours of a value, `steps` on each side."""
    centre = int(np.float32(value).view(np.int32))
    bits = np.arange(centre - steps, centre + steps + 1, dtype=np.int32)
    return lambda: {"image": bits.view(np.float32).reshape(1, -1, 1)}


def _close(*expected: float, relative: float = 1e-3, absolute: float = 1e-3) -> Holds:
    """Each sample is near what is expected; where that is NaN or infinite, the same."""

    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1).astype(np.float64)
        if not np.allclose(got, expected, rtol=relative, atol=absolute, equal_nan=True):
            return f"expected {list(expected)}, got {got.tolist()}"
        return None

    return holds


def _near(value: float, absolute: float) -> Holds:
    """Every sample is within `absolute` of one value."""

    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        worst = float(np.abs(pixels.astype(np.float64) - value).max())
        return None if worst <= absolute else f"differs from {value} by {worst:.3g}"

    return holds


def _bt709_gap(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Below 0.018 the toe, from 0.018 on the power, which starts 2.5e-4 higher."""
    light = inputs["image"].astype(np.float64)
    expected = np.where(light < 0.018, 4.5 * light, 0.0812479)
    worst = float(np.abs(pixels - expected).max())
    return None if worst <= 6e-5 else f"a sample took the wrong side of the gap: off by {worst:.3g}"


def _odd(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """The second half of the row, the negated first, gives the negated result."""
    first, second = np.split(pixels.reshape(-1), 2)
    return None if np.array_equal(first, -second) else "f(-x) is not -f(x)"


def _untouched_coverage() -> Mapping[str, Any]:
    """RGBA with NaN, infinite, negative and large coverage; 19 pixels, so that no vector ends with a row."""
    random = np.random.default_rng(7)
    pixels = random.uniform(-0.5, 1.5, (3, 19, 4)).astype(np.float32)
    pixels[0, :4, 3] = np.nan, np.inf, -1.0, 1e30
    return {"image": Image(pixels, alpha=Alpha.STRAIGHT)}


def _coverage_holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    before, after = inputs["image"].pixels[..., 3], pixels[..., 3].astype(np.float32)
    return None if np.array_equal(before, after, equal_nan=True) else "the coverage channel changed"


NAN, INF = math.nan, math.inf
DECODE: Mapping[str, Any] = {"direction": "decode"}
ENCODE: Mapping[str, Any] = {"direction": "encode"}
PQ: Mapping[str, Any] = {"curve": "pq", "white": 10000}
POWERS = _row(0.0, 0.25, 1.0, 7.0, 0.0, -0.25, -1.0, -7.0)

CASES = (
    HardCase(
        "srgb decode knee", "two formulas meet at 0.04045",
        _around(0.04045), DECODE, _near(0.0031308, 1e-6),
    ),
    HardCase(
        "srgb encode knee", "two formulas meet at 0.0031308",
        _around(0.0031308), ENCODE, _near(0.04045, 1e-5),
    ),
    HardCase(
        "bt709 encode knee", "the printed constants leave a gap of 2.5e-4 at 0.018",
        _around(0.018), {"curve": "bt709", **ENCODE}, _bt709_gap,
    ),
    HardCase(
        "bt709 decode gap", "no light gives a signal between 0.081 and 0.08125",
        _row(0.081, 0.0811, 0.0812), {"curve": "bt709", **DECODE}, _near(0.018, 1e-6),
    ),
    HardCase(
        "hlg knee", "a root and a logarithm meet at 1/12",
        _around(1 / 12), {"curve": "hlg", **ENCODE}, _near(0.5, 1e-5),
    ),
    HardCase(
        "hlg ends", "the root's slope is infinite at 0; 1 is the end of the standard's domain",
        _row(0.0, 1.0), {"curve": "hlg", **ENCODE}, _close(0.0, 1.0, absolute=1e-6),
    ),
    HardCase(
        "negative values mirrored", "a power of a negative number is NaN",
        POWERS, ENCODE, _odd,
    ),
    HardCase(
        "negative values of pq mirrored", "colour libraries give 106.7 for -1",
        POWERS, {**PQ, **DECODE}, _odd,
    ),
    HardCase(
        "negative values clamped", "-0.0 and negative infinity are no light either",
        _row(-0.0, -1e-30, -0.5, -7.0, -INF), {"negative": "clamp", **ENCODE}, _close(0, 0, 0, 0, 0, absolute=0),
    ),
    HardCase(
        "all zero", "log2(0)",
        _row(*([0.0] * 40)), {"curve": "gamma", **ENCODE}, _close(*([0.0] * 40), absolute=0),
    ),
    HardCase(
        "denormals", "the exponent field of a denormal is not its exponent",
        _row(1e-45, 1e-40, -1e-40), {"curve": "gamma", **ENCODE}, _close(0, 0, 0),
    ),
    HardCase(
        "huge light", "1e30 is a value like others",
        _row(1e30, -1e30), ENCODE, _close(3.336219e12, -3.336219e12, relative=1e-5),
    ),
    HardCase(
        "light beyond float32", "1e66 is infinite in float32 and must not wrap around",
        _row(1e30, -1e30, 2.0), {"curve": "gamma", **DECODE}, _close(INF, -INF, 2.0**2.2),
    ),
    HardCase(
        "nan and infinity", "NaN stays NaN where comparisons choose a branch",
        _row(NAN, INF, -INF, 0.5), DECODE, _close(NAN, INF, -INF, 0.2140411),
    ),
    HardCase(
        "nan and infinity in pq", "the quotient is infinity over infinity; colour management gives 1.547 and 7e-7",
        _row(NAN, INF, -INF, 1.0), {**PQ, **ENCODE}, _close(NAN, 1.99206, -1.99206, 1.0),
    ),
    HardCase(
        "pq ends", "black is a signal of 7.3e-7, not 0; below it there is no light",
        _row(0.0, 7e-7, 1.0, 1.1), {**PQ, **DECODE}, _close(0.0, 0.0, 1.0, 2.6556252),
    ),
    HardCase(
        "pq beyond its pole", "the quotient's denominator changes sign at 1.992",
        _row(1.85, 1.99205, 1.9920601, 2.0, 1e30, INF, NAN), {**PQ, **DECODE}, _close(*([1e6] * 5), INF, NAN),
    ),
    HardCase(
        "coverage", "a channel that is not colour",
        _untouched_coverage, DECODE, _coverage_holds,
    ),
)  # fmt: skip
