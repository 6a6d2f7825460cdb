"""A plan in sentences, as an engineer would note it down: what runs and by which method, on which part of the picture,
what was left out, how far that can change the result, and what it would have cost.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from lichen.operation import Error
from lichen.planning.graph import TRUTH, Decision, Node

if TYPE_CHECKING:
    from lichen.planning.plan import Plan

GONE = ("dropped", "skipped", "not lowered")
"""Actions of decisions after which something does not run."""
NARROWED = ("region", "hidden")
"""Passes that compute a part of a picture."""
HOW = ("choose", "fuse", "tile")
"""Passes that are told with what runs."""


def notes(plan: Plan) -> tuple[str, ...]:
    """The lines, headings ending in a colon and their items beginning with a dash."""
    return tuple(
        line
        for heading, lines in (
            ("", [_whole(plan)]),
            ("Runs", list(_running(plan))),
            ("Left out", [_gone(each) for each in plan.decisions if each.action in GONE]),
            ("Made smaller", list(_narrowed(plan))),
            ("Also", [_item(each) for each in plan.decisions if _further(each)]),
        )
        if lines
        for line in ([f"{heading}:"] if heading else []) + lines
    )


def _whole(plan: Plan) -> str:
    count = len(plan.graph.running())
    what = f"{count} {'step' if count == 1 else 'steps'} on {plan.request.backend}" if count else "Nothing runs"
    asked = []
    if plan.request.max_error is not None:
        asked.append(f"an error of {plan.request.max_error:.3g}")
    if plan.request.max_ms is not None:
        asked.append(f"{plan.request.max_ms:.3g} ms")
    wish = f"; asked: {' and '.join(asked)}" if asked else ""
    memory = f"holds {plan.peak_bytes / 2**20:.3g} MiB of pictures at most"
    return f"{what}: {_ms(plan.seconds * 1e3)} predicted, {_off(plan.error)}, {memory}{wish}."


def _off(error: Error) -> str:
    if not error.value:
        return "exact"
    kind = "proved" if error.kind == "bound" else "by calibration"
    return f"off by {error.value:.3g} at most ({kind})"


def _running(plan: Plan) -> Iterator[str]:
    """Every step in its order; a chain that one kernel does is one."""
    chains = {chain[-1]: chain for chain in plan.graph.fused}
    bands = {each.steps[-1]: each for each in plan.graph.banded}
    saved = {each.node: each.saved_ms for each in plan.decisions if each.pass_ == "fuse"}
    for node in plan.graph.steps():
        chain = chains.get(node.name, (node.name,))
        nodes = [plan.graph.named(name) for name in chain]
        own = sum(each.choice.seconds for each in nodes if each.choice is not None) * 1e3 - saved.get(node.name, 0.0)
        if len(nodes) > 1:
            apart = f"apart they would take {_ms(saved[node.name])} more"
            said = f"{', '.join(chain)}: one kernel, {_ms(max(own, 0.0))}; {apart}"
        else:
            said = f"{node.name}: {_method(node)}, {_ms(own)}{_instead(node)}"
        if node.name in bands:
            band = bands[node.name]
            said += f"; from {band.steps[0]} on in bands of {band.rows} rows, so that what lies between stays in cache"
        yield f"- {said}."


def _method(node: Node) -> str:
    choice = node.choice
    assert choice is not None, "every node of a plan has its choice"
    said = [] if node.operation.name == node.name else [node.operation.name]
    if choice.method == TRUTH:
        said.append("by its definition in doubles")
    elif len(node.operation.methods) > 1:
        knob = node.operation.methods[choice.method].knob
        at = f" at {knob.name} {choice.knob:g}" if knob is not None and choice.knob is not None else ""
        said.append(f"method {choice.method}{at}")
    return ", ".join([*said, _off(choice.error)])


def _instead(node: Node) -> str:
    """What the most accurate of the other methods would have cost."""
    choice = node.choice
    others = [each for each in node.alternatives if each.unfit is None and each.passes is None and each.method != TRUTH]
    best = min(others, key=lambda each: (each.error.value, each.seconds), default=None)
    if choice is None or best is None or best.error.value >= choice.error.value / 2 or best.seconds <= choice.seconds:
        return ""
    knob = "" if best.knob is None else f" at {best.knob:g}"
    return f" ({best.error.value:.3g} would cost {_ms(best.seconds * 1e3)}, by {best.method}{knob})"


def _narrowed(plan: Plan) -> Iterator[str]:
    """Nodes that make the same part of pictures of one size for the same reason are told together."""
    alike: dict[tuple[str, str], list[Decision]] = {}
    for each in plan.decisions:
        if each.pass_ in NARROWED:
            alike.setdefault((each.action, each.reason), []).append(each)
    for (action, reason), all_ in alike.items():
        names, saved = ", ".join(each.node for each in all_), sum(each.saved_ms for each in all_)
        yield _item(Decision("", names, action, reason, saved=saved))


def _gone(each: Decision) -> str:
    reason = f"does nothing here ({each.reason})" if each.pass_ == "identity" else each.reason
    change = f"changes the result by {each.bound:.3g} at most" if each.bound else "changes nothing"
    cost = f", and would have cost {_ms(each.saved_ms)}" if each.saved_ms else ""
    return f"- {each.node}: {reason}; {change}{cost}."


def _item(each: Decision) -> str:
    saved = f", which saves {_ms(each.saved_ms)}" if each.saved_ms else ""
    change = f"; changes the result by {each.bound:.3g} at most" if each.bound else ""
    name = "" if each.node == "*" else f"{each.node}: "
    return f"- {name}{each.action}: {each.reason}{saved}{change}."


def _further(each: Decision) -> bool:
    return each.action not in GONE and each.pass_ not in (*NARROWED, *HOW)


def _ms(milliseconds: float) -> str:
    return f"{milliseconds:.3g} ms" if milliseconds < 1000 else f"{milliseconds / 1000:.3g} s"
