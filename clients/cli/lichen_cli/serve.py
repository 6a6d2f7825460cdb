"""`lichen serve`: the HTTP service in the foreground, until it is told to end."""

from __future__ import annotations

import os
from collections.abc import Sequence


def main(arguments: Sequence[str]) -> int:
    from lichen_service import settings
    from lichen_service.http import server

    chosen = settings.from_command_line(arguments, prog="lichen serve")
    # Workers are started afresh and read the same settings from their environment.
    os.environ.update(chosen.environment())
    return server.serve("lichen_service.app:create_application", chosen)
