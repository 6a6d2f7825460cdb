"""The pass that asks only for the part of each picture that an output needs.

An output may be cropped. A crop moves towards the sources: crop(N(x)) is crop(N(crop(x))), the inner crop wider by
N's footprint. It ends there where the picture does, so borders are real ones; around pictures that wrap, and where a
footprint is the whole extent, that axis stays whole. Operations whose result depends on where a pixel lies, or has
another size than what they read, say themselves how a part of it is made (`Operation.part`): a warp by the part of the
source that it shows. Those that say nothing are not passed, nor are those that report what they find in all pixels.

Crops are ordinary nodes of an operation of this module: facts, errors, times and truth follow as for all others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from pydantic import Field

from lichen.memory import Array, aligned
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
from lichen.part import Part, Rectangle, united
from lichen.planning.graph import Decision, Graph, Moved, Node, Request, inputs_of
from lichen.planning.prune import cost

WORTHWHILE = 0.8
"""Of a picture; a larger part is not worth its copy."""


class Parameters(OperationParameters):
    left: int = Field(ge=0)
    top: int = Field(ge=0)
    width: int = Field(ge=1)
    height: int = Field(ge=1)

    @property
    def rectangle(self) -> Rectangle:
        return self.left, self.top, self.width, self.height


def _result(p: Parameters, facts: InputFacts) -> Facts:
    return dataclasses.replace(facts["image"], height=p.height, width=p.width)


crop = Operation(
    name="crop",
    family="planning",
    summary="A rectangle of a picture.",
    parameters=Parameters,
    inputs=(Input("image"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "all of it" if p.rectangle == whole(facts["image"]) else None,
    result=_result,
    implied=lambda p, facts: "a rectangle does not move with the part that is taken",
)


@crop.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    pixels: Array = inputs["image"].pixels[p.top : p.top + p.height, p.left : p.left + p.width]
    return pixels


@crop.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=lambda p, knob, facts: float(p.width * p.height * facts["image"].channels),
    rates={"opencl": Rate(2e-5, 2.5e-10), "numpy": Rate(2e-5, 2.5e-10)},
    scratch=0.0,
)
class Exact:
    """A copy."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(truth(inputs, p))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(truth(inputs, p))


def whole(facts: Facts) -> Rectangle:
    return 0, 0, facts.width, facts.height


def region(graph: Graph, request: Request) -> Graph:
    """The graph with its crops as near to the sources as they can be."""
    if not any(node.operation is crop for node in graph.nodes):
        return graph
    facts = graph.facts()
    asked = _asked(graph, facts)
    narrowed = _Narrowed(graph, facts, asked)
    for node in graph.nodes:
        narrowed.add(node)
    made = narrowed.graph()
    small = made.facts()
    return made.deciding(
        Decision(
            "region",
            node.name,
            f"computed on {_said(narrowed.parts[node.name].covers)}",
            f"no more of its {facts[node.name].width}x{facts[node.name].height} px reaches an output",
            saved=max(cost(node, facts, request) - cost(made.named(node.name), small, request), 0.0),
        )
        for node in graph.nodes
        if node.name in narrowed.parts
    )


def _said(rectangle: Rectangle) -> str:
    left, top, width, height = rectangle
    return f"{width}x{height} from ({left}, {top})"


def _asked(graph: Graph, facts: Mapping[str, Facts]) -> dict[str, Rectangle]:
    """Backward through the graph: which rectangle of each value is read at all."""
    asked: dict[str, Rectangle] = {}

    def ask(source: str, rectangle: Rectangle) -> None:
        asked[source] = united(asked[source], rectangle) if source in asked else rectangle

    for output in graph.outputs.values():
        ask(output.source, whole(facts[output.source]))
    for observer in graph.observers:
        for source in observer.inputs.values():
            ask(source, whole(facts[source]))
    for node in reversed(graph.nodes):
        if node.name not in asked:
            ask(node.name, whole(facts[node.name]))  # nobody reads it, and it runs all the same
        if isinstance(node.parameters, Parameters):
            ask(node.inputs["image"], _within(node.parameters.rectangle, asked[node.name]))
            continue
        part = needed(node, facts, asked[node.name])
        for key, source in node.inputs.items():
            ask(source, part.inputs[key] if part else whole(facts[source]))
    return asked


def _within(outer: Rectangle, inner: Rectangle) -> Rectangle:
    """What is told from the corner of a rectangle, told from where that one is."""
    return outer[0] + inner[0], outer[1] + inner[1], inner[2], inner[3]


