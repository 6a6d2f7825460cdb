"""Crops on their way to the sources: the same pixels from less work."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.accuracy.metrics import difference
from lichen.engine import prepare_pipeline
from lichen.errors import InvalidRequest
from lichen.execution import exact
from lichen.image import Image, Space
from lichen.operation import Facts, Operation
from lichen.planning.graph import Node
from lichen.planning.region import needed, region, whole

OPERATIONS = dict(lichen.operations())
PICTURE = Image(np.random.default_rng(5).random((60, 80, 3), dtype=np.float32), Space.SRGB)
CROP = [70, 5, 8, 9]


def cropped(*nodes: dict[str, Any], crop: Any = CROP, **wish: Any) -> lichen.Plan:
    names = [f"n{number}" for number in range(len(nodes))]
    chain = {
        name: {**each, "inputs": each.get("inputs", {"image": names[number - 1] if number else "input.image"})}
        for number, (name, each) in enumerate(zip(names, nodes, strict=True))
    }
    said = {"nodes": chain, "outputs": {"x": {"node": names[-1], "crop": crop}}}
    return lichen.explain_pipeline(said, PICTURE, **{"device": "numpy", **wish})


def sizes(plan: lichen.Plan) -> dict[str, tuple[int, int]]:
    facts = plan.graph.facts()
    return {node.name: (facts[node.name].width, facts[node.name].height) for node in plan.nodes}


BLUR = {"operation": "gaussian", "parameters": {"sigma": 1}}
BOX = {"operation": "box", "parameters": {"width": 5, "height": 3}}
LEVELS = {"operation": "levels", "parameters": {"black": 0.1}}


def test_a_pointwise_chain_is_computed_where_it_is_wanted() -> None:
    plan = cropped(LEVELS, {**LEVELS, "parameters": {"black": 0.2}})
    assert sizes(plan) == {"input.image.crop": (8, 9), "n0": (8, 9), "n1": (8, 9)}
    assert {each.node for each in plan.decisions if each.pass_ == "region"} == {"n0", "n1"}
    assert all(each.saved_ms > 0 for each in plan.decisions if each.pass_ == "region")


def test_footprints_add_up_and_end_at_the_border() -> None:
    plan = cropped(BOX, BOX)
    assert sizes(plan)["n0"] == (14, 13)  # 70 - 4 to the right border; 5 - 2 to 5 + 9 + 2
    assert sizes(plan)["n1"] == (12, 11)


def test_without_pruning_the_crop_comes_last() -> None:
    plan = cropped(BOX, prune=False)
    *before, last = sizes(plan).values()
    assert set(before) == {(80, 60)}
    assert last == (8, 9)


@pytest.mark.parametrize(
    "node",
    [
        {"operation": "mix", "parameters": {"preset": "contrast", "amount": 2}},
        {"operation": "box", "parameters": {"width": 21, "height": 21, "border": "wrap"}},
        {"operation": "equalise"},
    ],
)
def test_what_needs_everything_gets_it(node: dict[str, Any]) -> None:
    plan = cropped(LEVELS, node)
    assert sizes(plan)["n0"] == (80, 60)


def test_two_outputs_share_what_both_need() -> None:
    nodes = {"a": LEVELS, "b": {**BOX, "inputs": {"image": "a"}}}
    said = {
        "nodes": nodes,
        "outputs": {"x": {"node": "a", "crop": [0, 0, 10, 10]}, "y": {"node": "b", "crop": [20, 20, 4, 4]}},
    }
    results = lichen.run_pipeline(said, PICTURE, device="numpy")
    plan = results["x"].plan
    assert sizes(plan)["a"] == (26, 25)
    full = lichen.run("levels", PICTURE, black=0.1, device="numpy").image
    np.testing.assert_allclose(results["x"].image.pixels, full.pixels[:10, :10], atol=1e-6)
    whole_ = lichen.run("box", full, width=5, height=3, device="numpy").image.pixels
    np.testing.assert_allclose(results["y"].image.pixels, whole_[20:24, 20:24], atol=1e-5)


@pytest.mark.parametrize(
    "crop", [[0, 0, 81, 1], [80, 0, 1, 1], [0, 60, 1, 1], [-1, 0, 2, 2], [0, 0, 0, 1], [1, 2, 3], "x", [0.5, 0, 1, 1]]
)
def test_a_crop_lies_inside(crop: Any) -> None:
    with pytest.raises(InvalidRequest) as refused:
        cropped(LEVELS, crop=crop)
    assert [flaw.pointer for flaw in refused.value.flaws] == ["/outputs/x/crop"]


def test_all_of_a_picture_is_no_crop() -> None:
    assert "n0.crop" not in sizes(cropped(LEVELS, crop=[0, 0, 80, 60]))
    facts = Facts.of(PICTURE)
    node = Node("a", OPERATIONS["levels"], OPERATIONS["levels"].validate({}), {"image": "in"})
    known = {"in": facts, "a": facts}
    assert needed(node, known, whole(facts)) is None
    assert needed(dataclasses.replace(node, inputs={}), known, (0, 0, 1, 1)) is None
    assert region.__doc__


@pytest.mark.parametrize("operation", list(OPERATIONS.values()), ids=list(OPERATIONS))
def test_a_part_is_what_it_is_in_the_whole(operation: Operation[Any]) -> None:
    """By definition and by the methods, for every operation of the catalogue that takes the picture."""
    inputs = {each.name: f"input.{each.name}" for each in operation.inputs if each.required}
    images = {
        name: Image(PICTURE.pixels[..., : min(operation.inputs[0].channels[1] or 3, 3)].copy()) for name in inputs
    }
    for example in operation.examples[:2]:
        node = {"operation": operation.name, "parameters": dict(example), "inputs": inputs}
        try:
            whole_ = prepare_pipeline({"nodes": {"a": node}}, images=images, device="numpy", prune=False)
            size = whole_.plan.graph.facts()["a"]
            corner = [size.width // 2, 0, max(size.width // 5, 1), max(size.height // 6, 1)]
            said = {"nodes": {"a": node}, "outputs": {"x": {"node": "a", "crop": corner}}}
            part, full = (prepare_pipeline(said, images=images, device="numpy", prune=p) for p in (True, False))
        except InvalidRequest:
            continue
        if not any(each.pass_ == "region" for each in part.plan.decisions):
            continue  # all of it is computed either way
        truths = [exact(each.plan.graph, each.order.images) for each in (part, full)]
        apart = difference(truths[0], truths[1])
        assert apart.largest <= 1e-9 * max(np.max(np.abs(truths[1])), 1), (example, apart)
        made = [each.run()["x"] for each in (part, full)]
        both = made[0].error.value + made[1].error.value
        assert difference(made[0].image.pixels, made[1].image.pixels).largest <= both + 1e-30
