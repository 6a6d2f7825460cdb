"""`lichen config`: what `lichen serve` with the same arguments would run with, and where each value came from."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence

from lichen_cli.main import Parser, Usage


def main(arguments: Sequence[str]) -> int:
    from lichen_service import configuration
    from lichen_service.settings import InvalidSettings

    says = "Print the settings the service would run with, and for each the flag, variable or file it comes from."
    parser = Parser(prog="lichen config", description=says, allow_abbrev=False)
    parser.add_argument("--json", action="store_true", help="print JSON")
    configuration.add_flags(parser)
    given = vars(parser.parse_args(arguments))
    as_json = given.pop("json")
    try:
        found = configuration.load(given)
    except InvalidSettings as invalid:
        raise Usage(str(invalid)) from None
    values = dataclasses.asdict(found.settings)
    if as_json:
        print(
            json.dumps(
                {name: {"value": each, "origin": found.origins[name]} for name, each in values.items()}, indent=2
            )
        )
        return 0

    from rich.console import Console
    from rich.table import Table

    table = Table("setting", "value", "from", box=None, header_style="dim")
    for name, value in values.items():
        origin = found.origins[name]
        table.add_row(name, str(value), origin, style="dim" if origin == configuration.DEFAULT else None)
    Console(soft_wrap=True).print(table, markup=False)
    return 0
