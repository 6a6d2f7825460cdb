"""Random pipelines over the whole catalogue, and random scenes: what a plan leaves out changes the result by no more
than it says.

Three things are held, on drawn pictures with hard cases among them:

* by definition, the pruned and the unpruned graph differ by no more than the bounds of the decisions add up to;
* by the methods chosen, each keeps the error its plan states, so the two differ by no more than both errors;
* where only work was dropped that nobody reads or that is done already, and the methods are the same, no bit differs.

Operations that read what a scene's camera sees find depths, normals and motions among the sources, and whole scenes
are held to the first two as well: what their lights, fog and finish leave out by what the geometry shows.

Eighty draws and six scenes, always the same, run with every test; `make fuzz` draws two thousand new ones and a
scene for every eight of them (LICHEN_PIPELINES).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

import lichen
from lichen.accuracy.metrics import difference
from lichen.engine import Prepared, Result, prepare_pipeline, prepare_scene
from lichen.errors import InvalidRequest, LichenError, Unattainable
from lichen.execution import exact
from lichen.image import Alpha, Image, Space
from lichen.memory import Array
from lichen.operation import Facts, Operation
from lichen.planning.check import flaws_of
from lichen.planning.graph import Node
from lichen.planning.plan import Plan

from ..accuracy import drawing
from ..accuracy.test_bounds import SHARE, UNDERFLOW, representable
from ..scene.drawing import scenes

OPERATIONS = dict(lichen.operations())
FAMILIES = {
    family: [name for name, each in OPERATIONS.items() if each.family == family]
    for family in {each.family for each in OPERATIONS.values()}
}
FUZZED = int(os.environ.get("LICHEN_PIPELINES", "0"))
DEAREST = 0.5
"""Seconds that the truth of one node may take."""
JOINT = 3e-8
"""How far decoding and encoding move what lies where the line and the power of sRGB ought to meet: the numbers of the
standard are rounded, and leave 2.94e-8 between them."""
DOUBLES = 1e-14
"""Of the largest value: how far a definition that moves nothing may move it, weights being doubles."""
BUFFERED = 3e-8
"""Of the brightest value: how far apart scenes are that read other buffers of one geometry, distances in place of
positions, say. Buffers are float32 by their definition."""
NEARLY: dict[str, list[dict[str, Any]]] = {
    "composite": [{}, {"opacity": 0.5}, {"blend": "multiply"}],
    "gaussian": [{"sigma": 0}, {"sigma": 0.1}, {"sigma": 0.25}],
    "levels": [{}, {"white": 1.0001}, {"out_white": 0.9999, "clamp": True}],
    "saturation": [{"amount": 1}, {"amount": 1.0001}],
    "hue_rotate": [{"angle": 0}, {"angle": 0.01}],
    "mix": [{"amount": 1}, {"amount": 1.0001}, {"amount": 1e-5}, {"amount": 0}],
    "transfer": [{"direction": "encode"}, {"direction": "decode"}, {"curve": "gamma", "gamma": 1}],
    "matrix": [{}, {"matrix": [[1, 1e-5, 0], [0, 1, 0], [0, 0, 1]]}],
    "premultiply": [{}, {"inverse": True}],
}
"""Parameters with which operations do nothing, nearly nothing or not everywhere, or undo one another."""


@st.composite
def pictures(draw: st.DrawFn, height: int, width: int) -> Image:
    """Light, display values or data; with coverage above zero, since under none colour need not come back."""
    made = draw(drawing.pixels(height, width, draw(st.sampled_from([1, 3, 3]))))
    alpha = draw(st.sampled_from([Alpha.NONE, *Alpha]))
    if draw(st.integers(0, 9)) == 0:
        made[0, 0] = np.nan
    if alpha is not Alpha.NONE:
        rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
        coverage = rng.uniform(0.25, 1, (height, width, 1)).astype(np.float32)
        if draw(st.booleans()):  # opaque but for some rows or columns
            row, column = draw(st.integers(0, height)), draw(st.integers(0, width))
            coverage[:row], coverage[:, column:] = 1, 1
        made = np.concatenate([made * coverage if alpha is Alpha.ASSOCIATED else made, coverage], axis=-1)
    return Image(np.ascontiguousarray(made), draw(st.sampled_from(list(Space))), alpha)


SEEN = {
    "depth": "depth",
    "map": "depth",
    "normal": "normal",
    "position": "normal",
    "motion": "motion",
    "field": "motion",
}
"""Sources by the names of inputs that hold what a camera sees."""


@st.composite
def views(draw: st.DrawFn, height: int, width: int) -> dict[str, Image]:
    """What a camera may have seen: depths with nothing behind some of them, normals of any length, motions."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    depth = rng.uniform(0.5, 9, (height, width, 1)).astype(np.float32)
    depth[rng.random(depth.shape) < draw(st.sampled_from([0, 0.2]))] = np.inf
    normal = rng.normal(0, 1, (height, width, 3)).astype(np.float32)
    normal[rng.random((height, width)) < draw(st.sampled_from([0, 0.1]))] = 0
    motion = (rng.normal(0, 1, (height, width, 2)) * draw(st.sampled_from([0, 0.3, 3]))).astype(np.float32)
    made = {"depth": depth, "normal": normal, "motion": motion}
    return {name: Image(np.ascontiguousarray(each), Space.DATA) for name, each in made.items()}


