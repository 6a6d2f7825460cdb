"""What all tests share: plans that do not depend on what was once measured on this machine."""

from __future__ import annotations

import os
import tempfile

# Before anything of ours is imported, and for the processes that tests start, too.
os.environ["LICHEN_TIMES"] = tempfile.mkdtemp(prefix="lichen-times-")
os.environ["LICHEN_CALIBRATE"] = "off"
os.environ["LICHEN_SPARE"] = "off"


def pytest_unconfigure() -> None:
    """Leave nothing behind."""
    import shutil

    shutil.rmtree(os.environ["LICHEN_TIMES"], ignore_errors=True)
