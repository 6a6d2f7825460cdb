"""The pass that brings pictures into the light an operation is defined in, and back.

Operations declared in linear light get their pictures scene-linear with associated alpha, and what they return goes
back to the light and the alpha of their first picture, so that a chain reads as its author wrote it. Conversions are
ordinary nodes. Where one undoes another the pair is dropped, so a chain of linear operations converts once at each end.

Images whose space is DATA are never converted: nobody said that they are light.
"""

from __future__ import annotations

import dataclasses

from lichen.catalogue import operation
from lichen.image import Alpha, Space
from lichen.operation import Facts, Light
from lichen.planning.graph import Decision, Graph, Node, Request, inputs_of


def light(graph: Graph, request: Request) -> Graph:
    """Wrap every operation that needs it in conversions, convert the output as asked, drop pairs that cancel."""
    wrapped = _Builder(graph)
    for node in graph.nodes:
        wrapped.add(node)
    wrapped.deliver(request)
    return _cancel(wrapped.graph)


class _Builder:
    """Copies a graph node by node, adding conversions. `renamed` maps old names to where their value now is."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph.replace(nodes=())
        self.renamed: dict[str, str] = {}
        self.facts = dict(graph.sources)

    def add(self, node: Node) -> None:
        inputs = {key: self.renamed.get(source, source) for key, source in node.inputs.items()}
        before = {key: self.facts[source] for key, source in inputs.items()}
        pictures = [declared.name for declared in node.operation.inputs if declared.picture and declared.name in inputs]
        for key in pictures:
            space, alpha = _wanted(node, before[key])
            inputs[key] = self.convert(inputs[key], space, alpha)
        self.append(dataclasses.replace(node, inputs=inputs))
        value = node.name
        if pictures:
            original, given = before[pictures[0]], self.facts[inputs[pictures[0]]]
            made = self.facts[value]
            space = original.space if made.space is given.space else made.space
            alpha = original.alpha if made.alpha is given.alpha else made.alpha
            value = self.convert(value, space, alpha)
        self.renamed[node.name] = value

    def deliver(self, request: Request) -> None:
        """Point the output at the value in the asked space and alpha."""
        value = self.renamed.get(self.graph.output, self.graph.output)
        facts = self.facts[value]
        known = Space.DATA not in (facts.space, request.space)
        space = request.space if request.space is not None and known else facts.space
        covered = Alpha.NONE not in (facts.alpha, request.alpha)
        alpha = request.alpha if request.alpha is not None and covered else facts.alpha
        output = self.convert(value, space, alpha)  # adds nodes to the graph, so it comes first
        self.graph = self.graph.replace(output=output)

    def convert(self, source: str, space: Space, alpha: Alpha) -> str:
        """The name of `source` in `space` and `alpha`, through straight alpha where colour changes light."""
        facts = self.facts[source]
        if facts.space is not space:
            source = self.associate(source, Alpha.STRAIGHT)
            direction = "decode" if space is Space.LINEAR else "encode"
            source = self.insert(source, "transfer", curve="srgb", direction=direction)
        return self.associate(source, alpha)

    def associate(self, source: str, alpha: Alpha) -> str:
        if Alpha.NONE in (self.facts[source].alpha, alpha) or self.facts[source].alpha is alpha:
            return source
        return self.insert(source, "premultiply", inverse=alpha is Alpha.STRAIGHT)

    def insert(self, source: str, name: str, **values: object) -> str:
        chosen = operation(name)
        stem = f"{source}.{name}"
        taken = {node.name for node in self.graph.nodes} | set(self.graph.sources)
        unique = next(label for n in range(len(taken) + 1) if (label := f"{stem}{n or ''}") not in taken)
        self.append(Node(unique, chosen, chosen.validate(values), {chosen.inputs[0].name: source}))
        return unique

    def append(self, node: Node) -> None:
        self.graph = self.graph.replace(nodes=(*self.graph.nodes, node))
        self.facts[node.name] = node.operation.result(node.parameters, inputs_of(node, self.facts))


def _wanted(node: Node, facts: Facts) -> tuple[Space, Alpha]:
    """The space and alpha in which a picture enters a node."""
    space, alpha = facts.space, facts.alpha
    if node.operation.light is Light.LINEAR:
        space = Space.LINEAR if space is Space.SRGB else space
        alpha = Alpha.ASSOCIATED if alpha is Alpha.STRAIGHT else alpha
    if node.operation.wants_alpha is not None and alpha is not Alpha.NONE:
        alpha = node.operation.wants_alpha
    return space, alpha


def _cancel(graph: Graph) -> Graph:
    """Drop pairs in which a node undoes the one it reads."""
    changed = True
    while changed:
        changed = False
        for node in graph.nodes:
            before = graph.node(node.first) if node.inputs else None
            undone = before is not None and node.operation.inverse(node.parameters) == before.parameters
            if before is None or not undone or node.operation is not before.operation:
                continue
            graph = graph.bypass(node.name, before.first)
            if graph.readers(before.name) == 0:
                graph = graph.bypass(before.name, before.first)
            graph = graph.deciding([Decision("light", node.name, "dropped", f"undoes {before.name}")])
            changed = True
            break
    return graph
