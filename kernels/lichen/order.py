"""From a caller's arguments to an order: images, parameters and wishes, all checked, every flaw named at once.

The names in `Wish` are reserved beside an operation's own parameters and are the same in the library, in URLs, in JSON,
on the command line and in the clients.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeVar

import numpy.typing as npt

from lichen.accuracy.precision import Precision
from lichen.catalogue import operation
from lichen.errors import Flaw, InvalidRequest, NonfiniteInput, nearest
from lichen.image import Alpha, Image, Space, Storage, as_image, repaired
from lichen.operation import Facts, Operation
from lichen.planning.check import flaws_of_crop, flowing, unfit
from lichen.planning.graph import RESULT, Asked, Graph, Node, Output, Request
from lichen.planning.pipeline import INPUT, Exit, Pipeline, escaped, read
from lichen.planning.remember import Kept, told, written

Picture = Image | npt.ArrayLike
Named = TypeVar("Named", bound=StrEnum)


class Nonfinite(StrEnum):
    """What to do with NaN and infinity in the inputs."""

    PROPAGATE = "propagate"
    """compute with them; they spread no further than the footprint"""
    REJECT = "reject"
    REPAIR = "repair"
    """replace each by the mean of its finite neighbours"""


@dataclass(frozen=True, slots=True)
class Wish:
    """What a caller may ask for beside the operation's own parameters."""

    method: str | None = None
    max_error: float | str | None = None
    max_ms: float | str | None = None
    device: str | None = None
    nonfinite: str = Nonfinite.PROPAGATE
    space: Space | str | None = None
    alpha: Alpha | str | None = None
    storage: Storage | str | None = None
    prune: bool = True
    precision: Precision | str | None = None
    verify: bool = False
    max_bytes: int | str | None = None


RESERVED = tuple(field.name for field in dataclasses.fields(Wish))


@dataclass(frozen=True, eq=False)
class Order:
    """What is to be computed, ready to be planned: a single operation is a graph of one node."""

    title: str
    """what it is called in a sentence"""
    nodes: tuple[Node, ...]
    images: Mapping[str, Image]
    """by their names in the graph"""
    outputs: Mapping[str, Output]
    request: Request
    precision: Precision = Precision.FLOAT32
    verify: bool = False
    pointers: bool = False
    """whether flaws of nodes are pointed at by the nodes' names"""
    key: Hashable | None = None
    """stands for all but the pictures; None where nothing short does"""

    def refuse_flaws(self, sources: Mapping[str, Facts]) -> None:
        """Raises `InvalidRequest` with all that parameters and pictures show only together; no pixel is looked at."""

        def where(node: Node) -> str:
            return f"/nodes/{escaped(node.name)}" if self.pointers else ""

        flaws, known = flowing(self.nodes, sources, where)
        for name, output in self.outputs.items():
            flaws += flaws_of_crop(output, known.get(output.source), f"/outputs/{escaped(name)}/crop")
        if flaws:
            raise InvalidRequest(f"This request for {self.title} is not valid.", flaws)

    def expected(self) -> dict[str, Facts]:
        """Size, channels, space and alpha of what will come out. No pixel is looked at, so extents mean nothing.

        Raises `InvalidRequest` for pictures that an operation does not take.
        """
        sources = {name: Facts.sized(image) for name, image in self.images.items()}
        self.refuse_flaws(sources)
        known = Graph(sources, self.nodes, self.outputs).facts()
        facts = {name: known[output.source] for name, output in self.outputs.items()}
        return {
            name: dataclasses.replace(facts[name], width=output.crop[2], height=output.crop[3])
            if output.crop
            else facts[name]
            for name, output in self.outputs.items()
        }


@dataclass(frozen=True, eq=False)
class Said:
    """What a call of one operation says beside its pictures, checked."""

    nodes: tuple[Node, ...]
    outputs: Mapping[str, Output]
    request: Request
    precision: Precision
    nonfinite: Nonfinite
    verify: bool


_said: Kept[Said] = Kept()


def read_order(name: str, first: Picture | None, arguments: Mapping[str, Any], backend: str) -> Order:
    """Check a call of one operation. `arguments` mixes reserved names, parameters, knobs and further inputs, as callers
    write them.

    Raises `UnknownOperation`, `InvalidRequest` with every flaw, `NonfiniteInput`.
    """
    wanted = operation(name)
    values = dict(arguments)
    given = {each.name: values.pop(each.name) for each in wanted.inputs if each.name in values}
    flaws: list[Flaw] = []
    unfit: list[Flaw] = []
    images = _images(wanted, first, given, unfit)
    said = _read(wanted, values, images, backend, flaws)
    if said is None or flaws or unfit:
        raise InvalidRequest(f"This request for {name} is not valid.", [*flaws, *unfit])
    policed = _policed(images, said.nonfinite)
    return Order(name, said.nodes, policed, said.outputs, said.request, said.precision, said.verify, key=said)


