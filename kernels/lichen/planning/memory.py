"""How much memory a plan's images take while it runs.

Images are freed after their last reader, and those that come out are kept to the end. What is counted are the images
between the steps, sources included; what a method takes for itself while it runs is not.
"""

from __future__ import annotations

from collections.abc import Mapping

from lichen.accuracy.precision import Precision
from lichen.errors import TooLarge
from lichen.operation import Facts
from lichen.planning.graph import Graph, Request


def last_readers(graph: Graph) -> dict[str, str]:
    """By the name of each value the node after which nobody needs it; none for values that come out or are observed."""
    kept = {output.source for output in graph.outputs.values()}
    kept |= {source for node in graph.observers for source in node.inputs.values()}
    running = graph.running()
    read = {node.name: node.name for node in running}
    read |= {source: node.name for node in running for source in node.inputs.values()}
    return {source: reader for source, reader in read.items() if source not in kept}


def peak_bytes(graph: Graph, facts: Mapping[str, Facts]) -> int:
    """The most bytes that the images of a graph take at once."""
    each = 8 if graph.precision is Precision.FLOAT64 else 4
    size = {name: known.samples * each for name, known in facts.items()}
    last = last_readers(graph)
    held = sum(size[name] for name in graph.sources)
    peak = held
    for node in graph.running():
        held += size[node.name]
        peak = max(peak, held)
        held -= sum(size[source] for source in {node.name, *node.inputs.values()} if last.get(source) == node.name)
    return peak


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
