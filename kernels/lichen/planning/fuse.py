"""The pass that lets chains of pointwise methods run as one kernel, so that pixels are read and written once.

A link of a chain is a node whose method says what it is as a stage (`Method.stage`), one input of which is the chain so
far, which nobody else reads, and whose pictures are all of one size and number of channels. Stages do the arithmetic of
their methods, so fusing changes no bit, and all that is predicted of the nodes stays true. The kernel's text follows
from the stages' headers and definitions; their numbers are its argument: pipelines of one shape share a program.

A stage of two pictures reads the second one beside the chain. All that a chain reads is there when it begins: of what
had to be computed no more than `BESIDE`, which is what a step of two pictures holds by itself.

What reads its neighbours may be the head of a chain whose stages do the same to all samples (`Method.head`): they are
done to sums in registers, where pixels are not taken apart. Of 2048 x 2048 x 4, a convolution of 3 x 3 and the encoding
of sRGB take 0.74 of the time of both apart, and with levels 0.69; of 7 x 7 taps 0.83. Warps are none: those whose
kernels went on with stages in the pixels that they had just written took 1.00 to 1.09 times as long as warp and chain
apart. What the pixels' way to memory and back costs, less room in registers costs again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import islice

from lichen.accuracy.precision import Precision
from lichen.image import Alpha
from lichen.operation import Facts
from lichen.planning.budget import Problem
from lichen.planning.candidates import Candidate
from lichen.planning.choose import measures, target_error
from lichen.planning.error import delivered, reaching, reaching_with
from lichen.planning.graph import TRUTH, Decision, Graph, Node, Request, inputs_of
from lichen.planning.region import crop
from lichen.stage import Head, Stage

CHANNELS = (3, 4)
"""Of pictures whose pixels are taken apart into vectors quickly."""
LONGEST = 16
"""Stages of one kernel."""
BESIDE = 2
"""Pictures that a chain reads and that are neither sources nor parts of such."""
FEWEST = 16
"""Pixels of a picture that a chain's kernel can make."""
TRIED = 1 << 16
"""Steps whose error is carried anew in the search for further links, about; 0.2 s."""
MOVED = {"start": 2e-4, "step": 1.5e-10}
"""Seconds that a launch takes and that a sample takes on its way from memory and back: what a link saves."""


def fuse(graph: Graph, request: Request) -> Graph:
    """The graph with its chains named, first node to last."""
    if request.backend != "opencl" or graph.precision is not Precision.FLOAT32:
        return graph
    facts = graph.facts()
    stages = {node.name for node in graph.nodes if stage_of(node, facts) is not None}
    graph, further = _linked(graph, facts, request, stages)
    stages |= further.keys()
    heads = {node.name for node in graph.nodes if head_of(node, facts) is not None}
    if len(stages | heads) < 2:
        return graph
    readers: dict[str, list[str]] = {}
    for node in (*graph.nodes, *graph.observers):
        for source in node.inputs.values():
            readers.setdefault(source, []).append(node.name)
    kept = {output.source for output in graph.outputs.values()}
    held = {*graph.sources, *(node.name for node in graph.nodes if node.operation is crop)}
    chains: dict[str, list[Node]] = {}
    for node in graph.nodes:
        if node.name in heads:
            chains[node.name] = [node]
        if node.name not in stages:
            continue
        before = [
            chains[source]
            for source in node.inputs.values()
            if source in chains and readers[source] == [node.name] and source not in kept
        ]
        longer = [
            [*chain, node]
            for chain in before
            if len(chain) < LONGEST and (chain[0].name not in heads or samplewise(node, facts))
        ]
        chain = max((each for each in longer if _beside(each, held) <= BESIDE), key=len, default=[node])
        for each in chain[-2:-1]:
            del chains[each.name]
        chains[node.name] = chain
    found = tuple(tuple(node.name for node in chain) for chain in chains.values() if len(chain) > 1)
    return graph.replace(fused=found).deciding(_decision(chain, facts) for chain in found)


def _beside(chain: Sequence[Node], held: Set[str]) -> int:
    """How many pictures a chain reads that it does not make and that would not be there without it."""
    made = {node.name for node in chain}
    return len({source for node in chain for source in node.inputs.values()} - made - held)


