"""How far the outputs of a graph may be from truth, and how long it takes, by the choices made for its nodes.

The error is carried forward: what reaches a node passes through its modulus of continuity, and its own method's error
is added. Inputs that err by all of it and inputs that err by its rounding alone are no further apart than the rest, so
what is carried of the rest is what lies beyond rounding, also where the modulus jumps. What work that was left out
would have changed arrives at the readers of what it left (`inherited`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from lichen.accuracy.precision import Precision, visible_storing_error
from lichen.image import Alpha
from lichen.operation import EXACT, Error, Facts
from lichen.planning.candidates import Candidate
from lichen.planning.graph import Graph, Node

Choices = Mapping[str, Candidate]


def errors(graph: Graph, facts: Mapping[str, Facts], choices: Choices) -> dict[str, Error]:
    """Predicted error of every output, with every node by its choice."""
    return delivered(graph, reaching(graph, facts, choices))


def reaching(graph: Graph, facts: Mapping[str, Facts], choices: Choices) -> dict[str, Error]:
    """Predicted error of every value."""
    reached = {name: _kept(EXACT, known, graph.precision, source=True) for name, known in graph.sources.items()}
    for node in graph.nodes:
        reached[node.name] = _reached(graph, node, choices[node.name].error, facts, reached)
    return reached


def reaching_with(
    graph: Graph, facts: Mapping[str, Facts], choices: Choices, reached: Mapping[str, Error], name: str, error: Error
) -> dict[str, Error]:
    """`reached` with another error of the method of one node: only what reads what it changes is looked at."""
    found, changed = dict(reached), {name}
    for node in graph.nodes[graph.place(name) :]:
        if node.name != name and changed.isdisjoint(node.inputs.values()):
            continue
        own = error if node.name == name else choices[node.name].error
        made = _reached(graph, node, own, facts, found)
        if made != reached[node.name]:
            found[node.name] = made
            changed.add(node.name)
    return found


def delivered(graph: Graph, reached: Mapping[str, Error]) -> dict[str, Error]:
    """Of every output."""
    return {name: _off(reached[each.source], each.inherited) for name, each in graph.outputs.items()}


def _reached(graph: Graph, node: Node, own: Error, facts: Mapping[str, Facts], reached: Mapping[str, Error]) -> Error:
    made = _made(node, own, facts, reached)
    return made if graph.precision.lossless else _kept(made, facts[node.name], graph.precision, own.rounding)


def total_error(graph: Graph, facts: Mapping[str, Facts], choices: Choices) -> Error:
    """The largest error of any output."""
    return max(errors(graph, facts, choices).values(), key=lambda error: error.value)


def total_seconds(graph: Graph, choices: Choices) -> float:
    return sum(choices[node.name].seconds for node in graph.nodes)


def _made(node: Node, own: Error, facts: Mapping[str, Facts], reached: Mapping[str, Error]) -> Error:
    """The error of what a node makes.

    What reaches an input that is data passes through no modulus: the result is then known by its range alone.
    """
    about = node.about(facts)
    if len(node.inputs) == 1 and not node.inherited:
        (source,) = node.inputs.values()
        arriving = [reached[source]]
        worst, rounded, often = arriving[0].value, arriving[0].rounding, arriving[0].usual
    else:
        arriving = [_off(reached[source], node.inherited.get(key, 0.0)) for key, source in node.inputs.items()]
        worst = max((error.value for error in arriving), default=0.0)
        rounded = max((error.rounding for error in arriving), default=0.0)
        often = max((error.usual for error in arriving), default=0.0)
    value = about.carried(worst) if worst else 0.0
    rounding = value if rounded == worst else max(value - about.carried(worst - rounded), 0.0)
    usual = value if often == worst else about.carried(often) if often else 0.0
    kind: Literal["bound", "estimate"] = "bound"
    if own.kind != "bound" or any(error.kind != "bound" for error in arriving):
        kind = "estimate"
    largest = value + own.value
    if worst and about.data and any(arriving[number].value for number in about.data):
        largest = facts[node.name].extent.spread + own.rounding
    return Error(largest, kind, rounding + own.rounding, usual + own.usual)


def _off(error: Error, by: float) -> Error:
    """An error that is larger by a proved amount."""
    return Error(error.value + by, error.kind, error.rounding, error.usual + by) if by else error


def _kept(error: Error, facts: Facts, precision: Precision, slack: float = 0.0, *, source: bool = False) -> Error:
    """The error once the value is stored; the value strays from its facts by at most `slack`.

    The facts of a straight picture that was computed tell how bright it shows, not how bright its colour is where it
    shines through little coverage. Fixed point may clip all of that; half floats hold it as a rule.
    """
    if precision.lossless:
        return error
    covered = facts.alpha is Alpha.STRAIGHT and not source
    usual = visible_storing_error(facts, precision, error.usual if covered else slack)
    added, kind = usual, error.kind
    if covered and precision.levels is not None:
        added = max(usual, facts.extent.magnitude + slack)
    elif covered:
        kind = "estimate"
    return Error(error.value + added, kind, error.rounding + added, error.usual + usual)
