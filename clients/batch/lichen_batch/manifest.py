"""From a manifest to items, all of them checked before the first one starts.

A manifest is a file of JSON lines, a CSV file with a line of names, or a pattern of image files. A line says

    {"id": "a17", "operation": "gaussian", "input": "a17.exr", "output": "soft/a17.exr", "parameters": {"sigma": 5}}

or `"pipeline"` (text or a graph) or `"scene"` instead of `"operation"`. `inputs` and `outputs` name several places.
`parameters` holds whatever a query of the service may: parameters, knobs, `max_error`, `method`, `storage` ... In CSV a
column that is none of these words is a parameter, and an empty cell says nothing. What a line leaves out the command
line may say for all. Inputs are seen from the manifest's folder, outputs from the folder of results.

Every flaw of every line is found at once: unknown names, parameters out of range, missing inputs, ids and outputs that
two lines share, formats that no ending names.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lichen_batch import places
from lichen_batch.checking import Checked, check
from lichen_batch.item import Item

WORDS = ("id", "operation", "op", "pipeline", "scene", "input", "inputs", "output", "outputs", "parameters", "params")
MOST_SHOWN = 200
"""Flaws that an error lists; the others are counted."""


@dataclass(frozen=True, slots=True)
class Defaults:
    """What holds for lines that do not say it."""

    operation: str | None = None
    pipeline: str | None = None
    scene: str | None = None
    parameters: Mapping[str, str] = field(default_factory=dict)
    output: str | None = None
    """a template: {id}, {stem}, {suffix} and {number} stand for the line's own"""


@dataclass(frozen=True, slots=True)
class LineFlaw:
    """What is wrong with one line."""

    line: int
    id: str
    pointer: str
    detail: str

    def __str__(self) -> str:
        where = (f"line {self.line}", f"({self.id})" if self.id else "", self.pointer)
        return f"{' '.join(each for each in where if each)}: {self.detail}"


class InvalidManifest(Exception):
    """The manifest cannot be run; `flaws` holds all that is wrong."""

    def __init__(self, detail: str, flaws: Iterable[LineFlaw] = ()) -> None:
        self.flaws = tuple(flaws)
        super().__init__(detail)


def load(source: str, defaults: Defaults, out: str) -> list[Item]:
    """All items, in the order of the lines. Raises `InvalidManifest`."""
    try:
        kind, lines = _lines(source)
    except (OSError, ValueError, ImportError) as failure:
        raise InvalidManifest(f"{source} cannot be read: {failure}") from None
    folder = "" if kind == "pattern" else _folder(source)
    items: list[Item] = []
    flaws: list[LineFlaw] = []
    ids: dict[str, int] = {}
    targets: dict[str, int] = {}
    for number, line in lines:
        reader = _Reader(number, line, defaults, folder, out)
        checked = reader.read()
        found = [
            *reader.flaws,
            *(LineFlaw(number, reader.id, _here(each.pointer), each.detail) for each in checked.flaws),
        ]
        if reader.id and (first := ids.setdefault(reader.id, number)) != number:
            found.append(LineFlaw(number, reader.id, "/id", f"stands on line {first}, too"))
        for name, place in reader.outputs.items():
            if (before := targets.setdefault(place, number)) != number:
                found.append(
                    LineFlaw(
                        number,
                        reader.id,
                        f"/outputs/{name}" if name else "/output",
                        f"line {before} writes {place}, too",
                    )
                )
        flaws += found
        if not found and checked.item is not None:
            items.append(checked.item)
    if flaws:
        bad = len({each.line for each in flaws})
        raise InvalidManifest(f"{source} has {len(flaws)} flaw(s) on {bad} of {len(lines)} line(s).", flaws)
    if not items:
        raise InvalidManifest(f"{source} names no item.")
    return items


def _here(pointer: str) -> str:
    """Where a line says what a query does."""
    return pointer.replace("/query/", "/parameters/", 1)


def _folder(source: str) -> str:
    head, slash, _ = source.rpartition("/")
    return (head or "/") if slash else ""


def _lines(source: str) -> tuple[str, list[tuple[int, Any]]]:
    """What the source is, and its lines by number; a line that is not JSON stays text."""
    if any(each in source for each in "*?["):
        return "pattern", [(at, {"input": place}) for at, place in enumerate(places.matching(source), 1)]
    text = places.read(source).decode("utf-8-sig")
    if places.suffix_of(source) == ".csv":
        rows = csv.DictReader(io.StringIO(text), strict=True)
        try:
            return "csv", [(rows.line_num, _from_row(row)) for row in rows]
        except csv.Error as broken:
            raise ValueError(f"line {rows.line_num} is not CSV: {broken}") from None
    return "json", [(at, _from_json(line)) for at, line in enumerate(text.split("\n"), 1) if line.strip()]


def _from_json(line: str) -> Any:
    try:
        return json.loads(line, parse_constant=_refuse)
    except (ValueError, RecursionError) as broken:
        return f"is not JSON: {broken}"


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is not a number of JSON")


