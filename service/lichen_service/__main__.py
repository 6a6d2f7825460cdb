"""`python -m lichen_service`: starts the service and stays in it until it is told to end."""

from __future__ import annotations

import sys

from lichen_service.serving import main

if __name__ == "__main__":
    sys.exit(main())