def _linked(
    graph: Graph, facts: Mapping[str, Facts], request: Request, staged: Set[str]
) -> tuple[Graph, Mapping[str, Candidate]]:
    """With methods that are stages in place of others between stages, where that is quicker and the errors allow it;
    and what was taken for which node."""
    near = {source for node in graph.nodes if node.name in staged for source in node.inputs.values()}
    offered = {
        node.name: offers
        for node in graph.nodes
        if node.name not in staged and (node.name in near or node.first in staged)
        if (offers := _stages_among(node, facts))
    }
    if request.max_ms is not None or not offered:
        return graph, {}
    choices = {node.name: node.choice for node in graph.nodes if node.choice is not None}
    targets = {name: target_error(facts[each.source], each, request) for name, each in graph.outputs.items()}
    problem = Problem(graph, facts, request, {}, targets, measures(request))
    reached = reaching(graph, facts, choices)
    kept = [each for _, each in problem.measures if problem.used(delivered(graph, reached), each) <= 1][:1]
    taken: dict[str, Candidate] = {}
    for name, offer in islice(((name, offer) for name, offers in offered.items() for offer in offers), _most(graph)):
        if name in taken:
            continue
        found = reaching_with(graph, facts, choices, reached, name, offer.error)
        if all(problem.used(delivered(graph, found), measure) <= 1 for measure in kept):
            reached, taken[name], choices[name] = found, offer, offer
    if not taken:
        return graph, {}
    nodes = (node.chosen(taken[node.name], node.alternatives) if node.name in taken else node for node in graph.nodes)
    return graph.replace(nodes=tuple(nodes)), taken


