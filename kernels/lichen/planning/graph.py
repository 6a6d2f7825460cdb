"""The graph that passes rewrite: sources, nodes in the order they run, and what comes out.

Graphs are values. A pass takes one and returns another, with what it decided added to `decisions`; nothing here looks
at a pixel.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lichen.accuracy.precision import Precision, keeping
from lichen.image import Alpha, Space, Storage
from lichen.operation import Facts, Method, Operation, OperationParameters, Rate
from lichen.part import Rectangle
from lichen.planning import predict
from lichen.planning.candidates import NOTHING, Candidate, Offers
from lichen.stage import Stage

RESULT = "result"
"""The output of a graph that has one and does not name it."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What a pass did to a node, and why. `bound` is the largest change of the output it can cause, `saved_ms` the
    predicted milliseconds that it saves."""

    pass_: str
    node: str
    action: str
    reason: str
    bound: float = 0.0
    saved: float | Callable[[], float] = 0.0
    """the milliseconds, or what finds them when they are asked for"""

    @property
    def saved_ms(self) -> float:
        return self.saved() if callable(self.saved) else self.saved

    def to_json(self) -> dict[str, Any]:
        said = {"pass": self.pass_, "node": self.node, "action": self.action, "reason": self.reason}
        return {**said, "bound": self.bound, "saved_ms": self.saved_ms}


@dataclass(frozen=True, slots=True)
class Asked:
    """What the caller asked of one node: it narrows the candidates."""

    method: str | None = None
    knobs: Mapping[str, float] = field(default_factory=dict)
    max_error: float | None = None
    """the largest error that the node's own method may add"""


FREE = Asked()
TRUTH = "truth"
"""The name of the candidate that is the definition itself, in doubles."""


@dataclass(frozen=True, slots=True)
class Node:
    """One operation to run. `inputs` maps its input names to the names of nodes or sources.

    `inherited` is by how much what an input reads may be off because work before it was left out.
    """

    name: str
    operation: Operation[Any]
    parameters: OperationParameters
    inputs: Mapping[str, str]
    choice: Candidate | None = None
    alternatives: Offers = NOTHING
    asked: Asked = FREE
    inherited: Mapping[str, float] = field(default_factory=dict)
    memo: list[tuple[OperationParameters, predict.About]] = field(default_factory=list, compare=False, repr=False)
    """what `about` found last"""

    @property
    def first(self) -> str | None:
        """What its first input reads; None where it reads nothing."""
        return next(iter(self.inputs.values()), None)

    def about(self, facts: Mapping[str, Facts]) -> predict.About:
        """What its operation says of itself, given these facts of all values."""
        if self.memo:
            parameters, found = self.memo[0]
            if parameters is self.parameters and self._same(facts, found.known):
                return found
        known = tuple([facts[source] for source in self.inputs.values()])
        found = predict.about((self.operation, self.parameters, tuple(self.inputs), known))
        self.memo[:] = [(self.parameters, found)]
        return found

    def _same(self, facts: Mapping[str, Facts], known: tuple[Facts, ...]) -> bool:
        """Whether these are the facts of what it reads. Asked a dozen times of every node."""
        return tuple([facts[source] for source in self.inputs.values()]) == known

    def result(self, facts: Mapping[str, Facts]) -> Facts:
        """Facts of what it makes."""
        return self.about(facts).result

    def carried(self, facts: Mapping[str, Facts], error: float) -> float:
        """What an error of its inputs becomes behind it."""
        return self.about(facts).carried(error) if error else 0.0

    def offers(self, facts: Mapping[str, Facts]) -> Mapping[tuple[str, float | None], predict.Offer]:
        """What its methods state, at all values of their knobs."""
        return self.about(facts).offers

    def stage(self, facts: Mapping[str, Facts], method: str) -> Stage | None:
        """What one of its methods is as a step of a fused chain."""
        return self.about(facts).stage(method)

    def chosen(self, choice: Candidate, alternatives: Offers) -> Node:
        """With what was chosen, and from what."""
        return Node(
            self.name, self.operation, self.parameters, self.inputs, choice, alternatives, self.asked, self.inherited,
            self.memo,
        )  # fmt: skip

    def replace(self, **changes: Any) -> Node:
        return dataclasses.replace(self, **changes)


