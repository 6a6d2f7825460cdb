"""Truth on tiles is truth: crops, borders, chains, and what is said where there can be none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import lichen
from lichen import verification
from lichen.accuracy.metrics import difference
from lichen.execution import exact
from lichen.image import Alpha, Image, Space, as_image
from lichen.operation import Facts, Operation
from lichen.planning.graph import Graph, Node
from lichen.verification import truth_of_tile, verify

OPERATIONS = dict(lichen.operations())
SIZE = (34, 37)


def graph_of(operation: Operation[Any], inputs: Mapping[str, Image], example: Mapping[str, Any]) -> Graph:
    facts = {f"input.{key}": Facts.of(image) for key, image in inputs.items()}
    node = Node("it", operation, operation.validate(example), {key: f"input.{key}" for key in inputs})
    return Graph.of(facts, (node,), "it")


def sources_of(inputs: Mapping[str, Image]) -> dict[str, Image]:
    return {f"input.{key}": image for key, image in inputs.items()}


def inputs_of(
    operation: Operation[Any], example: Mapping[str, Any] | None = None, size: tuple[int, int] = SIZE
) -> dict[str, Image]:
    """Noise for the required inputs, with a number of channels that the parameters take."""
    rng = np.random.default_rng(5)
    required = [each for each in operation.inputs if each.required]
    for channels in (2, 3, 4):
        if any(channels < each.channels[0] or channels > (each.channels[1] or channels) for each in required):
            continue
        made = {each.name: as_image(rng.random((*size, channels), dtype=np.float32)) for each in required}
        facts = {name: Facts.of(image) for name, image in made.items()}
        if example is None or not operation.check(operation.validate(example), facts):
            return made
    raise AssertionError(f"{operation.name} takes no noise for {example}")


def tiles_of(size: tuple[int, int], rows: int, columns: int) -> list[verification.Tile]:
    """All tiles of an image."""
    return [
        ((top, min(top + rows, size[0])), (left, min(left + columns, size[1])))
        for top in range(0, size[0], rows)
        for left in range(0, size[1], columns)
    ]


EXAMPLES = [
    *((name, example) for name, each in OPERATIONS.items() for example in each.examples),
    *(("gaussian", {"sigma": 0.7, "border": border}) for border in ("reflect", "reflect101", "clamp", "wrap")),
    ("gaussian", {"sigma": 0.7, "border": "constant", "value": -2}),
    ("lic", {"length": 6.5, "scale": 2, "bias": 0.5, "kernel": "hann", "seed": 3}),
]


@pytest.mark.parametrize(("name", "example"), EXAMPLES, ids=[f"{n}-{e}" for n, e in EXAMPLES])
def test_truth_of_tiles_is_the_truth(name: str, example: Mapping[str, Any]) -> None:
    """Of all tiles, so that interior, borders and corners are among them; the last ones are odd remainders."""
    operation = OPERATIONS[name]
    try:
        inputs = inputs_of(operation, example)
    except AssertionError:
        pytest.skip("the example asks for optional inputs")
    graph, sources = graph_of(operation, inputs, example), sources_of(inputs)
    reach = verification._reach(graph, *SIZE)
    facts = graph.facts()
    if any((each.height, each.width) != SIZE for each in facts.values()):
        assert isinstance(reach, str), "what changes its size has no tiles"
        return
    if isinstance(reach, str):
        (node,) = graph.nodes
        known = {key: facts[source] for key, source in node.inputs.items()}
        assert operation.implied(node.parameters, known) == reach
        return
    whole = exact(graph, sources)
    for tile in tiles_of(SIZE, 12, 11):
        part = truth_of_tile(graph, sources, reach, tile)
        expected = whole[slice(*tile[0]), slice(*tile[1])]
        assert part.shape == expected.shape
        np.testing.assert_allclose(part, expected, rtol=0, atol=1e-13)


def test_crops_really_are_crops(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above would hold as well if every tile took the whole image."""
    operation = OPERATIONS["gaussian"]
    seen: list[tuple[int, ...]] = []
    original = type(operation).evaluate_truth

    def spying(self: Operation[Any], inputs: Mapping[str, Image], parameters: Any) -> np.ndarray:
        seen.append(inputs["image"].pixels.shape)
        return original(self, inputs, parameters)

    monkeypatch.setattr(type(operation), "evaluate_truth", spying)
    inputs = inputs_of(operation)
    graph = graph_of(operation, inputs, {"sigma": 1})
    reach = verification._reach(graph, *SIZE)
    assert not isinstance(reach, str)
    truth_of_tile(graph, sources_of(inputs), reach, ((12, 22), (0, 10)))
    assert seen == [(10 + 2 * 10, 10 + 10, 2)]


def chain(operation: Operation[Any], *examples: Mapping[str, Any], size: tuple[int, int] = SIZE) -> Graph:
    """One operation after another, as a pipeline would have them."""
    sources = {"input.image": Facts(*size, 2)}
    nodes = []
    before = "input.image"
    for number, example in enumerate(examples):
        nodes.append(Node(f"n{number}", operation, operation.validate(example), {"image": before}))
        before = f"n{number}"
    return Graph.of(sources, tuple(nodes), before)


