"""From a graph and a request to a plan: the value that says what will run, how, and what was dropped and why."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lichen.accuracy.precision import Precision
from lichen.operation import Error
from lichen.planning.bands import bands
from lichen.planning.candidates import Candidate
from lichen.planning.choose import choose
from lichen.planning.error import errors, total_error, total_seconds
from lichen.planning.fuse import fuse
from lichen.planning.graph import TRUTH, Decision, Graph, Node, Request
from lichen.planning.hidden import hidden
from lichen.planning.join import concatenate, join
from lichen.planning.light import light
from lichen.planning.memory import peak_bytes, refuse_too_large
from lichen.planning.notes import notes
from lichen.planning.prune import identity, shared, unread
from lichen.planning.region import region
from lichen.planning.settle import settle
from lichen.planning.verdicts import Setting, judged

Pass = Callable[[Graph, Request], Graph]

ALL: tuple[Pass, ...] = (
    concatenate,
    unread,
    shared,
    identity,
    light,
    join,
    hidden,
    region,
    choose,
    settle,
    fuse,
    bands,
)
NEEDED: tuple[Pass, ...] = (concatenate, light, choose, settle)
"""what `prune=false` leaves"""
PLANNING = 4e-3
"""Seconds for each node of a graph that was not seen before, on a slow day; most of it goes into what operations say
of their errors. A chain of conversions takes 0.4 to 1.3 ms a node, one of matrices up to 3."""
ENGINE_VERSION = "2"
"""Part of every plan's digest; raise it when the same plan gives other bytes."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What will run. Printable (as notes), serialisable, hashed."""

    graph: Graph
    request: Request

    def __str__(self) -> str:
        return "\n".join(self.notes)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What runs, and what was left out and why, in sentences."""
        return notes(self)

    @property
    def nodes(self) -> tuple[Node, ...]:
        return self.graph.nodes

    @property
    def decisions(self) -> tuple[Decision, ...]:
        return self.graph.decisions

    @property
    def _choices(self) -> dict[str, Candidate]:
        return {node.name: node.choice for node in self.nodes if node.choice is not None}

    @cached_property
    def errors(self) -> dict[str, Error]:
        """Predicted error of every output."""
        return errors(self.graph, self.graph.facts(), self._choices)

    @property
    def error(self) -> Error:
        """The largest predicted error of any output."""
        return max(self.errors.values(), key=lambda error: error.value)

    @cached_property
    def peak_bytes(self) -> int:
        """Bytes of images held at once, at most."""
        return peak_bytes(self.graph, self.graph.facts())

    @property
    def seconds(self) -> float:
        """Predicted time of all nodes."""
        saved = sum(each.saved_ms for each in self.decisions if each.pass_ == "fuse") / 1e3
        return total_seconds(self.graph, self._choices) - saved

    @property
    def method(self) -> str:
        """How the node the caller asked for is computed, `identity` if it was dropped; of a pipeline all nodes."""
        if not self.request.target:
            return ", ".join(f"{node.name}={_method(node)}" for node in self.nodes) or "identity"
        node = self.graph.node(self.request.target)
        return "identity" if node is None else _method(node)

    @property
    def by_definition(self) -> bool:
        """Whether what `method` is about is computed by its definition, which runs in NumPy; conversions around it may
        be computed otherwise."""
        asked = [node.choice for node in self.nodes if self.request.target in ("", node.name)]
        exact = self.graph.precision is Precision.FLOAT64
        return bool(asked) and (exact or all(each and each.method == TRUTH for each in asked))

    @cached_property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of all that decides the bytes of the result, the pixels aside."""
        nodes = [_node_to_json(node) for node in self.nodes]
        outputs = {name: each.source for name, each in self.graph.outputs.items()}
        observers = [_node_to_json(node) for node in self.graph.observers]
        banded = [[each.steps, each.rows] for each in self.graph.banded]
        said = [ENGINE_VERSION, self.request.backend, self.graph.precision, outputs, nodes, observers, banded]
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()

    def identities(self, origins: Mapping[str, str]) -> dict[str, str]:
        """What stands for all that decides the pixels of each step that runs, by its name: what is done, from the
        sources on, whose contents `origins` identifies. Steps that read others have none."""
        chains = {chain[-1]: chain for chain in self.graph.fused}
        bands = {each.steps[-1]: each for each in self.graph.banded}
        found = dict(origins)
        for node in self.graph.running():
            if not all(source in found for source in node.inputs.values()):
                continue
            steps = bands[node.name].steps if node.name in bands else (node.name,)
            done = [self.graph.named(name) for step in steps for name in chains.get(step, (step,))]
            said = [_node_to_json(each) | {"name": "", "inputs": [*each.inputs]} for each in done]
            rows = bands[node.name].rows if node.name in bands else 0
            read = {key: found[source] for key, source in node.inputs.items()}
            told = [self.request.backend, self.graph.precision, said, len(steps), rows, read]
            found[node.name] = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()
        return {name: each for name, each in found.items() if name not in origins}

    def to_json(self) -> dict[str, Any]:
        """The plan as JSON values: nodes, choices, alternatives with why they were not taken, decisions."""
        setting = Setting(self.graph, self.request)
        return {
            "device": self.request.backend,
            "precision": self.graph.precision,
            "method": self.method,
            "error": _error_to_json(self.error),
            "milliseconds": self.seconds * 1e3,
            "peak_bytes": self.peak_bytes,
            "nodes": [{**_node_to_json(node), "alternatives": _alternatives(setting, node)} for node in self.nodes],
            "outputs": {
                name: {"node": each.source, "error": _error_to_json(self.errors[name])}
                for name, each in self.graph.outputs.items()
            },
            "fused": [list(chain) for chain in self.graph.fused],
            "bands": [{"nodes": list(each.steps), "rows": each.rows} for each in self.graph.banded],
            "decisions": [decision.to_json() for decision in self.decisions],
            "notes": list(self.notes),
            "digest": self.digest,
        }


