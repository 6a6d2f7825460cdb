"""Pipelines run: on the road of single operations, with every flaw found before a pixel is read."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest, TooLarge, Unattainable
from lichen.image import Alpha, Image, Space

PICTURE = Image(np.random.default_rng(5).random((24, 31, 3), dtype=np.float32), Space.SRGB)
BLUR = {"operation": "gaussian", "parameters": {"sigma": 2}}


@pytest.mark.parametrize("device", ["opencl", "numpy"])
@pytest.mark.parametrize("asked", [{}, {"max_error": 1e-3}, {"storage": "uint8"}, {"precision": "fixed12"}])
def test_a_single_operation_is_a_graph_of_one_node(device: str, asked: dict[str, Any]) -> None:
    alone = lichen.run("gaussian", PICTURE, sigma=2, device=device, **asked)
    piped = lichen.run_pipeline("gaussian:sigma=2", PICTURE, device=device, **asked)["result"]
    np.testing.assert_array_equal(alone.image.pixels, piped.image.pixels)
    assert (alone.image.space, alone.error, alone.device) == (piped.image.space, piped.error, piped.device)


def test_a_chain_is_the_operations_one_after_the_other() -> None:
    step = lichen.run("levels", PICTURE, black=0.1, white=0.8, gamma=1.5, device="numpy").image
    step = lichen.run("saturation", step, amount=1.5, device="numpy").image
    piped = lichen.run_pipeline("levels:black=0.1,white=0.8,gamma=1.5|saturation:amount=1.5", PICTURE, device="numpy")[
        "result"
    ]
    np.testing.assert_array_equal(step.pixels, piped.image.pixels)


def test_several_outputs_share_what_they_have_in_common() -> None:
    nodes = {
        "blur": BLUR,
        "again": BLUR,
        "sharp": {
            "operation": "mix",
            "parameters": {"amount": 1.5},
            "inputs": {"image": "input.image", "base": "blur"},
        },
    }
    results = lichen.run_pipeline(
        {"nodes": nodes, "outputs": {"soft": "again", "sharp": "sharp", "original": "input.image"}}, PICTURE
    )
    assert set(results) == {"soft", "sharp", "original"}
    assert [node.operation.name for node in results["soft"].plan.nodes].count("gaussian") == 1
    np.testing.assert_array_equal(results["original"].image.pixels, PICTURE.pixels)
    np.testing.assert_array_equal(results["soft"].image.pixels, lichen.run("gaussian", PICTURE, sigma=2).image.pixels)
    expected = lichen.run("mix", PICTURE, base=results["soft"].image, amount=1.5).image.pixels
    np.testing.assert_allclose(results["sharp"].image.pixels, expected, atol=2e-6)
    assert results["original"].error.value == 0 < results["soft"].error.value


def test_outputs_may_be_asked_for_in_different_forms() -> None:
    said = {"nodes": {"blur": BLUR}, "outputs": {"light": {"node": "blur", "space": "linear"}, "shown": "blur"}}
    results = lichen.run_pipeline(said, PICTURE)
    assert (results["light"].image.space, results["shown"].image.space) == (Space.LINEAR, Space.SRGB)
    assert results["light"].error.value < results["shown"].error.value


@pytest.mark.parametrize(
    ("pipeline", "images", "pointer"),
    [
        ("matrix:matrix=[[1,0,0],[0,0,1],[0,1,0]]", {"image": np.ones((4, 4, 2))}, "/nodes/matrix/inputs/image"),
        ("mix:base=input.base", {"image": np.ones((4, 4, 3)), "base": np.ones((4, 5, 3))}, "/nodes/mix/inputs/base"),
        ("gaussian:sigma=1", {"image": np.ones((4, 4)), "other": np.ones((4, 4))}, "/inputs/other"),
        ("gaussian:sigma=1|mix:base=input.base", {"image": np.ones((4, 4))}, "/inputs/base"),
        ("gaussian:sigma=1", {"image": np.ones((4, 4), complex)}, "/inputs/image"),
        ("levels|levels:black=3,white=3", {"image": np.ones((4, 4))}, "/nodes/levels2/parameters/white"),
    ],
)
def test_what_does_not_fit_together_is_told_by_node_and_field(pipeline: str, images: Any, pointer: str) -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.explain_pipeline(pipeline, images=images)
    assert pointer in {flaw.pointer for flaw in refused.value.flaws}


def test_the_error_asked_for_holds_for_every_output_and_the_nodes_own() -> None:
    said = {
        "nodes": {"a": {**BLUR, "max_error": 1e-5}, "b": {**BLUR, "inputs": {"image": "a"}}},
        "outputs": {"one": "a", "two": "b"},
    }
    plan = lichen.explain_pipeline(said, PICTURE, max_error=1e-2)
    assert max(error.value for error in plan.errors.values()) <= 1e-2
    chosen = {node.name: node.choice for node in plan.nodes}
    assert chosen["a"] is not None
    assert chosen["b"] is not None
    assert chosen["a"].error.value <= 1e-5 < chosen["b"].error.value
    with pytest.raises(Unattainable) as refused:
        lichen.explain_pipeline({"nodes": {"a": {**BLUR, "max_error": 1e-12}}}, PICTURE)
    assert refused.value.flaws[0].pointer == "/nodes/a/max_error"


def test_a_time_is_divided_over_a_pipeline() -> None:
    said = "gaussian:sigma=6|levels:gamma=1.2|gaussian:sigma=9"
    big = Image(np.broadcast_to(np.float32(0.5), (900, 900, 3)), Space.DATA)
    vars(big)["extent"] = PICTURE.extent
    cheapest = lichen.explain_pipeline(said, big, max_error=0.5, device="numpy").seconds * 1e3
    tight = lichen.explain_pipeline(said, big, max_ms=cheapest * 1.05, device="numpy")
    ample = lichen.explain_pipeline(said, big, max_ms=cheapest * 20, device="numpy")
    assert tight.seconds * 1e3 <= cheapest * 1.05
    assert ample.error.value < tight.error.value
    with pytest.raises(Unattainable):
        lichen.explain_pipeline(said, big, max_ms=1e-9, device="numpy")


def test_a_plan_too_large_for_memory_is_refused_before_it_runs() -> None:
    plan = lichen.explain_pipeline("gaussian:sigma=2|levels:black=0.1", PICTURE)
    blur = plan.graph.named("gaussian")
    assert blur.choice is not None
    scratch = blur.operation.methods[blur.choice.method].scratch
    assert scratch is not None
    assert plan.peak_bytes == pytest.approx((2 + scratch) * PICTURE.pixels.nbytes, abs=1)
    assert lichen.explain_pipeline("gaussian:sigma=2|levels:black=0.1", PICTURE, max_bytes=plan.peak_bytes)
    with pytest.raises(TooLarge) as refused:
        lichen.run_pipeline("gaussian:sigma=2|levels:black=0.1", PICTURE, max_bytes=plan.peak_bytes - 1)
    assert (refused.value.limit, refused.value.actual) == (plan.peak_bytes - 1, plan.peak_bytes)


def test_every_output_is_verified() -> None:
    said = {
        "nodes": {"a": BLUR, "b": {"operation": "levels", "inputs": {"image": "a"}}},
        "outputs": {"x": "a", "y": "b"},
    }
    for result in lichen.run_pipeline(said, PICTURE, verify=True).values():
        assert result.measured is not None
        assert result.measured.largest <= result.error.value


def test_coverage_goes_through_a_pipeline() -> None:
    pixels = np.random.default_rng(1).random((16, 16, 4), dtype=np.float32)
    picture = Image(pixels, Space.SRGB, Alpha.STRAIGHT)
    result = lichen.run_pipeline("gaussian:sigma=1|saturation:amount=0.5", picture)["result"]
    assert (result.image.alpha, result.image.space) == (Alpha.STRAIGHT, Space.SRGB)
    conversions = [node.operation.name for node in result.plan.nodes].count("transfer")
    assert conversions == 2


def test_wishes_that_do_not_exist_are_named() -> None:
    with pytest.raises(InvalidRequest) as refused:
        lichen.run_pipeline("levels", PICTURE, max_errors=1, method="exact", max_ms=-1)
    assert {flaw.pointer for flaw in refused.value.flaws} == {"/max_errors", "/method", "/max_ms"}


def test_warps_are_concatenated_where_the_pipeline_says_so() -> None:
    """Twice as large and half as large again is the picture itself, unless it is filtered between."""
    nodes = {
        "up": {"operation": "affine", "parameters": {"matrix": [[2, 0, 0], [0, 2, 0]], "width": 32, "height": 24}},
        "down": {
            "operation": "affine",
            "parameters": {"matrix": [[0.5, 0, 0], [0, 0.5, 0]], "width": 16, "height": 12},
            "inputs": {"image": "up"},
        },
    }
    image = np.random.default_rng(4).random((12, 16, 3), dtype=np.float32)
    once = lichen.run_pipeline({"nodes": nodes, "concatenate": True}, image, device="numpy")["result"]
    twice = lichen.run_pipeline({"nodes": nodes}, image, device="numpy")["result"]
    np.testing.assert_array_equal(once.image.pixels, image)
    assert np.abs(twice.image.pixels - image).max() > 0.01
    assert [(each.pass_, each.node) for each in once.decisions[:2]] == [("concatenate", "up"), ("identity", "down")]
