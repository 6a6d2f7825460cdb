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


SHRUNK = [[0.35, 0.12, -3.0], [-0.04, 0.45, 2.0], [0.0003, 0.0004, 1.0]]
PLACED: list[tuple[str, dict[str, Any]]] = [
    ("homography", {"matrix": SHRUNK}),
    ("homography", {"matrix": SHRUNK, "border": "reflect", "inverse": True}),
    ("homography", {"matrix": [[1.05, 0.12, -3.0], [-0.04, 0.95, 2.0], [0.0003, 0.0004, 1.0]], "border": "clamp"}),
    ("affine", {"matrix": [[0.1, 0.02, 30.0], [0.0, 0.3, 20.0]], "value": 0.3}),
    ("affine", {"matrix": [[1, 0, 0.5], [0, 1, 0]], "border": "wrap"}),
    ("rotate", {"angle": 90, "expand": True}),
    ("rotate", {"angle": 33, "border": "clamp"}),
    ("lens_distort", {"k": [-0.25, 0.06]}),
    ("arrange", {"left": 7, "top": -5, "right": -3, "transpose": True, "flip": "both", "border": "reflect101"}),
    ("arrange", {"flip": "horizontal", "tile": [2, 1], "value": 0.5}),
    ("resize", {"scale": [0.3, 1.7]}),
    ("resize", {"width": 210, "border": "constant", "value": 0.2}),
]
"""Operations that say themselves how a part is made, with what keeps it small."""
LARGE = np.random.default_rng(6).random((220, 300, 3), dtype=np.float32)


@pytest.mark.parametrize(("name", "parameters"), PLACED)
def test_what_depends_on_where_a_pixel_lies_gives_the_same_bits(name: str, parameters: dict[str, Any]) -> None:
    """By every method, amid the result and at its corner, findings included; NaN reach as far as they did."""
    image = Image(LARGE.copy())
    image.pixels[100:110, 150] = np.nan
    operation = OPERATIONS[name]
    size = operation.result(operation.validate(parameters), {"image": Facts.of(image)})
    for method in operation.methods:
        narrowed = 0
        for crop in ([size.width // 2, size.height // 3, 9, 7], [0, size.height - 5, 4, 5]):
            node = {"operation": name, "parameters": parameters, "method": method}
            said = {"nodes": {"a": node}, "outputs": {"x": {"node": "a", "crop": crop}}}
            part, full = (prepare_pipeline(said, image, device="opencl", prune=prune) for prune in (True, False))
            found, expected = part.run()["x"], full.run()["x"]
            np.testing.assert_array_equal(found.image.pixels, expected.image.pixels, err_msg=f"{method} {crop}")
            if "part" not in found.findings.get("a", {}):
                assert found.findings == expected.findings
            narrowed += sum(each.pass_ == "region" for each in part.plan.decisions)
        assert narrowed == (0 if method == "shears" else 2), method


def test_a_warp_reads_what_it_shows() -> None:
    """The blur of a large warp, asked for in part, is made of a part of the source; and says so."""
    image = Image(np.zeros((2048, 2048, 1), np.float32))
    said = {
        "nodes": {
            "warp": {
                "operation": "homography",
                "parameters": {"matrix": [[1.02, 0.05, -20], [-0.03, 0.98, 15], [1e-6, 2e-6, 1]]},
            },
            "blur": {"operation": "gaussian", "parameters": {"sigma": 8}, "inputs": {"image": "warp"}},
        },
        "outputs": {"x": {"node": "blur", "crop": [1000, 400, 256, 256]}},
    }
    plan = lichen.explain_pipeline(said, image, device="numpy")
    across, down = sizes(plan)["input.image.crop"]
    assert max(across, down) < 600
    assert max(sizes(plan)["warp"]) <= 256 + 2 * 9 * 8  # to nine standard deviations
    assert [each.node for each in plan.decisions if each.pass_ == "region"] == ["warp", "blur"]
    said_ = next(node for node in plan.to_json()["nodes"] if node["name"] == "warp")["parameters"]["place"]
    assert said_["source"][2:] == [across, down]
    assert said_["result_size"] == [2048, 2048]
    behind = {**said, "outputs": {"x": {"node": "blur", "crop": [0, 0, 8, 8]}}}
    behind["nodes"]["warp"]["parameters"] = {"matrix": [[1, 0, 0], [0, 0.3, 6], [0, 0.125, -1]], "inverse": True}
    assert sizes(lichen.explain_pipeline(behind, image, device="numpy"))["warp"] == (2048, 2048)


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


def test_what_is_read_at_other_places_is_not_cut_with_the_picture() -> None:
    """A projector's slide may be as large as the picture, and is no part of it all the same."""
    rng = np.random.default_rng(6)
    size = 12, 20
    x, y = np.meshgrid(np.linspace(-1, 1, size[1]), np.linspace(-1, 1, size[0]))
    given = {
        "normal": np.broadcast_to(np.array([0, 0, 1], np.float32), (*size, 3)).copy(),
        "position": np.stack([x, y, 0 * x - 3], axis=-1).astype(np.float32),
        "slide": rng.random((*size, 3), dtype=np.float32),
    }
    lamp = {"kind": "projector", "position": [0, 0, 0], "direction": [0, 0, -1], "fov": 60}
    said = {
        "nodes": {
            "lit": {
                "operation": "lighting",
                "parameters": {"lights": [lamp], "model": "lambert"},
                "inputs": {name: f"input.{name}" for name in given},
            }
        },
        "outputs": {"x": {"node": "lit", "crop": [11, 6, 5, 4]}},
    }
    pruned, whole = (
        lichen.run_pipeline(said, images=given, device="numpy", prune=prune)["x"].image.pixels
        for prune in (True, False)
    )
    assert whole.any()
    np.testing.assert_array_equal(pruned, whole)