def _read(
    wanted: Operation[Any], arguments: Mapping[str, Any], images: Mapping[str, Image], backend: str, flaws: list[Flaw]
) -> Said | None:
    """What is said beside such pictures, kept from call to call; None where `flaws` has become longer."""
    storage = _storage(images)
    key = written((wanted.name, backend, tuple(images), storage and storage.value, arguments))
    kept = None if key is None else _said.get(key)
    if kept is not None:
        return kept
    wish, values = _wish(arguments)
    wrong: list[Flaw] = []
    request, output, precision = _request(wish, backend, wrong)
    if wish.method is not None and wish.method not in wanted.methods:
        hint = nearest(wish.method, wanted.methods)
        wrong.append(Flaw("/method", f"{wanted.name} has no method {wish.method!r}; {hint}"))
    if precision is Precision.FLOAT64 and (wish.method is not None or wanted.knobs.keys() & values.keys()):
        wrong.append(Flaw("/precision", "float64 evaluates the definition itself; leave out method and knobs"))
    knobs = {key: _knob(wanted, key, values.pop(key), wrong) for key in wanted.knobs.keys() & values.keys()}
    try:
        parameters = wanted.validate(values)
    except InvalidRequest as invalid:
        flaws += [*invalid.flaws, *wrong]
        return None
    flaws += wrong
    if wrong:
        return None
    inputs, asked = {name: INPUT + name for name in images}, Asked(wish.method, knobs, None)
    made = Said(
        (Node(wanted.name, wanted, parameters, inputs, asked=asked),),
        {RESULT: dataclasses.replace(output, source=wanted.name, storage=output.storage or storage)},
        dataclasses.replace(request, target=wanted.name),
        precision,
        Nonfinite(wish.nonfinite),
        wish.verify,
    )
    if key is not None:
        _said.put(key, made)
    return made


def read_pipeline_order(
    said: Pipeline | Mapping[str, Any] | str | bytes,
    given: Mapping[str, Picture],
    arguments: Mapping[str, Any],
    backend: str,
) -> Order:
    """Check a call of a pipeline, whose pictures are `given` by name. `arguments` holds reserved names.

    Raises `InvalidRequest` with every flaw, `NonfiniteInput`.
    """
    flaws: list[Flaw] = []
    wish, values = _wish(arguments)
    flaws += [Flaw(f"/{key}", f"is not known here; {nearest(key, RESERVED)}") for key in values]
    if wish.method is not None:
        flaws.append(Flaw("/method", "is asked of a node of the pipeline"))
    request, output, precision = _request(wish, backend, flaws)
    pipeline: Pipeline | None = None
    nodes: tuple[Node, ...] = ()
    try:
        pipeline = read(said)
        nodes = pipeline.nodes
    except InvalidRequest as invalid:
        flaws += invalid.flaws
    images: dict[str, Image] = {}
    if pipeline is not None:
        images = _named_images(pipeline, given, flaws)
        outputs = {name: _exit(name, each, output, images, flaws) for name, each in pipeline.outputs.items()}
    if precision is Precision.FLOAT64:
        asked = [node for node in nodes if node.asked.method or node.asked.knobs]
        flaws += [
            Flaw(f"/nodes/{node.name}", "has a method or knobs, and float64 evaluates definitions") for node in asked
        ]
    if pipeline is None or flaws:
        raise InvalidRequest(f"The pipeline has {len(flaws)} flaw(s).", flaws)
    policed = _policed(images, Nonfinite(wish.nonfinite))
    request = dataclasses.replace(request, concatenate=pipeline.concatenate)
    key = told(nodes, outputs, request, precision)
    return Order("a pipeline", nodes, policed, outputs, request, precision, wish.verify, pointers=True, key=key)


def _named_images(pipeline: Pipeline, given: Mapping[str, Picture], flaws: list[Flaw]) -> dict[str, Image]:
    images = {}
    for name in pipeline.inputs:
        if name not in given:
            flaws.append(Flaw(f"/inputs/{escaped(name)}", "is read by the pipeline and was not given"))
    for name, value in given.items():
        if name not in pipeline.inputs:
            flaws.append(Flaw(f"/inputs/{escaped(name)}", f"is not read; {nearest(name, pipeline.inputs)}"))
            continue
        try:
            images[name] = as_image(value, pointer=f"/inputs/{escaped(name)}")
        except InvalidRequest as invalid:
            flaws.extend(invalid.flaws)
    return images


