"""How a budget of error or of time is divided over the nodes of a graph.

Theory. Let g_i be how much of the error allowed at the outputs one unit of error of node i uses up: 1 / target at an
output, and behind a reader its own g times the slope of its modulus. For small errors what is used up is at most the
sum of g_i e_i, so the choice is a knapsack: from the most accurate candidates, those are taken first that save the most
time for what they use up. A modulus of continuity need not be a line, so the slope is taken for a share of what is
allowed, and the choice is judged by carrying the errors forward exactly; where it fails, the budget is halved.

Small graphs are then searched exactly: the dearest node first, each takes its cheapest candidate with which the whole
still meets the target.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from lichen.errors import Flaw, Unattainable
from lichen.once import once
from lichen.operation import Error, Facts
from lichen.planning.candidates import Candidate, Measure, Offers
from lichen.planning.error import Choices, errors, total_error, total_seconds
from lichen.planning.graph import Graph, Node, Request

TRIALS = 100
"""Choices that are tried exactly at most, which is all of them for a chain of a few nodes."""
FINEST = 1e-300
"""Errors are followed back through a graph no finer than this: what is finer is no number any more."""
HALVINGS = 8
STEPS = 12
"""Of the search for the error that a time allows: to a factor of 1.3 over four decades."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Candidates for every node, what they must keep, and by which errors that is judged."""

    graph: Graph
    facts: Mapping[str, Facts]
    request: Request
    offers: Mapping[str, Offers]
    targets: Mapping[str, float]
    measures: Sequence[tuple[str, Measure]]

    @once
    def usable(self) -> Mapping[str, Offers]:
        """Those that can be taken."""
        return {name: each.usable for name, each in self.offers.items()}

    def excess(self, choices: Choices, measure: Measure) -> float:
        """The largest share of what is allowed that an output uses up; beyond 1 the choice is not good enough."""
        return self.used(errors(self.graph, self.facts, choices), measure)

    def used(self, found: Mapping[str, Error], measure: Measure) -> float:
        """As `excess`, by the errors of the outputs."""
        return max(share(measure(error), self.targets[name]) for name, error in found.items())

    def error(self, choices: Choices) -> Error:
        return total_error(self.graph, self.facts, choices)

    def seconds(self, choices: Choices) -> float:
        return total_seconds(self.graph, choices)


def share(error: float, target: float) -> float:
    """`error` in parts of `target`, which may be nothing at all."""
    if target > 0:
        return error / target
    return 0.0 if error <= 0 else float("inf")


# ------------------------------------------------------------------------------------------------------------- error


def within_error(problem: Problem) -> Choices:
    """The cheapest choices that keep every target. Raises `Unattainable` where an error was asked that none keeps."""
    request = problem.request
    for _, measure in problem.measures:
        found = _alone(problem, measure) if len(problem.offers) == 1 else _together(problem, measure)
        if found is not None:
            return found
    usable = problem.usable
    if request.max_error is not None:
        best = problem.error(_most_accurate(usable, measure))
        raise Unattainable(
            f"No method meets an error of {request.max_error:g}; the smallest that can be stated is {best.value:.3g}.",
            [Flaw("/max_error", f"at least {best.value:.3g} is needed")],
            limit=best.value,
            actual=request.max_error,
        )
    return {name: _customary(problem.graph.named(name), each) or each.best(measure) for name, each in usable.items()}


def _alone(problem: Problem, measure: Measure) -> Choices | None:
    """The quickest candidate of the one node there is that keeps the targets; no slower one states its error."""
    ((name, offers),) = problem.offers.items()
    graph = problem.graph
    if not graph.precision.lossless or graph.nodes[0].inherited:
        return next((trial for each in offers.in_turn() if problem.excess(trial := {name: each}, measure) <= 1), None)
    # Nothing arrives at the node, so what comes out errs as it does, and by what its readers inherit.
    targets = {out: problem.targets[out] - each.inherited for out, each in graph.outputs.items()}
    if any(targets[out] < 0 for out, each in graph.outputs.items() if each.source != name):
        return None
    least = min((targets[out] for out, each in graph.outputs.items() if each.source == name), default=math.inf)
    found = offers.first(measure, least)
    return None if found is None else {name: found}


