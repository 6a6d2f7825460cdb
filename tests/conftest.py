"""What all tests share: plans that do not depend on what was once measured on this machine."""

from __future__ import annotations

import os
import tempfile

from hypothesis.internal.conjecture import providers

# Before anything of ours is imported, and for the processes that tests start, too.
os.environ["LICHEN_TIMES"] = tempfile.mkdtemp(prefix="lichen-times-")
os.environ["LICHEN_CALIBRATE"] = "off"
os.environ["LICHEN_SPARE"] = "off"
# Processes that tests start find our modules compiled, as an installation has them.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Draws that are the same every time must not depend on which of our modules a process has imported so far: no numbers
# are picked out of their sources.
providers._get_local_constants = lambda: providers._local_constants


def pytest_unconfigure() -> None:
    """Leave nothing behind."""
    import shutil

    shutil.rmtree(os.environ["LICHEN_TIMES"], ignore_errors=True)
