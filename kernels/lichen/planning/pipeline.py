"""A pipeline as its author wrote it: named nodes, each an operation with parameters and inputs, and what comes out.

    {"nodes": {"light": {"operation": "transfer", "inputs": {"image": "input.image"}},
               "soft":  {"operation": "gaussian", "parameters": {"sigma": 5}, "inputs": {"image": "light"},
                         "method": "fir", "max_error": 0.001, "knobs": {"tail": 0.0001}}},
     "outputs": {"preview": {"node": "soft", "format": "png"}}}

A node reads other nodes by their names and the pictures sent along as `input.NAME`. `inputs` may be left out where the
operation reads one picture and the pipeline has one, called `image`. `outputs` may be left out where there is one node
that no other reads. With `"concatenate": true` warps that follow one another are one where they can be, and the image
is filtered once: that is another picture, so it is asked for. The same as text, for URLs and the shell: see `text`.

Reading finds every flaw at once and says where: `/nodes/soft/parameters/sigma`, `/outputs/preview/node`.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lichen.catalogue import operation
from lichen.errors import Flaw, InvalidRequest, UnknownOperation, nearest
from lichen.operation import Operation, OperationParameters
from lichen.planning import text
from lichen.planning.graph import RESULT, Asked, Node

INPUT = "input."
"""What the name of a picture sent along begins with where a node reads it."""
FIRST = "image"
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,63}")
MOST = text.MOST
"""Nodes of one pipeline."""
_NODE = ("operation", "parameters", "inputs", "method", "knobs", "max_error")
_OUTPUT = ("node", "format", "storage", "space", "alpha", "crop")


@dataclass(frozen=True, slots=True)
class Step:
    """One node, not yet checked beyond its shape."""

    operation: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    method: str | None = None
    knobs: Mapping[str, Any] = field(default_factory=dict)
    max_error: Any = None


@dataclass(frozen=True, slots=True)
class Exit:
    """What comes out under a name, and in which form it is wanted (None: whatever suits)."""

    node: str
    format: str | None = None
    storage: str | None = None
    space: str | None = None
    alpha: str | None = None
    crop: tuple[int, int, int, int] | None = None
    """left, top, width and height, px"""


@dataclass(frozen=True)
class Pipeline:
    """Steps by name in the order they were written, and what comes out by name."""

    steps: Mapping[str, Step]
    outputs: Mapping[str, Exit]
    concatenate: bool = False
    """whether warps that follow one another are to be one"""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the pictures it reads, in the order in which it reads them."""
        read = [source for step in self.steps.values() for source in step.inputs.values()]
        read += [each.node for each in self.outputs.values()]
        return tuple(dict.fromkeys(source.removeprefix(INPUT) for source in read if source.startswith(INPUT)))

    @cached_property
    def nodes(self) -> tuple[Node, ...]:
        """In an order in which they can run, with parameters read; found once. Raises `InvalidRequest` with every
        flaw."""
        return nodes_of(self)


# ----------------------------------------------------------------------------------------------------------- reading


def read(said: Pipeline | Mapping[str, Any] | str | bytes) -> Pipeline:
    """The pipeline that a mapping, its JSON or the text form says. Raises `InvalidRequest` with every flaw of shape."""
    if isinstance(said, Pipeline):
        return said
    if isinstance(said, bytes):
        try:
            said = said.decode()
        except UnicodeDecodeError:
            raise InvalidRequest("The pipeline is not UTF-8.", [Flaw("/pipeline", "is not UTF-8")]) from None
    if isinstance(said, str):
        said = _from_json(said) if said.lstrip()[:1] == "{" else text.read(said)
    flaws: list[Flaw] = []
    steps = _steps(said, flaws)
    outputs = _outputs(said, steps, flaws)
    concatenate = said.get("concatenate", False)
    if not isinstance(concatenate, bool):
        flaws.append(Flaw("/concatenate", "must be true or false"))
    if flaws:
        try:
            nodes_of(Pipeline(steps, {}))
        except InvalidRequest as invalid:
            flaws += invalid.flaws
        raise InvalidRequest(f"The pipeline has {len(flaws)} flaw(s).", flaws)
    return Pipeline(steps, outputs, concatenate)


def _from_json(said: str) -> Mapping[str, Any]:
    try:
        document = json.loads(said)
    except (ValueError, RecursionError) as broken:
        raise InvalidRequest("The pipeline is not JSON.", [Flaw("/pipeline", f"is not JSON: {broken}")]) from None
    assert isinstance(document, dict), "text that starts with a brace is an object"
    return document


