"""The pass that brings pictures into the light an operation is defined in, and back.

Operations declared in linear light get their pictures scene-linear with associated alpha, and what they return goes
back to the light and the alpha of their first picture, so that a chain reads as its author wrote it. Conversions are
ordinary nodes. Where one undoes another the pair is dropped, so a chain of linear operations converts once at each end.

Images whose space is DATA are never converted: nobody said that they are light.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from lichen.catalogue import operation
from lichen.image import Alpha, Space
from lichen.operation import Facts, Light, Operation
from lichen.part import Rectangle
from lichen.planning.graph import Graph, Node, Output, Request
from lichen.planning.prune import cancelled
from lichen.planning.region import crop, whole


def light(graph: Graph, request: Request) -> Graph:
    """Wrap every operation that needs it in conversions, convert the outputs as asked, drop pairs that cancel."""
    wrapped = _Builder(graph)
    for node in graph.nodes:
        wrapped.add(node)
    wrapped.observe()
    wrapped.deliver()
    made = wrapped.graph()
    cancelling = cancelled(made, request, "light", None if request.prune else wrapped.inserted)
    return _without_idle(cancelling, wrapped.inserted)


def _without_idle(graph: Graph, inserted: set[str]) -> Graph:
    """Without conversions back that nobody reads, since every reader wants linear light."""
    read = graph.needed()
    for node in reversed(graph.nodes):
        if node.name not in inserted or node.name in read:
            read.update(node.inputs.values())
    return graph.replace(nodes=tuple(node for node in graph.nodes if node.name not in inserted or node.name in read))


class _Builder:
    """Copies a graph node by node, adding conversions. `renamed` maps old names to where their value now is."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._nodes: list[Node] = []
        self._taken = {node.name for node in graph.nodes} | set(graph.sources)
        self._made: dict[tuple[str, str, str], str] = {}
        self._observers: tuple[Node, ...] = ()
        self._outputs: dict[str, Output] = {}
        self.inserted: set[str] = set()
        self.renamed: dict[str, str] = {}
        self.facts: dict[str, Facts] = dict(graph.sources)

    def graph(self) -> Graph:
        return self._graph.replace(nodes=tuple(self._nodes), outputs=self._outputs, observers=self._observers)

    def add(self, node: Node) -> None:
        inputs = {key: self.renamed.get(source, source) for key, source in node.inputs.items()}
        before = {key: self.facts[source] for key, source in inputs.items()}
        pictures = [declared.name for declared in node.operation.inputs if declared.picture and declared.name in inputs]
        for key in pictures:
            space, alpha = _wanted(node, before[key])
            inputs[key] = self.convert(inputs[key], space, alpha)
        self.append(node if inputs == node.inputs else node.replace(inputs=inputs))
        value = node.name
        if pictures:
            original, given = before[pictures[0]], self.facts[inputs[pictures[0]]]
            made = self.facts[value]
            space = original.space if made.space is given.space else made.space
            alpha = original.alpha if made.alpha is given.alpha else made.alpha
            value = self.convert(value, space, alpha)
        self.renamed[node.name] = value

    def observe(self) -> None:
        """Let observers see what they would have seen: pictures in the light and with the alpha they came in."""
        self._observers = tuple(
            node.replace(inputs={key: self.renamed.get(source, source) for key, source in node.inputs.items()})
            for node in self._graph.observers
        )

    def deliver(self) -> None:
        """Point every output at the value in the asked space and alpha."""
        for name, output in self._graph.outputs.items():
            value = self.renamed.get(output.source, output.source)
            facts = self.facts[value]
            known = Space.DATA not in (facts.space, output.space)
            space = output.space if output.space is not None and known else facts.space
            covered = Alpha.NONE not in (facts.alpha, output.alpha)
            alpha = output.alpha if output.alpha is not None and covered else facts.alpha
            value = self.convert(value, space, alpha)
            self._outputs[name] = dataclasses.replace(output, source=self.cut(value, output.crop), crop=None)

    def cut(self, source: str, rectangle: Rectangle | None) -> str:
        """The name of a rectangle of `source`."""
        if rectangle is None or rectangle == whole(self.facts[source]):
            return source
        left, top, width, height = rectangle
        return self.insert(source, crop, left=left, top=top, width=width, height=height)

    def convert(self, source: str, space: Space, alpha: Alpha) -> str:
        """The name of `source` in `space` and `alpha`, through straight alpha where colour changes light."""
        facts = self.facts[source]
        if facts.space is not space:
            source = self.associate(source, Alpha.STRAIGHT)
            direction = "decode" if space is Space.LINEAR else "encode"
            source = self.insert(source, operation("transfer"), direction=direction)
        return self.associate(source, alpha)

    def associate(self, source: str, alpha: Alpha) -> str:
        if Alpha.NONE in (self.facts[source].alpha, alpha) or self.facts[source].alpha is alpha:
            return source
        return self.insert(source, operation("premultiply"), inverse=alpha is Alpha.STRAIGHT)

    def insert(self, source: str, chosen: Operation[Any], **values: object) -> str:
        """The name of `source` after a conversion, which is made once however many read it."""
        said = (source, chosen.name, str(values))
        if said not in self._made:
            stem = f"{source}.{chosen.name}"
            unique = next(
                label for n in range(len(self._taken) + 1) if (label := f"{stem}{n or ''}") not in self._taken
            )
            self.append(Node(unique, chosen, chosen.validate(values), {chosen.inputs[0].name: source}))
            self._taken.add(unique)
            self.inserted.add(unique)
            self._made[said] = unique
        return self._made[said]

    def append(self, node: Node) -> None:
        self._nodes.append(node)
        self.facts[node.name] = node.result(self.facts)


def _wanted(node: Node, facts: Facts) -> tuple[Space, Alpha]:
    """The space and alpha in which a picture enters a node."""
    space, alpha = facts.space, facts.alpha
    if node.operation.light is Light.LINEAR and not node.operation.as_stored(node.parameters):
        space = Space.LINEAR if space is Space.SRGB else space
        alpha = Alpha.ASSOCIATED if alpha is Alpha.STRAIGHT else alpha
    if node.operation.wants_alpha is not None and alpha is not Alpha.NONE:
        alpha = node.operation.wants_alpha
    return space, alpha