def _from_row(row: Mapping[str | None, Any]) -> dict[str, Any]:
    """A line of CSV: words of ours by name, everything else as parameters."""
    if None in row:
        return {"more cells than names": row[None]}
    said = {str(name).strip(): value for name, value in row.items() if value not in (None, "")}
    line: dict[str, Any] = {name: value for name, value in said.items() if name in WORDS}
    for name in ("inputs", "outputs", "parameters", "params"):
        if isinstance(line.get(name), str):
            line[name] = _from_json(line[name])
    further = {name: value for name, value in said.items() if name not in WORDS}
    if further:
        line["parameters"] = {**(line.get("parameters") or {}), **further}
    return line


class _Reader:
    """One line on its way to an item."""

    def __init__(self, number: int, line: Any, defaults: Defaults, folder: str, out: str) -> None:
        self._number = number
        self._line: dict[str, Any] = line if isinstance(line, dict) else {}
        self._whole = None if isinstance(line, dict) else line if isinstance(line, str) else "is not an object"
        self._defaults = defaults
        self._folder, self._out = folder, out
        self.flaws: list[LineFlaw] = []
        self.id = str(self._line.get("id", "")) if isinstance(self._line.get("id", ""), str | int) else ""
        self.outputs: dict[str, str] = {}

    def read(self) -> Checked:
        if self._whole is not None:
            self._flaw("", self._whole)
            return Checked(None)
        for name in self._line:
            if name not in WORDS:
                self._flaw(f"/{name}", f"is not known here; known: {', '.join(WORDS)}")
        inputs = self._named("input", "inputs")
        first = next(iter(inputs.values()), "")
        self.id = self.id or first or f"line-{self._number}"
        inputs = {name: places.resolved(place, self._folder) for name, place in inputs.items()}
        operation, pipeline, scene = self._what()
        self.outputs = {
            name: places.resolved(place, self._out)
            for name, place in (self._named("output", "outputs") or self._from_template(first)).items()
        }
        if self.flaws:
            return Checked(None)
        return check(self.id, operation, pipeline, scene, inputs, self.outputs, self._parameters())

    def _what(self) -> tuple[str | None, Any, Any]:
        """Operation, pipeline and scene, of which there is one."""
        line, defaults = self._line, self._defaults
        operation, pipeline, scene = self._either("operation", "op"), line.get("pipeline"), line.get("scene")
        if operation is None and pipeline is None and scene is None:
            operation, pipeline, scene = defaults.operation, defaults.pipeline, defaults.scene
        if sum(each is not None for each in (operation, pipeline, scene)) != 1:
            self._flaw("/operation", "one operation, pipeline or scene is required, here or on the command line")
        if operation is not None and not isinstance(operation, str):
            self._flaw("/operation", "must be the name of an operation")
        for name, document in (("pipeline", pipeline), ("scene", scene)):
            if document is not None and not isinstance(document, str | dict):
                self._flaw(f"/{name}", "must be text or an object")
        return operation, pipeline, scene

    def _parameters(self) -> dict[str, Any]:
        given = self._either("parameters", "params")
        if given is None:
            given = {}
        if not isinstance(given, dict):
            self._flaw("/parameters", "must be an object")
            given = {}
        return {**self._defaults.parameters, **{str(name): each for name, each in given.items() if each is not None}}

    def _either(self, name: str, short: str) -> Any:
        if name in self._line and short in self._line:
            self._flaw(f"/{short}", f"is the same as {name}; give one of them")
        return self._line.get(name, self._line.get(short))

    def _named(self, one: str, several: str) -> dict[str, str]:
        """Places by name; a single one is called as the first is wherever it goes."""
        if one in self._line and several in self._line:
            self._flaw(f"/{one}", f"is given beside {several}; give one of them")
        given = self._line.get(several, self._line.get(one, {}))
        named = {"": given} if isinstance(given, str) else given
        if not isinstance(named, dict) or not all(isinstance(each, str) and each for each in named.values()):
            self._flaw(f"/{one}", "must be a place, or an object of places by name")
            return {}
        return dict(named)

    def _from_template(self, first: str) -> dict[str, str]:
        template = self._defaults.output
        if template is None:
            return {}
        name = first.partition("::")[0].rpartition("/")[2]
        stem, dot, ending = name.rpartition(".")
        words = {"id": self.id, "stem": stem if dot else name, "suffix": dot + ending if dot else ""}
        try:
            return {"": template.format(**words, number=self._number)}
        except (KeyError, IndexError, ValueError) as wrong:
            self._flaw("/output", f"the template {template!r} cannot be filled in: {wrong!r}")
            return {}

    def _flaw(self, pointer: str, detail: str) -> None:
        self.flaws.append(LineFlaw(self._number, self.id, pointer, detail))


def shard(items: list[Item], index: int, count: int) -> list[Item]:
    """Every `count`th item from `index` on: shards differ by one item at most."""
    return items[index::count]


def told(flaws: Iterable[LineFlaw]) -> Iterator[str]:
    """Flaws as lines, no more than anybody reads."""
    every = list(flaws)
    yield from (str(each) for each in every[:MOST_SHOWN])
    if len(every) > MOST_SHOWN:
        yield f"... and {math.floor(len(every) - MOST_SHOWN)} more"
