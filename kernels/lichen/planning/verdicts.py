"""Why each candidate was taken or was not, in words that carry the number that decided.

A candidate is judged as the choice pass judged it: in its node's place, with all other nodes as they were chosen, by
the error and the time of the whole plan against what the request asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from lichen.operation import Error, Facts
from lichen.planning.budget import share
from lichen.planning.choose import measures, target_error
from lichen.planning.error import Choices, errors, total_error, total_seconds
from lichen.planning.graph import Candidate, Graph, Node, Request


def verdicts(graph: Graph, request: Request, node: Node) -> list[str]:
    """One for each alternative of a node of a planned graph, in their order."""
    taken = node.choice
    if taken is None:
        return ["not considered"] * len(node.alternatives)
    judge = _Judge(graph, request, node, taken)
    return [judge.verdict(offer) for offer in node.alternatives]


def outcomes(graph: Graph, request: Request, node: Node) -> list[Error | None]:
    """For each alternative of a node the error that the result would have with it, other nodes and conversions between
    them included; None where it cannot be taken."""
    taken = node.choice
    if taken is None:
        return [None] * len(node.alternatives)
    judge = _Judge(graph, request, node, taken)
    return [None if offer.unfit is not None else judge.error(offer) for offer in node.alternatives]


@dataclass(frozen=True, eq=False)
class _Judge:
    graph: Graph
    request: Request
    node: Node
    taken: Candidate

    def verdict(self, offer: Candidate) -> str:
        if offer.unfit is not None:
            return f"not possible: {offer.unfit}"
        if (offer.method, offer.knob) == (self.taken.method, self.taken.knob):
            return "taken"
        return self._timed(offer) if self.request.max_ms is not None else self._accurate(offer)

    @cached_property
    def _choices(self) -> Choices:
        return {node.name: node.choice for node in self.graph.nodes if node.choice is not None}

    def error(self, offer: Candidate) -> Error:
        return total_error(self.graph, self._facts, {**self._choices, self.node.name: offer})

    def _seconds(self, offer: Candidate) -> float:
        return total_seconds(self.graph, {**self._choices, self.node.name: offer})

    @cached_property
    def _facts(self) -> Mapping[str, Facts]:
        return self.graph.facts()

    def _timed(self, offer: Candidate) -> str:
        """Where time is asked for: the most accurate that fits, or with an error the fastest within both."""
        limit, error = (self.request.max_ms or 0.0) / 1e3, self.request.max_error
        if self._seconds(offer) > limit:
            return f"too slow: {_ms(self._seconds(offer))} of {_ms(limit)} allowed"
        if error is None:
            return f"fast enough, but {self._worse(offer)}"
        if self.error(offer).value > error:
            return f"not accurate enough: an error of {self.error(offer).value:.3g}, asked {error:.3g}"
        return f"fast and accurate enough, but {self._slower(offer)}"

    def _accurate(self, offer: Candidate) -> str:
        """Where an error is asked for, or none at all: the fastest whose error is small enough."""
        measure = self._governing()
        if measure is None:
            return f"no setting promises {min(self._targets.values()):.3g}; {self._customary(offer)}"
        name, value = measure
        found, target = self._tightest(offer, value)
        if found > target:
            asked = "asked" if self.request.max_error is not None else "a quarter of the output's quantum is"
            return f"not accurate enough: {name} of {found:.3g}, {asked} {target:.3g}"
        return f"accurate enough, but {self._slower(offer)}"

    def _governing(self) -> tuple[str, Callable[[Error], float]] | None:
        """The error by which the choice was made: the first of them by which the taken candidate is good enough."""
        for name, value in measures(self.request):
            found, target = self._tightest(self.taken, value)
            if found <= target:
                return name, value
        return None

    def _tightest(self, offer: Candidate, value: Callable[[Error], float]) -> tuple[float, float]:
        """The error and the target of the output that uses up most of what it is allowed."""
        found = errors(self.graph, self._facts, {**self._choices, self.node.name: offer})
        pairs = [(value(error), self._targets[name]) for name, error in found.items()]
        return max(pairs, key=lambda pair: share(*pair))

    @cached_property
    def _targets(self) -> Mapping[str, float]:
        outputs = self.graph.outputs.items()
        return {name: target_error(self._facts[each.source], each, self.request) for name, each in outputs}

    def _customary(self, offer: Candidate) -> str:
        """Where nothing meets the target the operation's customary setting is taken, if it declares one."""
        if (self.taken.method, self.taken.knob) != self.node.operation.customary:
            return self._worse(offer)
        found = f"this one has a typical error of {offer.error.usual:.3g} instead of {self.taken.error.usual:.3g}"
        apart = offer.seconds - self.taken.seconds
        return f"the customary one is taken, {found} and is {'slower' if apart > 0 else 'faster'} by {_ms(abs(apart))}"

    def _slower(self, offer: Candidate) -> str:
        apart = offer.seconds - self.taken.seconds
        if apart > 0:
            return f"slower by {_ms(apart)}"
        if apart < 0:  # a step of a kernel saves more than it costs; and searches are bounded
            chained = any(self.node.name in chain for chain in self.graph.fused)
            return f"{_ms(-apart)} quicker {'alone, and no step of its kernel' if chained else 'and not found'}"
        return "no faster" if offer.error.value == self.taken.error.value else "no faster, and less accurate"

    def _worse(self, offer: Candidate) -> str:
        mine, best = self.error(offer), self.error(self.taken)
        if mine.value > best.value:
            return f"less accurate: an error of {mine.value:.3g} instead of {best.value:.3g}"
        if mine.usual > best.usual:
            return f"less accurate as a rule: a typical error of {mine.usual:.3g} instead of {best.usual:.3g}"
        return "no more accurate"


def _ms(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms"
