"""Steps that several runs have in common are done once, while they are at work at the same time.

A step is known by all that decides its pixels: the operation, its parameters and method, and what it reads, down to the
names that the caller gives to the contents of its pictures. Whoever needs a step that another is doing waits for it,
and takes it over; what is done is held only as long as somebody works with it, so nothing is kept for its own sake.
Whoever does a step waits for nobody meanwhile, so no two can wait for each other. Where a step fails, those who waited
do it themselves.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar
from weakref import WeakValueDictionary

Made = TypeVar("Made")


class _Making:
    """A step that is being done. Those who wait for it hold this, and so what was made until they have it."""

    def __init__(self) -> None:
        self.done = threading.Event()
        self.made: Any = None


class Sharing:
    """What is being done and what is in use, in this process. Safe to use from any thread."""

    def __init__(self) -> None:
        self._in_use: WeakValueDictionary[str, Any] = WeakValueDictionary()
        self._making: dict[str, _Making] = {}
        self._lock = threading.Lock()

    def of(self, step: str, compute: Callable[[], Made]) -> Made:
        """What a step makes: that which is in use or being made, or else what `compute` gives."""
        waited = False
        while True:
            with self._lock:
                found: Made | None = self._in_use.get(step)
                if found is not None:
                    return found
                making = self._making.get(step)
                if making is None:
                    mine = self._making[step] = _Making()
                    break
                if waited:  # somebody else was quicker to begin once more
                    return compute()
            making.done.wait()
            if making.made is not None:  # even if nobody else has it in use any more
                made: Made = making.made
                return made
            waited = True
        try:
            mine.made = done = compute()
            with self._lock:
                self._in_use[step] = done
            return done
        finally:
            with self._lock:
                del self._making[step]
            mine.done.set()


@dataclass(frozen=True, slots=True)
class Shared:
    """Where runs meet, and what identifies the contents of this one's sources, by their names in its graph."""

    sharing: Sharing
    origins: Mapping[str, str]
