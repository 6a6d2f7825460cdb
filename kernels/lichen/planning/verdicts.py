"""Why each candidate was taken or was not, in words that carry the number that decided.

A candidate is judged as the choice pass judged it: in its node's place, with all other nodes as they were chosen, by
the error and the time of the whole plan against what the request asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from lichen.operation import Error, Facts
from lichen.planning.budget import share
from lichen.planning.candidates import Candidate
from lichen.planning.choose import measures, target_error
from lichen.planning.error import Choices, delivered, reaching, reaching_with, total_seconds
from lichen.planning.graph import Graph, Node, Request

MOST = 1 << 14
"""Steps whose error is carried anew, of some 0.1 ms each: the candidates of 60 blurs and levels in a row are about
so many. Where trying each takes more, they are not tried."""


@dataclass(frozen=True, eq=False)
class Setting:
    """A planned graph, with what is the same for all candidates that are judged in it."""

    graph: Graph
    request: Request

    @cached_property
    def facts(self) -> Mapping[str, Facts]:
        return self.graph.facts()

    @cached_property
    def choices(self) -> Choices:
        return {node.name: node.choice for node in self.graph.nodes if node.choice is not None}

    @cached_property
    def reached(self) -> Mapping[str, Error]:
        return reaching(self.graph, self.facts, self.choices)

    @cached_property
    def targets(self) -> Mapping[str, float]:
        outputs = self.graph.outputs.items()
        return {name: target_error(self.facts[each.source], each, self.request) for name, each in outputs}

    @cached_property
    def seconds(self) -> float:
        return total_seconds(self.graph, self.choices)

    @cached_property
    def crowded(self) -> bool:
        """Whether there are too many candidates to try each."""
        return len(self.graph.nodes) * sum(len(node.alternatives) for node in self.graph.nodes) > 2 * MOST

    @cached_property
    def governing(self) -> tuple[str, Callable[[Error], float]] | None:
        """The error by which the choice was made: the first of them by which what was chosen is good enough."""
        for name, value in measures(self.request):
            found, target = self.tightest(self.reached, value)
            if found <= target:
                return name, value
        return None

    def tightest(self, reached: Mapping[str, Error], value: Callable[[Error], float]) -> tuple[float, float]:
        """The error and the target of the output that uses up most of what it is allowed."""
        pairs = [(value(error), self.targets[name]) for name, error in delivered(self.graph, reached).items()]
        return max(pairs, key=lambda pair: share(*pair))


def verdicts(graph: Graph, request: Request, node: Node) -> list[str]:
    """One for each alternative of a node of a planned graph, in their order."""
    return [said for said, _ in judged(Setting(graph, request), node)]


def outcomes(graph: Graph, request: Request, node: Node) -> list[Error | None]:
    """As `judged` has them."""
    return [outcome for _, outcome in judged(Setting(graph, request), node)]


def judged(setting: Setting, node: Node) -> list[tuple[str, Error | None]]:
    """For each alternative of a node why it was taken or was not, and the error that the result would have with it,
    other nodes and conversions between them included; None where it cannot be taken, or was not tried."""
    taken = node.choice
    if taken is None:
        return [("not considered", None)] * len(node.alternatives)
    judge = _Judge(setting, node, taken)
    return [(judge.verdict(each), None if judge.untried(each) else judge.error(each)) for each in node.alternatives]


@dataclass(frozen=True, eq=False)
class _Judge:
    setting: Setting
    node: Node
    taken: Candidate
    _tried: dict[int, Mapping[str, Error]] = field(default_factory=dict)

    def untried(self, offer: Candidate) -> bool:
        return offer.unfit is not None or (self.setting.crowded and not self._same(offer))

    def _same(self, offer: Candidate) -> bool:
        return (offer.method, offer.knob) == (self.taken.method, self.taken.knob)

    def verdict(self, offer: Candidate) -> str:
        if offer.unfit is not None:
            return f"not possible: {offer.unfit}"
        if self._same(offer):
            return "taken"
        if self.setting.crowded:
            count = len(self.setting.graph.nodes)
            return f"not tried: {count} {'step has' if count == 1 else 'steps have'} too many candidates to try each"
        return self._timed(offer) if self.setting.request.max_ms is not None else self._accurate(offer)

    def error(self, offer: Candidate) -> Error:
        return max(delivered(self.setting.graph, self._reached(offer)).values(), key=lambda error: error.value)

    def _reached(self, offer: Candidate) -> Mapping[str, Error]:
        """The errors of all values with a candidate in place of what was taken."""
        if id(offer) not in self._tried:
            setting = self.setting
            self._tried[id(offer)] = reaching_with(
                setting.graph, setting.facts, setting.choices, setting.reached, self.node.name, offer.error
            )
        return self._tried[id(offer)]

    def _seconds(self, offer: Candidate) -> float:
        return self.setting.seconds - self.taken.seconds + offer.seconds

    def _timed(self, offer: Candidate) -> str:
        """Where time is asked for: the most accurate that fits, or with an error the fastest within both."""
        limit, error = (self.setting.request.max_ms or 0.0) / 1e3, self.setting.request.max_error
        if self._seconds(offer) > limit:
            return f"too slow: {_ms(self._seconds(offer))} of {_ms(limit)} allowed"
        if error is None:
            return f"fast enough, but {self._worse(offer)}"
        if self.error(offer).value > error:
            return f"not accurate enough: an error of {self.error(offer).value:.3g}, asked {error:.3g}"
        return f"fast and accurate enough, but {self._slower(offer)}"

    def _accurate(self, offer: Candidate) -> str:
        """Where an error is asked for, or none at all: the fastest whose error is small enough."""
        measure = self.setting.governing
        if measure is None:
            return f"no setting promises {min(self.setting.targets.values()):.3g}; {self._customary(offer)}"
        name, value = measure
        found, target = self.setting.tightest(self._reached(offer), value)
        if found > target:
            asked = "asked" if self.setting.request.max_error is not None else "a quarter of the output's quantum is"
            return f"not accurate enough: {name} of {found:.3g}, {asked} {target:.3g}"
        return f"accurate enough, but {self._slower(offer)}"

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
            chained = any(self.node.name in chain for chain in self.setting.graph.fused)
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
