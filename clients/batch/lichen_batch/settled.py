"""By which times the methods of a batch are chosen: settled when it begins, and the same for all that do its items.

What a method takes is measured on a machine, and not once for all: calibration goes on, other machines join. Left to
themselves, two processes could choose two methods for one item, both accurate enough and not the same bit for bit. So
what the first run of a batch knows is written beside its journal, and whoever does an item, here or on a cluster, now
or weeks later, chooses by that alone. Its digest is part of what an item is done under: other times, and items are done
anew.

`python -m lichen_batch.settled` prints what a process that does items here would know.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from secrets import token_hex
from typing import Any

from lichen.accuracy import times
from lichen_batch.places import PART

STARTING = 120.0
"""Seconds that the process which is asked has."""


class Unusable(Exception):
    """The times that were settled cannot be used; the text says why."""


@dataclass(frozen=True, slots=True)
class Settled:
    known: times.Known
    digest: str


def settled(path: Path, version: str, *, anew: bool = False) -> Settled:
    """The times that `path` holds for this version of the engine; where it holds none, or with `anew`, what is known
    now, which is written there. Of several runs that begin at once, all take what one of them has written. Raises
    `Unusable`, OSError."""
    said = None if anew else _read(path)
    if said is not None and said["version"] == version:
        return _settled(said)
    _write(path, {"version": version, "times": _known()}, replace=anew or said is not None)
    said = _read(path)
    if said is None or said["version"] != version:
        raise Unusable(f"{path} was written by another run of another version")
    return _settled(said)


def _settled(said: dict[str, Any]) -> Settled:
    text = json.dumps(said["times"], sort_keys=True)
    return Settled(said["times"], hashlib.sha256(text.encode()).hexdigest()[:16])


def _read(path: Path) -> dict[str, Any] | None:
    """What a file says; None where there is none."""
    try:
        said = json.loads(path.read_bytes())
        with times.held(said["times"]):
            return {"version": str(said["version"]), "times": said["times"]}
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError) as wrong:
        raise Unusable(f"{path} holds no times of methods ({wrong}); without it, items are done anew") from None


def _write(path: Path, said: dict[str, Any], *, replace: bool) -> None:
    """The whole file or nothing; what another run has written meanwhile stays, unless it is to be replaced."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}{PART}{token_hex(8)}")
    try:
        with open(part, "x") as file:
            json.dump(said, file)
            file.flush()
            os.fsync(file.fileno())
        try:
            if not replace:
                os.link(part, path)
        except FileExistsError:
            return
        except OSError:  # a file system without links: the last of several runs wins
            replace = True
        if replace:
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _known() -> times.Known:
    """What a process that does items here would know. This one must not start a device: its runtime would set
    variables that they inherit."""
    if not any(times.folder().glob("*.json")):
        return times.known()
    command = [sys.executable, "-m", "lichen_batch.settled"]
    try:
        said = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=STARTING, check=True)
        known: times.Known = json.loads(said.stdout.splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError) as wrong:
        raise Unusable(f"the times of this machine cannot be told: {wrong}") from None
    return known


if __name__ == "__main__":
    print(json.dumps(times.known()))
