"""`lichen operations [NAME]`: what there is, or all about one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lichen_cli.main import Parser

if TYPE_CHECKING:
    from rich.console import Console

    from lichen.operation import Operation


def main(arguments: Sequence[str]) -> int:
    parser = Parser(prog="lichen operations", description="List the operations, or describe one.", allow_abbrev=False)
    parser.add_argument("name", nargs="?", help="the operation to describe")
    parser.add_argument("--json", action="store_true", help="print JSON, as the service does")
    given = parser.parse_args(arguments)

    from rich.console import Console

    from lichen.catalogue import operation

    chosen = None if given.name is None else operation(given.name)
    if given.json:
        print(json.dumps(_document(chosen), indent=2, ensure_ascii=False))
    elif chosen is None:
        _list(Console())
    else:
        _describe(Console(), chosen)
    return 0


def _document(operation: Operation[Any] | None) -> Any:
    from lichen.catalogue import operations
    from lichen_service.descriptions import description_of, summary_of
    from lichen_service.documents import plain
    from lichen_service.settings import Settings

    if operation is None:
        return plain({"operations": [summary_of(each) for each in operations().values()]})
    return plain(description_of(operation, Settings.load()))


def _list(console: Console) -> None:
    from rich.table import Table

    from lichen.catalogue import operations

    table = Table("operation", "family", "what it does", box=None)
    for each in operations().values():
        table.add_row(each.name, each.family, each.summary)
    console.print(table)


def _describe(console: Console, operation: Operation[Any]) -> None:
    from rich.table import Table

    console.print(f"[bold]{operation.name}[/bold] ({operation.family}, computed in {operation.light} light)")
    console.print(operation.description.strip() or operation.summary, markup=False, highlight=False)
    inputs = Table("input", "channels", "", "what it is", box=None)
    for each in operation.inputs:
        least, most = each.channels
        span = f"{least}" if least == most else f"{least} to {most}" if most else f"{least} or more"
        inputs.add_row(each.name, span, "required" if each.required else "optional", each.description)
    parameters = Table("parameter", "takes", "range", "unit", "default", "what it is", box=None)
    for row in _parameters(operation):
        parameters.add_row(*row)
    methods = Table("method", "knob", "cheap to exact", "how it computes", box=None)
    for method in operation.methods.values():
        knob = method.knob
        values = ", ".join(f"{value:g}" for value in knob.values) if knob else ""
        methods.add_row(method.name, knob.name if knob else "", values, method.description)
    for table in (inputs, parameters, methods):
        if table.row_count:
            console.print()
            console.print(table, markup=False)


def _parameters(operation: Operation[Any]) -> list[tuple[str, ...]]:
    from lichen_cli.options import kind_of, range_of
    from lichen_service.descriptions import inlined

    schema = inlined(operation.schema())
    required = schema.get("required", ())
    return [
        (
            name,
            kind_of(field),
            range_of(field),
            field.get("unit", ""),
            "required" if name in required else "" if field.get("default") is None else str(field["default"]),
            " ".join(field.get("description", "").split()),
        )
        for name, field in schema.get("properties", {}).items()
    ]
