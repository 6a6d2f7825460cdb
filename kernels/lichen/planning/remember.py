"""What was asked before, and plans that were made of it.

A plan follows from the graph and the request alone, and callers ask for the same again and again: the frames of an
animation, the tiles of a picture, the requests of a page. Planning takes at least 0.2 to 0.4 ms, which is as much as a
small kernel, and reading what is asked a part of that, so the last ones are kept.

Rules:

* A plan is kept by everything that it follows from: facts of pictures, and a key for the rest. Rates are those of one
  table, itself and not its equal.
* What a call says is kept number for number: 1, 1.0 and true are three. What was read of it is the key of its plans.
  What cannot be written out plainly is read anew.
* Pipelines are told apart node by node. Parameters count as they are written out, so that numbers that are equal and
  not the same (0 and -0) are two.
* What was refused is not kept: a second request is refused as the first was.
"""

from __future__ import annotations

import marshal
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from lichen.accuracy.precision import Precision
from lichen.planning.graph import Node, Output, Request
from lichen.planning.plan import Plan

KEPT = 128
"""Values; the longest unused are dropped first."""
MOST_NODES = 64
"""Of a graph; larger ones are planned anew, since telling them apart takes memory and time."""
LONGEST = 1 << 17
"""Bytes of a key that is written out."""
PLAIN = 2
"""The version of `marshal` that writes values alone, and not which of them are one object."""

Value = TypeVar("Value")


class Kept(Generic[Value]):
    """The last values by their keys. Safe to use from any thread."""

    def __init__(self) -> None:
        self._held: OrderedDict[Hashable, Value] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Value | None:
        with self._lock:
            found = self._held.get(key)
            if found is not None:
                self._held.move_to_end(key)
            return found

    def put(self, key: Hashable, value: Value) -> None:
        with self._lock:
            self._held[key] = value
            while len(self._held) > KEPT:
                self._held.popitem(last=False)


def written(said: Any) -> bytes | None:
    """What somebody says, as a key; None where it is too long, or made of more than numbers, text, lists and mappings.
    Of arrays only the bytes would be written, whatever their shape and type, so that what is read is not what was said.

    >>> written({"lights": [{}]}) == written({"lights": [{}]}), written({"x": 1}) == written({"x": 1.0})
    (True, False)
    """
    try:
        made = marshal.dumps(said, PLAIN)
        return made if len(made) <= LONGEST and marshal.loads(made) == said else None
    except ValueError:
        return None


_plans: Kept[Plan] = Kept()


def remembered(key: Hashable | None, rates: object, make: Callable[[], Plan]) -> Plan:
    """The plan that was made by `rates` for all that `key` stands for, or what `make` gives, which is kept if there is
    a key."""
    plan = None if key is None else _plans.get(key)
    if plan is None or plan.request.rates is not rates:
        plan = make()
        if key is not None:
            _plans.put(key, plan)
    return plan


def told(
    nodes: Sequence[Node], outputs: Mapping[str, Output], request: Request, precision: Precision
) -> Hashable | None:
    """All that a plan has of what was asked; None where telling it apart takes too much."""
    if len(nodes) > MOST_NODES:
        return None
    wished = (
        request.backend, request.max_error, request.max_ms, request.target, request.prune, request.concatenate,
        request.max_bytes,
    )  # fmt: skip
    return (tuple([_told(node) for node in nodes]), tuple(outputs.items()), wished, precision)


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
