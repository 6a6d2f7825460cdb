"""Pipelines built in Python: operations as nodes, one reading another, and drawings of them.

    p = Pipeline()
    photo = p.input("image")
    soft = p.add("gaussian", photo, sigma=5)
    p.output("soft", soft, format="png")
    p.output("sharp", p.add("mix", photo, base=soft, amount=1.5))
    results = client.run_pipeline(p, "photo.jpg")

Nothing is checked here but that nodes belong together: the service knows its operations, and says everything that is
wrong with a pipeline at once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lichen_client.drawing import Box, to_png, to_svg
from lichen_client.operations import FIRST_INPUTS, Operations
from lichen_client.values import plain

if TYPE_CHECKING:
    from lichen_client.scene import Scene

_PREFIX = "input."


@dataclass(frozen=True, slots=True)
class Value:
    """What a node makes, or a picture that is sent along; give it to `Pipeline.add`."""

    name: str
    owner: Pipeline = field(repr=False, compare=False)


@dataclass(eq=False)
class Pipeline:
    """A graph of operations. Without `output` what the last node makes comes out, as `result`.

    With `concatenate`, warps that follow one another are one, and the image is filtered once: another picture."""

    nodes: dict[str, dict[str, Any]] = field(default_factory=dict)
    outputs: dict[str, dict[str, Any]] = field(default_factory=dict)
    concatenate: bool = False

    def input(self, name: str = "image") -> Value:
        """A picture that is sent along under this name."""
        return Value(_PREFIX + name, self)

    def add(self, operation: str, /, *inputs: Value, name: str | None = None, **settings: Any) -> Value:
        """A node. `inputs` come first to last; settings are parameters, and values for inputs by their names.

        `method`, `knobs` (a mapping) and `max_error` are asked of this node alone.
        """
        unique = name or self._free(operation)
        if unique in self.nodes:
            raise ValueError(f"there is a node {unique!r} already")
        asked = {key: settings.pop(key) for key in ("method", "knobs", "max_error") if key in settings}
        named = {key: value for key, value in settings.items() if isinstance(value, Value)}
        for value in (*inputs, *named.values()):
            if value.owner is not self:
                raise ValueError(f"{value.name!r} belongs to another pipeline")
        if len(inputs) > 1:
            raise TypeError("one input is given by its place; give the others by their names")
        node: dict[str, Any] = {"operation": operation}
        parameters = {key: plain(value) for key, value in settings.items() if key not in named and value is not None}
        if parameters:
            node["parameters"] = parameters
        read = {key: value.name for key, value in named.items()}
        if inputs or read:
            node["inputs"] = {**({FIRST: inputs[0].name} if inputs else {}), **read}
        self.nodes[unique] = {**node, **{key: plain(value) for key, value in asked.items() if value is not None}}
        return Value(unique, self)

    def output(self, name: str, value: Value, **form: Any) -> None:
        """Lets a value come out under a name; `form` may say format, storage, space, alpha and crop."""
        if value.owner is not self:
            raise ValueError(f"{value.name!r} belongs to another pipeline")
        if name in self.outputs:
            raise ValueError(f"there is an output {name!r} already")
        self.outputs[name] = {
            "node": value.name,
            **{key: plain(each) for key, each in form.items() if each is not None},
        }

    def to_json(self) -> dict[str, Any]:
        """What the service is sent."""
        if not self.nodes and not self.outputs:
            raise ValueError("the pipeline is empty")
        outputs = self.outputs or {"result": {"node": list(self.nodes)[-1]}}
        said: dict[str, Any] = {"nodes": self.nodes, "outputs": outputs}
        return {**said, "concatenate": True} if self.concatenate else said

    def _free(self, operation: str) -> str:
        count = 1
        while (name := operation if count == 1 else f"{operation}{count}") in self.nodes:
            count += 1
        return name

    # ------------------------------------------------------------------------------------------------------ drawings

    def __str__(self) -> str:
        """One line for each node, in the order in which they were added."""
        lines = []
        for name, node in self.nodes.items():
            said = [f"{key}={short(value)}" for key, value in node.get("parameters", {}).items()]
            read = [source if key == FIRST else f"{key}={source}" for key, source in node.get("inputs", {}).items()]
            call = f"{node['operation']}({', '.join([*read, *said])})"
            lines.append(f"{name} = {call}")
        for name, output in self.to_json()["outputs"].items():
            lines.append(f"{output['node']} -> {name}")
        return "\n".join(lines)

    def to_svg(self) -> str:
        """A drawing: boxes in columns by how much comes before them, lines from left to right."""
        return to_svg(self._boxes())

    def _repr_svg_(self) -> str | None:
        """What a notebook shows."""
        return self.to_svg() if self.nodes or self.outputs else None

    def _repr_html_(self) -> str | None:
        """The same for what shows HTML alone."""
        return self._repr_svg_()

    def _repr_png_(self) -> bytes | None:
        """The same for what shows neither, with Pillow."""
        return to_png(self._boxes()) if self.nodes or self.outputs else None

    def _boxes(self) -> dict[str, Box]:
        """What is drawn."""
        column: dict[str, int] = {}
        for name in self.nodes:
            for source in self._reads(name):
                column.setdefault(source, 0)
            column[name] = 1 + max((column[source] for source in self._reads(name)), default=0)
        outputs = self.to_json()["outputs"]
        for output in outputs.values():
            column.setdefault(output["node"], 0)
        boxes = {name: self._box(name, at) for name, at in column.items()}
        for name, output in outputs.items():
            node = output["node"]
            boxes[_EXIT + name] = Box(1 + column[node], "output", name, output.get("format", "output"), (node,))
        return boxes

    def _box(self, name: str, column: int) -> Box:
        if name.startswith(_PREFIX):
            return Box(column, "input", name.removeprefix(_PREFIX), "input")
        node = self.nodes[name]
        said = ", ".join(f"{key} {short(value)}" for key, value in node.get("parameters", {}).items())
        title = name if name == node["operation"] else f"{name}: {node['operation']}"
        return Box(column, "node", title, said, self._reads(name))

    def _reads(self, name: str) -> tuple[str, ...]:
        """Names of what a node reads: what it was given, else the picture that is sent, unless it reads none."""
        node = self.nodes[name]
        if "inputs" in node:
            return tuple(node["inputs"].values())
        makes = node["operation"] not in FIRST_INPUTS and hasattr(Operations, node["operation"])
        return () if makes else (_PREFIX + FIRST,)


FIRST = "image"
_EXIT = "output "


def short(value: Any) -> str:
    """A parameter as a drawing has room for it."""
    text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
    return text if len(text) <= 24 else text[:21] + "..."


def document_of(pipeline: Pipeline | Scene | Mapping[str, Any] | str) -> str:
    """A pipeline or a scene as the service reads it: JSON, or its text form as it is."""
    if isinstance(pipeline, str):
        return pipeline
    said = pipeline if isinstance(pipeline, Mapping) else pipeline.to_json()
    return json.dumps(said, separators=(",", ":"), default=plain)
