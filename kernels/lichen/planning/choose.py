"""The pass that picks a method and a knob for every node, from predicted errors and times.

The caller's wish decides:

* `max_error`: the cheapest choices whose predicted errors meet it;
* `max_ms`: the most accurate choices that fit; with both, the cheapest within both;
* neither: the cheapest choices whose largest error, float32 rounding aside, lies below a quarter of each output's
  quantum; where none does, the cheapest whose typical error does; where none does either, the operation's customary
  method, or the most accurate;
* what is asked of a single node (method, knobs, its own largest error) narrows its candidates.

A node whose output is proved to be as close to one of its inputs as the budget allows (`Operation.departure`) may also
be left out: that is a candidate like the others, which takes no time and errs by that distance.

Where no method meets an asked error, nodes may be computed by their definitions, in doubles and slowly: only the
rounding of each result is then left. Where steps enlarge even that, as the encoding of dark colours does, nothing is
rounded between them either: all of the graph is evaluated in doubles, as `precision=float64` asks for. What even that
does not meet is `Unattainable`, with the best that can be had; it is never missed silently.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from lichen.accuracy.precision import Precision
from lichen.errors import Flaw, InvalidRequest, Unattainable, nearest
from lichen.image import Storage
from lichen.operation import ROUNDING, Error, Facts, Method
from lichen.planning.budget import Problem, within_error, within_time
from lichen.planning.candidates import NOTHING, Candidate, Offers, Way
from lichen.planning.graph import FREE, TRUTH, Asked, Decision, Graph, Node, Output, Request, inputs_of
from lichen.planning.predict import About, Told

DOUBLE_ROUNDING = 2.0**-40
"""Relative to the output's magnitude: of sums of thousands of terms in doubles, whatever order they are added in."""
LEFT_OUT = "left out"
"""The name of the candidate that does nothing."""


def choose(graph: Graph, request: Request) -> Graph:
    """Every node with its choice and the alternatives it was chosen from. Raises `InvalidRequest`, `Unattainable`."""
    facts = graph.facts()
    candidates = _definition if graph.precision is Precision.FLOAT64 else _candidates
    offers = {node.name: candidates(node, facts, request) for node in graph.nodes}
    _refuse_unusable(graph, request, offers)
    targets = {name: target_error(facts[each.source], each, request) for name, each in graph.outputs.items()}
    problem = Problem(graph, facts, request, offers, targets, measures(request))
    try:
        choices = within_time(problem) if request.max_ms is not None else _within_error(problem, offers)
    except Unattainable:
        if not _may_be_exact(graph, request):
            raise
        return choose(graph.replace(precision=Precision.FLOAT64), request)
    nodes = tuple([node.chosen(choices[node.name], offers[node.name]) for node in graph.nodes])
    said = _reason(request, min(targets.values()))
    decisions = [
        Decision("choose", node.name, f"method {_label(made)}", said, made.error.value, partial(_saved, node))
        for node in nodes
        if (made := node.choice) is not None and made.passes is None
    ]
    return graph.replace(nodes=nodes, decisions=(*graph.decisions, *decisions))


def _may_be_exact(graph: Graph, request: Request) -> bool:
    """Whether nothing but an error is asked, which leaves open in what numbers it is kept."""
    free = request.max_error is not None and request.max_ms is None and all(node.asked == FREE for node in graph.nodes)
    return free and graph.precision is Precision.FLOAT32


def _within_error(problem: Problem, offers: dict[str, Offers]) -> Mapping[str, Candidate]:
    """The cheapest methods that are accurate enough; with definitions among them only where there are none."""
    try:
        return within_error(problem)
    except Unattainable:
        free = [node for node in problem.graph.nodes if node.asked.method is None and not node.asked.knobs]
        if not free or not problem.graph.precision.lossless:
            raise
        for node in free:
            by_truth = _definition(node, problem.facts, problem.request, DOUBLE_ROUNDING + ROUNDING)
            known = offers[node.name]
            offers[node.name] = Offers(known.single + by_truth.single, known.ways)
        return within_error(dataclasses.replace(problem, offers=offers))


def _refuse_unusable(graph: Graph, request: Request, offers: Mapping[str, Offers]) -> None:
    flaws = []
    for node in graph.nodes:
        if offers[node.name].possible:
            continue
        reasons = "; ".join(f"{offer.method}: {offer.unfit}" for offer in offers[node.name])
        flaws.append((node.operation.name, Flaw(_where(node, request, "/method"), reasons)))
    if flaws:
        names = ", ".join(name for name, _ in flaws)
        raise InvalidRequest(f"No method of {names} can take this.", [flaw for _, flaw in flaws])


def _where(node: Node, request: Request, pointer: str) -> str:
    """A pointer to what was asked of a node: the request itself where it is about one operation."""
    return pointer if request.target else f"/nodes/{node.name}{pointer}"


def _definition(node: Node, facts: Mapping[str, Facts], request: Request, relative: float = DOUBLE_ROUNDING) -> Offers:
    """Truth itself, in doubles, with its rounding relative to the output's magnitude."""
    rounding = relative * facts[node.name].extent.magnitude
    seconds = node.operation.truth_seconds(node.parameters, inputs_of(node, facts))
    return Offers((Candidate(TRUTH, None, Told(Error(rounding, "bound", rounding), seconds)),))