def _steps(said: Mapping[str, Any], flaws: list[Flaw]) -> dict[str, Step]:
    _unknown(said, ("nodes", "outputs", "concatenate"), "", flaws)
    nodes = said.get("nodes")
    if not isinstance(nodes, Mapping) or not 1 <= len(nodes) <= MOST:
        flaws.append(Flaw("/nodes", f"must be an object of 1 to {MOST} nodes by name"))
        return {}
    steps = {}
    for name, node in nodes.items():
        where = f"/nodes/{escaped(name)}"
        if not NAME.fullmatch(name):
            flaws.append(Flaw(where, "a node's name is letters, digits, _ and -, and begins with a letter"))
        if not isinstance(node, Mapping) or not isinstance(node.get("operation"), str):
            flaws.append(Flaw(f"{where}/operation", "is required, as text"))
            continue
        _unknown(node, _NODE, where, flaws)
        parts = {key: _mapping(node, key, where, flaws) for key in ("parameters", "inputs", "knobs")}
        for key, source in parts["inputs"].items():
            if not isinstance(source, str):
                flaws.append(Flaw(f"{where}/inputs/{escaped(key)}", "must be the name of a node, or input.NAME"))
        method = node.get("method")
        if method is not None and not isinstance(method, str):
            flaws.append(Flaw(f"{where}/method", "must be text"))
            method = None
        inputs = {key: str(source) for key, source in parts["inputs"].items()}
        inputs = inputs or _implied_input(node["operation"])
        steps[name] = Step(
            node["operation"], parts["parameters"], inputs, method, parts["knobs"], node.get("max_error")
        )
    return steps


def _implied_input(name: str) -> dict[str, str]:
    """The picture `image` for an operation whose inputs are left out, if it reads any."""
    try:
        declared = operation(name).inputs
    except UnknownOperation:
        return {}
    return {declared[0].name: f"{INPUT}image"} if declared and declared[0].required else {}


def _outputs(said: Mapping[str, Any], steps: Mapping[str, Step], flaws: list[Flaw]) -> dict[str, Exit]:
    outputs = said.get("outputs")
    if outputs is None:
        read = {source for step in steps.values() for source in step.inputs.values()}
        last = [name for name in steps if name not in read]
        if steps and len(last) != 1:
            which = ", ".join(last) or "none"
            flaws.append(Flaw("/outputs", f"is required unless one node is read by no other (here: {which})"))
        return {RESULT: Exit(last[0])} if last else {}
    if not isinstance(outputs, Mapping) or not 1 <= len(outputs) <= MOST:
        flaws.append(Flaw("/outputs", "must be an object of outputs by name, at least one"))
        return {}
    exits = {}
    for name, output in outputs.items():
        where = f"/outputs/{escaped(name)}"
        output = {"node": output} if isinstance(output, str) else output
        if not NAME.fullmatch(name):
            flaws.append(Flaw(where, "an output's name is letters, digits, _ and -, and begins with a letter"))
        if not isinstance(output, Mapping) or not isinstance(output.get("node"), str):
            flaws.append(Flaw(f"{where}/node", "is required: the name of a node, or input.NAME"))
            continue
        _unknown(output, _OUTPUT, where, flaws)
        for key in _OUTPUT[1:-1]:
            if not isinstance(output.get(key, ""), str):
                flaws.append(Flaw(f"{where}/{key}", "must be text"))
        form = {key: str(output[key]) for key in _OUTPUT[:-1] if output.get(key) is not None}
        exits[name] = Exit(**form, crop=_rectangle(output.get("crop"), f"{where}/crop", flaws))
        _refuse_unknown_source(exits[name].node, steps, f"{where}/node", flaws)
    return exits


def _rectangle(value: Any, where: str, flaws: list[Flaw]) -> tuple[int, int, int, int] | None:
    if value is None:
        return None
    whole = isinstance(value, list | tuple) and len(value) == 4 and all(type(each) is int for each in value)
    if not whole or min(value[:2]) < 0 or min(value[2:]) < 1:
        flaws.append(Flaw(where, "must be [left, top, width, height] in whole pixels, of at least one"))
        return None
    left, top, width, height = value
    return left, top, width, height


def _mapping(node: Mapping[str, Any], key: str, where: str, flaws: list[Flaw]) -> dict[str, Any]:
    value = node.get(key, {})
    if isinstance(value, Mapping):
        return dict(value)
    flaws.append(Flaw(f"{where}/{key}", "must be an object"))
    return {}


def _unknown(said: Mapping[str, Any], known: tuple[str, ...], where: str, flaws: list[Flaw]) -> None:
    flaws += [
        Flaw(f"{where}/{escaped(str(key))}", f"is not known here; {nearest(str(key), known)}")
        for key in said
        if key not in known
    ]


def _refuse_unknown_source(source: str, steps: Mapping[str, Step], where: str, flaws: list[Flaw]) -> None:
    if source in steps or (source.startswith(INPUT) and NAME.fullmatch(source.removeprefix(INPUT))):
        return
    flaws.append(Flaw(where, f"reads {source!r}, which is neither a node nor input.NAME; {nearest(source, steps)}"))


def escaped(name: str) -> str:
    """A name as one step of a JSON pointer."""
    return str(name).replace("~", "~0").replace("/", "~1")


# ---------------------------------------------------------------------------------------------------------- checking


