"""The light and the alpha in which nodes get their pictures, and in which readers get what they made.

Operations declared in linear light get their pictures scene-linear with associated alpha, and what they return goes
back to the light and the alpha of their first picture, so that a chain reads as its author wrote it. Conversions are
ordinary nodes.

Images whose space is DATA are never converted: nobody said that they are light.
"""

from __future__ import annotations

from typing import Any

from lichen.catalogue import operation
from lichen.image import Alpha, Space
from lichen.operation import Facts, Light, Operation
from lichen.planning.graph import Graph, Node


class Conversions:
    """Copies a graph node by node, adding conversions. `renamed` maps old names to where their value now is; `facts`
    tells of every value."""

    def __init__(self, graph: Graph) -> None:
        self.nodes: list[Node] = []
        self._taken = {node.name for node in graph.nodes} | set(graph.sources)
        self._made: dict[tuple[str, str, str], str] = {}
        self.inserted: set[str] = set()
        self.renamed: dict[str, str] = {}
        self.facts: dict[str, Facts] = dict(graph.sources)

    def add(self, node: Node) -> Node:
        """The node as it will run."""
        inputs = {key: self.renamed.get(source, source) for key, source in node.inputs.items()}
        before = {key: self.facts[source] for key, source in inputs.items()}
        pictures = [declared.name for declared in node.operation.inputs if declared.picture and declared.name in inputs]
        for key in pictures:
            space, alpha = _wanted(node, before[key])
            inputs[key] = self.convert(inputs[key], space, alpha)
        running = node if inputs == node.inputs else node.replace(inputs=inputs)
        self.append(running)
        value = node.name
        if pictures:
            original, given = before[pictures[0]], self.facts[inputs[pictures[0]]]
            made = self.facts[value]
            space = original.space if made.space is given.space else made.space
            alpha = original.alpha if made.alpha is given.alpha else made.alpha
            value = self.convert(value, space, alpha)
        self.renamed[node.name] = value
        return running

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
        self.nodes.append(node)
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