def _candidates(node: Node, facts: Mapping[str, Facts], request: Request) -> Offers:
    """All methods at all knob values, or those that were asked for; unfit ones carry their reason. Of a node of which
    nothing is asked they are made once for the same rates."""
    if node.asked != FREE:
        return _sought(node, facts, request)
    kept, question = node.about(facts).kept, (request.backend, request.prune, request.max_ms is None)
    rates, found = kept.get(question, (None, NOTHING))
    offers: Offers = found if rates is request.rates else _sought(node, facts, request)
    kept[question] = request.rates, offers
    return offers


def _sought(node: Node, facts: Mapping[str, Facts], request: Request) -> Offers:
    asked, methods = node.asked, node.operation.methods
    if asked.method is not None and asked.method not in methods:
        raise InvalidRequest(
            f"{node.operation.name} has no method {asked.method!r}.",
            [Flaw(_where(node, request, "/method"), nearest(asked.method, methods))],
        )
    about = node.about(facts)
    ways = [
        _way(about, method, asked, request)
        for method in methods.values()
        if asked.method in (None, method.name)
        and (not asked.knobs or (method.knob and method.knob.name in asked.knobs))
    ]
    if not ways:
        raise InvalidRequest(
            f"The method {asked.method!r} of {node.operation.name} has no such knob.",
            [
                Flaw(_where(node, request, f"/knobs/{name}"), f"is not a knob of {asked.method}")
                for name in sorted(asked.knobs)
            ],
        )
    free = request.prune and (asked.method, asked.knobs) == (FREE.method, FREE.knobs) and not node.operation.finds
    offers = Offers(tuple(_left_out(node, facts, request)) if free else (), tuple(ways))
    return offers if asked.max_error is None else Offers(tuple(_accurate(node, offers, request)))


def _way(about: About, method: Method[Any], asked: Asked, request: Request) -> Way:
    rate = request.rate(about.operation, method)
    if rate.kinds:
        rate = rate.of(about.kind)
    setting = asked.knobs.get(method.knob.name) if asked.knobs and method.knob else None
    return Way(about, method, method.settings if setting is None else (setting,), rate)


def _left_out(node: Node, facts: Mapping[str, Facts], request: Request) -> Iterator[Candidate]:
    """Handing on an input instead, where the output is known to be near it. A time asked for buys no such error."""
    known, made = inputs_of(node, facts), facts[node.name]
    if any(each.extent.nonfinite for each in known.values()):
        return
    for key, change in node.about(facts).departure.items():
        if _alike(known[key], made) and (change == 0 or request.max_ms is None):
            yield Candidate(LEFT_OUT, None, Told(Error(change, "bound")), passes=key)


def _alike(given: Facts, made: Facts) -> bool:
    """Whether one picture can stand where the other does."""
    forms = [(each.height, each.width, each.channels, each.space, each.alpha, each.pages) for each in (given, made)]
    return forms[0] == forms[1]


def _accurate(node: Node, offers: Offers, request: Request) -> list[Candidate]:
    """The offers that keep the error asked of the node itself. Raises `Unattainable` where none does."""
    limit = node.asked.max_error
    assert limit is not None
    kept = [offer for offer in offers if offer.unfit is not None or offer.error.value <= limit]
    if any(offer.unfit is None for offer in kept):
        return kept
    best = min((offer.error.value for offer in offers if offer.unfit is None), default=None)
    if best is None:
        return kept
    raise Unattainable(
        f"No method of {node.name} meets an error of {limit:g}; the smallest that can be stated is {best:.3g}.",
        [Flaw(_where(node, request, "/max_error"), f"at least {best:.3g} is needed")],
        limit=best,
        actual=limit,
    )


def target_error(facts: Facts, output: Output, request: Request) -> float:
    """The error asked for, or a quarter of the output's quantum."""
    if request.max_error is not None:
        return request.max_error
    if output.storage is not None and output.storage.integer:
        return 0.25 / output.storage.levels
    relative = 2.0**-13 if output.storage is Storage.FLOAT16 else 1e-6
    return relative * facts.extent.magnitude


def measures(request: Request) -> tuple[tuple[str, Callable[[Error], float]], ...]:
    """The errors by which a choice may be good enough, with their names, the strictest first."""
    if request.max_error is not None:
        return (("an error", largest),)
    return ("an error", beyond_rounding), ("a typical error", typical_beyond_rounding)


def largest(error: Error) -> float:
    return error.value


def beyond_rounding(error: Error) -> float:
    return error.value - error.rounding


def typical_beyond_rounding(error: Error) -> float:
    return error.usual - error.rounding


def _saved(node: Node) -> float:
    """Milliseconds that the choice saves against the most accurate candidate."""
    assert node.choice is not None
    done = Offers(tuple([offer for offer in node.alternatives.single if offer.passes is None]), node.alternatives.ways)
    return max(done.best(largest).seconds - node.choice.seconds, 0.0) * 1e3


def _label(choice: Candidate) -> str:
    return choice.method if choice.knob is None else f"{choice.method} at {choice.knob:g}"


def _reason(request: Request, target: float) -> str:
    if request.max_ms is not None:
        return f"most accurate within {request.max_ms:g} ms"
    if request.max_error is not None:
        return f"cheapest within an error of {target:g}"
    return f"cheapest within a quarter of the output's quantum, {target:.3g}, or else the customary"
