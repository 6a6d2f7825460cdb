"""Writes `lichen_client/operations.py` from the catalogue: every operation as a typed method of the clients.

    .venv/bin/python clients/python/make.py            # or: make client

A test holds the file to what this makes.
"""

from __future__ import annotations

import json
import keyword
import subprocess
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from lichen.catalogue import operations
from lichen.operation import Operation
from lichen_cli.options import range_of
from lichen_service.descriptions import inlined, options_schema

TARGET = Path(__file__).parent / "lichen_client" / "operations.py"
WIDTH = 110
NOT_OF_A_RESULT = ("explain", "findings")
"""Options that make another kind of answer; they have methods of their own."""
HEAD = '''"""Every operation as a method. Made by clients/python/make.py from the catalogue; not to be edited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeAlias, TypedDict, TypeVar, Unpack

if TYPE_CHECKING:
    import numpy.typing as npt

    from lichen_client.calls import ImageLike

    Numbers: TypeAlias = npt.ArrayLike | Sequence[Any]

R = TypeVar("R", covariant=True)
'''
CLASS = '''

class Operations(Generic[R]):
    """The operations of the catalogue this client was made from. What is not given is not sent: the service's own
    default holds. `run` calls those that are newer."""

    def run(self, operation: str, image: ImageLike = None, /, **values: Any) -> R:
        raise NotImplementedError
'''
TYPES = {"string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "None", "array": "Numbers"}


def text() -> str:
    """The module, in the house style."""
    known = operations()
    firsts = {each.name: each.inputs[0].name for each in known.values() if each.inputs}
    lines = [HEAD, "FIRST_INPUTS: Mapping[str, str] = {"]
    lines += [f"    {json.dumps(name)}: {json.dumps(first)}," for name, first in sorted(firsts.items())]
    lines += ["}", '"""What the first input of each operation is called."""', "", ""]
    lines += [*_options(), CLASS]
    for each in sorted(known.values(), key=lambda operation: operation.name):
        lines += _method(each)
    arguments = [sys.executable, "-m", "ruff", "format", "--stdin-filename", str(TARGET), "-"]
    made = subprocess.run(arguments, input="\n".join(lines) + "\n", capture_output=True, check=True, text=True)
    return made.stdout


def _options() -> Iterator[str]:
    yield "class Options(TypedDict, total=False):"
    yield '    """What may be asked of every operation beside its own parameters."""'
    yield ""
    yield "    format: str | None"
    yield '    """the format to get the encoded image in; without it the result is an array"""'
    for name, field in options_schema()["properties"].items():
        if name != "format" and name not in NOT_OF_A_RESULT:
            yield f"    {name}: {_optional(_hint(field))}"
            yield from textwrap.indent(_quoted([field.get("description", "")]), "    ").splitlines()


def _method(operation: Operation[Any]) -> Iterator[str]:
    schema = inlined(operation.schema())
    required = schema.get("required", ())
    own = ["self"]
    sent = [json.dumps(operation.name)]
    told = [f"{operation.summary.strip()}", ""]
    if operation.inputs:
        first = operation.inputs[0]
        own += [f"{first.name}: ImageLike" + ("" if first.required else " = None"), "/"]
        sent.append(first.name)
        told += _said(first.name, [first.description])
    named: list[tuple[str, str]] = []
    for each in operation.inputs[1:]:
        named.append((each.name, "ImageLike" if each.required else "ImageLike = None"))
        told += _said(each.name, [each.description or "an image"])
    for name, field in schema.get("properties", {}).items():
        hint = _hint(field)
        named.append((name, hint if name in required else f"{_optional(hint)} = None"))
        default = "" if name in required or field.get("default") is None else f"default {json.dumps(field['default'])}"
        told += _said(name, [field.get("description", ""), range_of(field), field.get("unit", ""), default])
    for knob in operation.knobs.values():
        named.append((knob.name, "float | None = None"))
        told += _said(knob.name, [knob.description, f"{knob.low:g} to {knob.high:g}", "a knob"])
    told += _said("method", [", ".join(operation.methods)])
    # Required ones first, in the order of the declaration.
    named.sort(key=lambda each: each[1].endswith("= None"))
    names = [name for name, _ in named]
    bad = [name for name in names if not name.isidentifier() or keyword.iskeyword(name) or name in ("self", "options")]
    assert not bad, f"{operation.name}: {bad} cannot be arguments"
    own += (["*"] if named else []) + [f"{name}: {hint}" for name, hint in named] + ["**options: Unpack[Options]"]
    sent += [f"{name}={name}" for name in names] + ["**options"]
    yield f"    def {operation.name}({', '.join(own)}) -> R:"
    yield textwrap.indent(_quoted(told), "        ")
    yield f"        return self.run({', '.join(sent)})"
    yield ""


def _said(name: str, facts: Iterable[str]) -> list[str]:
    text = f"{name}: " + "; ".join(" ".join(fact.split()) for fact in facts if fact)
    return textwrap.wrap(text.removesuffix(": "), WIDTH, subsequent_indent="    ", break_long_words=False)


def _quoted(lines: list[str]) -> str:
    """A docstring."""
    said = "\n".join(lines).strip().replace("\\", "\\\\").replace('"""', "'''")
    return f'"""{said}"""' if "\n" not in said and not said.endswith('"') else f'"""{said}\n"""'


def _optional(hint: str) -> str:
    return hint if hint.endswith("None") or hint == "Any" else f"{hint} | None"


def _hint(field: Mapping[str, Any]) -> str:
    """The type of a value, from its JSON schema."""
    if "enum" in field:
        return f"Literal[{', '.join(_literal(each) for each in field['enum'])}]"
    if "const" in field:
        return f"Literal[{_literal(field['const'])}]"
    if several := field.get("anyOf") or field.get("oneOf"):
        hints = list(dict.fromkeys(_hint(each) for each in several))
        if "Any" in hints:
            return "Any"
        return " | ".join(sorted(hints, key=lambda hint: hint == "None"))
    return {**TYPES, "object": "Mapping[str, Any]"}.get(str(field.get("type")), "Any")


def _literal(value: object) -> str:
    return json.dumps(value) if isinstance(value, str) else repr(value)


if __name__ == "__main__":
    TARGET.write_text(text())
