"""`python -m lichen_cli`: the `lichen` command."""

from __future__ import annotations

import sys

from lichen_cli.main import main

if __name__ == "__main__":
    sys.exit(main())
