"""The pass that picks a method and a knob for every node, from predicted errors and times.

The error of the whole result is carried forward: what reaches a node passes through its modulus of continuity and its
own method's error is added. The caller's wish decides:

* `max_error`: the cheapest choice whose predicted error meets it;
* `max_ms`: the most accurate choice that fits; with both, the cheapest within both;
* neither: the cheapest choice whose largest error, float32 rounding aside, lies below a quarter of the output's
  quantum; where none does, the cheapest whose typical error does; where none does either, the operation's customary
  method, or the most accurate;
* `method` and knobs narrow the candidates of the node they name.

Nothing that meets the request is `Unattainable`, with the best that can be had; it is never missed silently.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Literal

from lichen.accuracy.precision import Precision, visible_storing_error
from lichen.errors import Flaw, InvalidRequest, Unattainable, nearest
from lichen.image import Alpha, Storage
from lichen.operation import EXACT, Error, Facts
from lichen.planning.graph import Candidate, Decision, Graph, Node, Request, inputs_of

Choices = Mapping[str, Candidate]

DOUBLE_ROUNDING = 2.0**-40
"""Relative to the output's magnitude: of sums of thousands of terms in doubles, whatever order they are added in."""


def choose(graph: Graph, request: Request) -> Graph:
    """Every node with its choice and the alternatives it was chosen from. Raises `InvalidRequest`, `Unattainable`."""
    facts = graph.facts()
    candidates = _definition if graph.precision is Precision.FLOAT64 else _candidates
    offers = {node.name: candidates(node, facts, request) for node in graph.nodes}
    target = target_error(facts[graph.output], request)
    usable = {name: [offer for offer in offered if offer.unfit is None] for name, offered in offers.items()}
    for node in graph.nodes:
        if not usable[node.name]:
            reasons = "; ".join(f"{offer.method}: {offer.unfit}" for offer in offers[node.name])
            raise InvalidRequest(f"No method of {node.operation.name} can take this.", [Flaw("/method", reasons)])
    choices = _within_time(graph, facts, usable, request) or _within_error(graph, facts, usable, request, target)
    nodes = tuple(
        dataclasses.replace(node, choice=choices[node.name], alternatives=tuple(offers[node.name]))
        for node in graph.nodes
    )
    decided = [
        Decision("choose", node.name, f"method {_label(choices[node.name])}", _reason(request, target), bound)
        for node in graph.nodes
        for bound in [choices[node.name].error.value]
    ]
    return graph.replace(nodes=nodes).deciding(decided)


def total_error(graph: Graph, facts: Mapping[str, Facts], choices: Choices) -> Error:
    """Predicted error of the output, with every node by its choice.

    What reaches an input that is data passes through no modulus: the result is then known by its range alone.
    """
    reached = {name: _kept(EXACT, known, graph.precision, source=True) for name, known in graph.sources.items()}
    for node in graph.nodes:
        own, known = choices[node.name].error, inputs_of(node, facts)
        arriving = [reached[source] for source in node.inputs.values()]
        carried = max((error.value for error in arriving), default=0.0)
        value = node.operation.propagate(node.parameters, known, carried) if carried else 0.0
        rounding = max((error.rounding for error in arriving), default=0.0)
        if rounding:
            rounding = node.operation.propagate(node.parameters, known, rounding)
        proved = own.kind == "bound" and all(error.kind == "bound" for error in arriving)
        usual = max((error.usual for error in arriving), default=0.0)
        usual = node.operation.propagate(node.parameters, known, usual) if usual else 0.0
        kind: Literal["bound", "estimate"] = "bound" if proved else "estimate"
        largest = value + own.value
        if any(reached[node.inputs[key]].value for key in _data(node)):
            largest = facts[node.name].extent.spread + own.rounding
        made = Error(largest, kind, rounding + own.rounding, usual + own.usual)
        reached[node.name] = _kept(made, facts[node.name], graph.precision, own.rounding)
    return reached[graph.output]


def _data(node: Node) -> list[str]:
    """The inputs of a node that are no pictures."""
    return [each.name for each in node.operation.inputs if not each.picture and each.name in node.inputs]


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


def total_seconds(graph: Graph, choices: Choices) -> float:
    return sum(choices[node.name].seconds for node in graph.nodes)


def _definition(node: Node, facts: Mapping[str, Facts], request: Request) -> list[Candidate]:
    """Truth itself, in doubles: what remains where no method is precise enough."""
    rounding = DOUBLE_ROUNDING * facts[node.name].extent.magnitude
    seconds = node.operation.truth_seconds(node.parameters, inputs_of(node, facts))
    return [Candidate("truth", None, Error(rounding, "bound", rounding), seconds)]


def _candidates(node: Node, facts: Mapping[str, Facts], request: Request) -> list[Candidate]:
    """All methods at all knob values, or those the request names; unfit ones carry their reason."""
    named = request.method if node.name == request.target else None
    methods = node.operation.methods
    if named is not None and named not in methods:
        raise InvalidRequest(
            f"{node.operation.name} has no method {named!r}.", [Flaw("/method", nearest(named, methods))]
        )
    known = inputs_of(node, facts)
    knobs = request.knobs if node.name == request.target else {}
    offers = []
    for method in methods.values():
        if named not in (None, method.name) or (knobs and (method.knob is None or method.knob.name not in knobs)):
            continue
        unfit = method.unfit(node.parameters, known)
        if method.knob is None:
            settings: tuple[float, ...] = (0.0,)
        else:
            asked = knobs.get(method.knob.name)
            settings = method.knob.values if asked is None else (asked,)
        rate = request.rates.get((node.operation.name, method.name), method.rates[request.backend])
        for setting in settings:
            error = method.error(node.parameters, setting, known)
            seconds = rate.start + rate.step * method.work(node.parameters, setting, known)
            knob = setting if method.knob else None
            offers.append(Candidate(method.name, knob, error, seconds, unfit))
    if not offers:
        wrong = ", ".join(sorted(knobs))
        raise InvalidRequest(
            f"The method {named!r} of {node.operation.name} has no such knob.",
            [Flaw(f"/knobs/{name}", f"is not a knob of {named}") for name in sorted(knobs)] or [Flaw("/method", wrong)],
        )
    return offers