def _together(problem: Problem, measure: Measure) -> Choices | None:
    choices = _most_accurate(problem.usable, measure)
    kept = problem.excess(choices, measure) <= 1
    return _cheapest(problem, choices, measure, problem.targets) if kept else None


def _most_accurate(usable: Mapping[str, Offers], measure: Measure) -> dict[str, Candidate]:
    return {name: offers.best(measure) for name, offers in usable.items()}


def _customary(node: Node, offers: Offers) -> Candidate | None:
    """The candidate that the operation declares as customary, if it is among those that the request leaves."""
    named = node.operation.customary
    return None if named is None else offers.named(*named)


def _cheapest(problem: Problem, choices: Choices, measure: Measure, targets: Mapping[str, float]) -> Choices:
    """From choices that meet the targets to the cheapest that still do."""
    scaled = Problem(problem.graph, problem.facts, problem.request, problem.offers, targets, problem.measures)
    quickest = {name: offers.quickest for name, offers in problem.usable.items()}
    if scaled.excess(quickest, measure) <= 1:
        return quickest
    trials = sum(len(offers) for offers in problem.usable.values())
    if trials > TRIALS:
        return _divided(scaled, choices, measure)
    return _searched(scaled, choices, measure)


def _searched(problem: Problem, choices: Choices, measure: Measure) -> Choices:
    limits = _limits(problem)
    # Judged by the strictest measure, what comes out errs by no less where one method errs by more; unless values are
    # rounded between steps, or read as data.
    judged = measure is problem.measures[0][1] and problem.graph.precision.lossless
    judged = judged and not any(node.about(problem.facts).data for node in problem.graph.nodes)
    for names in sorted(_alike(problem), key=lambda names: -choices[names[0]].seconds):
        limit = min(limits.get(name, math.inf) for name in names)
        too_much = math.inf
        for offer in problem.usable[names[0]].in_turn():
            if offer.stated.least >= too_much or measure(offer.error) >= too_much:
                continue
            if share(measure(offer.error), limit) > 1:
                continue  # what arrives beside only adds
            trial = {**choices, **dict.fromkeys(names, offer)}
            if problem.excess(trial, measure) <= 1:
                choices = trial
                break
            if judged:
                too_much = min(too_much, measure(offer.error))
    return choices


def _limits(problem: Problem) -> dict[str, float]:
    """The error allowed to what comes out, by the name of the node that makes it."""
    limits: dict[str, float] = {}
    for name, output in problem.graph.outputs.items():
        limits[output.source] = min(limits.get(output.source, math.inf), problem.targets[name])
    return limits


def _alike(problem: Problem) -> list[list[str]]:
    """The nodes, together where they do the same with sources that are alike: equal pictures stay equal."""
    groups: list[tuple[Node, list[str]]] = []
    for node in problem.graph.nodes:
        own = problem.usable[node.name]
        for first, names in groups:
            same = node.operation is first.operation and node.parameters == first.parameters
            begin = _of_sources(problem, node) and _of_sources(problem, first)
            if same and begin and own == problem.usable[first.name]:
                names.append(node.name)
                break
        else:
            groups.append((node, [node.name]))
    return [names for _, names in groups]


def _of_sources(problem: Problem, node: Node) -> bool:
    return all(source in problem.graph.sources for source in node.inputs.values())


def _divided(problem: Problem, choices: Choices, measure: Measure) -> Choices:
    """The knapsack of the module's docstring."""
    gains = _gains(problem)
    left = 1 - problem.excess(choices, measure)
    upgrades = []
    for name, start in choices.items():
        for offer in problem.usable[name]:
            saved = start.seconds - offer.seconds
            used = gains[name] * max(measure(offer.error) - measure(start.error), 0.0)
            if saved > 0 and used <= left:
                upgrades.append((saved / used if used else float("inf"), saved, used, name, offer))
    upgrades.sort(key=lambda upgrade: upgrade[:2], reverse=True)
    for _ in range(HALVINGS):
        trial, spent = dict(choices), dict.fromkeys(choices, 0.0)
        total = 0.0
        for _, _, used, name, offer in upgrades:
            if offer.seconds < trial[name].seconds and total - spent[name] + used <= left:
                total += used - spent[name]
                spent[name], trial[name] = used, offer
        if problem.excess(trial, measure) <= 1:
            return trial
        left /= 2
    return choices


