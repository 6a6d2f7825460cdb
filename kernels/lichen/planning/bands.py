"""The pass that lets chains of steps run band after band of rows, so that large pictures between them never are whole.

A step takes part if it makes every row of its result from rows near it in the one picture it reads, wherever they lie:
what `needed` says of a band, with the step's own parameters. Rows that two bands read are computed twice, so a band is
at least `FEWEST` times as high as the rows that all steps of its chain reach together; where that is much of the
picture, the chain ends. Bands do the arithmetic of parts, and what is stated of those holds.

Only pictures of `WORTHWHILE` bytes are cut, which is more than is kept for reuse (`lichen.memory.KEPT`): what lies
between steps would be new memory, whose first touch costs more than a fast step. Twelve steps, boxes and levels by
turns, take 8.9 s in bands and 23 s whole on 8192 x 8192 x 4; on 4096 x 4096 x 4, where memory is reused, 2.9 s in bands
and 2.5 s whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lichen.accuracy.precision import Precision
from lichen.operation import Facts
from lichen.planning.graph import TRUTH, Banded, Decision, Graph, Node, Request, inputs_of

WORTHWHILE = 1 << 29
"""Bytes of a picture."""
BAND = 16 << 20
"""Bytes of a band, about."""
FEWEST = 8
"""How many times as high as what its steps reach a band is at least."""


def bands(graph: Graph, request: Request) -> Graph:
    """The graph with its chains named, first step to last."""
    if graph.precision is not Precision.FLOAT32:
        return graph
    facts = graph.facts()
    if not any(_bytes(each) >= WORTHWHILE for each in facts.values()):
        return graph
    found = tuple(_banded(chain, graph, facts) for chain in _chains(graph, facts) if len(chain) > 1)
    return graph.replace(banded=found).deciding(_decision(each, facts) for each in found)


def _chains(graph: Graph, facts: Mapping[str, Facts]) -> list[list[Node]]:
    read: dict[str, int] = {}
    for node in (*graph.running(), *graph.observers):
        for source in node.inputs.values():
            read[source] = read.get(source, 0) + 1
    kept = {output.source for output in graph.outputs.values()}
    inner = {chain[-1]: [graph.named(name) for name in chain] for chain in graph.fused}
    chains: dict[str, list[Node]] = {}
    for node in graph.running():
        if not all(_near(each, facts) for each in inner.get(node.name, [node])):
            continue
        before = chains.get(node.first or "")
        alone = read.get(node.first or "") == 1 and node.first not in kept
        if before is not None and alone and _fits([*before, node], graph, facts):
            del chains[before[-1].name]
            chains[node.name] = [*before, node]
        else:
            chains[node.name] = [node]
    return list(chains.values())


def _near(node: Node, facts: Mapping[str, Facts]) -> bool:
    """Whether bands of a node's picture give bands of its result."""
    known, made = inputs_of(node, facts), facts[node.name]
    if len(known) != 1 or node.operation.part is not None or node.operation.finds or _bytes(made) < WORTHWHILE:
        return False
    if node.choice is None or node.choice.method == TRUTH or node.operation.implied(node.parameters, known):
        return False
    (image,) = known.values()
    footprint = node.operation.footprint(node.parameters, known)
    return (image.height, image.width, image.pages, made.pages) == (made.height, made.width, 1, 1) and (
        footprint.rows is not None and not footprint.wraps
    )


def _reach(step: Node, graph: Graph, facts: Mapping[str, Facts]) -> int:
    """Of a step, which may be a chain that runs as one: rows that its head reaches."""
    head = next((graph.named(chain[0]) for chain in graph.fused if chain[-1] == step.name), step)
    return head.operation.footprint(head.parameters, inputs_of(head, facts)).rows or 0


def _rows(chain: Sequence[Node], graph: Graph, facts: Mapping[str, Facts]) -> int:
    """Of a band: as many as stay near the processor, and enough for what all steps reach."""
    each = max(_bytes(facts[node.name]) // facts[node.name].height for node in chain)
    return max(BAND // each, FEWEST * sum(_reach(node, graph, facts) for node in chain), 1)


def _fits(chain: Sequence[Node], graph: Graph, facts: Mapping[str, Facts]) -> bool:
    return 4 * _rows(chain, graph, facts) <= facts[chain[0].name].height


def _banded(chain: Sequence[Node], graph: Graph, facts: Mapping[str, Facts]) -> Banded:
    reaches = [_reach(node, graph, facts) for node in chain]
    return Banded(tuple(node.name for node in chain), _rows(chain, graph, facts), tuple(reaches))


def spans(banded: Banded, start: int, height: int) -> list[tuple[int, int]]:
    """First row and the one after the last: of what each step makes for the band that starts at `start`, the first
    step first, and before them of what the first one reads."""
    found = [(start, min(start + banded.rows, height))]
    for reach in reversed(banded.reaches):
        low, high = found[-1]
        found.append((max(low - reach, 0), min(high + reach, height)))
    return found[::-1]


def _bytes(facts: Facts) -> int:
    return 4 * facts.samples


def _decision(banded: Banded, facts: Mapping[str, Facts]) -> Decision:
    last = banded.steps[-1]
    reason = f"{', '.join(banded.steps)} need no more of what lies between them; its {facts[last].height} rows are many"
    return Decision("tile", last, f"made in bands of {banded.rows} rows", reason)
