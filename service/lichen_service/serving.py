"""The service in the foreground: from a command line to the supervisor that keeps its workers alive."""

from __future__ import annotations

import os
from collections.abc import Sequence

from lichen_service import configuration
from lichen_service.http import server


def main(arguments: Sequence[str] | None = None, prog: str = "python -m lichen_service") -> int:
    """Serves until told to end; returns the exit status of the process."""
    settings = configuration.from_command_line(arguments, prog).settings
    # Workers are started afresh and read the same settings from their environment.
    os.environ.update(settings.environment())
    return server.serve("lichen_service.app:create_application", settings)