def needed(node: Node, facts: Mapping[str, Facts], rectangle: Rectangle) -> Part | None:
    """How a node makes a rectangle of its result; None where it makes all of it."""
    known, made = inputs_of(node, facts), facts[node.name]
    if made.pages > 1:
        return None
    if node.operation.part is not None:
        part = node.operation.part(node.parameters, known, rectangle)
    else:
        part = _by_footprint(node, known, made, rectangle)
    if part is None or not _worthwhile(part, known, made) or not _possible(node, part, known):
        return None
    return part


def _by_footprint(node: Node, known: InputFacts, made: Facts, rectangle: Rectangle) -> Part | None:
    """A rectangle of every input, wider by the footprint, gives the same rectangle of the result."""
    sizes = {(each.height, each.width) for each in (*known.values(), made)}
    if not known or len(sizes) > 1 or node.operation.finds or node.operation.implied(node.parameters, known):
        return None
    footprint = node.operation.footprint(node.parameters, known)
    left, width = _widened(rectangle[0], rectangle[2], footprint.columns, made.width, footprint.wraps)
    top, height = _widened(rectangle[1], rectangle[3], footprint.rows, made.height, footprint.wraps)
    part = left, top, width, height
    return Part(node.parameters, dict.fromkeys(node.inputs, part), part)


def _worthwhile(part: Part, known: InputFacts, made: Facts) -> bool:
    pairs = [(part.covers, made), *((part.inputs[key], each) for key, each in known.items())]
    return any(width * height <= WORTHWHILE * each.pixels for (_, _, width, height), each in pairs)


def _possible(node: Node, part: Part, known: InputFacts) -> bool:
    """Whether the method that the caller asked for can make a part."""
    method = node.operation.methods.get(node.asked.method or "")
    return method is None or method.unfit(part.parameters, known) == method.unfit(node.parameters, known)


def _widened(start: int, length: int, reach: int | None, size: int, wraps: bool) -> tuple[int, int]:
    """A span and all within reach of it, inside the picture."""
    if reach is None or (wraps and (start < reach or start + length + reach > size)):
        return 0, size
    low, high = max(start - reach, 0), min(start + length + reach, size)
    return low, high - low


class _Narrowed:
    """Copies a graph node by node. `covers` says which rectangle of a value there is."""

    def __init__(self, graph: Graph, facts: Mapping[str, Facts], asked: Mapping[str, Rectangle]) -> None:
        self._graph, self._facts, self._asked = graph, facts, asked
        self._nodes: list[Node] = []
        self._made: dict[tuple[str, Rectangle], str] = {}
        self._taken = {*facts}
        self._covers = {name: whole(facts[name]) for name in graph.sources}
        self._moved: dict[str, Moved] = {}
        self._crops: dict[str, tuple[str, Rectangle]] = {}
        self._kept = {output.source for output in graph.outputs.values()}
        self._kept |= {source for node in graph.observers for source in node.inputs.values()}
        self.parts: dict[str, Part] = {}

    def graph(self) -> Graph:
        return self._graph.replace(nodes=tuple(self._nodes)).reading(self._moved)

    def add(self, node: Node) -> None:
        if isinstance(node.parameters, Parameters):
            self._crops[node.name] = node.inputs["image"], node.parameters.rectangle
            if node.name in self._kept:
                self._moved[node.name] = Moved(self._cut(node.name, whole(self._facts[node.name])))
            return
        part = needed(node, self._facts, self._asked[node.name])
        if part is None:
            whole_ = {key: whole(self._facts[source]) for key, source in node.inputs.items()}
            part = Part(node.parameters, whole_, whole(self._facts[node.name]))
        else:
            self.parts[node.name] = part
        inputs = {key: self._cut(source, part.inputs[key]) for key, source in node.inputs.items()}
        self._covers[node.name] = part.covers
        self._append(node.replace(inputs=inputs, parameters=part.parameters))

    def _cut(self, source: str, rectangle: Rectangle) -> str:
        """The name of a rectangle of a value; of a crop it is one of what that is cut from."""
        if source in self._crops:
            source, outer = self._crops[source]
            return self._cut(source, _within(outer, rectangle))
        if self._covers[source] == rectangle:
            return source
        if (source, rectangle) not in self._made:
            name = next(
                label for n in range(len(self._taken) + 1) if (label := f"{source}.crop{n or ''}") not in self._taken
            )
            self._taken.add(name)
            model = Node(name, crop, Parameters(left=0, top=0, width=1, height=1), {"image": source})
            self._append(self._placed(model, source, rectangle))
            self._made[source, rectangle] = name
        return self._made[source, rectangle]

    def _placed(self, node: Node, source: str, rectangle: Rectangle) -> Node:
        """A crop whose rectangle is told from the corner of what there is of its source."""
        left, top, _, _ = self._covers[source]
        x, y, width, height = rectangle
        return node.replace(parameters=Parameters(left=x - left, top=y - top, width=width, height=height))

    def _append(self, node: Node) -> None:
        self._nodes.append(node)
