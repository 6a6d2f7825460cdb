"""What parameters and pictures show only together, found on facts that flow forward: channels, pages, sizes, kinds.

A node is looked at when all it reads is known; behind one that has a flaw nothing is known, so nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from lichen.errors import Flaw
from lichen.operation import Facts, Input
from lichen.planning.graph import Node, Output


def flaws_of(nodes: Iterable[Node], sources: Mapping[str, Facts], where: Callable[[Node], str]) -> list[Flaw]:
    """Every flaw of every node; `where` gives the pointer that flaws of a node begin with."""
    return flowing(nodes, sources, where)[0]


def flowing(
    nodes: Iterable[Node], sources: Mapping[str, Facts], where: Callable[[Node], str]
) -> tuple[list[Flaw], dict[str, Facts]]:
    """Every flaw of every node, and the facts of all values that are known all the same."""
    known = dict(sources)
    flaws: list[Flaw] = []
    for node in nodes:
        if any(source not in known for source in node.inputs.values()):
            continue
        facts = {key: known[source] for key, source in node.inputs.items()}
        declared = {each.name: each for each in node.operation.inputs}
        found = [flaw for key, each in facts.items() for flaw in unfit(declared[key], each)]
        found = found or node.operation.check(node.parameters, facts)
        if found:
            flaws += [Flaw(where(node) + flaw.pointer, flaw.detail) for flaw in found]
        else:
            known[node.name] = node.result(known)
    return flaws, known


def flaws_of_crop(output: Output, facts: Facts | None, where: str) -> list[Flaw]:
    """Why a part cannot be had of a value of which this is known."""
    if output.crop is None or facts is None:
        return []
    left, top, width, height = output.crop
    if facts.pages == 1 and left + width <= facts.width and top + height <= facts.height:
        return []
    what = f"{facts.width}x{facts.height} px" + (f" of {facts.pages} pages" if facts.pages > 1 else "")
    return [Flaw(where, f"must lie inside the picture, which is {what}")]


def unfit(declared: Input, facts: Facts) -> list[Flaw]:
    """Why a picture cannot be this input."""
    pointer = f"/inputs/{declared.name}"
    fewest, most = declared.channels
    flaws = []
    if facts.channels < fewest or (most is not None and facts.channels > most):
        wants = f"{fewest}" if fewest == most else f"{fewest} to {most}" if most else f"at least {fewest}"
        flaws.append(Flaw(pointer, f"must have {wants} channels (has {facts.channels})"))
    if facts.pages > 1:
        flaws.append(Flaw(pointer, f"must be one picture (has {facts.pages} pages)"))
    return flaws
