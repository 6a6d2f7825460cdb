"""Passes that make one operation of two that are neighbours.

`join`: matrices are multiplied, in doubles, wherever one follows another: their definitions agree to the rounding of
doubles. It is done where the product is proved to be no less accurate than the two, and where nothing leaves float's
range between them that would not leave it in the product. Nodes of which anything is asked stay as they are, and so
does what others read too.

`concatenate`: two warps as one filter the image once, and show what the two do without the blur of the filter between:
another picture, with no bound on how far from the first. So that is done only where it is asked for
(`Request.concatenate`), with warps that are neighbours as the graph was written, whether or not it is pruned then.

Tables of one dimension are not composed. Looking twice is no longer the dearer part of a pixel once both are steps of
one kernel, and a table of the two would have an error of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from lichen.catalogue import operation
from lichen.joining import Joined
from lichen.operation import Facts
from lichen.planning.graph import FREE, Decision, Graph, Node, Request
from lichen.planning.prune import cost

ROUNDED = 2.0**-50
"""Of a product of matrices in doubles, relative to the products of magnitudes."""


def join(graph: Graph, request: Request) -> Graph:
    """With one node for every two that one does as well."""
    return _Joining(graph, request, same=True).all()


def concatenate(graph: Graph, request: Request) -> Graph:
    """With one warp for every two that can be one, where that was asked for."""
    return _Joining(graph, request, same=False).all() if request.concatenate else graph


class _Joining:
    """Copies a graph node by node; a node that is joined with the one before it takes its place behind it."""

    def __init__(self, graph: Graph, request: Request, *, same: bool) -> None:
        self._graph, self._request, self._same = graph, request, same
        self._facts: dict[str, Facts] = graph.facts()
        self._read: dict[str, int] = {}
        for each in (*graph.nodes, *graph.observers):
            for source in each.inputs.values():
                self._read[source] = self._read.get(source, 0) + 1
        for output in graph.outputs.values():
            self._read[output.source] = self._read.get(output.source, 0) + 1
        self.nodes: dict[str, Node] = {}
        self.decisions: list[Decision] = []

    def all(self) -> Graph:
        for node in self._graph.nodes:
            self._add(node)
        if not self.decisions:
            return self._graph
        return self._graph.replace(nodes=tuple(self.nodes.values())).deciding(self.decisions)

    def _add(self, node: Node) -> None:
        before = self.nodes.get(node.first or "")
        if before is not None and self._alone(before, node):
            node = self._joined(before, node) or node
        self.nodes[node.name] = node

    def _alone(self, before: Node, node: Node) -> bool:
        return self._read[before.name] == 1 and all(
            each.asked == FREE and len(each.inputs) == 1 and not each.inherited for each in (before, node)
        )

    def _joined(self, before: Node, node: Node) -> Node | None:
        """One node for both, if there is one, with the decision that tells it."""
        facts = self._facts
        first, second = before.about(facts).link, node.about(facts).link
        found = first.then(second) if first is not None and second is not None else None
        if isinstance(found, str):
            if not self._same:
                self.decisions.append(Decision("concatenate", node.name, "kept apart", found))
            return None
        if found is None or found.same is not self._same:
            return None
        wanted = operation(found.operation)
        source = before.first
        assert source is not None, "it reads one picture"
        made = Node(node.name, wanted, wanted.validate(found.parameters), {wanted.inputs[0].name: source})
        if found.same and not self._as_good(made, before, node):
            return None
        self._decide(made, before, node, found)
        del self.nodes[before.name]
        facts[made.name] = made.result(facts)
        return made

    def _as_good(self, made: Node, before: Node, node: Node) -> bool:
        """Whether every method of the one states no more than the best of the two do, and no value is lost between."""
        facts = self._facts
        if facts[before.name].extent.nonfinite > facts[before.first or ""].extent.nonfinite:
            return False
        apart = _least(node, facts) + node.carried(facts, _least(before, facts))
        return all(offer.error.value <= apart for offer in made.offers(facts).values())

    def _decide(self, made: Node, before: Node, node: Node, found: Joined) -> None:
        facts, bound = self._facts, 0.0
        if found.same:
            bound = ROUNDED * node.carried(facts, before.carried(facts, facts[before.first or ""].extent.magnitude))
        why = found.reason if found.same else f"{found.reason}; it was asked for, and the picture is another one"
        pass_, action = "join" if found.same else "concatenate", f"joined with {node.name}"
        saved = partial(_saved, before, node, made, facts, self._request)
        self.decisions.append(Decision(pass_, before.name, action, why, bound, saved))


def _saved(before: Node, node: Node, made: Node, facts: Mapping[str, Facts], request: Request) -> float:
    """Milliseconds that one node takes less than the two."""
    return max(cost(before, facts, request) + cost(node, facts, request) - cost(made, facts, request), 0.0)


def _least(node: Node, facts: Mapping[str, Facts]) -> float:
    """The least error that any of its methods states."""
    return min(offer.error.value for offer in node.offers(facts).values() if offer.unfit is None)
