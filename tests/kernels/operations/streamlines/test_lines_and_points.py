"""Flows in closed form, streamlines and critical points against analytic results and SciPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root

import lichen
from lichen.errors import InvalidRequest
from lichen.operations.streamlines.adaptive import DIFFERENCE, NODES, STAGES
from lichen.operations.streamlines.critical_points import zeros
from lichen.operations.streamlines.lines import Grid
from lichen.operations.streamlines.tracing import Tracer
from lichen.operations.streamlines.walker import Walker

Array = np.ndarray
BACKENDS = ("opencl", "numpy")


def made(kind: str, width: int = 48, height: int = 48, backend: str = "opencl", **values: Any) -> Array:
    return lichen.run("field", width=width, height=height, kind=kind, device=backend, **values).image.pixels


def centred(width: int, height: int) -> tuple[Array, Array]:
    y, x = np.mgrid[:height, :width] + 0.5
    short = min(width, height) / 2
    return (x - width / 2) / short, (y - height / 2) / short


def test_findings_are_tables_too() -> None:
    lines = lichen.operations()["streamlines"]
    assert lines.table is not None
    found = lichen.run("streamlines", made("circular"), spacing=9, length=20).findings
    table = lines.table(found)
    pieces = np.split(table[:, 1:], np.flatnonzero(np.diff(table[:, 0])) + 1)
    assert [piece.tolist() for piece in pieces] == [line["points"] for line in found["lines"]]
    assert lines.table({"lines": []}).shape == (0, 3)
    points = lichen.operations()["critical_points"]
    assert points.table is not None
    row = points.table(lichen.run("critical_points", made("circular", strength=24)).findings)
    assert np.allclose(row, [[24, 24, 0, -1, 1, 0]], atol=1e-3)
    assert points.table({"points": []}).shape == (0, 6)


# ------------------------------------------------------------------------------------------------------------- fields


@pytest.mark.parametrize("backend", BACKENDS)
def test_flows_are_what_they_are_called(backend: str) -> None:
    x, y = centred(48, 30)
    for kind, exact in {
        "uniform": (np.ones_like(x), np.zeros_like(x)),
        "circular": (-y, x),
        "saddle": (x, -y),
        "source": (x, y),
    }.items():
        field = made(kind, 48, 30, backend, strength=-2)
        assert np.abs(field - np.float32(-2) * np.stack(exact, axis=-1)).max() < 1e-6
    turned = made("uniform", 4, 4, backend, angle=30)
    assert np.allclose(turned, [np.cos(np.pi / 6), 0.5])


@pytest.mark.parametrize("kind", ["cylinder", "gyre"])
def test_flows_have_no_sources(kind: str) -> None:
    field = made(kind, 400, 200, time=2.5, circulation=2.0).astype(np.float64)
    spacing = (1 / 200, 1 / 200) if kind == "gyre" else (1 / 100, 1 / 100)
    divergence = np.gradient(field[..., 0], spacing[1], axis=1) + np.gradient(field[..., 1], spacing[0], axis=0)
    rest = (field == 0).all(axis=2)
    near = np.array(np.where(rest))
    inner = np.ones(rest.shape, bool)
    if near.size:
        x, y = centred(400, 200)
        inner = np.hypot(x, y) > 0.45
    steep = np.abs(np.gradient(field[..., 0], spacing[1], axis=1)).max()
    assert np.abs(divergence[inner])[2:-2].max() < 0.02 * steep


def test_flow_past_a_cylinder_is_twice_as_fast_beside_it_and_rests_before_it() -> None:
    field = made("cylinder", 801, 801, radius=0.5)
    assert np.hypot(*field[400, 199]) < 0.02
    assert abs(field[199, 400, 0] - 2) < 0.02
    assert (field[400, 400] == 0).all()
    stopped = made("cylinder", 801, 801, radius=0.5, circulation=4 * np.pi * 0.5)
    assert np.hypot(*stopped[601, 400]) < 0.02  # both points of rest meet below


# -------------------------------------------------------------------------------------------------------- convergence


def path_errors(advance: Any, vector: Any, start: Array, exact: Array, length: float, counts: list[int]) -> list[float]:
    found = []
    for count in counts:
        at, h = start.astype(float), length / count
        for _ in range(count):
            at = at + h * advance(vector, at, h)
        found.append(float(np.hypot(*(at - exact))))
    return found


def unit(vector: Array) -> Array:
    return vector / np.hypot(*vector)


def circle(at: Array) -> Array:
    return unit(np.array([-at[1], at[0]]))


def saddle(at: Array) -> Array:
    return unit(np.array([at[0], -at[1]]))


def by_stages(rows: list[tuple[float, ...]], weights: tuple[float, ...]) -> Any:
    def advance(vector: Any, at: Array, h: float) -> Array:
        stages = [vector(at)]
        for row in rows:
            stages.append(vector(at + h * sum(w * k for w, k in zip(row, stages, strict=False))))
        return sum(w * k for w, k in zip(weights, stages, strict=False))

    return advance


RULES = {
    2: by_stages([(0.5,)], (0.0, 1.0)),
    4: by_stages([(0.5,), (0, 0.5), (0, 0, 1)], (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    5: by_stages(list(STAGES[:-1]), STAGES[-1]),
}


@pytest.mark.parametrize("order", [2, 4, 5])
@pytest.mark.parametrize("flow", ["circle", "saddle"])
def test_rules_reach_their_order_on_circles_and_saddles(order: int, flow: str) -> None:
    vector = circle if flow == "circle" else saddle
    start = np.array([20.0, 0.0]) if flow == "circle" else np.array([4.0, 15.0])
    if flow == "circle":
        exact = 20 * np.array([np.cos(1.5), np.sin(1.5)])
    else:
        way = solve_ivp(lambda s, at: saddle(at), (0, 30), start, rtol=1e-13, atol=1e-13, method="DOP853")
        exact = way.y[:, -1]
    length, counts = 30.0, [8, 16, 32] if order > 2 else [16, 32, 64]
    errors = path_errors(RULES[order], vector, start, exact, length, counts)
    fitted = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order - 0.35 < fitted < order + 1.3, (fitted, errors)


def test_the_pair_of_orders_5_and_4_is_consistent() -> None:
    for row, node in zip(STAGES, NODES, strict=True):
        assert sum(row) == pytest.approx(node)
    assert sum(DIFFERENCE) == pytest.approx(0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_smaller_tolerances_and_distances_leave_smaller_errors(backend: str) -> None:
    field, texture = made("gyre", 84, 70, time=2.5), np.random.default_rng(2).random((70, 84), np.float32)
    asked: dict[str, Any] = {"texture": texture, "length": 8, "device": backend}
    exact = lichen.run("lic", field, method="rk4", step=0.125, **{**asked, "device": "opencl"}).image.pixels

    def errors(method: str, knob: str, settings: tuple[float, ...]) -> list[float]:
        found = []
        for setting in settings:
            made = lichen.run("lic", field, method=method, **{knob: setting}, **asked).image.pixels
            found.append(float(np.sqrt(np.square(made - exact).mean())))
        return found

    assert errors("rk45", "tolerance", (0.3, 0.003))[1] < 0.5 * errors("rk45", "tolerance", (0.3,))[0]
    far, near = errors("fastlic", "distance", (0.5, 0.125))
    assert near < 0.85 * far < 0.1
    coarse, fine = errors("fixed", "bits", (6, 12))
    assert fine < 0.7 * coarse


# --------------------------------------------------------------------------------------------------------- streamlines


def test_polylines_are_the_solutions_of_the_field() -> None:
    field = made("cylinder", 96, 64, circulation=1.0).astype(np.float64)
    grid = Grid.of(field)

    def slope(s: float, at: Array) -> Array:
        return unit(grid.at((np.zeros(1, int),) * 2, at[:1] - 0.5, at[1:] - 0.5)[0])

    seed = np.array([20.3, 20.6])
    exact = solve_ivp(slope, (0, 40), seed, rtol=1e-9, atol=1e-9, dense_output=True).sol(np.arange(41)).T
    for found in (Tracer(grid, 40, 1).halves(seed[None], 1.0)[0], Walker(grid, 40, 1).half((20.3, 20.6), 1.0)):
        assert np.abs(found - exact[: len(found)]).max() < 2e-3


def test_one_line_at_a_time_goes_where_many_go() -> None:
    rng = np.random.default_rng(5)
    field = rng.standard_normal((20, 30, 2))
    field[4:6, 8:10] = 0
    grid, seeds = Grid.of(field), rng.uniform((0, 0), (30, 20), (60, 2))
    tracer, walker = Tracer(grid, 12, 0.5), Walker(grid, 12, 0.5)
    for seed, line in zip(seeds, tracer.lines(seeds), strict=True):
        alone = np.concatenate([walker.half(tuple(seed), -1.0)[:0:-1], walker.half(tuple(seed), 1.0)])
        assert alone.shape == line.shape
        assert np.abs(alone - line).max() < 1e-6


@pytest.mark.parametrize("spacing", [6.0, 10.0])
def test_evenly_spaced_lines_keep_their_distance_and_leave_no_gap(spacing: float) -> None:
    result = lichen.run("streamlines", made("gyre", 120, 80, time=2.5), spacing=spacing, length=200)
    lines = [np.array(each["points"]) for each in result.findings["lines"]]
    assert result.findings["count"] == len(lines) > 5
    owner = np.concatenate([np.full(len(line), n) for n, line in enumerate(lines)])
    points = np.concatenate(lines)
    apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    assert apart[owner[:, None] != owner[None]].min() > 0.5 * spacing - 2e-3
    y, x = np.mgrid[4:76:4, 4:116:4]
    gaps = np.hypot(*(np.stack([x, y], axis=-1).reshape(-1, 1, 2) - points[None]).transpose(2, 0, 1)).min(axis=1)
    assert np.quantile(gaps, 0.95) < 1.1 * spacing


def test_given_seeds_and_their_picture() -> None:
    field = np.broadcast_to(np.float32([1, 0]), (16, 32, 2)).copy()
    result = lichen.run("streamlines", field, seeding="points", points=[[10, 8]], length=5, width=2)
    line = np.array(result.findings["lines"][0]["points"])
    assert np.allclose(line, np.stack([np.arange(5, 16), np.full(11, 8)], axis=1))
    exact = np.zeros((16, 32))
    exact[7:9, 5:15] = 1  # centres half a pixel off a pen of radius 1
    assert np.abs(result.image.pixels[6:10, 6:14, 0] - exact[6:10, 6:14]).max() < 1e-5


def test_streamlines_name_what_is_missing_or_too_much() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("streamlines", np.zeros((4, 4, 2)), seeding="points")
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/parameters/points"]


# ----------------------------------------------------------------------------------------------------- critical points


def test_zeros_are_those_that_a_solver_finds() -> None:
    vectors = np.random.default_rng(6).standard_normal((12, 15, 2))
    grid = Grid.of(vectors)
    origin = (np.zeros(1, int),) * 2

    def value(at: Array) -> Array:
        return grid.at(origin, at[:1] - 0.5, at[1:] - 0.5)[0]

    places, jacobians = zeros(vectors)
    for place, jacobian in zip(places, jacobians, strict=True):
        assert np.abs(value(place)).max() < 1e-9
        inside = np.floor(place - 0.5) + 1
        nudge = 1e-6 * np.sign(inside - place)
        slopes = np.stack([(value(place + nudge * axis) - value(place)) / (nudge @ axis) for axis in np.eye(2)], axis=1)
        assert np.abs(slopes - jacobian).max() < 1e-4
    solved = set()
    for start in np.random.default_rng(7).uniform((1, 1), (14, 11), (150, 2)):
        found = root(value, start)
        inside = (found.x > 0.5).all() and (found.x < [14.5, 11.5]).all()
        if found.success and inside and np.abs(value(found.x)).max() < 1e-10:
            solved.add(tuple(np.round(found.x, 5)))
    for each in solved:
        assert np.abs(places - each).max(axis=1).min() < 1e-4


@pytest.mark.parametrize(
    ("matrix", "kind"),
    [
        ([[1, 0], [0, -2]], "saddle"),
        ([[1, 0.5], [0, 2]], "source"),
        ([[-1, 0.5], [0, -2]], "sink"),
        ([[0.2, -1], [1, 0.2]], "outward"),
        ([[-0.2, -1], [1, -0.2]], "inward"),
        ([[0, -1], [1, 0]], "centre"),
    ],
)
@pytest.mark.parametrize("place", [(10.5, 7.5), (10.2, 7.9), (10.0, 7.5)])
def test_linear_fields_have_one_point_of_the_right_kind(matrix: Any, kind: str, place: tuple[float, float]) -> None:
    y, x = np.mgrid[:16, :20] + 0.5
    field = np.stack([x - place[0], y - place[1]], axis=-1) @ np.array(matrix).T
    for size in (1e-30, 1.0, 1e30):
        findings = lichen.run("critical_points", (size * field).astype(np.float32)).findings
        assert findings["counts"][kind] == len(findings["points"]) == 1
        point = findings["points"][0]
        assert (point["x"], point["y"]) == pytest.approx(place, abs=1e-4)
        assert np.allclose(np.array(point["jacobian"]) / size, matrix, atol=1e-4)


# ---------------------------------------------------------------------------------------------------------- calculus


@pytest.mark.parametrize("backend", BACKENDS)
def test_calculus_is_that_of_numpy(backend: str) -> None:
    rng = np.random.default_rng(9)
    picture, field = rng.random((17, 23, 3), np.float32), rng.standard_normal((17, 23, 2)).astype(np.float32)

    def vector(image: Array, **values: Any) -> Array:
        return lichen.run("vector", image, device=backend, **values).image.pixels.astype(np.float64)

    down, right = np.gradient(picture.mean(axis=2, dtype=np.float64))
    assert np.abs(vector(picture, make="gradient") - np.stack([right, down], axis=-1)).max() < 1e-6
    assert np.abs(vector(picture) - np.stack([-down, right], axis=-1)).max() < 1e-6
    u, v = np.gradient(field[..., 0].astype(float)), np.gradient(field[..., 1].astype(float))
    assert np.abs(vector(field, make="curl")[..., 0] - (v[1] - u[0])).max() < 1e-6
    assert np.abs(vector(field, make="divergence")[..., 0] - (u[1] + v[0])).max() < 1e-6
    turned = (field[..., 0] + 1j * field[..., 1]) * np.exp(1j * np.radians(40))
    assert np.abs(vector(field, make="rotate", angle=40) - np.stack([turned.real, turned.imag], axis=-1)).max() < 1e-6
    assert np.abs(np.hypot(*np.moveaxis(vector(field, make="normalise"), -1, 0)) - 1).max() < 1e-6


def test_curl_needs_components() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("vector", np.zeros((4, 4, 1)), make="curl")
    assert [flaw.pointer for flaw in caught.value.flaws] == ["/inputs/image"]