def make_plan(graph: Graph, request: Request) -> Plan:
    """Run the passes. Raises what they raise: `InvalidRequest`, `Unattainable`."""
    for step in ALL if request.prune else NEEDED:
        graph = step(graph, request)
    refuse_too_large(graph, request)
    return Plan(graph.deciding(_storing(graph)), request)


def planning_seconds(nodes: int) -> float:
    """Predicted time of planning so many nodes."""
    return PLANNING * nodes


def _storing(graph: Graph) -> list[Decision]:
    """The decision that says what keeping values in another precision than computed costs."""
    precision = graph.precision
    if precision is Precision.FLOAT32:
        return []
    if precision.lossless:
        return [Decision("precision", "*", "evaluated by definition", "float64 asks for nothing less")]
    choices = {node.name: node.choice for node in graph.nodes if node.choice is not None}
    stored = total_error(graph, graph.facts(), choices).value
    computed = graph.replace(precision=Precision.FLOAT32)
    bound = max(stored - total_error(computed, computed.facts(), choices).value, 0.0)
    return [Decision("precision", "*", f"kept in {precision}", "inputs and every result are stored in it", bound)]


def _method(node: Node) -> str:
    """The method of a node with its knob."""
    choice = node.choice
    assert choice is not None, "every node of a plan has its choice"
    if choice.knob is None:
        return choice.method
    knob = node.operation.methods[choice.method].knob
    assert knob is not None, "only knobs have settings"
    return f"{choice.method}; {knob.name}={choice.knob:g}"


def _error_to_json(error: Error) -> dict[str, Any]:
    return {"value": error.value, "kind": error.kind, "metric": "max"}


def _node_to_json(node: Node) -> dict[str, Any]:
    return {
        "name": node.name,
        "operation": node.operation.name,
        "parameters": node.parameters.model_dump(mode="json"),
        "inputs": dict(node.inputs),
        "method": node.choice.method if node.choice else None,
        "knob": node.choice.knob if node.choice else None,
    }


def _alternatives(setting: Setting, node: Node) -> list[dict[str, Any]]:
    return [_offer_to_json(offer, *said) for offer, said in zip(node.alternatives, judged(setting, node), strict=True)]


def _offer_to_json(offer: Candidate, verdict: str, outcome: Error | None) -> dict[str, Any]:
    return {
        "method": offer.method,
        "knob": offer.knob,
        "error": offer.error.value,
        "kind": offer.error.kind,
        "typical": offer.error.typical,
        "milliseconds": offer.seconds * 1e3,
        "verdict": verdict,
        "result_error": None if outcome is None else _error_to_json(outcome),
    }
