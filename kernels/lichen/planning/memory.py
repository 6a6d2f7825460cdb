"""How much memory a plan's images take while it runs.

Images are freed after their last reader, and those that come out are kept to the end. Counted are the images between
the steps, sources included, and what each step takes for itself while it runs: what its method says (`Method.scratch`),
and of a chain made in bands the band that is read and the band that is made.
"""

from __future__ import annotations

from collections.abc import Mapping

from lichen.accuracy.precision import Precision
from lichen.errors import TooLarge
from lichen.operation import POINTWISE, Facts
from lichen.planning.graph import TRUTH, Graph, Node, Request, inputs_of


def last_readers(graph: Graph) -> dict[str, str]:
    """By the name of each value the node after which nobody needs it; none for values that come out or are observed."""
    kept = {output.source for output in graph.outputs.values()}
    kept |= {source for node in graph.observers for source in node.inputs.values()}
    running = graph.running()
    read = {node.name: node.name for node in running}
    read |= {source: node.name for node in running for source in node.inputs.values()}
    return {source: reader for source, reader in read.items() if source not in kept}


def peak_bytes(graph: Graph, facts: Mapping[str, Facts]) -> int:
    """The most bytes that a graph takes at once."""
    each = 8 if graph.precision is Precision.FLOAT64 else 4
    size = {name: known.samples * each for name, known in facts.items()}
    last = last_readers(graph)
    held = sum(size[name] for name in graph.sources)
    peak = held
    own = _own_bytes(graph, facts)
    for node in graph.running():
        held += size[node.name]
        peak = max(peak, held + own[node.name])
        held -= sum(size[source] for source in {node.name, *node.inputs.values()} if last.get(source) == node.name)
    return peak


def _own_bytes(graph: Graph, facts: Mapping[str, Facts]) -> dict[str, int]:
    """What each step takes while it runs, beside what it reads and makes; by the names of what runs."""
    heads = {chain[-1]: graph.named(chain[0]) for chain in graph.fused}
    own = {node.name: _scratch(heads.get(node.name, node), facts) for node in graph.steps()}
    for banded in graph.banded:
        rows = banded.rows + 2 * sum(banded.reaches)
        most = 0.0
        for name in banded.steps:
            read, made = facts[graph.named(name).first or ""], facts[name]
            row = 4 * (read.samples + made.samples) / made.height
            most = max(most, rows * (row + own[name] / made.height))
        own[banded.steps[-1]] = int(most)
    return own


def _scratch(node: Node, facts: Mapping[str, Facts]) -> int:
    known, choice = inputs_of(node, facts), node.choice
    largest = max((each.samples for each in (*known.values(), facts[node.name])), default=0)
    if choice is None or choice.passes is not None:
        return 0
    if choice.method == TRUTH:
        return 8 * (sum(each.samples for each in known.values()) + facts[node.name].samples)
    pictures = node.operation.methods[choice.method].scratch
    if pictures is None:
        pointwise = node.operation.footprint(node.parameters, known) == POINTWISE
        pictures = 0.0 if pointwise else 1.0
    return int(4 * largest * pictures)


def refuse_too_large(graph: Graph, request: Request) -> None:
    """Raises `TooLarge` for a plan that would hold more than was allowed."""
    if request.max_bytes is None:
        return
    needed = peak_bytes(graph, graph.facts())
    if needed > request.max_bytes:
        raise TooLarge(
            f"The plan would hold {needed} bytes of images at once.",
            limit=request.max_bytes,
            actual=needed,
        )
