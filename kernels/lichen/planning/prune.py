"""Passes that leave out work without changing a bit of the output, or by no more than rounding.

* `unread` floods back from the outputs and drops what nothing reads.
* `shared` computes once what several nodes ask for in the same words.
* `identity` drops operations that declare, for these parameters and inputs, that they return their first input.
* `cancelled` drops pairs in which one operation undoes the other.

What an operation finds in pictures it returns unchanged is still reported: such nodes stay as observers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

from lichen.image import Alpha, Space
from lichen.operation import Facts
from lichen.planning.conversions import Conversions
from lichen.planning.graph import Decision, Graph, Moved, Node, Request, rewired


def unread(graph: Graph, request: Request) -> Graph:
    """Drop nodes whose result reaches no output."""
    needed = graph.needed()
    dropped = [node for node in graph.nodes if node.name not in needed]
    if not dropped:
        return graph
    facts = graph.facts()
    names = {node.name for node in dropped}
    return graph.replace(nodes=tuple(node for node in graph.nodes if node.name not in names)).deciding(
        Decision("unread", node.name, "dropped", "nothing reads its result", saved=partial(cost, node, facts, request))
        for node in dropped
    )


def shared(graph: Graph, request: Request) -> Graph:
    """Let nodes that do the same to the same inputs be one. Parameters are compared where the rest is the same."""
    facts: dict[str, Facts] | None = None
    moved: dict[str, Moved] = {}
    first: dict[object, Node] = {}
    beside: dict[object, dict[object, str]] = {}
    decisions = []
    for node in graph.nodes:
        if node.operation.finds:
            continue
        now = rewired(node, moved)
        where = now.operation.name, *now.inputs.values()
        if first.setdefault(where, now) is now:
            continue
        others = beside.setdefault(where, {})
        others.setdefault(_same(first[where]), first[where].name)
        twin = others.setdefault(_same(now), now.name)
        if twin == now.name:
            continue
        facts = facts or graph.facts()
        moved[node.name] = Moved(twin)
        reason, saved = f"{twin} computes the same", partial(cost, node, facts, request)
        decisions.append(Decision("shared", node.name, "dropped", reason, saved=saved))
    return graph.reading(moved).deciding(decisions)


def _same(node: Node) -> object:
    """Equal for nodes that compute the same."""
    asked = (node.asked.method, tuple(sorted(node.asked.knobs.items())), node.asked.max_error)
    return node.operation.name, node.parameters.model_dump_json(), tuple(node.inputs.items()), asked


def identity(graph: Graph, request: Request) -> Graph:
    """Drop operations that change nothing, by their own declaration, and pairs that undo each other. What they read is
    then in the light and has the alpha in which it reaches them."""
    facts = graph.facts()
    plain = all(each.space is not Space.SRGB and each.alpha is Alpha.NONE for each in facts.values())
    conversions = None if plain else Conversions(graph)
    moved: dict[str, Moved] = {}
    observers = []
    decisions = []
    for node in graph.nodes:
        known = facts if conversions is None else conversions.facts
        running = node if conversions is None else conversions.add(node)
        reason = running.about(known).identity
        if reason is None:
            continue
        source = node.first
        assert source is not None, "only nodes that read something return their first input"
        moved[node.name] = Moved(moved[source].source if source in moved else source)
        decisions.append(
            Decision("identity", node.name, "dropped", reason, saved=partial(cost, node, facts, request)),
        )
        if node.operation.finds:
            observers.append(node)
    graph = graph.replace(observers=(*graph.observers, *observers)).reading(moved).deciding(decisions)
    return cancelled(graph, request, "identity")


def cancelled(graph: Graph, request: Request, cause: str, among: Iterable[str] | None = None) -> Graph:
    """Drop pairs in which a node undoes the one it reads. `among` names the only nodes that may be dropped."""
    allowed = None if among is None else set(among)
    before = {node.name: node for node in graph.nodes}
    facts: dict[str, Facts] | None = None
    moved: dict[str, Moved] = {}
    undone: list[tuple[str, str]] = []
    for node in graph.nodes:
        now = rewired(node, moved)
        other = before.get(now.first or "")
        if other is None or other.operation is not node.operation or node.operation.finds:
            continue
        if allowed is not None and not {node.name, other.name} <= allowed:
            continue
        if node.operation.inverse(node.parameters) != other.parameters or len(other.inputs) != 1:
            continue
        facts = facts or graph.facts()
        origin = rewired(other, moved)
        source = origin.first
        assert source is not None, "it has one input"
        if facts[other.name].extent.nonfinite > facts[source].extent.nonfinite:
            continue  # what went beyond float's range does not come back
        moved[node.name] = Moved(source, _through(now, facts, _through(origin, facts, 0.0)))
        undone.append((node.name, other.name))
    if not undone:
        return graph
    return swept(graph, graph.reading(moved), request, cause, undone)


def _through(node: Node, facts: Mapping[str, Facts], error: float) -> float:
    """What an error of the first input, with what it inherits, grows to behind a node."""
    key = next(iter(node.inputs))
    return node.carried(facts, error + node.inherited.get(key, 0.0))


def swept(before: Graph, graph: Graph, request: Request, cause: str, undone: Iterable[tuple[str, str]]) -> Graph:
    """`graph` without what nothing reads since pairs were taken out of `before`, with a decision for each node."""
    facts = before.facts()
    needed = graph.needed()
    kept = [node for node in graph.nodes if node.name in needed]
    names = {node.name for node in kept}
    gone = [node for node in before.nodes if node.name not in names]
    why = {}
    for second, first in undone:
        why[second] = f"undoes {first}"
        why.setdefault(first, f"{second} undoes it")
    return graph.replace(nodes=tuple(kept)).deciding(
        Decision(cause, node.name, "dropped", why.get(node.name, "nothing reads its result any more"),
                 saved=partial(cost, node, facts, request))
        for node in gone
    )  # fmt: skip


def cost(node: Node, facts: Mapping[str, Facts], request: Request) -> float:
    """Predicted milliseconds that a node would have taken, by its quickest method."""
    quickest = float("inf")
    for (method, _), offer in node.offers(facts).items():
        if offer.unfit is None:
            rate = request.rate(node.operation, node.operation.methods[method])
            quickest = min(quickest, rate.seconds(offer.work, node.about(facts).kind))
    return quickest * 1e3 if quickest < float("inf") else 0.0