def nodes_of(pipeline: Pipeline) -> tuple[Node, ...]:
    """The nodes in an order in which they can run, with parameters read. Raises `InvalidRequest` with every flaw."""
    flaws: list[Flaw] = []
    made: dict[str, Node] = {}
    for name, step in pipeline.steps.items():
        where = f"/nodes/{escaped(name)}"
        for key, source in step.inputs.items():
            _refuse_unknown_source(source, pipeline.steps, f"{where}/inputs/{escaped(key)}", flaws)
        try:
            wanted = operation(step.operation)
        except UnknownOperation as unknown:
            flaws.append(Flaw(f"{where}/operation", unknown.detail))
            continue
        parameters = _parameters(wanted, step, where, flaws)
        inputs = _inputs(wanted, step, where, flaws)
        asked = _asked(wanted, step, where, flaws)
        if parameters is not None:
            made[name] = Node(name, wanted, parameters, inputs, asked=asked)
    order, cycle = _ordered(pipeline.steps)
    if cycle:
        flaws += [Flaw(f"/nodes/{escaped(name)}/inputs", f"reads itself: {' -> '.join(cycle)}") for name in cycle[:1]]
    if flaws:
        raise InvalidRequest(f"The pipeline has {len(flaws)} flaw(s).", flaws)
    return tuple(made[name] for name in order)


def _parameters(wanted: Operation[Any], step: Step, where: str, flaws: list[Flaw]) -> OperationParameters | None:
    try:
        parameters: OperationParameters = wanted.validate(step.parameters)
    except InvalidRequest as invalid:
        flaws += [Flaw(where + flaw.pointer, flaw.detail) for flaw in invalid.flaws]
        return None
    return parameters


def _inputs(wanted: Operation[Any], step: Step, where: str, flaws: list[Flaw]) -> dict[str, str]:
    """Inputs in the declared order; `image` stands for the first, whatever that is called."""
    names = [each.name for each in wanted.inputs]
    if FIRST in step.inputs and names and FIRST not in names and names[0] not in step.inputs:
        step = dataclasses.replace(step, inputs={names[0]: step.inputs[FIRST], **_without(step.inputs, FIRST)})
    for key in step.inputs:
        if key not in names:
            hint = nearest(key, names) if names else f"{wanted.name} reads none"
            flaws.append(Flaw(f"{where}/inputs/{escaped(key)}", f"is not an input of {wanted.name}; {hint}"))
    for each in wanted.inputs:
        if each.required and each.name not in step.inputs:
            flaws.append(Flaw(f"{where}/inputs/{each.name}", "is required"))
    return {name: step.inputs[name] for name in names if name in step.inputs}


def _without(inputs: Mapping[str, str], name: str) -> dict[str, str]:
    return {key: source for key, source in inputs.items() if key != name}


def _asked(wanted: Operation[Any], step: Step, where: str, flaws: list[Flaw]) -> Asked:
    if step.method is not None and step.method not in wanted.methods:
        hint = nearest(step.method, wanted.methods)
        flaws.append(Flaw(f"{where}/method", f"{wanted.name} has no method {step.method!r}; {hint}"))
    knobs = {}
    for key, value in step.knobs.items():
        knob, number = wanted.knobs.get(key), _number(value)
        if knob is None:
            hint = nearest(key, wanted.knobs)
            flaws.append(Flaw(f"{where}/knobs/{escaped(key)}", f"is not a knob of {wanted.name}; {hint}"))
        elif not knob.low <= number <= knob.high:
            span = f"must lie between {knob.low:g} and {knob.high:g} (got {value!r})"
            flaws.append(Flaw(f"{where}/knobs/{key}", span))
        else:
            knobs[key] = number
    limit = None if step.max_error is None else _number(step.max_error)
    if limit is not None and not 0 < limit < math.inf:
        flaws.append(Flaw(f"{where}/max_error", f"must be a finite number above 0 (got {step.max_error!r})"))
    return Asked(step.method, knobs, limit)


def _number(value: Any) -> float:
    """The number in a value or its text; NaN where there is none."""
    if isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _ordered(steps: Mapping[str, Step]) -> tuple[list[str], list[str]]:
    """Names in an order in which every node comes after what it reads, as near to the written one as can be; or a
    cycle, which begins and ends with the same name."""
    order: dict[str, None] = {}
    for start in steps:
        path: list[str] = [] if start in order else [start]
        on_path = set(path)
        unread: list[Iterator[str]] = [_reads(steps, name) for name in path]
        while path:
            source = next(unread[-1], None)
            if source is None:
                unread.pop()
                on_path.discard(path[-1])
                order[path.pop()] = None
            elif source in on_path:
                return list(order), [*path[path.index(source) :], source]
            elif source not in order:
                path.append(source)
                on_path.add(source)
                unread.append(_reads(steps, source))
    return list(order), []


def _reads(steps: Mapping[str, Step], name: str) -> Iterator[str]:
    return iter([source for source in steps[name].inputs.values() if source in steps])
