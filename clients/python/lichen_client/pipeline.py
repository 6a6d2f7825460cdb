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

import html
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lichen_client.values import plain

if TYPE_CHECKING:
    from lichen_client.scene import Scene

_PREFIX = "input."
_WIDE, _HIGH, _ACROSS, _DOWN = 150, 40, 190, 64
"""px of a box, and from one box to the next."""


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
            said = [f"{key}={_short(value)}" for key, value in node.get("parameters", {}).items()]
            read = [source if key == FIRST else f"{key}={source}" for key, source in node.get("inputs", {}).items()]
            call = f"{node['operation']}({', '.join([*read, *said])})"
            lines.append(f"{name} = {call}")
        for name, output in self.to_json()["outputs"].items():
            lines.append(f"{output['node']} -> {name}")
        return "\n".join(lines)

    def to_svg(self) -> str:
        """A drawing: boxes in columns by how much comes before them, lines from left to right."""
        places = self._places()
        width = max(x for x, _ in places.values()) + _WIDE + 20
        height = max(y for _, y in places.values()) + _HIGH + 20
        boxes, lines = [], []
        for name, (x, y) in places.items():
            kind, first, second, sources = self._shown(name)
            boxes.append(_box(x, y, kind, first, second))
            lines += [_line(places[source], (x, y)) for source in sources]
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            f'viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">\n'
            "<style>rect{fill:#fff;stroke:#456;stroke-width:1.5}.input{fill:#e8f1e4}.output{fill:#e6eef8}"
            "path{fill:none;stroke:#789;stroke-width:1.5}.small{fill:#567;font-size:10px}</style>\n"
            + "\n".join([*lines, *boxes])
            + "\n</svg>\n"
        )

    def _repr_svg_(self) -> str | None:
        """What a notebook shows."""
        return self.to_svg() if self.nodes or self.outputs else None

    def _repr_html_(self) -> str | None:
        """The same for what shows HTML alone."""
        return self._repr_svg_()

    def _shown(self, name: str) -> tuple[str, str, str, list[str]]:
        """Kind, two lines of text and sources of a box."""
        if name.startswith(_PREFIX):
            return "input", name.removeprefix(_PREFIX), "input", []
        if name.startswith(_EXIT):
            output = self.to_json()["outputs"][name.removeprefix(_EXIT)]
            return "output", name.removeprefix(_EXIT), output.get("format", "output"), [output["node"]]
        node = self.nodes[name]
        said = ", ".join(f"{key} {_short(value)}" for key, value in node.get("parameters", {}).items())
        title = name if name == node["operation"] else f"{name}: {node['operation']}"
        return "node", title, said, list(self._reads(name))

    def _reads(self, name: str) -> list[str]:
        node = self.nodes.get(name)
        return [] if node is None else list((node.get("inputs") or {FIRST: _PREFIX + FIRST}).values())

    def _places(self) -> dict[str, tuple[int, int]]:
        """The corner of every box."""
        column: dict[str, int] = {}
        for name in self.nodes:
            for source in self._reads(name):
                column.setdefault(source, 0)
            column[name] = 1 + max((column[source] for source in self._reads(name)), default=0)
        for name, output in self.to_json()["outputs"].items():
            column[_EXIT + name] = 1 + column.setdefault(output["node"], 0)
        filled: dict[int, int] = {}
        places = {}
        for name, across in column.items():
            places[name] = (10 + across * _ACROSS, 10 + filled.get(across, 0) * _DOWN)
            filled[across] = filled.get(across, 0) + 1
        return places


FIRST = "image"
_EXIT = "output "


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
    return text if len(text) <= 24 else text[:21] + "..."


def _box(x: int, y: int, kind: str, first: str, second: str) -> str:
    def line(text: str, down: int, small: bool) -> str:
        fitting = text if len(text) <= 26 else text[:23] + "..."
        style = ' class="small"' if small else ""
        return f'<text x="{x + 8}" y="{y + down}"{style}>{html.escape(fitting)}</text>'

    return (
        f'<g><rect class="{kind}" x="{x}" y="{y}" width="{_WIDE}" height="{_HIGH}" rx="6"/>'
        f"{line(first, 17, False)}{line(second, 32, True)}</g>"
    )


def _line(start: tuple[int, int], end: tuple[int, int]) -> str:
    x1, y1, x2, y2 = start[0] + _WIDE, start[1] + _HIGH // 2, end[0], end[1] + _HIGH // 2
    middle = (x1 + x2) // 2
    return f'<path d="M{x1} {y1}C{middle} {y1} {middle} {y2} {x2} {y2}"/>'


def document_of(pipeline: Pipeline | Scene | Mapping[str, Any] | str) -> str:
    """A pipeline or a scene as the service reads it: JSON, or its text form as it is."""
    if isinstance(pipeline, str):
        return pipeline
    said = pipeline if isinstance(pipeline, Mapping) else pipeline.to_json()
    return json.dumps(said, separators=(",", ":"), default=plain)