def test_footprints_add_up_along_a_chain() -> None:
    gaussian = OPERATIONS["gaussian"]
    size = (50, 61)
    steps = ({"sigma": 0.8}, {"sigma": 0.7, "border": "wrap"}, {"sigma": 0.5, "border": "reflect101"})
    graph = chain(gaussian, *steps, size=size)
    sources = sources_of(inputs_of(gaussian, size=size))
    whole = exact(graph, sources)
    reach = verification._reach(graph, *size)
    assert not isinstance(reach, str)
    assert reach.rows is not None
    assert 12 < reach.rows < 24
    tile = ((24, 30), (27, 33))
    part = truth_of_tile(graph, sources, reach, tile)
    np.testing.assert_allclose(part, whole[24:30, 27:33], rtol=0, atol=1e-13)


# ---------------------------------------------------------------------------------------------------------- verifying


def test_small_images_are_compared_whole() -> None:
    pixels = np.random.default_rng(1).random((60, 50, 3), dtype=np.float32)
    result = lichen.run("gaussian", pixels, sigma=2, tail=1e-3, method="fir", verify=True)
    truth = lichen.evaluate_truth("gaussian", pixels, sigma=2)
    assert result.measured == difference(result.image.pixels, truth)
    assert result.measured is not None
    assert 0 < result.measured.largest <= result.error.value
    assert result.timing["verify"] > 0
    assert result.verification is not None
    assert result.verification.map is not None
    assert result.verification.map.max() == pytest.approx(result.measured.largest)
    assert lichen.run("gaussian", pixels, sigma=2).measured is None


def test_large_images_are_sampled_the_same_way_each_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "PIXELS", 6000)
    pixels = np.random.default_rng(1).random((300, 200, 1), dtype=np.float32)
    pixels[170, 100] = 50  # the centre is always looked at
    found = [lichen.run("gaussian", pixels, sigma=2, method="fir", tail=1e-2, verify=True) for _ in range(2)]
    first, second = (each.verification for each in found)
    assert first is not None
    assert second is not None
    assert first.measured == second.measured
    assert first.measured is not None
    taken = np.isfinite(first.map)
    assert 0.05 < first.measured.sampled < 0.2
    assert taken.mean() == pytest.approx(first.measured.sampled)
    assert all(taken[row, column] for row in (0, 170, -1) for column in (0, 100, -1))
    whole = difference(found[0].image.pixels, lichen.evaluate_truth("gaussian", pixels, sigma=2))
    assert 0.5 * whole.largest < first.measured.largest <= whole.largest * (1 + 1e-6)


def test_what_cannot_be_afforded_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "SECONDS", 1e-6)
    field = np.random.default_rng(1).random((60, 50, 2), dtype=np.float32)
    for values in ({"length": 20}, {"length": 20, "speed": "field"}):
        result = lichen.run("lic", field, verify=True, **values)
        assert result.measured is None
        assert result.verification is not None
        assert " s" in result.verification.reason
        assert result.decisions[-1].pass_ == "verify"
        assert result.decisions[-1].reason == result.verification.reason


def test_sizes_that_differ_cannot_be_tiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verification, "PIXELS", 100)
    rng = np.random.default_rng(1)
    field, texture = rng.random((20, 20, 2), dtype=np.float32), rng.random((40, 40, 1), dtype=np.float32)
    result = lichen.run("lic", field, texture=texture, length=3, verify=True)
    assert result.measured is not None  # there is time for all of it
    assert result.measured.sampled == 1
    monkeypatch.setattr(verification, "SECONDS", 1e-6)
    result = lichen.run("lic", field, texture=texture, length=3, verify=True)
    assert result.verification is not None
    assert "not of one size" in result.verification.reason


def test_the_whole_road_is_judged() -> None:
    """Conversions and stores belong to what a result can be wrong by."""
    pixels = np.random.default_rng(1).random((40, 30, 4), dtype=np.float32)
    picture = Image(pixels, Space.SRGB, Alpha.STRAIGHT)
    fine = lichen.run("gaussian", picture, sigma=1, verify=True)
    coarse = lichen.run("gaussian", picture, sigma=1, precision="fixed8", verify=True)
    for result in (fine, coarse):
        assert result.measured is not None
        assert result.measured.largest <= result.error.value
    assert fine.measured is not None
    assert coarse.measured is not None
    assert coarse.measured.largest > 100 * fine.measured.largest


def test_a_wrong_result_is_found() -> None:
    inputs = inputs_of(OPERATIONS["gaussian"])
    graph = graph_of(OPERATIONS["gaussian"], inputs, {"sigma": 1})
    truth = exact(graph, sources_of(inputs))
    wrong = truth.copy()
    wrong[3, 4, 1] += 0.25
    found = verify(graph, sources_of(inputs), as_image(wrong.astype(np.float32)))
    assert found.measured is not None
    assert found.measured.largest == pytest.approx(0.25)
    assert found.map is not None
    assert np.unravel_index(np.argmax(found.map), SIZE) == (3, 4)
    wrong[0, 0, 0] = np.nan
    assert verify(graph, sources_of(inputs), as_image(wrong)).measured.mismatched == 1
