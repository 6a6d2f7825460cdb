"""What parameters and pictures show only together, found on facts that flow forward: channels, pages, sizes, kinds.

A node is looked at when all it reads is known; behind one that has a flaw nothing is known, so nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from lichen.errors import Flaw
from lichen.image import Image
from lichen.operation import Facts, Input
from lichen.planning.graph import Node


def flaws_of(nodes: Iterable[Node], sources: Mapping[str, Facts], where: Callable[[Node], str]) -> list[Flaw]:
    """Every flaw of every node; `where` gives the pointer that flaws of a node begin with."""
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
    return flaws


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


def unmeasured(image: Image) -> Facts:
    """What is known of a picture without a look at its pixels: its extent means nothing."""
    return Facts(image.height, image.width, image.channels, image.space, image.alpha, pages=image.pages)
