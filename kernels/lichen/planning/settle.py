"""The pass that takes out what was chosen to be left out, and what that makes superfluous.

A node left out hands on one of its inputs. Its readers inherit the proved distance between the two, so the error of the
whole counts it. Conversions that then undo each other go, too, and what nothing reads any more.

What remains is chosen anew: the conversions that went no longer amplify anybody's error, so that methods may do which
before could not, down to the definition of a node that nothing else was accurate enough for. That leaves out more, or
nothing, and ends where nothing is left out. Where it saves no time the choices stay, predicted from the facts of what
really arrives.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from lichen.errors import Unattainable
from lichen.operation import Facts
from lichen.planning.candidates import Candidate, Offers
from lichen.planning.choose import choose
from lichen.planning.error import total_seconds
from lichen.planning.graph import Decision, Graph, Moved, Node, Request
from lichen.planning.prune import cancelled, cost, unread


def settle(graph: Graph, request: Request) -> Graph:
    """Without the nodes whose choice is to hand on an input."""
    facts = graph.facts()
    moved: dict[str, Moved] = {}
    decisions = []
    for node in graph.nodes:
        choice = node.choice
        if choice is None or choice.passes is None:
            continue
        source, change = node.inputs[choice.passes], choice.error.value + node.inherited.get(choice.passes, 0.0)
        if source in moved:
            source, change = moved[source].source, change + moved[source].change
        moved[node.name] = Moved(source, change)
        bound = effect(graph, facts, node.name, choice.error.value)
        apart = f"differs from its {choice.passes} by {choice.error.value:.3g} at most"
        reason = apart if choice.error.value else f"returns its {choice.passes} as it is"
        decisions.append(
            Decision("invisible", node.name, "dropped", reason, bound, partial(cost, node, facts, request))
        )
    if not moved:
        return graph
    left = graph.reading(moved).deciding(decisions)
    return _anew(_predicted(unread(cancelled(left, request, "light"), request), request), request)


def _anew(graph: Graph, request: Request) -> Graph:
    """With what is left chosen once more, if that is quicker."""
    told = tuple(each for each in graph.decisions if each.pass_ != "choose")
    try:
        found = settle(choose(graph.replace(decisions=told), request), request)
    except Unattainable:
        return graph
    return found if _seconds(found) < _seconds(graph) else graph


def _seconds(graph: Graph) -> float:
    return total_seconds(graph, {node.name: node.choice for node in graph.nodes if node.choice is not None})


def effect(graph: Graph, facts: Mapping[str, Facts], name: str, change: float) -> float:
    """The largest change of any output when the value called `name` changes by at most `change`. Of an operation that
    reads it as data, the range of what it makes alone is known."""
    reached = {name: change}
    for node in graph.nodes[graph.place(name) + 1 :]:
        arriving = [reached.get(source, 0.0) for source in node.inputs.values()]
        worst = max(arriving, default=0.0)
        if worst:
            about = node.about(facts)
            as_data = any(arriving[number] for number in about.data)
            reached[node.name] = facts[node.name].extent.spread if as_data else about.carried(worst)
    return max(reached.get(output.source, 0.0) for output in graph.outputs.values())


def _predicted(graph: Graph, request: Request) -> Graph:
    """The same choices, with what they make of the inputs as they are now."""
    facts, left = graph.facts(), {node.name for node in graph.nodes}
    told = tuple(each for each in graph.decisions if each.pass_ != "choose" or each.node in left)
    return graph.replace(nodes=tuple(_again(node, facts, request) for node in graph.nodes), decisions=told)


def _again(node: Node, facts: Mapping[str, Facts], request: Request) -> Node:
    choice, about = node.choice, node.about(facts)
    assert choice is not None, "every node has its choice"

    def again(offer: Candidate) -> Candidate:
        method = node.operation.methods.get(offer.method)
        if method is None:
            return offer
        rate = request.rate(node.operation, method).of(about.kind)
        return offer._replace(stated=about.offer(method, offer.knob), rate=rate)

    return node.chosen(again(choice), Offers(tuple(map(again, node.alternatives))))
