"""`lichen COMMAND ...`: finds the command, and turns what goes wrong into a sentence and an exit status.

Statuses: 0 done; 1 it failed (a file, a device, an unsound installation); 2 what was asked for is not valid; 130
interrupted. Commands are imported when they are asked for, so that help and mistakes cost no image library.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

FAILED, INVALID, INTERRUPTED = 1, 2, 130

COMMANDS = {
    "serve": ("lichen_cli.serve", "answer requests over HTTP"),
    "config": ("lichen_cli.config", "show the settings of the service and where each comes from"),
    "keys": ("lichen_cli.keys", "make, list and revoke the keys that callers need"),
    "run": ("lichen_cli.run", "run an operation on image files"),
    "pipeline": ("lichen_cli.pipeline", "run a graph of operations on image files"),
    "scene": ("lichen_cli.scene", "compute the picture of a scene"),
    "compare": ("lichen_cli.compare", "say how far a picture is from another"),
    "batch": ("lichen_cli.batch", "run the lines of a manifest, here, on a service or on a cluster"),
    "operations": ("lichen_cli.operations", "list the operations, or describe one"),
    "textures": ("lichen_cli.textures", "list named textures, or print the pipeline of one"),
    "accuracy": ("lichen_cli.accuracy", "show what accuracy costs in time"),
    "calibrate": ("lichen_cli.calibrate", "measure how fast this machine is, so that plans promise its times"),
    "warm": ("lichen_cli.warm", "compile all kernels, so that nobody waits for that later"),
    "completion": ("lichen_cli.completion", "print what a shell needs to complete commands and options"),
    "doctor": ("lichen_cli.doctor", "find out what works on this machine, and why the rest does not"),
}


class Usage(Exception):
    """A command line that cannot be understood; the message says why."""


class Parser(argparse.ArgumentParser):
    """An argument parser that raises `Usage` instead of ending the process."""

    def error(self, message: str) -> NoReturn:
        raise Usage(f"{message}; see {self.prog} --help")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line (the process's own by default); returns the exit status."""
    try:
        command, rest = _parse(sys.argv[1:] if arguments is None else arguments)
        status = int(importlib.import_module(COMMANDS[command][0]).main(rest))
        sys.stdout.flush()  # what is left in the buffer may find its reader gone, too
        return status
    except Usage as wrong:
        return _say(str(wrong), INVALID)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has left. Python would complain once more when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as failure:
        where = f"{failure.filename}: " if failure.filename else ""
        return _say(f"{where}{failure.strerror or failure}", FAILED)
    except Exception as failure:
        told = _told(failure)
        if told is None:
            raise
        return told


def _parse(arguments: Sequence[str]) -> tuple[str, list[str]]:
    parser = Parser(
        prog="lichen",
        description="Image operations whose accuracy has a stated price.",
        epilog="commands:\n" + "\n".join(f"  {name:12}{help}" for name, (_, help) in COMMANDS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="lichen COMMAND ...",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="print the version")
    parser.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    parser.add_argument("rest", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.version:
        import lichen

        print(lichen.__version__)
        raise SystemExit(0)
    if given.command is None:
        parser.print_help(sys.stderr)
        raise SystemExit(INVALID)
    if given.command not in COMMANDS:
        import difflib

        close = difflib.get_close_matches(given.command, COMMANDS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(COMMANDS)}"
        raise Usage(f"there is no command {given.command!r}; {hint}")
    return given.command, given.rest


def _told(failure: Exception) -> int | None:
    """Prints one of the library's errors with every flaw; None for an exception that is a defect of ours."""
    from lichen.errors import DeviceFailure, LichenError

    if not isinstance(failure, LichenError):
        return None
    limits = f" (limit {failure.limit:g}, actual {failure.actual:g})" if failure.limit and failure.actual else ""
    _say(failure.detail + limits, INVALID)
    for flaw in failure.flaws:
        print(f"  {_option(flaw.pointer)}: {flaw.detail}", file=sys.stderr)
    return FAILED if isinstance(failure, DeviceFailure) else INVALID


def _option(pointer: str) -> str:
    """What a JSON pointer speaks of: /parameters/max_error/0 is --max-error, /inputs/image is image, and
    /nodes/soft/parameters/sigma is node soft parameters sigma."""
    kind, _, rest = pointer.lstrip("/").partition("/")
    if kind in ("nodes", "outputs"):
        return " ".join([kind.removesuffix("s"), *rest.split("/")])
    name = (rest or kind).partition("/")[0].replace("~1", "/").replace("~0", "~")
    return name if kind == "inputs" else "--" + name.replace("_", "-")


def _say(sentence: str, status: int) -> int:
    print(f"lichen: {sentence}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
