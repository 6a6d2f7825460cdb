"""Where settings come from: flags, then the environment, then a TOML file, then defaults.

    lichen serve --config service.toml --max-body 1000000        LICHEN_CONFIG, LICHEN_MAX_BODY
    max_body = 1_000_000                                         a line of the file; names are those of `Settings`

No file is read unless one is named. Whatever is wrong, in whichever place, is told at once, and each value is kept with
the place it came from, so that nobody has to guess why the service behaves as it does (`lichen config`).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lichen.errors import nearest
from lichen_service.settings import CONFIG_VARIABLE, DECLARED, NO_FILE, InvalidSettings, Settings

DEFAULT = "default"


@dataclass(frozen=True, slots=True)
class Configuration:
    """Settings, and by name where each value came from: a flag, a variable, a line of a file, or the default."""

    settings: Settings
    origins: Mapping[str, str]


def load(flags: Mapping[str, str | None] | None = None, environ: Mapping[str, str] | None = None) -> Configuration:
    """The effective configuration; `flags` holds texts by setting and, as `config`, the name of a file.

    A variable that is empty counts as absent. Raises `InvalidSettings` naming every flaw at once.
    """
    environ = os.environ if environ is None else environ
    flags = flags or {}
    flaws: list[str] = []
    named = flags.get("config")
    path = environ.get(CONFIG_VARIABLE) if named is None else named
    lines = _read_file(path, flaws) if path and path != NO_FILE else {}
    values: dict[str, Any] = {}
    origins: dict[str, str] = {}
    for each in DECLARED:
        places = (
            (each.flag, flags.get(each.name)),
            (each.variable, environ.get(each.variable) or None),
            (f"{path}: {each.name}", lines.get(each.name)),
        )
        # Every place is read, also those that a better one overrides: a bad line is a bad line.
        for origin, given in reversed(places):
            if given is not None:
                try:
                    values[each.name] = each.read(given)
                    origins[each.name] = origin
                except ValueError as wrong:
                    flaws.append(f"{origin} {wrong}")
    if flaws:
        raise InvalidSettings("; ".join(flaws))
    return Configuration(Settings(**values), {each.name: origins.get(each.name, DEFAULT) for each in DECLARED})


def _read_file(path: str, flaws: list[str]) -> dict[str, Any]:
    """The lines of a file by setting; what is wrong with the file goes to `flaws`."""
    import tomllib  # the service starts sooner without it

    try:
        lines = tomllib.loads(Path(path).read_text("utf-8"))
    except OSError as failure:
        flaws.append(f"{path} cannot be read: {failure.strerror or failure}")
        return {}
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as broken:
        flaws.append(f"{path} is not TOML: {broken}")
        return {}
    names = {each.name for each in DECLARED}
    flaws += [f"{path}: {name} is not a setting; {nearest(name, names)}" for name in lines if name not in names]
    return {name: value for name, value in lines.items() if name in names}


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Gives a command line one flag for each setting, and `--config`."""
    parser.add_argument(
        "--config", metavar="FILE", help=f"TOML file of settings, {NO_FILE!r} for none ({CONFIG_VARIABLE})"
    )
    for each in DECLARED:
        default = each.default if each.default != "" else "empty"
        shown = f"{each.help} (default {default}; {each.variable})"
        if each.choices[:2] == ("on", "off"):  # the flag alone switches it on
            parser.add_argument(each.flag, nargs="?", const="on", metavar="|".join(each.choices), help=shown)
        else:
            parser.add_argument(each.flag, metavar=each.kind.__name__.upper(), help=shown)


def from_command_line(arguments: Sequence[str] | None = None, prog: str = "python -m lichen_service") -> Configuration:
    """The configuration of a command line; exits with status 2 and one sentence per flaw when it is not valid."""
    parser = argparse.ArgumentParser(prog=prog, description="Serve image operations over HTTP.", allow_abbrev=False)
    add_flags(parser)
    given = vars(parser.parse_args(arguments))
    try:
        return load(given)
    except InvalidSettings as invalid:
        parser.error(str(invalid))
