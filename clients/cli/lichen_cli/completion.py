"""`lichen completion bash|zsh|fish`: what a shell needs to complete commands, operations and options.

    eval "$(lichen completion bash)"        # in ~/.bashrc; zsh: the same with zsh in ~/.zshrc
    lichen completion fish | source         # in ~/.config/fish/config.fish

The script holds all words, so that completing starts no Python; print it anew after an update.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from lichen_cli.main import COMMANDS, Parser

SHELLS = ("bash", "zsh", "fish")
_BASH = """_lichen() {
    local word=${COMP_WORDS[COMP_CWORD]} words=
    COMPREPLY=()
    case "${COMP_WORDS[1]} ${COMP_WORDS[2]}" in
@CASES@
    esac
    case $COMP_CWORD in
        1) words="@COMMANDS@" ;;
        2) case ${COMP_WORDS[1]} in
@SECOND@
           esac ;;
    esac
    [[ $COMP_CWORD -le 2 || $word == -* ]] && COMPREPLY=($(compgen -W "$words" -- "$word"))
}
complete -o default -F _lichen lichen
"""
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"


def main(arguments: Sequence[str]) -> int:
    parser = Parser(prog="lichen completion", description="Print a script for a shell.", allow_abbrev=False)
    parser.add_argument("shell", choices=SHELLS)
    given = parser.parse_args(arguments)
    second, options = _words()
    print(_fish(second, options) if given.shell == "fish" else _bash(second, options, zsh=given.shell == "zsh"), end="")
    return 0


def _words() -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """What may follow a command, and the options of a command, or of one with its second word."""
    from lichen.catalogue import operations
    from lichen_cli import batch, pipeline, scene
    from lichen_cli.options import build

    names = list(operations())
    second = {
        "run": [*names, "--pipeline", "--scene"],
        "operations": [*names, "--json"],
        "accuracy": [*names, "--json"],
        "batch": ["run", "tiles"],
        "keys": ["add", "list", "revoke", "sign"],
        "completion": list(SHELLS),
    }
    options = {f"run {name}": _flags(build(each)) for name, each in operations().items()}
    options["batch run"] = _flags(batch._parser())
    for name, parser in (("pipeline", pipeline.build()), ("scene", scene.build())):
        options[name] = options[f"run --{name}"] = _flags(parser)
    options["compare"] = options["run compare"]
    return second, options


def _flags(parser: argparse.ArgumentParser) -> list[str]:
    return sorted(flag for flag in parser._option_string_actions if flag.startswith("--"))


def _bash(second: Mapping[str, list[str]], options: Mapping[str, list[str]], *, zsh: bool) -> str:
    patterns = {key: f'"{key}"' if " " in key else f'"{key} "*' for key in options}
    cases = "\n".join(f'        {patterns[key]}) words="{" ".join(flags)}" ;;' for key, flags in options.items())
    follow = "\n".join(f'               {command}) words="{" ".join(words)}" ;;' for command, words in second.items())
    script = _BASH.replace("@CASES@", cases).replace("@SECOND@", follow).replace("@COMMANDS@", " ".join(COMMANDS))
    return (_ZSH if zsh else "") + script


def _fish(second: Mapping[str, list[str]], options: Mapping[str, list[str]]) -> str:
    lines = [
        f"complete -c lichen -n __fish_use_subcommand -a {name} -d '{help}'" for name, (_, help) in COMMANDS.items()
    ]
    for command, words in second.items():
        condition = f"__fish_seen_subcommand_from {command}; and test (count (commandline -opc)) -eq 2"
        lines.append(f"complete -c lichen -n '{condition}' -a '{' '.join(words)}'")
    for key, flags in options.items():
        condition = "; and ".join(f"__fish_seen_subcommand_from {word}" for word in key.split())
        lines += [f"complete -c lichen -n '{condition}' -l {flag.removeprefix('--')}" for flag in flags]
    return "\n".join(lines) + "\n"
