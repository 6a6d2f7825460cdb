"""The command line of one operation, read off its declaration.

`lichen run NAME` takes an option for every parameter, further input and knob of the operation, and one for every
reserved name of the service. Values stay text: the same reader that checks a query in a URL checks them, so both report
every flaw at once and in the same words. Unknown options are therefore not refused here but handed on.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lichen.files import FORMATS
from lichen.operation import Operation
from lichen_cli.main import Parser, Usage
from lichen_service.descriptions import inlined, options_schema

_NUMBER = re.compile(r"-(\d|\.\d|inf|nan)", re.IGNORECASE)


@dataclass(frozen=True)
class Given:
    """What a command line of an operation says."""

    values: tuple[tuple[str, str], ...]
    """parameters, knobs, reserved and unknown names with their text"""
    inputs: Mapping[str, str]
    """input names with their files"""
    output: str | None
    json: bool


def read(operation: Operation[Any], arguments: Sequence[str]) -> Given:
    """Raises `Usage` where files are missing or an option lacks its value."""
    parser = build(operation)
    tokens = joined(arguments, parser)
    unknown = _add_unknown(parser, tokens)
    try:
        given = vars(parser.parse_intermixed_args(tokens))
    except Usage:
        if not unknown:
            raise
        # The option nobody knows explains the mistake better than what it did to the rest.
        return Given(tuple((name, "") for name in unknown), {}, None, False)
    files, as_json = given.pop("files"), given.pop("json")
    further = {each.name for each in operation.inputs[1:]}
    inputs = {name: given.pop(name) for name in further & given.keys()}
    bare = operation.finds or "explain" in given
    first, output = _distribute(operation, files, bare, bool(unknown))
    if first is not None:
        inputs = {operation.inputs[0].name: first, **inputs}
    values = tuple((name, str(value).lower() if isinstance(value, bool) else value) for name, value in given.items())
    return Given(values, inputs, output, as_json)


def build(operation: Operation[Any]) -> Parser:
    """The parser of one operation's command line."""
    parser = Parser(
        prog=f"lichen run {operation.name}",
        usage=f"lichen run {operation.name} {_shown_files(operation)} [options]",
        description=operation.summary,
        epilog="A file called - is standard input or output. The suffix of OUT names its format.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("files", nargs="*", help=argparse.SUPPRESS)
    group = parser.add_argument_group("inputs")
    for each in operation.inputs[1:]:
        group.add_argument(_flag(each.name), dest=each.name, metavar="FILE", help=_percent(each.description))
    group = parser.add_argument_group("parameters")
    schema = inlined(operation.schema())
    for name, field in schema.get("properties", {}).items():
        _add(group, name, field, name in schema.get("required", ()))
    group = parser.add_argument_group("knobs of methods")
    for knob in operation.knobs.values():
        span = f"{knob.low:g} to {knob.high:g}"
        group.add_argument(_flag(knob.name), dest=knob.name, metavar="X", help=_percent(f"{knob.description}; {span}"))
    group = parser.add_argument_group("how to compute and to store")
    _add(group, "method", {**options_schema()["properties"]["method"], "enum": list(operation.methods)}, False)
    add_wishes(group, {"method"})
    group.add_argument("--json", action="store_true", default=False, help="print the report as JSON")
    group.add_argument("--url", metavar="URL", help="let a service compute")  # taken off before the rest is read
    return parser


def add_wishes(group: Any, but: Collection[str]) -> None:
    """One option for each of the service's reserved names, but for some."""
    for name, field in options_schema()["properties"].items():
        if name not in but:
            _add(group, name, {**field, "enum": list(FORMATS)} if name == "format" else field, False)


def kind_of(field: Mapping[str, Any]) -> str:
    """What values a field of a JSON schema takes, in a word or two."""
    offered = [each for each in field.get("anyOf", [field]) if each.get("type") != "null"]
    kinds = []
    for each in offered:
        if "enum" in field or "enum" in each:
            kinds.append("|".join(str(value) for value in field.get("enum", each.get("enum"))))
        elif "const" in each:
            kinds.append(str(each["const"]))
        else:
            kinds.append({"array": "JSON", "object": "JSON"}.get(each.get("type", ""), each.get("type", "text")))
    return " or ".join(dict.fromkeys(kinds))


def range_of(field: Mapping[str, Any]) -> str:
    """The range of a number, such as "at least 0, below 1"; empty where there is none."""
    bounds: dict[str, float] = {}
    for each in (field, *field.get("anyOf", ())):
        bounds |= {key: each[key] for key in _BOUNDS if key in each}
    return ", ".join(f"{words} {bounds[key]:.15g}" for key, words in _BOUNDS.items() if key in bounds)


_BOUNDS = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}


