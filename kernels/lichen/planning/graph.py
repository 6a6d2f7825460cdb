"""The graph that passes rewrite: sources, nodes in the order they run, one output.

Graphs are values. A pass takes one and returns another, with what it decided added to `decisions`; nothing here looks
at a pixel.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lichen.accuracy.precision import Precision, keeping
from lichen.image import Alpha, Space, Storage
from lichen.operation import Error, Facts, Operation, OperationParameters, Rate


@dataclass(frozen=True, slots=True)
class Decision:
    """What a pass did to a node, and why. `bound` is the largest change of the output it can cause."""

    pass_: str
    node: str
    action: str
    reason: str
    bound: float = 0.0

    def to_json(self) -> dict[str, Any]:
        return {
            "pass": self.pass_,
            "node": self.node,
            "action": self.action,
            "reason": self.reason,
            "bound": self.bound,
        }


@dataclass(frozen=True, slots=True)
class Candidate:
    """A method at one setting of its knob, with what it would make of a node."""

    method: str
    knob: float | None
    error: Error
    seconds: float
    unfit: str | None = None
    """why it cannot be taken at all"""


@dataclass(frozen=True, slots=True)
class Node:
    """One operation to run. `inputs` maps its input names to the names of nodes or sources."""

    name: str
    operation: Operation[Any]
    parameters: OperationParameters
    inputs: Mapping[str, str]
    choice: Candidate | None = None
    alternatives: tuple[Candidate, ...] = ()

    @property
    def first(self) -> str:
        """What its first input reads."""
        return next(iter(self.inputs.values()))


@dataclass(frozen=True, slots=True)
class Request:
    """What the caller asked for beside operations and pixels."""

    backend: str = "numpy"
    max_error: float | None = None
    max_ms: float | None = None
    method: str | None = None
    """for the node called `target`"""
    knobs: Mapping[str, float] = field(default_factory=dict)
    target: str = ""
    prune: bool = True
    space: Space | None = None
    alpha: Alpha | None = None
    storage: Storage | None = None
    rates: Mapping[tuple[str, str], Rate] = field(default_factory=dict)
    """of (operation, method) for the backend in use, as measured on this machine; the declared ones otherwise"""


@dataclass(frozen=True, slots=True)
class Graph:
    """Sources by name with their facts, nodes in running order, and the name of what comes out."""

    sources: Mapping[str, Facts]
    nodes: tuple[Node, ...]
    output: str
    decisions: tuple[Decision, ...] = ()
    precision: Precision = Precision.FLOAT32
    """in which sources and results are kept"""

    def facts(self) -> dict[str, Facts]:
        """Facts of every source and node, forward through the graph."""
        known = {name: keeping(facts, self.precision) for name, facts in self.sources.items()}
        for node in self.nodes:
            made = node.operation.result(node.parameters, inputs_of(node, known))
            known[node.name] = keeping(made, self.precision)
        return known

    def node(self, name: str) -> Node | None:
        return next((node for node in self.nodes if node.name == name), None)

    def readers(self, name: str) -> int:
        """How many inputs, the graph's output included, read `name`."""
        read = sum(source == name for node in self.nodes for source in node.inputs.values())
        return read + (self.output == name)

    def replace(self, **changes: Any) -> Graph:
        return dataclasses.replace(self, **changes)

    def deciding(self, decisions: Iterable[Decision]) -> Graph:
        return self.replace(decisions=(*self.decisions, *decisions))

    def bypass(self, name: str, successor: str) -> Graph:
        """Without the node `name`; whoever read it reads `successor`."""
        nodes = tuple(
            dataclasses.replace(
                node,
                inputs={key: successor if source == name else source for key, source in node.inputs.items()},
            )
            for node in self.nodes
            if node.name != name
        )
        return self.replace(nodes=nodes, output=successor if self.output == name else self.output)


def inputs_of(node: Node, facts: Mapping[str, Facts]) -> dict[str, Facts]:
    """Facts of a node's inputs by input name."""
    return {key: facts[source] for key, source in node.inputs.items()}
