"""Stores of less precision: what they do to values, what they do to pictures, and that plans foresee it.

The last part repeats what made film and visualisation leave 8-bit frame buffers: line integrals, exponential curves and
repeated accumulation lose a factor of 16 of their error with every four bits.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.accuracy.metrics import difference
from lichen.accuracy.precision import (
    HALF_MAX,
    PRECISIONS,
    Precision,
    keeping,
    kept,
    stored,
    storing_error,
    visible_storing_error,
)
from lichen.errors import InvalidRequest
from lichen.execution import by_definition, computed, exact, walk
from lichen.image import Alpha, Extent, Image, Space, as_image
from lichen.operation import Facts
from lichen.planning.graph import RESULT, Graph, Node, Request
from lichen.planning.plan import make_plan

OPERATIONS = lichen.operations()
LOSSY = [each for each in PRECISIONS if not each.lossless]
FIXED = (Precision.FIXED8, Precision.FIXED12, Precision.FIXED16)

# ------------------------------------------------------------------------------------------------------------- values


@pytest.mark.parametrize("precision", FIXED)
def test_fixed_point_is_the_nearest_code_with_ties_to_even(precision: Precision) -> None:
    levels = precision.levels
    assert levels == 2 ** int(precision[5:]) - 1
    codes = np.arange(min(levels, 4095) + 1, dtype=np.float64)
    exactly = stored(codes / levels, precision)
    assert (np.rint(exactly * levels) == codes).all()
    assert np.abs(exactly - codes / levels).max() < 1e-15
    between = (codes[:-1] + 0.5) / levels
    codes = np.rint(stored(between, precision) * levels)
    ties = (between * levels) % 1 == 0.5
    assert ties.sum() > 100
    assert (codes[ties] % 2 == 0).all()


def test_half_floats_are_rounded_and_saturate() -> None:
    values = np.float32([1 + 2**-11, 1 + 3 * 2**-11, 65519, 65520, 1e30, -1e30, 2**-25, 1.5 * 2**-24])
    halves = stored(values, Precision.FLOAT16)
    assert halves.tolist() == [1, 1 + 2**-9, HALF_MAX, HALF_MAX, HALF_MAX, -HALF_MAX, 0, 2**-23]
    assert halves.dtype == np.float32


@pytest.mark.parametrize("precision", PRECISIONS)
def test_what_is_not_finite_stays(precision: Precision) -> None:
    values = np.float32([np.nan, np.inf, -np.inf])
    np.testing.assert_array_equal(stored(values, precision), values)


def test_nothing_is_copied_where_nothing_is_lost() -> None:
    values = np.float32([0.1, 5])
    assert stored(values, Precision.FLOAT32) is values
    assert stored(values, Precision.FLOAT64) is values
    facts = Facts(2, 2, 1)
    assert keeping(facts, Precision.FLOAT32) is facts


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("span", [(0, 1), (-0.5, 1), (0.2, 3), (-1e-6, 1e-6), (0, 65504), (-7e4, 1e5), (0, 0)])
def test_the_error_of_storing_is_bounded_and_reached(precision: Precision, span: tuple[float, float]) -> None:
    low, high = span
    values = np.random.default_rng(1).uniform(low, high, 200_000).astype(np.float32)
    values = np.append(values, np.float32([low, high]))
    extent = Extent(float(values.min()), float(values.max()), 0)
    found = stored(values, precision)
    error = float(np.abs(found.astype(np.float64) - values).max())
    bound = storing_error(extent, precision)
    assert error <= bound
    if precision in LOSSY and high > 1e-3:
        assert error > 0.45 * bound
    known = keeping(Facts(1, values.size, 1, Space.LINEAR, extent=extent), precision).extent
    assert known.low <= found.min()
    assert found.max() <= known.high


@pytest.mark.parametrize("precision", FIXED)
def test_data_are_kept_with_a_bias_and_a_scale(precision: Precision) -> None:
    """Vectors keep both signs, and depths what lies beyond 1; pictures are clipped, as frame buffers clip them."""
    vectors = as_image(np.random.default_rng(1).uniform(-1, 3, (40, 40, 2)).astype(np.float32))
    result = kept(vectors, precision).pixels
    bound = visible_storing_error(Facts.of(vectors), precision)
    assert 0.45 * bound < np.abs(result.astype(np.float64) - vectors.pixels).max() <= bound
    assert bound == pytest.approx(2 / precision.levels, rel=0.01)
    np.testing.assert_array_equal(kept(vectors.replace(pixels=result), precision).pixels, result)
    picture = vectors.replace(space=Space.LINEAR)
    assert (kept(picture, precision).pixels.min(), kept(picture, precision).pixels.max()) == (0, 1)
    assert visible_storing_error(Facts.of(picture), precision) > 0.9 + 1
    inside = as_image(np.float32([[0.2, 0.7]]))
    np.testing.assert_array_equal(kept(inside, precision).pixels, stored(inside.pixels, precision))


@pytest.mark.parametrize("precision", LOSSY)
def test_colour_and_coverage_of_straight_pictures_are_both_stored(precision: Precision) -> None:
    rng = np.random.default_rng(1)
    pixels = np.concatenate([rng.random((200, 200, 3)), rng.random((200, 200, 1))], axis=2).astype(np.float32)
    image = Image(pixels, alpha=Alpha.STRAIGHT)
    found = difference(stored(pixels, precision), pixels.astype(np.float64), Alpha.STRAIGHT)
    bound = visible_storing_error(Facts.of(image), precision)
    assert 0.2 * bound < found.largest <= bound


# -------------------------------------------------------------------------------------------------------------- runs


@pytest.mark.parametrize("precision", LOSSY)
def test_inputs_and_results_come_from_the_store(precision: Precision) -> None:
    pixels = np.random.default_rng(1).random((20, 30, 3), dtype=np.float32)
    result = lichen.run("gaussian", pixels, sigma=1, precision=precision)
    np.testing.assert_array_equal(stored(result.image.pixels, precision), result.image.pixels)
    plain = lichen.run("gaussian", stored(pixels, precision), sigma=1, method="fir", tail=1e-7)
    assert (
        difference(result.image.pixels, plain.image.pixels).largest
        <= 1.01 * storing_error(Extent(0, 1, 0), precision) + lichen.explain("gaussian", pixels, sigma=1).error.value
    )
    left_out = lichen.run("gaussian", pixels, sigma=0, precision=precision)
    np.testing.assert_array_equal(left_out.image.pixels, stored(pixels, precision))
    assert left_out.error.value == storing_error(as_image(pixels).extent, precision)


def test_plans_say_what_storing_costs() -> None:
    pixels = np.random.default_rng(1).random((20, 30, 3), dtype=np.float32)
    plain = lichen.explain("gaussian", pixels, sigma=1).to_json()
    coarse = lichen.explain("gaussian", pixels, sigma=1, precision="fixed8").to_json()
    assert (plain["precision"], coarse["precision"]) == ("float32", "fixed8")
    assert plain["digest"] != coarse["digest"]
    decision = coarse["decisions"][-1]
    assert (decision["pass"], decision["action"]) == ("precision", "kept in fixed8")
    assert decision["bound"] == pytest.approx(1 / 255, rel=0.01)
    assert coarse["error"]["value"] > decision["bound"]
    assert coarse["error"]["kind"] == plain["error"]["kind"]
    with pytest.raises(InvalidRequest) as caught:
        lichen.run("gaussian", pixels, sigma=1, precision="fixed9")
    assert "fixed8" in caught.value.flaws[0].detail


def test_doubles_are_the_definition_itself() -> None:
    pixels = np.random.default_rng(1).random((20, 30, 3))
    result = lichen.run("gaussian", pixels, sigma=2, precision="float64", max_error=1e-11)
    assert result.method == "truth"
    assert result.image.pixels.dtype == np.float64
    truth = lichen.evaluate_truth("gaussian", pixels, sigma=2)
    assert difference(result.image.pixels, truth).largest <= result.error.value < 1e-11
    for values in ({"method": "fir"}, {"tail": 1e-3}):
        with pytest.raises(InvalidRequest) as caught:
            lichen.run("gaussian", pixels, sigma=2, precision="float64", **values)
        assert caught.value.flaws[0].pointer == "/precision"


def test_what_is_not_finite_is_a_value_to_doubles_and_warns_nobody() -> None:
    endless = np.full((2, 2, 3), np.inf, np.float32)
    made = lichen.run("hue_rotate", endless, angle=30, precision="float64", device="numpy")
    assert not np.isfinite(made.image.pixels).any()


def test_a_stored_field_leaves_nothing_but_the_texture_s_range_to_promise() -> None:
    field = np.random.default_rng(1).random((20, 20, 2), dtype=np.float32)
    texture = np.random.default_rng(2).random((20, 20, 1), dtype=np.float32)
    values = {"texture": texture, "length": 4, "scale": 2, "bias": 0.5}
    for precision in LOSSY:
        result = lichen.run("lic", field, precision=precision, verify=True, **values)
        assert result.measured is not None
        assert result.measured.largest <= result.error.value < 1.02


# ------------------------------------------------------------------------------- eight bits, twelve bits, sixteen bits


def chain(name: str, image: Image, *examples: Mapping[str, Any]) -> Graph:
    nodes, before = [], "input.image"
    for number, example in enumerate(examples):
        operation = OPERATIONS[name]
        nodes.append(Node(f"step{number}", operation, operation.validate(example), {"image": before}))
        before = f"step{number}"
    return Graph.of({"input.image": Facts.of(image)}, tuple(nodes), before)


def accumulation() -> tuple[Graph, dict[str, Image]]:
    image = as_image(np.random.default_rng(3).uniform(0.05, 0.95, (48, 48, 1)).astype(np.float32))
    return chain("gaussian", image, *[{"sigma": 0.6}] * 16), {"input.image": image}


def exponential(curve: str) -> tuple[Graph, dict[str, Image]]:
    image = as_image(np.random.default_rng(3).uniform(0.05, 0.95, (48, 48, 1)).astype(np.float32))
    white = {"white": 10000} if curve == "pq" else {}
    return chain("transfer", image, {"curve": curve, **white}), {"input.image": image}


def streamlines() -> tuple[Graph, dict[str, Image]]:
    y, x = np.mgrid[0:24, 0:24]
    around = np.stack([10.3 - y, x - 12.1], axis=-1) / np.hypot(y - 10.3, x - 12.1)[..., None]
    images = {
        "input.field": as_image((0.5 + 0.45 * around).astype(np.float32)),
        "input.texture": as_image((0.5 + 0.4 * np.sin(0.3 * x + 0.1 * y)).astype(np.float32)),
    }
    lic = OPERATIONS["lic"]
    node = Node(
        "lic",
        lic,
        lic.validate({"length": 6, "scale": 2, "bias": 0.5}),
        {"field": "input.field", "texture": "input.texture"},
    )
    return Graph.of({name: Facts.of(image) for name, image in images.items()}, (node,), "lic"), images


CASES = {
    "line integrals": streamlines,
    "PQ": lambda: exponential("pq"),
    "HLG": lambda: exponential("hlg"),
    "sixteen blurs": accumulation,
}


@pytest.mark.parametrize("case", list(CASES))
def test_four_bits_are_worth_a_factor_of_sixteen(case: str) -> None:
    """Storing alone: everything between is by definition."""
    graph, sources = CASES[case]()
    truth = exact(graph, sources)
    errors = {
        precision: difference(
            walk(graph.replace(precision=precision), sources, by_definition)[RESULT].pixels, truth
        ).rms
        for precision in PRECISIONS
    }
    for coarse, fine in itertools.pairwise(FIXED):
        assert 12 < errors[coarse] / errors[fine] < 24
    assert errors[Precision.FIXED16] < errors[Precision.FLOAT16] < errors[Precision.FIXED8]
    assert errors[Precision.FLOAT32] == errors[Precision.FLOAT64] == 0


@pytest.mark.parametrize("case", [case for case in CASES if case != "line integrals"])
@pytest.mark.parametrize("precision", PRECISIONS)
def test_plans_of_chains_foresee_it(case: str, precision: Precision) -> None:
    graph, sources = CASES[case]()
    plan = make_plan(graph.replace(precision=precision), Request(backend="numpy", target=graph.output))
    found = difference(computed(plan, sources, None, {})[0][RESULT].pixels, exact(graph, sources))
    assert found.largest <= plan.error.value
    if precision in LOSSY:
        assert plan.error.value < 40 * found.largest
