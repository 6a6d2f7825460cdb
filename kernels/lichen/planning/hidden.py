"""The pass that computes nothing which an opaque picture hides.

Where an operation hands on one of its pictures wherever that covers wholly (`Operation.hides`), the other is needed in
the rest alone: in the smallest rectangle outside which the upper picture is opaque, as its pixels tell. The operation
is done there, and its result patched into the upper picture; what is below is then narrowed as a crop is.

Coverage is not changed by light or association, so a source's opaque part is also that of what it is converted to.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    EXACT,
    POINTWISE,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.part import Rectangle
from lichen.planning.graph import Decision, Graph, Moved, Node, Request, inputs_of, rewired
from lichen.planning.prune import cost
from lichen.planning.region import WORTHWHILE, crop

BLOCK = 16
"""Rows or columns that are looked through at once."""
PROBED = 16
"""Points of a row that are looked at first: columns lie apart in memory, and to go through 16 takes 0.5 ms."""
CONVERSIONS = ("transfer", "premultiply")
"""Operations that leave coverage as it is."""


class Parameters(OperationParameters):
    left: int = Field(ge=0)
    top: int = Field(ge=0)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, part = facts["image"].extent, facts["part"].extent
    low, high = min(image.low, part.low), max(image.high, part.high)
    return dataclasses.replace(facts["image"], extent=Extent(low, high, image.nonfinite + part.nonfinite))


patch = Operation(
    name="patch",
    family="planning",
    summary="A picture with a rectangle of another in it.",
    parameters=Parameters,
    inputs=(Input("image"), Input("part")),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    implied=lambda p, facts: "the part does not move with the part that is taken",
)


@patch.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _patched(inputs, p, np.empty(inputs["image"].pixels.shape, np.float64))


def _patched(inputs: Inputs, p: Parameters, out: Array) -> Array:
    part = inputs["part"].pixels
    out[...] = inputs["image"].pixels
    out[p.top : p.top + part.shape[0], p.left : p.left + part.shape[1]] = part
    return out


@patch.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: float(facts["image"].samples),
    rates={"opencl": Rate(2e-5, 2.5e-10), "numpy": Rate(2e-5, 2.5e-10)},
    scratch=0.0,
)
class Exact:
    """A copy."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, part = inputs["image"].pixels, inputs["part"].pixels
        (height, width, channels), (tall, wide) = image.shape, part.shape[:2]
        out = aligned_empty(image.shape)
        numbers = (height, width * channels, p.top, p.top + tall, p.left * channels, wide * channels)
        with device.session() as session:
            session.launch(
                "patch.cl", "patch", (height,), image, part, session.write(out), *(np.int32(n) for n in numbers),
                local=(1,),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _patched(inputs, p, aligned_empty(inputs["image"].pixels.shape))


def thin(nodes: Sequence[Node], images: Mapping[str, Image], *, prune: bool) -> dict[str, Rectangle]:
    """The parts of pictures outside which they hide what is below, if they lie on anything."""
    upper = {
        source
        for node in nodes
        if len(node.inputs) > 1 and prune and node.operation.hides is not None
        for source in node.inputs.values()
        if source in images
    }
    found = {source: thin_part(images[source]) for source in sorted(upper)}
    return {source: part for source, part in found.items() if part is not None}


def thin_part(image: Image) -> Rectangle | None:
    """The smallest rectangle outside which a picture covers wholly; None where that is all of it, or nothing. Looks no
    further than it must: where the edges are not opaque, at a few rows and columns of them."""
    if image.alpha is Alpha.NONE or image.pages > 1:
        return None
    coverage = image.pixels[..., -1]
    top = _opaque(coverage)
    if top == image.height:
        return None
    bottom = image.height - _opaque(coverage[::-1])
    left = _opaque(coverage[top:bottom].T)
    right = image.width - _opaque(coverage[top:bottom].T[::-1])
    return left, top, right - left, bottom - top


def _opaque(coverage: Array) -> int:
    """How many of the first rows are opaque. Most pictures show at a few points of the first one that none is."""
    if (coverage[:1, :: max(1, coverage.shape[1] // PROBED)] != 1).any():
        return 0
    for first in range(0, len(coverage), BLOCK):
        thin = np.flatnonzero((coverage[first : first + BLOCK] != 1).any(axis=1))
        if thin.size:
            return first + int(thin[0])
    return len(coverage)


def hidden(graph: Graph, request: Request) -> Graph:
    """With operations done only where what they hand on does not cover wholly."""
    if not graph.thin or any(node.operation is crop for node in graph.nodes):
        return graph
    facts, before = graph.facts(), {node.name: node for node in graph.nodes}
    nodes: list[Node] = []
    moved: dict[str, Moved] = {}
    decisions = []
    for node in graph.nodes:
        part = _part(node, before, graph.thin, facts)
        node = rewired(node, moved)
        if part is None:
            nodes.append(node)
            continue
        rectangle, upper = part
        made = _narrowed(node, rectangle, upper)
        nodes += made
        moved[node.name] = Moved(made[-1].name)
        left, top, width, height = rectangle
        share = 1 - width * height / facts[node.name].pixels
        reason = f"its {upper} covers all else of {facts[node.name].width}x{facts[node.name].height} px wholly"
        action = f"computed on {width}x{height} from ({left}, {top})"
        decisions.append(Decision("hidden", node.name, action, reason, saved=share * cost(node, facts, request)))
    if not moved:
        return graph
    outputs = {
        name: dataclasses.replace(each, source=moved[each.source].source) if each.source in moved else each
        for name, each in graph.outputs.items()
    }
    observers = tuple(rewired(node, moved) for node in graph.observers)
    return graph.replace(nodes=tuple(nodes), outputs=outputs, observers=observers).deciding(decisions)


def _part(
    node: Node, before: Mapping[str, Node], thin: Mapping[str, Rectangle], facts: Mapping[str, Facts]
) -> tuple[Rectangle, str] | None:
    """Where a node has something to do, and the input that it hands on elsewhere; None where that is all of it."""
    known, made = inputs_of(node, facts), facts[node.name]
    hides = node.operation.hides
    upper = None if hides is None else hides(node.parameters, known)
    if upper is None or node.operation.finds:
        return None
    source = node.inputs[upper]
    while source in before and before[source].operation.name in CONVERSIONS and before[source].first:
        source = before[source].first or source
    rectangle, image = thin.get(source), known[upper]
    forms = [(each.height, each.width, each.channels, each.space, each.alpha) for each in (image, made)]
    sizes = {(each.height, each.width) for each in known.values()}
    if rectangle is None or forms[0] != forms[1] or len(sizes) > 1:
        return None
    return (rectangle, upper) if rectangle[2] * rectangle[3] <= WORTHWHILE * made.pixels else None


def _narrowed(node: Node, rectangle: Rectangle, upper: str) -> list[Node]:
    """Crops of what a node reads, the node, and its result in what it hands on."""
    left, top, width, height = rectangle
    parameters = crop.validate({"left": left, "top": top, "width": width, "height": height})
    crops = {
        key: Node(f"{node.name}.{key}", crop, parameters, {"image": source}) for key, source in node.inputs.items()
    }
    narrow = node.replace(inputs={key: each.name for key, each in crops.items()})
    inputs = {"image": node.inputs[upper], "part": node.name}
    return [*crops.values(), narrow, Node(f"{node.name}.patch", patch, Parameters(left=left, top=top), inputs)]
