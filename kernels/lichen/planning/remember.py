"""Plans that were made before.

A plan follows from the graph and the request alone, and callers ask for the same again and again: the frames of an
animation, the tiles of a picture, the requests of a page. Making it takes 0.2 to 0.4 ms, which is as much as a small
kernel, so the last ones are kept.

Rules:

* A plan is kept by everything that it follows from. Parameters count as they are written out, so that numbers that
  are equal and not the same (0 and -0) are two; rates are those of one table, itself and not its equal.
* What was refused is not kept: a second request is refused as the first was.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from lichen.planning.graph import Graph, Node, Request
from lichen.planning.plan import Plan, make_plan

KEPT = 128
"""Plans; the longest unused are dropped first."""
MOST_NODES = 64
"""Of a graph; larger ones are planned anew, since telling them apart takes memory and time."""
_kept: OrderedDict[object, Plan] = OrderedDict()
_lock = threading.Lock()


def remembered(graph: Graph, request: Request, check: Callable[[], None]) -> Plan:
    """The plan of `graph` for `request`: one that was made before, or a new one, once `check` has raised nothing."""
    if len(graph.nodes) > MOST_NODES:
        check()
        return make_plan(graph, request)
    key = _key(graph, request)
    with _lock:
        plan = _kept.get(key)
        if plan is not None and plan.request.rates is request.rates:
            _kept.move_to_end(key)
            return plan
    check()
    plan = make_plan(graph, request)
    with _lock:
        _kept[key] = plan
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
    return plan


def _key(graph: Graph, request: Request) -> object:
    wished = (
        request.backend, request.max_error, request.max_ms, request.target, request.prune, request.concatenate,
        request.max_bytes,
    )  # fmt: skip
    return (
        tuple(graph.sources.items()),
        tuple([_told(node) for node in graph.nodes]),
        tuple(graph.outputs.items()),
        graph.decisions,
        graph.precision,
        tuple(graph.thin.items()),
        wished,
    )


def _told(node: Node) -> tuple[Any, ...]:
    """All that a plan has of a node."""
    asked = node.asked
    return (
        node.name,
        node.operation,
        node.parameters.written,
        tuple(node.inputs.items()),
        asked.method,
        tuple(asked.knobs.items()),
        asked.max_error,
        tuple(node.inherited.items()),
    )
