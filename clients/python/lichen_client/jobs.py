"""Work that is asked for now and fetched later."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from lichen_client.errors import LichenClientError

FINAL = frozenset({"successful", "failed", "dismissed"})
FIRST_LOOK, LONGEST_LOOK = 0.1, 2.0
"""Seconds between looks at a job: few at first, more the longer it takes."""

Progress = Callable[[float, str], None] | bool


class Dismissed(LichenClientError):
    """The job was given up before it ended."""


@dataclass(frozen=True, slots=True)
class State:
    """Where a job is."""

    id: str
    status: str
    """accepted, running, successful, failed or dismissed"""
    progress: float
    """per cent"""
    stage: str

    @classmethod
    def read(cls, said: Mapping[str, Any]) -> State:
        progress = float(said.get("progress") or 0)
        return cls(str(said["id"]), str(said["status"]), progress, str(said.get("stage") or ""))

    @property
    def ended(self) -> bool:
        return self.status in FINAL


def looks() -> Callable[[], float]:
    """Gives the seconds to wait before each look."""
    pause = FIRST_LOOK / 1.5

    def following() -> float:
        nonlocal pause
        pause = min(pause * 1.5, LONGEST_LOOK)
        return pause

    return following


def teller(progress: Progress) -> Callable[[State], None]:
    """What is done with each state: nothing, what the caller wants, or a bar on standard error."""
    if progress is False:
        return lambda state: None
    if progress is not True:
        return lambda state: progress(state.progress, state.stage or state.status)

    def bar(state: State) -> None:
        filled = round(state.progress / 5)
        end = "\n" if state.ended else ""
        print(
            f"\r[{'#' * filled}{'.' * (20 - filled)}] {state.progress:3.0f} % {state.stage or state.status:12}",
            end=end,
            file=sys.stderr,
            flush=True,
        )

    return bar