def _most(graph: Graph) -> int:
    """How many candidates are tried in a graph of so many nodes."""
    return max(TRIED // max(len(graph.nodes), 1), 1)


def _stages_among(node: Node, facts: Mapping[str, Facts]) -> list[Candidate]:
    """The candidates that are stages and, with what a link saves, no slower than the choice."""
    methods = _staged(node, facts)
    if node.choice is None or not methods:
        return []
    most = node.choice.seconds + MOVED["start"] + MOVED["step"] * facts[node.name].samples
    return [
        offer
        for offer in node.alternatives
        if offer.method in methods and offer.unfit is None and offer.passes is None and offer.seconds <= most
    ]


def stage_of(node: Node, facts: Mapping[str, Facts]) -> Stage | None:
    """The node as a stage, where its method is one and its picture fits."""
    if node.choice is None or node.choice.method not in _staged(node, facts):
        return None
    return node.stage(facts, node.choice.method)


def head_of(node: Node, facts: Mapping[str, Facts]) -> Head | None:
    """The node as the head of a chain, where its method is one and its picture keeps its size."""
    if node.choice is None or node.choice.method == TRUTH or len(node.inputs) != 1 or node.operation.finds:
        return None
    known = inputs_of(node, facts)
    if not all(_alike(each, facts[node.name]) for each in known.values()):
        return None
    return node.operation.methods[node.choice.method].head(node.parameters, node.choice.knob or 0.0, known)


def samplewise(node: Node, facts: Mapping[str, Facts]) -> bool:
    """Whether a stage does the same to all samples of its picture."""
    stage = stage_of(node, facts)
    return stage is not None and stage.single is not None and facts[node.name].alpha is Alpha.NONE


def tail_of(nodes: Sequence[Node], facts: Mapping[str, Facts], source: str) -> tuple[str, list[float]]:
    """The kernel of a head's source with samplewise stages behind it, and their numbers."""
    lines, calls, numbers = [], [], list[float]()
    for at, node in enumerate(nodes):
        stage = stage_of(node, facts)
        assert stage is not None, f"{node.name} is no stage"
        assert stage.single is not None, f"{node.name} does not do the same to all samples"
        lines += _included(at, stage, {**stage.defines, "COLOURS": 1, "CHANNELS": 1})
        calls.append(f"    stage{at}_stage(&v, k + {len(numbers)});")
        numbers += stage.single
    head = "static inline __attribute__((always_inline)) float16 tail(float16 v, global const float *k)"
    lines += [head, "{", *calls, "    return v;", "}", "#define TAIL tail", f'#include "{source}"']
    return "\n".join(lines) + "\n", numbers


def _included(number: int, stage: Stage, defines: Mapping[str, int | float | str]) -> list[str]:
    """The lines that define the function of a stage."""
    return [
        f"#define OWN(name) stage{number}_##name",
        *(f"#define {name} {_literal(value)}" for name, value in defines.items()),
        f'#include "{stage.source}"',
        *(f"#undef {name}" for name in ("OWN", *defines)),
    ]


def _staged(node: Node, facts: Mapping[str, Facts]) -> tuple[str, ...]:
    """The methods by which a node would be a stage."""
    made = facts[node.name]
    if made.channels not in CHANNELS or node.operation.finds or len(node.inputs) not in (1, 2):
        return ()
    if not all(_alike(facts[source], made) for source in node.inputs.values()):
        return ()
    return node.about(facts).staged


def _alike(one: Facts, other: Facts) -> bool:
    return (one.height, one.width, one.channels) == (other.height, other.width, other.channels)


def _decision(chain: Sequence[str], facts: Mapping[str, Facts]) -> Decision:
    saved = (len(chain) - 1) * (MOVED["start"] + MOVED["step"] * facts[chain[-1]].samples)
    reason = f"one kernel does {', '.join(chain)}"
    return Decision("fuse", chain[-1], f"fused with {len(chain) - 1} before it", reason, saved=saved * 1e3)


@dataclass(frozen=True, slots=True)
class Step:
    """A node of a chain. `sources` are what it reads, as its operation declares them; `chained` says which of them the
    chain before it is."""

    stage: Stage
    sources: tuple[str, ...]
    chained: int
    alpha: Alpha
    """of what it reads"""

    @property
    def beside(self) -> str | None:
        """What it reads beside the chain."""
        return self.sources[1 - self.chained] if len(self.sources) > 1 else None


def steps_of(nodes: Sequence[Node], facts: Mapping[str, Facts]) -> list[Step]:
    """A chain as its steps; the first one goes on with what it reads first."""
    steps, last = [], ""
    for node in nodes:
        stage = stage_of(node, facts)
        assert stage is not None, f"{node.name} is no stage"
        sources = tuple(node.inputs[each.name] for each in node.operation.inputs if each.name in node.inputs)
        chained = sources.index(last) if last in sources else 0
        steps.append(Step(stage, sources, chained, facts[sources[chained]].alpha))
        last = node.name
    return steps


def text_of(steps: Sequence[Step], channels: int) -> str:
    """The kernel of a chain, for `Session.sweep`: `fused(in, out, k, pixels, ...)` with what steps read beside it, for
    `FEWEST` pixels at least. The last sixteen begin so much earlier that they are sixteen, and some are made twice:
    what takes fewer, for every picture that is read, would be most of the text."""
    lines = [f"#define {name} {channels}" for name in ("IN", "OUT", "READ", "MADE", "CHANNELS")]
    lines.append('#include "colour/planes.clh"')
    for number, step in enumerate(steps):
        stage = step.stage
        defines = {"COLOURS": channels - (step.alpha is not Alpha.NONE), **stage.defines}
        lines += _included(number, stage, defines)
    others = "".join(f", global const float *restrict other{n}" for n, step in enumerate(steps) if step.beside)
    lines += [
        "kernel void fused(global const float *restrict in, global float *restrict out,",
        f"                  global const float *restrict k, int pixels{others})",
        "{",
        "    int end = run_end(pixels);",
        "    for (int at = run_start(); at < end; at += WIDTH) {",
        "        int first = min(at, pixels - WIDTH);",
        "        global const float *from = in + (size_t)first * IN;",
        "        float16 v[4], w[4];",
        "        load_planes(from, WIDTH, v);",
    ]
    at = 0
    for number, step in enumerate(steps):
        pictures = "v"
        if step.beside:
            lines.append(f"        load_planes(other{number} + (size_t)first * IN, WIDTH, w);")
            pictures = "w, v" if step.chained else "v, w"
        lines.append(f"        stage{number}_stage({pictures}, k + {at});")
        if step.chained:
            lines += [f"        v[{channel}] = w[{channel}];" for channel in range(channels)]
        at += len(step.stage.numbers)
    lines.append("        store_planes(v, from, WIDTH, out + (size_t)first * OUT, pixels);")
    return "\n".join([*lines, "    }", "}"]) + "\n"


def _literal(value: int | float | str) -> str:
    return f"{value.hex()}f" if isinstance(value, float) else str(int(value) if isinstance(value, bool) else value)
