"""Fused chains: the same bits as one method after the other, from generated kernels."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import lichen
from lichen import engine, execution
from lichen.errors import DeviceFailure
from lichen.execution import by_chain, by_method
from lichen.image import Alpha, Image, Space
from lichen.opencl import programs
from lichen.opencl.device import LANES, default_device
from lichen.operation import Error, Facts, Method, Operation, no_stage
from lichen.operations.compositing.blending import Operator
from lichen.planning import fuse
from lichen.planning.candidates import Candidate
from lichen.planning.error import reaching_with
from lichen.planning.fuse import LONGEST, stage_of
from lichen.planning.graph import Graph, Node
from lichen.planning.plan import Plan
from lichen.planning.predict import Told

OPERATIONS = dict(lichen.operations())
STAGED = {
    f"{operation.name}-{method.name}": (operation, method)
    for operation in OPERATIONS.values()
    for method in operation.methods.values()
    if method.stage is not no_stage
}
CHAIN = (
    "transfer:direction=decode|matrix:matrix=[[0.8,0.15,0.05],[0.1,0.8,0.1],[0.05,0.15,0.8]]|levels:black=0.02"
    "|saturation:amount=1.2|curve:points=[[0,0],[0.3,0.2],[0.7,0.8],[1,1]]|transfer:direction=encode"
)


def picture(channels: int, alpha: Alpha, seed: int = 0) -> Image:
    """9 x 13 pixels with all that is hard; of another seed it lies elsewhere."""
    pixels = (np.random.default_rng([channels, seed]).random((9, 13, channels)) * 1.5 - 0.25).astype(np.float32)
    pixels[0, :5, 0] = [np.nan, np.inf, -np.inf, 0.0, -0.0]
    pixels[1, :4] = [[1e-40], [1e30], [-1e-3], [0.0031308]]
    pixels[2, :4, -1] = [0, 1, np.nan, 1.5]
    return Image(np.roll(pixels, seed * 3, axis=1), Space.DATA, alpha)


@pytest.mark.parametrize(("operation", "method"), list(STAGED.values()), ids=list(STAGED))
@pytest.mark.parametrize(
    ("channels", "alpha"), [(3, Alpha.NONE), (4, Alpha.NONE), (4, Alpha.STRAIGHT), (4, Alpha.ASSOCIATED)]
)
def test_a_stage_does_what_its_method_does(
    operation: Operation[Any], method: Method[Any], channels: int, alpha: Alpha
) -> None:
    device = default_device()
    assert device is not None
    names = [each.name for each in operation.inputs if each.required]
    images = {name: picture(channels, alpha, seed) for seed, name in enumerate(names)}
    facts = {name: Facts.of(image) for name, image in images.items()}
    tried = 0
    # What becomes of a fourth channel shows as well in a few examples; every one is a program of its own.
    for example in operation.examples[: 2 if channels == 4 else None]:
        parameters = operation.validate(example)
        choice = Candidate(method.name, None, Told(Error(0.0, "bound")))
        node = Node("a", operation, parameters, {name: name for name in names}, choice)
        if operation.check(parameters, facts):
            continue
        graph = Graph.of(facts, (node,), "a")
        if stage_of(node, graph.facts()) is None:
            continue
        fused = by_chain([node], graph, images, device)
        np.testing.assert_array_equal(fused, by_method(node, images, device), err_msg=str(example))
        tried += 1
    assert tried or channels == 4


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (64, 65)])
@pytest.mark.parametrize("alpha", [Alpha.NONE, Alpha.STRAIGHT])
def test_a_chain_is_one_kernel_with_the_same_bits(size: tuple[int, int], alpha: Alpha) -> None:
    pixels = np.random.default_rng(2).random((*size, 3 + (alpha is not Alpha.NONE)), dtype=np.float32)
    pixels[0, 0, 0] = np.nan
    image = Image(pixels, Space.SRGB, alpha)
    fused = lichen.run_pipeline(CHAIN, image, device="opencl", max_error=1.0)["result"]
    alone = lichen.run_pipeline(CHAIN, image, device="opencl", max_error=1.0, prune=False)["result"]
    chains = fused.plan.graph.fused
    assert chains
    assert not alone.plan.graph.fused
    inner = {name for chain in chains for name in chain[:-1]}
    timed = {name.removeprefix("kernel.") for name in fused.timing if name.startswith("kernel.")}
    assert timed == {node.name for node in fused.plan.nodes} - inner
    if [node.choice.method for node in fused.plan.nodes if node.choice] == [
        node.choice.method for node in alone.plan.nodes if node.choice
    ]:
        np.testing.assert_array_equal(fused.image.pixels, alone.image.pixels)
    assert fused.plan.to_json()["fused"] == [list(chain) for chain in chains]
    assert [each.node for each in fused.decisions if each.pass_ == "fuse"] == [chain[-1] for chain in chains]


def links(text: str | dict[str, Any], channels: int = 3, **wish: Any) -> list[tuple[str, ...]]:
    image = Image(np.full((8, 8, channels), 0.5, np.float32))
    vars(image)["extent"] = lichen.Image(np.linspace(0, 1, 12, dtype=np.float32).reshape(2, 2, 3)).extent
    return list(lichen.explain_pipeline(text, image, **{"device": "opencl", **wish}).graph.fused)


def test_chains_end_where_others_read_or_pixels_meet() -> None:
    assert links("levels:black=0.1|gaussian:sigma=1|levels:black=0.2|saturation") == [("levels2", "saturation")]
    assert links("a=levels:black=0.1|b=levels:black=0.2|mix:base=a,amount=0.5|c=levels|d=levels:gamma=2") == []
    both = "a=levels:black=0.1|composite:base=a,opacity=0.5"
    assert links(both) == [], "the chain so far is read twice"
    two = {
        "nodes": {
            "a": {"operation": "levels", "parameters": {"black": 0.1}},
            "b": {"operation": "levels", "parameters": {"black": 0.2}, "inputs": {"image": "a"}},
            "c": {"operation": "levels", "parameters": {"black": 0.3}, "inputs": {"image": "b"}},
        },
        "outputs": {"x": "a", "y": "c"},
    }
    assert links(two) == [("b", "c")]


def stack(layers: int, top: str = "image") -> tuple[dict[str, Any], dict[str, Image]]:
    """Layers on each other by all operators in turn, or under each other, encoded at the end."""
    images = {f"l{n}": picture(4, Alpha.ASSOCIATED, n).replace(space=Space.LINEAR) for n in range(layers)}
    below = "base" if top == "image" else "image"
    nodes = {
        f"n{number}": {
            "operation": "composite",
            "parameters": {"operator": list(Operator)[number % len(Operator)], "opacity": 0.9},
            "inputs": {below: f"n{number - 1}" if number > 1 else "input.l0", top: f"input.l{number}"},
        }
        for number in range(1, layers)
    }
    nodes["end"] = {"operation": "levels", "parameters": {"black": 0.01}, "inputs": {"image": f"n{layers - 1}"}}
    return {"nodes": nodes, "outputs": {"x": "end"}}, images


@pytest.mark.parametrize("top", ["image", "base"])
def test_pictures_on_each_other_are_one_kernel_with_the_same_bits(top: str) -> None:
    pipeline, images = stack(len(Operator) + 1, top)
    fused, alone = (
        lichen.run_pipeline(pipeline, images=images, device="opencl", prune=prune)["x"] for prune in (True, False)
    )
    assert any(len(chain) > 2 for chain in fused.plan.graph.fused)
    np.testing.assert_array_equal(fused.image.pixels, alone.image.pixels)


def test_a_chain_holds_few_pictures_that_were_made_for_it() -> None:
    """Blurs of one picture on each other, each made just before it is wanted."""
    said = "".join(f"|b{n}=gaussian:sigma={n},image=input.image|n{n}=composite:base=n{n - 1}" for n in range(1, 7))
    image = picture(4, Alpha.ASSOCIATED).replace(space=Space.LINEAR)
    text = f"n0=gaussian:sigma=0.5{said}|levels:black=0.01|levels:black=0.02"
    plan, whole = (lichen.explain_pipeline(text, image, device="opencl", prune=prune) for prune in (True, False))
    assert plan.graph.fused
    assert plan.peak_bytes <= whole.peak_bytes


KERNEL = "convolve:kernel=[[1,2,3],[0,-4,1.5],[2,0.5,-1]],scale=0.25"
SAME = f"levels:black=0.1|curve:points={[[0, 0], [0.3, 0.2], [1, 1]]}|transfer:direction=encode"


@pytest.mark.parametrize("size", [(3, 1), (33, 70), (70, 400)])
@pytest.mark.parametrize("channels", [3, 4])
def test_a_convolution_goes_on_with_what_is_done_to_each_sample(size: tuple[int, int], channels: int) -> None:
    pixels = np.random.default_rng(4).random((*size, channels), dtype=np.float32)
    pixels[-1, 0, 0] = np.nan
    image = Image(pixels, Space.DATA)
    fused, alone = (
        lichen.run_pipeline(f"{KERNEL}|{SAME}", image, device="opencl", max_error=1.0, prune=prune)["result"]
        for prune in (True, False)
    )
    assert fused.plan.graph.fused == (("convolve", "levels", "curve", "transfer"),)
    methods = [[node.choice.method for node in each.plan.nodes if node.choice] for each in (fused, alone)]
    assert methods[0] == methods[1]
    np.testing.assert_array_equal(fused.image.pixels, alone.image.pixels)
    assert np.isnan(fused.image.pixels).any()


@pytest.mark.parametrize("method", ["fir", "multirate"])
@pytest.mark.parametrize("size", [(33, 70), (70, 400)])
def test_a_blur_goes_on_too(size: tuple[int, int], method: str) -> None:
    image = Image(np.random.default_rng(4).random((*size, 3), dtype=np.float32), Space.DATA)
    fused, alone = (
        lichen.run_pipeline(
            f"gaussian:sigma=4,method={method}|{SAME}", image, device="opencl", max_error=0.1, prune=prune
        )["result"]
        for prune in (True, False)
    )
    assert fused.plan.graph.fused == (("gaussian", "levels", "curve", "transfer"),)
    np.testing.assert_array_equal(fused.image.pixels, alone.image.pixels)


def test_where_a_convolution_does_not_go_on() -> None:
    assert links("gaussian:sigma=30,method=fir|levels:black=0.1") == []
    assert links("gaussian:sigma=2,method=deriche|levels:black=0.1") == []
    assert links(f"{KERNEL}|saturation|levels:black=0.1") == [("saturation", "levels")]
    assert links(f"{KERNEL}|levels:black=[0.1,0.2,0.3]|levels:white=2") == [("levels", "levels2")]
    assert links("convolve:name=disc,radius=9,method=direct|levels:black=0.1") == []
    assert links(f"{KERNEL},method=fft|levels:black=0.1") == []
    assert links(f"{KERNEL}|levels:black=0.1") == [("convolve", "levels")]
    covered = Image(np.full((8, 8, 4), 0.5, np.float32), Space.LINEAR, Alpha.ASSOCIATED)
    fused = lichen.explain_pipeline(f"{KERNEL}|levels:black=0.1", covered, device="opencl").graph.fused
    assert "convolve" not in {name for chain in fused for name in chain}


def test_a_convolution_goes_on_one_after_the_other_where_there_are_too_many_kernels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    image = Image(np.random.default_rng(1).random((8, 8, 3), dtype=np.float32))
    fused = lichen.run_pipeline(f"{KERNEL}|{SAME}", image, device="opencl", max_error=1.0)["result"]
    monkeypatch.setattr(execution, "compose", lambda text: None)
    apart = lichen.run_pipeline(f"{KERNEL}|{SAME}", image, device="opencl", max_error=1.0)["result"]
    np.testing.assert_array_equal(apart.image.pixels, fused.image.pixels)


def test_a_convolution_goes_on_one_after_the_other_where_items_step_together(monkeypatch: pytest.MonkeyPatch) -> None:
    image, device = Image(np.random.default_rng(1).random((8, 8, 3), dtype=np.float32)), default_device()
    assert device is not None
    fused = lichen.run_pipeline(f"{KERNEL}|{SAME}", image, device="opencl", max_error=1.0)["result"]
    monkeypatch.setattr(engine, "default_device", lambda: dataclasses.replace(device, lanes=LANES))
    apart = lichen.run_pipeline(f"{KERNEL}|{SAME}", image, device="opencl", max_error=1.0)["result"]
    assert apart.plan.graph.fused == fused.plan.graph.fused
    np.testing.assert_allclose(apart.image.pixels, fused.image.pixels, rtol=0, atol=1e-6)


def test_where_chains_are_not_fused() -> None:
    text = "levels:black=0.1|levels:black=0.2"
    assert links(text)
    for case in ({"prune": False}, {"device": "numpy"}, {"precision": "float16"}, {"channels": 2}, {"channels": 5}):
        assert not links(text, **case), case


def test_long_chains_are_cut() -> None:
    text = "|".join(f"levels:black=0.{number + 10}" for number in range(LONGEST + 3))
    assert [len(chain) for chain in links(text)] == [LONGEST, 3]


def test_memory_counts_no_picture_inside_a_chain() -> None:
    image = Image(np.random.default_rng(1).random((8, 8, 3), dtype=np.float32))
    plan = lichen.explain_pipeline(CHAIN, image, device="opencl", max_error=1e-3)
    assert plan.peak_bytes == 2 * image.pixels.nbytes


def test_too_many_kernels_run_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    image = Image(np.random.default_rng(1).random((8, 8, 3), dtype=np.float32))
    fused = lichen.run_pipeline(CHAIN, image, device="opencl", max_error=1e-3)["result"].image.pixels
    monkeypatch.setattr(execution, "compose", lambda text: None)
    np.testing.assert_array_equal(
        lichen.run_pipeline(CHAIN, image, device="opencl", max_error=1e-3)["result"].image.pixels, fused
    )


def test_generated_texts_are_bounded_and_named_by_what_they_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(programs, "_composed", {})
    monkeypatch.setattr(programs, "MOST_COMPOSED", 1)
    one = programs.compose('#include "numeric.clh"\n')
    assert one == programs.compose('#include "numeric.clh"\n')
    assert one is not None
    assert programs.compose("// another\n") is None
    assert "num_exp2" in programs._composed[one].text
    monkeypatch.setattr(programs, "_composed", {})
    with pytest.raises(DeviceFailure, match="does not exist"):
        programs.compose('#include "nothing.clh"\n')


PEAKS = "|".join(["transfer:curve=pq,direction=decode|levels:white=50"] * 3)
"""Decoding PQ is quickest by a table, which is no stage."""


def linked(monkeypatch: pytest.MonkeyPatch, steps: int, max_error: float) -> tuple[Plan, list[str]]:
    """The plan of these where so many steps may be carried anew, and the nodes that another method was tried for."""
    seen: list[str] = []

    def reaching(*given: Any) -> Any:
        seen.append(given[4])
        return reaching_with(*given)

    monkeypatch.setattr(fuse, "reaching_with", reaching)
    monkeypatch.setattr(fuse, "TRIED", steps)
    image = Image(np.random.default_rng(1).random((64, 64, 3), dtype=np.float32), Space.DATA)
    return lichen.explain_pipeline(PEAKS, image, device="opencl", max_error=max_error), seen


def test_a_method_that_can_be_fused_takes_the_place_of_one_that_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, seen = linked(monkeypatch, 1 << 16, 0.01)
    assert plan.graph.fused == (tuple(node.name for node in plan.nodes),)
    assert seen == ["transfer", "transfer2", "transfer3"]
    assert plan.error.value <= 0.01


@pytest.mark.parametrize("links", [1, 2])
def test_the_search_for_links_is_bounded(monkeypatch: pytest.MonkeyPatch, links: int) -> None:
    plan, seen = linked(monkeypatch, 6 * links, 0.02 * links)
    assert len(seen) == links
    assert [node.choice.method for node in plan.nodes if node.choice].count("table") == 3 - links
    assert [len(chain) for chain in plan.graph.fused] == [2 * links]
    assert plan.error.value <= 0.02
