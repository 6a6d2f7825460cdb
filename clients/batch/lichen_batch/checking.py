"""Whether a line can be done at all: what its operation and its places show without a pixel being read.

The query of a run is read by the service's own reader, so a manifest is refused for the same mistakes, in the same
words, as a request would be.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import lichen
from lichen.catalogue import operation as named
from lichen.errors import Flaw, InvalidRequest, LichenError, UnknownOperation, nearest
from lichen.files import FORMATS, format_for_path
from lichen.operation import Operation
from lichen.planning.graph import RESULT
from lichen.planning.pipeline import Pipeline, escaped, nodes_of, read
from lichen.planning.plan import ENGINE_VERSION
from lichen.scene.description import read as read_scene
from lichen.scene.lowering import lower
from lichen_batch import places
from lichen_batch.item import Item
from lichen_service import queries
from lichen_service.documents import as_query

VERSION = f"{lichen.__version__}+{ENGINE_VERSION}"
"""Of the engine; a new one does items anew."""


@dataclass(frozen=True, slots=True)
class Checked:
    """An item, or all that is wrong with it."""

    item: Item | None
    flaws: tuple[Flaw, ...] = ()


def check(
    id: str,
    operation: str | None,
    pipeline: Any,
    scene: Any,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    values: Mapping[str, Any],
) -> Checked:
    """An item of places by name; the one place called "" is that of the first input, or of the one output."""
    if operation is not None:
        try:
            found = named(operation)
        except UnknownOperation as unknown:
            return Checked(None, (Flaw("/operation", unknown.detail),))
        return _Operation(found, inputs, outputs, values).checked(id)
    if scene is not None:
        return _Scene(scene, inputs, outputs, values).checked(id)
    return _Pipeline(pipeline, inputs, outputs, values).checked(id)


class _Line:
    def __init__(self, inputs: Mapping[str, str], outputs: Mapping[str, str], values: Mapping[str, Any]) -> None:
        self.inputs, self.outputs, self.values = dict(inputs), dict(outputs), dict(values)
        self.formats: dict[str, str] = {}
        self.flaws: list[Flaw] = []

    def _settle_inputs(self, names: tuple[str, ...], required: tuple[str, ...], owner: str) -> None:
        if "" in self.inputs and names:
            self.inputs = {names[0] if name == "" else name: place for name, place in self.inputs.items()}
        for name, place in self.inputs.items():
            where = f"/inputs/{escaped(name or 'image')}"
            if name not in names:
                hint = nearest(name, names) if names and name else "it reads no image"
                self.flaws.append(Flaw(where, f"is not read by {owner}; {hint}"))
            elif wrong := places.missing(place):
                self.flaws.append(Flaw(where, f"{place}: {wrong}"))
        self.flaws += [Flaw(f"/inputs/{escaped(each)}", "is required") for each in required if each not in self.inputs]

    def _settle_outputs(self, said: Mapping[str, str | None], bare: bool) -> None:
        """`said` holds the outputs there are, with the format that is asked of each."""
        if "" in self.outputs and len(said) == 1:
            self.outputs = {next(iter(said)): self.outputs[""]}
        for name in self.outputs:
            if name not in said:
                self.flaws.append(Flaw(f"/outputs/{escaped(name)}", f"is not made; {nearest(name, said)}"))
        if not bare:
            missing = [name for name in said if name not in self.outputs]
            self.flaws += [Flaw(f"/outputs/{escaped(name)}", "nobody says where it goes") for name in missing]
        for name, place in self.outputs.items():
            asked = said.get(name) or self.values.get("format")
            if asked is not None:
                self.formats[name] = str(asked)
                continue
            try:
                self.formats[name] = format_for_path(f"x{places.suffix_of(place)}").name
            except LichenError as unknown:
                self.flaws.append(Flaw(f"/outputs/{escaped(name)}", unknown.detail))

    def _made(
        self,
        id: str,
        operation: str | None,
        pipeline: Mapping[str, Any] | None,
        scene: Mapping[str, Any] | None = None,
    ) -> Checked:
        if self.flaws:
            return Checked(None, tuple(dict.fromkeys(self.flaws)))
        values = {name: value for name, value in self.values.items() if name != "format"}
        item = Item(id, operation, pipeline, self.inputs, self.outputs, self.formats, values, scene=scene)
        return Checked(dataclasses.replace(item, digest=item.digested(VERSION)))


class _Operation(_Line):
    def __init__(self, operation: Operation[Any], *rest: Any) -> None:
        super().__init__(*rest)
        self._operation = operation

    def checked(self, id: str) -> Checked:
        operation = self._operation
        names = tuple(each.name for each in operation.inputs)
        self._settle_inputs(names, tuple(each.name for each in operation.inputs if each.required), operation.name)
        pairs = tuple(as_query(self.values))
        query, flaws = _query(operation.name, pairs)
        self.flaws += flaws
        if query.options.explain:
            self.flaws.append(Flaw("/query/explain", "computes nothing; a batch does"))
        self._settle_outputs({RESULT: None}, bare=operation.finds)
        return self._made(id, operation.name, None)


@cache
def _query(name: str, pairs: tuple[tuple[str, str], ...]) -> tuple[queries.Query, tuple[Flaw, ...]]:
    """Most lines of a manifest ask for the same."""
    query, flaws = queries.read(named(name), pairs)
    return query, tuple(flaws)


class _Pipeline(_Line):
    def __init__(self, said: Any, *rest: Any) -> None:
        super().__init__(*rest)
        self._said = said

    def checked(self, id: str) -> Checked:
        options, _, flaws = queries.read_options(tuple(as_query(self.values)), ())
        self.flaws += flaws
        if options.method is not None:
            self.flaws.append(Flaw("/query/method", "is asked of a node: name it there"))
        if options.explain:
            self.flaws.append(Flaw("/query/explain", "computes nothing; a batch does"))
        try:
            pipeline = read(self._said)
            finds = any(node.operation.finds for node in nodes_of(pipeline))
        except InvalidRequest as invalid:
            return Checked(None, (*self.flaws, *invalid.flaws))
        self._settle_inputs(pipeline.inputs, pipeline.inputs, "the pipeline")
        self._settle_outputs({name: each.format for name, each in pipeline.outputs.items()}, bare=finds)
        self.flaws += [
            Flaw(f"/outputs/{escaped(name)}/format", f"is not a format; {nearest(each, FORMATS)}")
            for name, each in self.formats.items()
            if each not in FORMATS
        ]
        return self._made(id, None, document(pipeline, self.formats))


class _Scene(_Line):
    def __init__(self, said: Mapping[str, Any] | str, *rest: Any) -> None:
        super().__init__(*rest)
        self._said = said

    def checked(self, id: str) -> Checked:
        options, _, flaws = queries.read_options(tuple(as_query(self.values)), ())
        self.flaws += flaws
        if options.explain:
            self.flaws.append(Flaw("/query/explain", "computes nothing; a batch does"))
        try:
            said = json.loads(self._said) if isinstance(self._said, str) else self._said
            scene = read_scene(said)
            lower(scene, prune=options.prune)
        except ValueError as broken:
            return Checked(None, (*self.flaws, Flaw("/scene", f"is not JSON: {broken}")))
        except InvalidRequest as invalid:
            return Checked(None, (*self.flaws, *invalid.flaws))
        self._settle_inputs(tuple(scene.names), tuple(scene.names), "the scene")
        self._settle_outputs({RESULT: None}, bare=False)
        return self._made(id, None, None, said)


def document(pipeline: Pipeline, formats: Mapping[str, str]) -> dict[str, Any]:
    """The pipeline as JSON, with the format of each output that is wanted."""
    nodes = {name: {**dict(_said(step)), "inputs": dict(step.inputs)} for name, step in pipeline.steps.items()}
    outputs = {
        name: {**dict(_said(dataclasses.replace(each, format=formats.get(name, each.format))))}
        for name, each in pipeline.outputs.items()
        if name in formats or not formats
    }
    return {"nodes": nodes, "outputs": outputs}


def _said(value: Any) -> Iterator[tuple[str, Any]]:
    """The fields that say anything."""
    for each in dataclasses.fields(value):
        said = getattr(value, each.name)
        if said is not None and said != {}:
            yield each.name, dict(said) if isinstance(said, Mapping) else said