def _gains(problem: Problem) -> dict[str, float]:
    """For each node how much of what is allowed one unit of its error uses up."""
    gains = dict.fromkeys([*problem.graph.sources, *problem.usable], 0.0)
    for name, output in problem.graph.outputs.items():
        target = problem.targets[name]
        gains[output.source] = max(gains[output.source], 1 / target if target > 0 else 0.0)
    for node in reversed(problem.graph.nodes):
        gain = gains[node.name]
        if not gain:
            continue
        probe = max(1 / gain / len(problem.usable), FINEST)
        slope = node.carried(problem.facts, probe) / probe
        for source in node.inputs.values():
            gains[source] = max(gains[source], min(gain * slope, 1 / FINEST))
    return gains


# -------------------------------------------------------------------------------------------------------------- time


def within_time(problem: Problem) -> Choices:
    """The most accurate choices within `max_ms`, the cheapest that keep `max_error` too. Raises `Unattainable`."""
    request, usable = problem.request, problem.usable
    assert request.max_ms is not None, "a time was asked for"
    budget = request.max_ms / 1e3
    fastest = {name: min(offers, key=lambda offer: offer.seconds) for name, offers in usable.items()}
    least = problem.seconds(fastest)
    if least > budget:
        raise Unattainable(
            f"No method takes {request.max_ms:g} ms or less; the fastest is predicted to take {least * 1e3:.3g} ms.",
            [Flaw("/max_ms", f"at least {least * 1e3:.3g} is needed")],
            limit=least * 1e3,
            actual=request.max_ms,
        )
    fitting = _varied(problem, fastest, budget) if request.target in usable else _bisected(problem, fastest, budget)
    found = [problem.error(trial) for trial in fitting]
    if request.max_error is None:
        return fitting[min(range(len(fitting)), key=lambda i: (found[i].value, found[i].usual))]
    meeting = [i for i, error in enumerate(found) if error.value <= request.max_error]
    if not meeting:
        closest = min(found, key=lambda error: error.value)
        raise Unattainable(
            f"Within {request.max_ms:g} ms the error can be held to {closest.value:.3g}, not to {request.max_error:g}.",
            [Flaw("/max_error", f"at least {closest.value:.3g} fits in {request.max_ms:g} ms")],
            limit=closest.value,
            actual=request.max_error,
        )
    return fitting[min(meeting, key=lambda i: problem.seconds(fitting[i]))]


def _largest(error: Error) -> float:
    return error.value


def _varied(problem: Problem, fastest: Choices, budget: float) -> list[Choices]:
    """All candidates of the one node that was asked for, beside the fastest of the others."""
    names = [node.name for node in problem.graph.nodes]
    offers = [problem.usable[name] if name == problem.request.target else [fastest[name]] for name in names]
    trials = (dict(zip(names, combination, strict=True)) for combination in product(*offers))
    return [trial for trial in trials if problem.seconds(trial) <= budget]


def _bisected(problem: Problem, fastest: Choices, budget: float) -> list[Choices]:
    """Choices that fit, for errors between those of the most accurate and of the fastest."""

    accurate = _most_accurate(problem.usable, _largest)
    if problem.seconds(accurate) <= budget:
        return [fastest, accurate]
    low, high = problem.error(accurate).value, problem.error(fastest).value
    fitting = [fastest]
    asked = problem.request.max_error
    for step in range(STEPS):
        middle = asked if asked is not None and step == 0 and low <= asked <= high else max(low * high, 0.0) ** 0.5
        trial = _cheapest(problem, accurate, _largest, dict.fromkeys(problem.targets, middle))
        if problem.seconds(trial) <= budget:
            fitting.append(trial)
            high = middle
        else:
            low = middle
    return fitting