def target_error(output: Facts, request: Request) -> float:
    """The error asked for, or a quarter of the output's quantum."""
    if request.max_error is not None:
        return request.max_error
    magnitude = output.extent.magnitude
    if request.storage is not None and request.storage.integer:
        return 0.25 / request.storage.levels
    relative = 2.0**-13 if request.storage is Storage.FLOAT16 else 1e-6
    return relative * magnitude


def measures(request: Request) -> tuple[tuple[str, Callable[[Error], float]], ...]:
    """The errors by which a choice may be good enough, with their names, the strictest first."""
    if request.max_error is not None:
        return (("an error", lambda error: error.value),)
    return (
        ("an error", lambda error: error.value - error.rounding),
        ("a typical error", lambda error: error.usual - error.rounding),
    )


def _within_error(
    graph: Graph, facts: Mapping[str, Facts], usable: Mapping[str, list[Candidate]], request: Request, target: float
) -> Choices:
    """From the most accurate choice, dearest node first, to the cheapest candidates that still meet the target."""
    asked = request.max_error is not None
    for _, measure in measures(request):
        order = partial(_by_error, measure)
        choices = {name: min(offers, key=order) for name, offers in usable.items()}
        best = total_error(graph, facts, choices)
        if measure(best) <= target:
            break
    else:
        if asked:
            raise Unattainable(
                f"No method meets an error of {target:g}; the smallest that can be stated is {best.value:.3g}.",
                [Flaw("/max_error", f"at least {best.value:.3g} is needed")],
                limit=best.value,
                actual=target,
            )
        return {node.name: _customary(node, usable[node.name]) or choices[node.name] for node in graph.nodes}
    for name in sorted(choices, key=lambda name: -choices[name].seconds):
        for offer in sorted(usable[name], key=lambda offer: (offer.seconds, offer.error.value)):
            trial = {**choices, name: offer}
            if measure(total_error(graph, facts, trial)) <= target:
                choices = trial
                break
    return choices


def _customary(node: Node, offers: Sequence[Candidate]) -> Candidate | None:
    """The candidate that the operation declares as customary, if it is among those that the request leaves."""
    return next((offer for offer in offers if (offer.method, offer.knob) == node.operation.customary), None)


def _by_error(measure: Callable[[Error], float], offer: Candidate) -> tuple[float, float, float]:
    return measure(offer.error), offer.error.usual, offer.seconds


def _within_time(
    graph: Graph, facts: Mapping[str, Facts], usable: Mapping[str, list[Candidate]], request: Request
) -> Choices | None:
    """The most accurate choice within `max_ms`, the cheapest that meets `max_error`; None if no time is asked."""
    if request.max_ms is None:
        return None
    budget = request.max_ms / 1e3
    names = [node.name for node in graph.nodes]
    fastest = {name: min(offers, key=lambda offer: offer.seconds) for name, offers in usable.items()}
    least = total_seconds(graph, fastest)
    if least > budget:
        raise Unattainable(
            f"No method takes {request.max_ms:g} ms or less; the fastest is predicted to take {least * 1e3:.3g} ms.",
            [Flaw("/max_ms", f"at least {least * 1e3:.3g} is needed")],
            limit=least * 1e3,
            actual=request.max_ms,
        )
    varied = request.target if request.target in usable else (names[0] if names else "")
    fitting = [
        trial
        for combination in product(*(usable[name] if name == varied else [fastest[name]] for name in names))
        if total_seconds(graph, trial := dict(zip(names, combination, strict=True))) <= budget
    ]
    errors = [total_error(graph, facts, trial) for trial in fitting]
    if request.max_error is None:
        return fitting[min(range(len(fitting)), key=lambda i: (errors[i].value, errors[i].usual))]
    meeting = [i for i, error in enumerate(errors) if error.value <= request.max_error]
    if not meeting:
        closest = min(errors, key=lambda error: error.value)
        raise Unattainable(
            f"Within {request.max_ms:g} ms the error can be held to {closest.value:.3g}, not to {request.max_error:g}.",
            [Flaw("/max_error", f"at least {closest.value:.3g} fits in {request.max_ms:g} ms")],
            limit=closest.value,
            actual=request.max_error,
        )
    return fitting[min(meeting, key=lambda i: total_seconds(graph, fitting[i]))]


def _label(choice: Candidate) -> str:
    return choice.method if choice.knob is None else f"{choice.method} at {choice.knob:g}"


def _reason(request: Request, target: float) -> str:
    if request.max_ms is not None:
        return f"most accurate within {request.max_ms:g} ms"
    if request.max_error is not None:
        return f"cheapest within an error of {target:g}"
    return f"cheapest within a quarter of the output's quantum, {target:.3g}, or else the customary"