@st.composite
def read_by(
    draw: st.DrawFn, operation: Operation[Any], recent: Sequence[str], known: Mapping[str, Facts]
) -> dict[str, str]:
    """A source for every input of an operation: as a rule what it is made for, or else what was made last."""
    found: dict[str, str] = {}
    for each in operation.inputs:
        if not (each.required or draw(st.booleans())):
            continue
        least, most = each.channels
        fitting = [name for name in recent if least <= known[name].channels <= (most or 99)]
        if each.name in SEEN and draw(st.integers(0, 3)):
            fitting = [f"input.{SEEN[each.name]}"]
        elif not fitting:
            fitting = [name for name in known if least <= known[name].channels <= (most or 99)]
        found[each.name] = draw(st.sampled_from(fitting or list(recent)))
    return found


@st.composite
def settings_of(draw: st.DrawFn, operation: Operation[Any], height: int, width: int) -> dict[str, Any]:
    """Parameters as drawn for the test of errors, or an example; pictures from nothing are as large as the rest."""
    if draw(st.booleans()):
        chosen = dict(draw(drawing.parameters(operation.name)))
    else:
        chosen = dict(draw(st.sampled_from(operation.examples)))
    return {**chosen, "width": width, "height": height} if operation.generates else chosen


@st.composite
def pipelines(draw: st.DrawFn) -> tuple[dict[str, Any], dict[str, Image]]:
    """Up to six nodes that fit together, and one or two outputs."""
    height, width = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    images = {name: draw(pictures(height, width)) for name in ("image", "other")} | draw(views(height, width))
    known = {f"input.{name}": Facts.of(image) for name, image in images.items()}
    drawn = [f"input.{name}" for name in ("image", "other")]
    nodes: dict[str, Any] = {}
    for number in range(draw(st.integers(1, 6))):
        nearly = draw(st.booleans())
        of = sorted(NEARLY) if nearly else FAMILIES[draw(st.sampled_from(sorted(FAMILIES)))]
        operation = OPERATIONS[draw(st.sampled_from(of))]
        inputs = draw(read_by(operation, drawn[::-1][: 2 + number // 2], known))
        chosen = draw(st.sampled_from(NEARLY[operation.name]) if nearly else settings_of(operation, height, width))
        try:
            parameters = operation.validate(chosen)
        except InvalidRequest:
            continue
        node = Node(f"n{number}", operation, parameters, inputs)
        facts = {key: known[source] for key, source in inputs.items()}
        if flaws_of([node], known, lambda node: "") or operation.truth_seconds(parameters, facts) > DEAREST:
            continue
        made = node.result(known)
        if made.samples > 1 << 14 or made.extent.magnitude > 1e12:
            continue
        known[node.name] = made
        drawn.append(node.name)
        nodes[node.name] = {"operation": operation.name, "parameters": chosen, "inputs": inputs}
    assume(nodes)
    outputs = draw(st.lists(st.sampled_from(sorted(nodes)), min_size=1, max_size=2, unique=True))
    used = {source for node in nodes.values() for source in node["inputs"].values()}
    sent = {name: image for name, image in images.items() if f"input.{name}" in used}
    return {
        "nodes": nodes,
        "outputs": {name: {"node": name, "crop": draw(parts(known[name]))} for name in outputs},
    }, sent


def parts(facts: Facts) -> st.SearchStrategy[list[int] | None]:
    """All of a picture, or a rectangle in it."""
    if facts.pages > 1:
        return st.none()
    left, top = st.integers(0, facts.width - 1), st.integers(0, facts.height - 1)
    some = st.tuples(left, top).flatmap(
        lambda at: st.tuples(
            st.just(at[0]), st.just(at[1]), st.integers(1, facts.width - at[0]), st.integers(1, facts.height - at[1])
        )
    )
    return st.one_of(st.none(), some.map(list))


def prepared(said: dict[str, Any], images: dict[str, Image], **wish: Any) -> Prepared:
    try:
        return prepare_pipeline(said, images=images, **wish)
    except Unattainable:
        return prepare_pipeline(said, images=images, **{**wish, "max_error": None})


def same_methods(one: Prepared, other: Prepared) -> bool:
    found = {node.name: node.choice for node in other.plan.nodes}
    return all(
        node.choice is not None
        and (choice := found.get(node.name)) is not None
        and (node.choice.method, node.choice.knob) == (choice.method, choice.knob)
        for node in one.plan.nodes
    )


def test_plans_change_results_by_no_more_than_they_say() -> None:
    broken: list[str] = []
    tried = 0

    @settings(
        max_examples=FUZZED or 80,
        derandomize=not FUZZED,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        nonlocal tried
        said, images = data.draw(pipelines())
        asked = data.draw(st.sampled_from([None, None, 1e-1, 1e-2, 1e-3, 1e-5]))
        wish = {"max_error": asked, "device": data.draw(st.sampled_from(["numpy", "numpy", "opencl"]))}
        try:
            pruned, whole = prepared(said, images, **wish), prepared(said, images, **wish, prune=False)
        except LichenError:
            assume(False)
        results, full = pruned.run(), whole.run()
        decisions = pruned.plan.decisions
        allowed = sum(each.bound for each in decisions if each.pass_ in ("invisible", "join"))
        dropping = {each.pass_ for each in decisions if each.action == "dropped"}
        dropping |= {each.pass_ for each in decisions if each.pass_ in ("region", "join")}
        lossless = dropping <= {"unread", "shared"} and same_methods(pruned, whole)
        for name, result in results.items():
            sources = pruned.order.images
            truths = [exact(each.plan.graph.only(name), sources) for each in (pruned, whole)]
            told = f"{said}, {wish}, {images}, {[each for each in decisions if each.action == 'dropped']}"
            alpha = result.image.alpha
            apart = difference(truths[0], truths[1], alpha)
            most = allowed + slack(pruned.plan, whole.plan, name) + 1e-9 * magnitude(truths[1])
            assert apart.largest <= most, f"by definition {apart} beyond {most}: {told}"
            assert not apart.mismatched or not np.isfinite(truths[1]).all(), told
            if lossless:
                np.testing.assert_array_equal(result.image.pixels, full[name].image.pixels, err_msg=told)
            tried += 1
            if wrong := beyond(result, full[name]):
                broken.append(f"{wrong}: {told}")

    holds()
    assert len(broken) <= max(tried * SHARE, 0 if not FUZZED else 1), "\n".join(broken[:20])


def slack(pruned: Plan, whole: Plan, output: str) -> float:
    """How far an output moves because nodes are gone that do nothing: by the step at the joint of conversions of light
    that stood in pairs and by rounding, grown by what stands behind them."""
    facts, kept = whole.graph.facts(), {node.name for node in pruned.nodes}
    moved = dict.fromkeys(whole.graph.sources, 0.0)
    for node in whole.graph.nodes:
        joint = JOINT if node.operation.name == "transfer" else 0.0
        own = 0.0 if node.name in kept else joint + DOUBLES * facts[node.name].extent.magnitude
        arriving = max((moved[source] for source in node.inputs.values()), default=0.0)
        moved[node.name] = own + node.carried(facts, arriving)
    return moved[whole.graph.outputs[output].source]


def magnitude(truth: Array) -> float:
    """The largest finite value, or one."""
    return float(np.max(np.abs(truth[np.isfinite(truth)]), initial=1.0))


def beyond(pruned: Result, whole: Result) -> str:
    """How much farther apart two results are than both errors allow; empty where they are not. Bounds must hold."""
    both = pruned.error.value + whole.error.value
    pixels = [each.image.pixels for each in (pruned, whole)]
    known = representable(pixels[1].astype(np.float64), pixels[0], both)
    found = difference(pixels[0], known, pruned.image.alpha)
    if found.largest <= both + UNDERFLOW:
        return ""
    assert {pruned.error.kind, whole.error.kind} != {"bound"}, f"{found} beyond {both}: {pruned.plan.decisions}"
    return f"{found} beyond {both}"


def test_scenes_change_by_no_more_than_they_say() -> None:
    broken: list[str] = []
    tried = 0

    @settings(
        max_examples=FUZZED // 8 or 6,
        derandomize=not FUZZED,
        phases=[Phase.generate],
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(scenes(), st.sampled_from([None, 1e-2, 1e-4]), st.sampled_from(["numpy", "opencl"]))
    def holds(drawn: tuple[dict[str, Any], dict[str, Image]], max_error: float | None, device: str) -> None:
        nonlocal tried
        scene, images = drawn
        wish = {"images": images, "max_error": max_error, "device": device}
        try:
            pruned, whole = prepare_scene(scene, **wish), prepare_scene(scene, **wish, prune=False)
        except Unattainable:
            assume(False)
        told = f"{scene}, {max_error}, {device}"
        truths = [exact(each.plan.graph, each.order.images) for each in (pruned, whole)]
        (result,), (full,) = pruned.run().values(), whole.run().values()
        # What tiles leave out is found, and said, by the run.
        allowed = sum(each.bound for each in result.decisions if each.pass_ in ("invisible", "join", "scene", "tiles"))
        apart = difference(truths[0], truths[1], Alpha.NONE)
        most = allowed + (1e-9 + BUFFERED) * magnitude(truths[1])
        assert apart.largest <= most, f"by definition {apart} beyond {most}: {told}"
        assert not apart.mismatched, told
        tried += 1
        if wrong := beyond(result, full):
            broken.append(f"{wrong}: {told}")

    holds()
    assert len(broken) <= max(tried * SHARE, 0 if not FUZZED else 1), "\n".join(broken[:20])
