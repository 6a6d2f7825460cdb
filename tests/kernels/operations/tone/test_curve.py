"""Curves through points against SciPy, and the bounds of their tables."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Alpha, Image
from lichen.operations.tone.curve import Parameters, pieces
from lichen.operations.tone.pieces import tabulated, through

BACKENDS = ("opencl", "numpy")


def random_points(seed: int, count: int) -> tuple[tuple[float, float], ...]:
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.uniform(0.01, 1, count))
    x /= x[-1]
    y = rng.choice([rng.random(count), np.sort(rng.random(count)), np.round(rng.random(count))])
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


@pytest.mark.parametrize("count", [3, 4, 9, 40, 256])
@pytest.mark.parametrize("seed", range(4))
def test_truth_is_scipys_monotone_cubic(seed: int, count: int) -> None:
    points = random_points(seed, count)
    x, y = np.array(points).T
    where = np.linspace(x[0], x[-1], 3001)
    np.testing.assert_allclose(through(points, False)(where), PchipInterpolator(x, y)(where), atol=1e-13)
    np.testing.assert_allclose(through(points, True)(where), np.interp(where, x, y), atol=1e-13)


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("cells", [16, 100, 1024])
def test_chords_keep_the_tables_bound(cells: int, straight: bool) -> None:
    for seed in range(12):
        points = random_points(seed, 3 + 5 * seed)
        shape, bound = through(points, straight), tabulated(points, straight, cells).bound
        edges = np.linspace(shape.knots[0], shape.knots[-1], cells + 1)
        where = np.linspace(shape.knots[0], shape.knots[-1], 100_001)
        found = float(np.abs(np.interp(where, edges, shape(edges)) - shape(where)).max())
        assert found <= bound * (1 + 1e-9) + 1e-14
        assert bound <= 60 * found + 1e-9, "a bound that says nothing"


def test_steepest_slope_is_found() -> None:
    for seed in range(10):
        shape = through(random_points(seed, 12), False)
        where = np.linspace(shape.knots[0], shape.knots[-1], 200_001)
        found = float(np.abs(np.diff(shape(where)) / np.diff(where)).max())
        assert found * 0.999 <= shape.steepest <= found * 1.02


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_channel_changes_and_the_others_do_not(backend: str) -> None:
    pixels = np.random.default_rng(1).random((19, 23, 4)).astype(np.float32)
    image = Image(pixels, alpha=Alpha.STRAIGHT)
    points = [[0, 0.5], [0.5, 0.6], [1, 1]]
    for method in ("exact", "table"):
        got = lichen.run("curve", image, points=points, channel=1, method=method, device=backend).image.pixels
        np.testing.assert_array_equal(got[..., [0, 2, 3]], pixels[..., [0, 2, 3]])
        expected = PchipInterpolator(*np.array(points).T)(pixels[..., 1])
        np.testing.assert_allclose(got[..., 1], expected, atol=1e-3 if method == "table" else 1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_goes_on_straight_beyond_its_ends(backend: str) -> None:
    points = ((0.0, 0.1), (0.3, 0.6), (1.0, 0.9))
    first, last = pieces(Parameters(points=points)).first, pieces(Parameters(points=points)).last
    x = np.array([[-3.0, -1.0, 2.0, 9.0]], np.float32)
    got = lichen.run("curve", x, points=points, beyond="extend", method="exact", device=backend).image.pixels
    expected = [0.1 - 3 * first[1], 0.1 - first[1], 0.9 + last[1], 0.9 + 8 * last[1]]
    np.testing.assert_allclose(got.reshape(-1), expected, rtol=1e-6)


@pytest.mark.parametrize(
    "values",
    [
        {"points": [[0, 0]]},
        {"points": [[0, 0], [0, 1]]},
        {"points": [[1, 0], [0, 1]]},
        {"points": [[0, 0], [1, 1], [1 + 1e-7, 2]]},
        {"points": "[[0, 0], [1"},
        {"channel": 3},
    ],
    ids=str,
)
def test_points_that_draw_nothing_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("curve", np.zeros((2, 2, 3), np.float32), **values)
    assert caught.value.flaws


def test_identity_is_found_only_where_it_is_one() -> None:
    ramp = np.linspace(-1, 2, 60, dtype=np.float32).reshape(6, 10, 1)
    straight = lichen.run("curve", ramp, points=[[0, 0], [0.5, 0.5], [1, 1]], beyond="extend")
    np.testing.assert_array_equal(straight.image.pixels, ramp)
    held = lichen.run("curve", ramp, points=[[0, 0], [1, 1]])
    np.testing.assert_allclose(held.image.pixels, np.clip(ramp, 0, 1), atol=1e-6)
