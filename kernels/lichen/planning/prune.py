"""Passes that drop work without changing a bit of the output.

`unread` floods back from the output and drops what nothing reads. `identity` drops operations that declare, for these
parameters and inputs, that they return their first input unchanged.
"""

from __future__ import annotations

from lichen.planning.graph import Decision, Graph, Request, inputs_of


def unread(graph: Graph, request: Request) -> Graph:
    """Drop nodes whose result reaches no output."""
    needed = {graph.output}
    for node in reversed(graph.nodes):
        if node.name in needed:
            needed.update(node.inputs.values())
    dropped = [node for node in graph.nodes if node.name not in needed]
    return graph.replace(nodes=tuple(node for node in graph.nodes if node.name in needed)).deciding(
        Decision("unread", node.name, "dropped", "nothing reads its result") for node in dropped
    )


def identity(graph: Graph, request: Request) -> Graph:
    """Drop operations that change nothing, by their own declaration."""
    facts = graph.facts()
    moved: dict[str, str] = {}
    for node in graph.nodes:
        reason = node.operation.identity(node.parameters, inputs_of(node, facts))
        if reason is not None:
            moved[node.name] = moved.get(node.first, node.first)
            graph = graph.bypass(node.name, moved[node.name])
            graph = graph.deciding([Decision("identity", node.name, "dropped", reason)])
    return graph
