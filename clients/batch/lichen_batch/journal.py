"""What became of each item, a line of JSON each: appended when the item has ended, and read when a run is resumed.

A line is written by one call and says nothing that is not so: outputs are on the disk before it. Killed at any moment,
the file holds whole lines and at most one part of a line at its end, which is cut off before more is added. A power
failure may take the newest lines with it; their items are done once more, to the same bytes.

Two runs cannot write one journal: the file is locked, and the lock dies with its process.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from lichen_batch import places
from lichen_batch.item import OK, Item, Outcome


class JournalError(Exception):
    """The journal cannot be used; the text says why."""


@dataclass(frozen=True, slots=True)
class Entry:
    """The last word on an item."""

    digest: str
    ok: bool
    attempts: int
    line: Mapping[str, Any]


class Journal:
    def __init__(self, path: Path) -> None:
        """Opens and locks the file, which is made where it is missing. Raises `JournalError`."""
        self.path = path
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._file)
            raise JournalError(f"another run is writing {path}") from None
        self._mend()

    def _mend(self) -> None:
        """Cuts off a line that was not written to its end."""
        size = at = os.fstat(self._file).st_size
        while at > 0:
            start = max(at - (1 << 16), 0)
            found = os.pread(self._file, at - start, start).rfind(b"\n")
            if found >= 0:
                at = start + found + 1
                break
            at = start
        if at < size:
            os.ftruncate(self._file, at)

    @property
    def empty(self) -> bool:
        return os.fstat(self._file).st_size == 0

    def clear(self) -> None:
        os.ftruncate(self._file, 0)

    def entries(self) -> dict[str, Entry]:
        """The last entry of each id; lines that are none are passed over."""
        found: dict[str, Entry] = {}
        with open(self.path, "rb") as file:
            for line in file:
                try:
                    said = json.loads(line)
                    entry = Entry(said["digest"], said["status"] == OK, int(said.get("attempts", 1)), said)
                except (ValueError, KeyError, TypeError):
                    continue
                found[str(said["id"])] = entry
        return found

    def add(self, outcome: Outcome, attempts: int) -> None:
        """One line more, whole."""
        data = b'%b,"attempts":%d,"at":%.3f}\n' % (outcome.to_line().removesuffix(b"}"), attempts, time.time())
        if os.write(self._file, data) != len(data):
            raise OSError(f"{self.path}: a line could not be written whole; the disk may be full")

    def close(self) -> None:
        os.fsync(self._file)
        os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def remaining(
    items: Iterable[Item], entries: Mapping[str, Entry], *, retry_failed: bool
) -> Iterator[tuple[Item, Entry | None]]:
    """Items that are still to be done, with what was said of them before.

    An item is done when its journal says so under the same digest and its local outputs are there; one that failed is
    tried again only where that is wished, or when its line or the engine has changed.
    """
    for item in items:
        entry = entries.get(item.id)
        if entry is None or entry.digest != item.digest:
            yield item, None
        elif entry.ok:
            if any(places.missing(place) for place in item.outputs.values()):
                yield item, entry
        elif retry_failed:
            yield item, entry