@dataclass(frozen=True, slots=True)
class Output:
    """What comes out: the value of a node or a source, and the form in which it is wanted (None: as it is)."""

    source: str
    space: Space | None = None
    alpha: Alpha | None = None
    storage: Storage | None = None
    crop: tuple[int, int, int, int] | None = None
    """left, top, width and height of the part that is wanted, px; None: all of it"""
    inherited: float = 0.0


@dataclass(frozen=True, slots=True)
class Request:
    """What the caller asked for beside operations and pixels."""

    backend: str = "numpy"
    max_error: float | None = None
    max_ms: float | None = None
    target: str = ""
    """the node whose method stands for the whole; empty for pipelines"""
    prune: bool = True
    concatenate: bool = False
    """whether warps that follow one another may be one, which is another picture"""
    rates: Mapping[tuple[str, str], Rate] = field(default_factory=dict)
    """of (operation, method) for the backend in use, as measured on this machine; the declared ones otherwise"""
    max_bytes: int | None = None
    """of images that a plan may hold at once"""

    def rate(self, operation: Operation[Any], method: Method[Any]) -> Rate:
        """How fast a method is."""
        return self.rates.get((operation.name, method.name)) or method.rates[self.backend]


@dataclass(frozen=True, slots=True)
class Banded:
    """A chain of steps, first to last, of which `rows` rows are made at a time; how many rows each reaches beyond."""

    steps: tuple[str, ...]
    rows: int
    reaches: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Graph:
    """Sources by name with their facts, nodes in running order, and what comes out by name."""

    sources: Mapping[str, Facts]
    nodes: tuple[Node, ...]
    outputs: Mapping[str, Output]
    decisions: tuple[Decision, ...] = ()
    precision: Precision = Precision.FLOAT32
    """in which sources and results are kept"""
    observers: tuple[Node, ...] = ()
    """nodes that return their first input and only report what they find in it"""
    fused: tuple[tuple[str, ...], ...] = ()
    """chains of nodes, first to last, that run as one"""
    thin: Mapping[str, Rectangle] = field(default_factory=dict)
    """by the names of sources that are opaque outside a rectangle, that rectangle"""
    banded: tuple[Banded, ...] = ()
    """chains of what runs, of which a band after the other is made"""
    memo: list[tuple[object, object, Precision, dict[str, Facts]]] = field(
        default_factory=list, compare=False, repr=False
    )
    """what `facts` found last, handed on to the graphs that are made of this one"""
    places: list[tuple[object, dict[str, int]]] = field(default_factory=list, compare=False, repr=False)
    """where nodes are by their names, as `place` found last"""

    @classmethod
    def of(cls, sources: Mapping[str, Facts], nodes: Iterable[Node], output: str, **further: Any) -> Graph:
        """A graph out of which the value called `output` comes as it is."""
        return cls(sources, tuple(nodes), {RESULT: Output(output)}, **further)

    @property
    def output(self) -> str:
        """The name of what comes out first."""
        return next(iter(self.outputs.values())).source

    def facts(self) -> dict[str, Facts]:
        """Facts of every source and node, forward through the graph."""
        if self.memo:
            sources, nodes, precision, found = self.memo[0]
            if sources is self.sources and nodes is self.nodes and precision is self.precision:
                return dict(found)
        known = {name: keeping(facts, self.precision) for name, facts in self.sources.items()}
        lossless = self.precision.lossless
        for node in self.nodes:
            made = node.about(known).result
            known[node.name] = made if lossless else keeping(made, self.precision)
        self.memo[:] = [(self.sources, self.nodes, self.precision, known)]
        return dict(known)

    def running(self) -> tuple[Node, ...]:
        """The nodes as they run: a chain as its last node, which reads what the first one does."""
        return _collapsed(self.steps(), [each.steps for each in self.banded])

    def steps(self) -> tuple[Node, ...]:
        """The nodes as they run, those of bands apart."""
        return _collapsed(self.nodes, self.fused)

    def named(self, name: str) -> Node:
        """The node called so, which there is."""
        node = self.node(name)
        assert node is not None, f"there is no node {name}"
        return node

    def node(self, name: str) -> Node | None:
        at = self._places().get(name)
        return None if at is None else self.nodes[at]

    def place(self, name: str) -> int:
        """Which of the nodes is called so, which there is."""
        return self._places()[name]

    def _places(self) -> dict[str, int]:
        if not self.places or self.places[0][0] is not self.nodes:
            self.places[:] = [(self.nodes, {node.name: at for at, node in enumerate(self.nodes)})]
        return self.places[0][1]

    def replace(self, **changes: Any) -> Graph:
        return dataclasses.replace(self, **changes)

    def deciding(self, decisions: Iterable[Decision]) -> Graph:
        return self.replace(decisions=(*self.decisions, *decisions))

    def reading(self, moved: Mapping[str, Moved]) -> Graph:
        """Without the nodes in `moved`; whoever read one of them reads what it moved to."""
        if not moved:
            return self
        outputs = {
            name: dataclasses.replace(each, source=to.source, inherited=each.inherited + to.change)
            if (to := moved.get(each.source))
            else each
            for name, each in self.outputs.items()
        }
        return self.replace(
            nodes=tuple(rewired(node, moved) for node in self.nodes if node.name not in moved),
            observers=tuple(rewired(node, moved) for node in self.observers),
            outputs=outputs,
        )

    def only(self, output: str) -> Graph:
        """What leads to one of the outputs."""
        alone = self.replace(outputs={output: self.outputs[output]}, observers=())
        needed = alone.needed(reporting=False)
        return alone.replace(nodes=tuple(node for node in self.nodes if node.name in needed))

    def needed(self, *, reporting: bool = True) -> set[str]:
        """Names of all nodes and sources whose value reaches an output or an observer, or, with `reporting`, a node
        that reports what it finds."""
        found = {each.source for each in self.outputs.values()}
        for node in self.observers:
            found.update(node.inputs.values())
        for node in reversed(self.nodes):
            if node.name in found or (reporting and node.operation.finds):
                found.add(node.name)
                found.update(node.inputs.values())
        return found


