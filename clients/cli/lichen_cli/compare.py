"""`lichen compare A B [MAP]`: how far picture A is from picture B, in figures and, in MAP, pixel by pixel.

It is `lichen run compare A MAP --reference B`, whose further options hold here, too.
"""

from __future__ import annotations

from collections.abc import Sequence

from lichen_cli.main import INVALID, Usage

_HELP = """usage: lichen compare A B [MAP] [options]

Prints how far picture A is from picture B; with MAP writes the differences of
all pixels there. `lichen run compare --help` lists the options.
"""


def main(arguments: Sequence[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_HELP, end="")
        return 0 if arguments else INVALID
    if len(arguments) < 2 or any(each.startswith("--") for each in arguments[:2]):
        raise Usage("the pictures to compare come first; see lichen compare --help")
    from lichen_cli import run

    return run.main(["compare", arguments[0], *arguments[2:], "--reference", arguments[1]])
