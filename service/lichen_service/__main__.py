"""`python -m lichen_service`: starts the service and stays in it until it is told to end."""

from __future__ import annotations

import os
import sys

from lichen_service import settings
from lichen_service.http import server


def main() -> int:
    chosen = settings.from_command_line()
    # Workers are started afresh and read the same settings from their environment.
    os.environ.update(chosen.environment())
    return server.serve("lichen_service.app:create_application", chosen)


if __name__ == "__main__":
    sys.exit(main())
