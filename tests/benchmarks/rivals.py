"""Other people's programs, in an environment of their own, which is no part of Lichen."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

RIVALS = ("thumbor", "pyvips[binary]")


def environment(tell: Callable[[str], None]) -> Path:
    """The folder of programs where the rivals are installed; made if it is not there."""
    folder = Path(os.environ.get("LICHEN_RIVALS", Path(tempfile.gettempdir()) / "lichen-rivals"))
    if not (folder / "ready").exists():
        tell(f"installing {', '.join(RIVALS)} into {folder}")
        subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True, stdout=sys.stderr)
        pip = [folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        for each in RIVALS:  # one that cannot be had costs its own rows
            subprocess.run([*pip, each], check=False, stdout=sys.stderr)
        (folder / "ready").touch()
    return folder / "bin"
