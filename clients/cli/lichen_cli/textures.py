"""`lichen textures [NAME]`: what textures there are, or the pipeline of one, to be run or changed."""

from __future__ import annotations

import json
from collections.abc import Sequence

from lichen_cli.main import Parser

_EPILOG = """lichen textures marble --width 1024 --height 1024 > marble.json
lichen run --pipeline @marble.json marble.png"""


def main(arguments: Sequence[str]) -> int:
    import argparse

    parser = Parser(
        prog="lichen textures",
        description="List named textures, or print the pipeline of one as JSON.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("name", nargs="?", help="the texture to print")
    for option, says in (("width", "px"), ("height", "px"), ("seed", "another seed makes another of its kind")):
        parser.add_argument(f"--{option}", default=argparse.SUPPRESS, help=says)
    given = vars(parser.parse_args(arguments))

    from lichen.presets import texture, textures

    name = given.pop("name")
    if name is not None:
        print(json.dumps(texture(name, **given), indent=2))
        return 0
    for each, summary in textures().items():
        print(f"{each:10}{summary}")
    return 0
