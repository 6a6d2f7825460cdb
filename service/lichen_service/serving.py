"""The service in the foreground: from a command line to the supervisor that keeps its workers alive.

The first worker is begun before anything else: it loads what it needs while settings are read.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from lichen_service.http import processes


def in_memory(place: Path = Path("/dev/shm")) -> str | None:
    """Where files are kept in memory, if anywhere. Workers map those that they count in, and a page that the system is
    writing to a disk makes them wait for it."""
    return str(place) if place.is_dir() and os.access(place, os.W_OK | os.X_OK) else None


def main(arguments: Sequence[str] | None = None, prog: str = "python -m lichen_service") -> int:
    """Serves until told to end; returns the exit status of the process."""
    begun = processes.begin()
    try:
        return _serve(arguments, prog, begun)
    finally:
        begun.end()


def _serve(arguments: Sequence[str] | None, prog: str, begun: processes.Begun) -> int:
    import tempfile

    from lichen_service import configuration
    from lichen_service.access.reach import must_not_listen
    from lichen_service.http import server
    from lichen_service.settings import FIGURES, SHARED

    settings = configuration.from_command_line(arguments, prog).settings
    if (reason := must_not_listen(settings)) is not None:
        print(f"Lichen does not listen: {reason}.", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="lichen-", dir=in_memory()) as shared:
        # Workers read the same settings from their environment.
        os.environ.update(settings.environment() | {SHARED: shared, FIGURES: shared})
        return server.serve("lichen_service.starting:create_application", settings, begun)
