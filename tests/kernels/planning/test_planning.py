"""The passes, on graphs built by hand: what they add, drop and choose, and what they refuse."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.calibration.sweep import backends
from lichen.errors import Unattainable
from lichen.image import Alpha, Extent, Image, Space
from lichen.operation import Facts
from lichen.planning.graph import FREE, Asked, Graph, Node, Output, Request
from lichen.planning.plan import make_plan

PICTURE = Facts(64, 96, 3, Space.SRGB, Alpha.NONE, Extent(0.0, 1.0, 0))


def node(name: str, operation: str, source: str, asked: Asked = FREE, **parameters: Any) -> Node:
    declared = lichen.operations()[operation]
    return Node(name, declared, declared.validate(parameters), {declared.inputs[0].name: source}, asked=asked)


def chain(*nodes: Node, facts: Facts = PICTURE) -> Graph:
    return Graph.of({"in": facts}, nodes, nodes[-1].name)


def steps(graph: Graph, space: Space | None = None, **asked: Any) -> list[str]:
    graph = graph.replace(outputs={"result": Output(graph.output, space=space)})
    plan = make_plan(graph, Request(**{"max_error": 1e-2, **asked}))
    return [f"{step.operation.name}:{getattr(step.parameters, 'direction', '')}".rstrip(":") for step in plan.nodes]


def test_linear_operations_are_wrapped_in_conversions() -> None:
    graph = chain(node("blur", "gaussian", "in", sigma=2))
    assert steps(graph) == ["transfer:decode", "gaussian", "transfer:encode"]


def test_straight_coverage_is_associated_in_linear_light() -> None:
    graph = chain(
        node("blur", "gaussian", "in", sigma=2), facts=dataclasses.replace(PICTURE, channels=4, alpha=Alpha.STRAIGHT)
    )
    assert steps(graph) == ["transfer:decode", "premultiply", "gaussian", "premultiply", "transfer:encode"]


def test_conversions_between_linear_operations_cancel() -> None:
    facts = dataclasses.replace(PICTURE, channels=4, alpha=Alpha.STRAIGHT)
    graph = chain(node("a", "gaussian", "in", sigma=2), node("b", "gaussian", "a", sigma=3), facts=facts)
    expected = ["transfer:decode", "premultiply", "gaussian", "gaussian", "premultiply", "transfer:encode"]
    assert steps(graph) == expected


def test_asking_for_linear_output_saves_the_way_back() -> None:
    graph = chain(node("blur", "gaussian", "in", sigma=2))
    assert steps(graph, space=Space.LINEAR) == ["transfer:decode", "gaussian"]


def test_data_is_never_converted() -> None:
    facts = dataclasses.replace(PICTURE, space=Space.DATA)
    assert steps(chain(node("blur", "gaussian", "in", sigma=2), facts=facts), space=Space.SRGB) == ["gaussian"]


def test_identity_drops_the_conversions_with_the_operation() -> None:
    graph = chain(node("none", "gaussian", "in", sigma=0))
    assert steps(graph) == []
    assert steps(graph, prune=False) == ["transfer:decode", "gaussian", "transfer:encode"]


def test_unread_nodes_are_dropped_and_named() -> None:
    graph = Graph.of(
        {"in": PICTURE},
        (node("used", "gaussian", "in", sigma=2), node("idle", "gaussian", "in", sigma=3)),
        "used",
    )
    plan = make_plan(graph, Request(max_error=1e-2))
    assert [decision.node for decision in plan.decisions if decision.pass_ == "unread"] == ["idle"]
    assert all(step.name != "idle" for step in plan.nodes)


def test_a_chain_of_identities_reads_the_source() -> None:
    graph = chain(node("a", "gaussian", "in", sigma=0), node("b", "gaussian", "a", sigma=0))
    assert make_plan(graph, Request()).graph.output == "in"


@pytest.mark.parametrize("asked", [1e-1, 1e-2, 1e-3, 1e-4])
def test_the_choice_meets_the_asked_error_and_nothing_cheaper_does(asked: float) -> None:
    graph = chain(node("blur", "gaussian", "in", sigma=6), facts=dataclasses.replace(PICTURE, space=Space.DATA))
    plan = make_plan(graph, Request(max_error=asked))
    assert plan.error.value <= asked
    (step,) = plan.nodes
    assert step.choice is not None
    for offer in step.alternatives:
        assert offer.unfit or offer.error.value > asked or offer.seconds >= step.choice.seconds


def test_more_time_buys_less_error() -> None:
    graph = chain(node("blur", "gaussian", "in", sigma=6), facts=Facts(2000, 2000, 3))
    cheapest = make_plan(graph, Request(max_error=0.9)).seconds * 1e3
    tight = make_plan(graph, Request(max_ms=cheapest * 1.01))
    ample = make_plan(graph, Request(max_ms=cheapest * 10))
    assert tight.seconds * 1e3 <= cheapest * 1.01
    assert ample.error.value < tight.error.value


def test_errors_that_grow_beyond_all_numbers_still_give_a_plan() -> None:
    """A power whose slope at black has no bound, many times over."""
    kinds = (("box", {"width": 3, "height": 3}), ("levels", {"gamma": 1.5}))
    names = ["in", *(f"n{i}" for i in range(64))]
    nodes = [node(names[i + 1], kinds[i % 2][0], names[i], **kinds[i % 2][1]) for i in range(64)]
    plan = make_plan(chain(*nodes, facts=dataclasses.replace(PICTURE, space=Space.DATA)), Request())
    assert len(plan.nodes) >= 32


def test_what_cannot_be_met_is_refused_with_the_best_there_is() -> None:
    graph = chain(node("blur", "gaussian", "in", sigma=6))
    with pytest.raises(Unattainable) as error:
        make_plan(graph, Request(max_error=1e-12))
    assert error.value.limit is not None
    assert make_plan(graph, Request(max_error=error.value.limit)).error.value <= error.value.limit
    with pytest.raises(Unattainable) as time:
        make_plan(graph, Request(max_ms=1e-9))
    assert time.value.limit is not None
    assert make_plan(graph, Request(max_ms=time.value.limit * 1.0001)).seconds * 1e3 <= time.value.limit * 1.0001


def test_errors_before_a_conversion_grow_with_its_slope() -> None:
    """An error in linear light is up to 12.92 times as large after sRGB encoding."""
    linear = make_plan(chain(node("blur", "gaussian", "in", Asked(knobs={"tail": 1e-2}), sigma=6)), Request())
    assert linear.error.value > 12 * 2e-3


def test_digest_follows_what_decides_the_bytes() -> None:
    image = np.random.default_rng(1).random((8, 8, 1), dtype=np.float32)
    digests = {
        lichen.explain("gaussian", image, device="numpy", **arguments).digest
        for arguments in ({"sigma": 2}, {"sigma": 3}, {"sigma": 2, "border": "clamp"}, {"sigma": 2, "tail": 1e-2})
    }
    assert len(digests) == 4
    assert lichen.explain("gaussian", image, sigma=2).digest == lichen.explain("gaussian", image, sigma=2.0).digest


def test_nonfinite_policies() -> None:
    pixels = np.ones((5, 5, 1), np.float32)
    pixels[2, 2] = np.nan
    with pytest.raises(lichen.errors.NonfiniteInput):
        lichen.run("gaussian", pixels, sigma=1, nonfinite="reject")
    assert lichen.run("gaussian", pixels, sigma=1, nonfinite="repair").nonfinite == 0
    assert lichen.run("gaussian", pixels, sigma=1).nonfinite > 0


def test_linear_light_gives_the_mean_of_light() -> None:
    """A checkerboard of black and white blurred away is 187.5 of 255 in sRGB, not 127.5."""
    board = (np.indices((64, 64)).sum(0) % 2).astype(np.float32)[..., None]
    image = Image(np.repeat(board, 3, 2), Space.SRGB)
    result = lichen.run("gaussian", image, sigma=20, border="wrap")
    np.testing.assert_allclose(result.image.pixels * 255, 187.516, atol=0.01)


def test_where_nothing_meets_the_quantum_the_customary_method_runs() -> None:
    """White noise along any field: no method can promise a quarter of a code."""
    field = np.ones((32, 32, 2), np.float32)
    assert lichen.explain("lic", field, storage="uint8").method == "rk2; step=1"
    assert lichen.explain("lic", field, storage="uint8", method="rk4").method == "rk4; step=0.25"


def test_where_rounding_between_definitions_is_too_much_all_is_done_in_doubles() -> None:
    """Encoding enlarges what is rounded before it in dark places thirteen times."""
    image = Image(np.random.default_rng(3).random((48, 40, 3), np.float32), Space.SRGB)
    coarse, fine = (lichen.run("gaussian", image, sigma=6, max_error=error) for error in (1e-3, 1e-6))
    assert fine.method == "truth" != coarse.method
    assert (fine.device, coarse.device) == ("numpy", backends()[0])
    linear = lichen.run("gaussian", image, sigma=6, max_error=1e-5)
    assert (linear.method, linear.device) == ("truth", "numpy")  # the conversions around it are not what was asked for
    assert fine.error.value <= 1e-6
    truth = lichen.evaluate_truth("gaussian", image, sigma=6)
    assert np.abs(fine.image.pixels - truth).max() <= fine.error.value
    with pytest.raises(Unattainable):
        lichen.run("gaussian", image, sigma=6, max_error=1e-15)
    with pytest.raises(Unattainable):
        lichen.run("gaussian", image, sigma=6, max_error=1e-6, method="fir")