def _add(group: Any, name: str, field: Mapping[str, Any], required: bool) -> None:
    """One option for a field of a JSON schema."""
    facts = [range_of(field), field.get("unit", "")]
    default = field.get("default")
    facts.append("required" if required else "" if default is None else f"default {json.dumps(default)}")
    help = "; ".join([field.get("description", ""), *filter(None, facts)]).removeprefix("; ")
    if any(each.get("type") == "boolean" for each in (field, *field.get("anyOf", ()))):
        group.add_argument(_flag(name), dest=name, action=argparse.BooleanOptionalAction, help=_percent(help))
        return
    kind = kind_of(field)
    metavar = {"number": "X", "integer": "N", "string": "TEXT"}.get(kind, kind)
    group.add_argument(_flag(name), dest=name, metavar=metavar, help=_percent(help))


def joined(arguments: Sequence[str], parser: Parser) -> list[str]:
    """Negative numbers tied to their option, since a bare -1e-3 looks like an option itself."""
    tokens: list[str] = []
    for token in arguments:
        if tokens and _NUMBER.match(token) and tokens[-1].startswith("--") and "=" not in tokens[-1]:
            tokens[-1] += f"={token}"
        else:
            tokens.append(token)
    return tokens


def _add_unknown(parser: Parser, tokens: Sequence[str]) -> list[str]:
    """Gives the parser every option it does not know, and returns their names."""
    known = set(parser._option_string_actions)
    flags = [token.partition("=")[0] for token in tokens if token.startswith("--") and token != "--"]
    unknown = [flag for flag in dict.fromkeys(flags) if flag not in known]
    for flag in unknown:
        parser.add_argument(flag, dest=_name(flag), nargs="?", const="")
    return [_name(flag) for flag in unknown]


def _distribute(
    operation: Operation[Any], files: Sequence[str], bare: bool, lenient: bool
) -> tuple[str | None, str | None]:
    """Which file is the first input and which the output, which may be missing where something else is printed."""
    remaining = list(files)
    first = None
    wants_input = bool(operation.inputs) and (operation.inputs[0].required or len(remaining) > 1)
    if wants_input and remaining:
        first = remaining.pop(0)
    output = remaining.pop(0) if remaining else None
    if remaining and not lenient:
        raise Usage(f"{', '.join(remaining)}: more files than {operation.name} takes; further inputs are named options")
    if output is None and not bare and not lenient:
        raise Usage(f"a file to write is missing; the order is {_shown_files(operation)}")
    return first, output


def _shown_files(operation: Operation[Any]) -> str:
    output = "[OUT]" if operation.finds else "OUT"
    if not operation.inputs:
        return output
    name = operation.inputs[0].name.upper()
    return f"{name} {output}" if operation.inputs[0].required else f"[{name}] {output}"


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


def _name(flag: str) -> str:
    return flag.removeprefix("--").replace("-", "_")


def _percent(help: str) -> str:
    """argparse takes % in a help text for a format."""
    return " ".join(help.split()).replace("%", "%%")
