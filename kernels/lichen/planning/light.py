"""The pass that brings pictures into the light an operation is defined in, and back, by `Conversions`.

Where one conversion undoes another the pair is dropped, so a chain of linear operations converts once at each end.
"""

from __future__ import annotations

import dataclasses

from lichen.image import Alpha, Space
from lichen.part import Rectangle
from lichen.planning.conversions import Conversions
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


class _Builder(Conversions):
    """Conversions for all of a graph, its outputs and observers too."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self._graph = graph
        self._observers: tuple[Node, ...] = ()
        self._outputs: dict[str, Output] = {}

    def graph(self) -> Graph:
        return self._graph.replace(nodes=tuple(self.nodes), outputs=self._outputs, observers=self._observers)

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