def _exit(name: str, said: Exit, usual: Output, images: Mapping[str, Image], flaws: list[Flaw]) -> Output:
    """An output as the pipeline says, the caller's wishes where it says nothing."""
    where = f"outputs/{escaped(name)}"
    return Output(
        said.node,
        _enumerated(Space, said.space, f"{where}/space", flaws) or usual.space,
        _enumerated(Alpha, said.alpha, f"{where}/alpha", flaws) or usual.alpha,
        _enumerated(Storage, said.storage, f"{where}/storage", flaws) or usual.storage or _storage(images),
        said.crop,
    )


def _storage(images: Mapping[str, Image]) -> Storage | None:
    """How the first picture was stored."""
    first = next(iter(images.values()), None)
    return None if first is None else first.storage


def _wish(arguments: Mapping[str, Any]) -> tuple[Wish, dict[str, Any]]:
    """The reserved names, and the others."""
    wish = Wish(**{key: value for key, value in arguments.items() if key in RESERVED})
    return wish, {key: value for key, value in arguments.items() if key not in RESERVED}


def _request(wish: Wish, backend: str, flaws: list[Flaw]) -> tuple[Request, Output, Precision]:
    _enumerated(Nonfinite, wish.nonfinite, "nonfinite", flaws)
    limit = _positive(wish.max_bytes, "max_bytes", flaws)
    request = Request(
        backend=backend,
        max_error=_positive(wish.max_error, "max_error", flaws),
        max_ms=_positive(wish.max_ms, "max_ms", flaws),
        prune=wish.prune,
        max_bytes=None if limit is None else int(limit),
    )
    output = Output(
        "",
        _enumerated(Space, wish.space, "space", flaws),
        _enumerated(Alpha, wish.alpha, "alpha", flaws),
        _enumerated(Storage, wish.storage, "storage", flaws),
    )
    return request, output, _enumerated(Precision, wish.precision, "precision", flaws) or Precision.FLOAT32


def _enumerated(kind: type[Named], value: str | None, key: str, flaws: list[Flaw]) -> Named | None:
    if value is None:
        return None
    try:
        return kind(value)
    except ValueError:
        flaws.append(Flaw(f"/{key}", f"{value!r} is not known; {nearest(str(value), list(kind))}"))
        return None


def _number(value: float | str) -> float:
    """The finite number in a value or its text; NaN where there is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return math.nan
    return number if math.isfinite(number) else math.nan


def _positive(value: float | str | None, key: str, flaws: list[Flaw]) -> float | None:
    if value is None:
        return None
    number = _number(value)
    if not number > 0:
        flaws.append(Flaw(f"/{key}", f"must be a finite number above 0 (got {value!r})"))
        return None
    return number


def _knob(wanted: Operation[Any], key: str, value: Any, flaws: list[Flaw]) -> float:
    knob, number = wanted.knobs[key], _number(value)
    if not knob.low <= number <= knob.high:
        flaws.append(Flaw(f"/knobs/{key}", f"must lie between {knob.low:g} and {knob.high:g} (got {value!r})"))
    return number


def _images(
    wanted: Operation[Any], first: Picture | None, others: Mapping[str, Any], flaws: list[Flaw]
) -> dict[str, Image]:
    """Inputs by name in the declared order; a missing or unfit one is a flaw."""
    given = dict(others)
    if first is not None:
        if not wanted.inputs:
            flaws.append(Flaw("/inputs", f"{wanted.name} takes no image"))
        elif wanted.inputs[0].name in given:
            flaws.append(Flaw(f"/inputs/{wanted.inputs[0].name}", "is given twice"))
        else:
            given[wanted.inputs[0].name] = first
    images = {}
    for declared in wanted.inputs:
        pointer = f"/inputs/{declared.name}"
        value = given.get(declared.name)
        if value is None:
            if declared.required:
                flaws.append(Flaw(pointer, "is required"))
            continue
        try:
            image = as_image(value, pointer=pointer)
        except InvalidRequest as invalid:
            flaws.extend(invalid.flaws)
            continue
        flaws += unfit(declared, Facts.sized(image))
        images[declared.name] = image
    return images


def _policed(images: Mapping[str, Image], policy: Nonfinite) -> dict[str, Image]:
    """The pictures by their names in the graph, with what the caller wants done to NaN and infinity."""
    if policy is Nonfinite.PROPAGATE:
        return {INPUT + name: image for name, image in images.items()}
    spoilt = {name: image.extent.nonfinite for name, image in images.items() if image.extent.nonfinite}
    if policy is Nonfinite.REJECT and spoilt:
        total = sum(spoilt.values())
        raise NonfiniteInput(
            f"The input(s) {', '.join(spoilt)} hold {total} values that are NaN or infinite.",
            [Flaw(f"/inputs/{name}", f"{count} values are NaN or infinite") for name, count in spoilt.items()],
            limit=0,
            actual=total,
        )
    return {INPUT + name: repaired(image) if name in spoilt else image for name, image in images.items()}