def _collapsed(nodes: tuple[Node, ...], chains: Sequence[tuple[str, ...]]) -> tuple[Node, ...]:
    if not chains:
        return nodes
    found = {node.name: node for node in nodes}
    ends = {chain[-1]: _read([found[name] for name in chain]) for chain in chains}
    inner = {name for chain in chains for name in chain[:-1]}
    return tuple(
        node.replace(inputs=ends[node.name]) if node.name in ends else node for node in nodes if node.name not in inner
    )


def _read(chain: Sequence[Node]) -> dict[str, str]:
    """What a chain reads that it does not make; first what the picture was that its result is made of at last."""
    made = {node.name for node in chain}
    read: dict[str, str] = {}
    for number, node in enumerate(chain):
        own = {
            f"{key}.{number}" if number else key: source for key, source in node.inputs.items() if source not in made
        }
        read = {**read, **own} if node.first in made else {**own, **read}
    return read


@dataclass(frozen=True, slots=True)
class Moved:
    """Where the value of a node that was left out is found, and by how much it differs from it at most."""

    source: str
    change: float = 0.0


def rewired(node: Node, moved: Mapping[str, Moved]) -> Node:
    """The node with its inputs read from where they moved to."""
    if moved.keys().isdisjoint(node.inputs.values()):
        return node
    inputs = {key: moved[source].source if source in moved else source for key, source in node.inputs.items()}
    inherited = dict(node.inherited)
    for key, source in node.inputs.items():
        if source in moved and moved[source].change:
            inherited[key] = inherited.get(key, 0.0) + moved[source].change
    return node.replace(inputs=inputs, inherited=inherited)


def inputs_of(node: Node, facts: Mapping[str, Facts]) -> dict[str, Facts]:
    """Facts of a node's inputs by input name."""
    return {key: facts[source] for key, source in node.inputs.items()}
