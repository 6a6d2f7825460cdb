"""Fixtures of the wire: a loop in a thread, with a toy application behind it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # the harness is also imported by worker processes, by its name

from wire_harness import Running, Toy, WireConfig

from lichen_service.http.limits import Bounds


@pytest.fixture
def serve() -> Iterator[Callable[..., Running]]:
    """`serve(bounds=..., **settings)` starts a server; all of them end with the test."""
    running: list[Running] = []

    def start(bounds: Bounds | None = None, **settings: float) -> Running:
        running.append(Running(Toy(), WireConfig(**settings), bounds or Bounds()))
        return running[-1]

    yield start
    for each in running:
        each.stop()


@pytest.fixture(scope="module")
def server() -> Iterator[Running]:
    """One server with default settings for tests that only talk to it."""
    running = Running(Toy(), WireConfig(), Bounds())
    yield running
    running.stop()
