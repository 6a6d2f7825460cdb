"""Where the OpenCL runtime keeps the kernels it has compiled.

PoCL compiles to shared objects in a folder and loads them from there. Where that folder cannot be written the device
vanishes, and where its file system forbids execution the process ends with a segmentation fault, so both are
checked before the runtime is touched.

`LICHEN_KERNELS` may name a folder of kernels that were compiled before, as a container image holds one: they are found
through links, so that the folder may be read-only and costs no memory, and what is compiled besides lies beside them.
They are of use on processors like the one they were compiled for; on another the runtime compiles its own.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import shutil
import tempfile
from pathlib import Path

import platformdirs

_log = logging.getLogger("lichen")


class NoCache(Exception):
    """No folder will do; the text says which were tried and what is wrong with each."""


def flaw(folder: Path) -> str | None:
    """What makes `folder` unfit for compiled kernels, or None. Creates it where it does not exist."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return f"cannot be written ({error.strerror})"
    if hasattr(os, "ST_NOEXEC") and os.statvfs(folder).f_flag & os.ST_NOEXEC:
        return "lies on a file system mounted noexec"
    return None


def prepare() -> Path:
    """A folder fit for compiled kernels: `POCL_CACHE_DIR` if set, else the user's cache, else a temporary one.

    A temporary folder is removed when the process ends. Raises `NoCache`.
    """
    named = os.environ.get("POCL_CACHE_DIR")
    wanted = Path(named) if named else platformdirs.user_cache_path("lichen") / "pocl"
    wrong = flaw(wanted)
    if wrong is None:
        adopt(wanted)
        return wanted
    try:
        spare = Path(tempfile.mkdtemp(prefix="lichen-pocl-"))
    except OSError as error:
        raise NoCache(f"{wanted} {wrong}, and there is no temporary folder ({error.strerror})") from error
    atexit.register(shutil.rmtree, spare, ignore_errors=True)
    wrong_too = flaw(spare)
    if wrong_too is not None:
        raise NoCache(f"{wanted} {wrong}, and {spare} {wrong_too}")
    adopt(spare)
    _log.warning("compiled kernels are kept in %s until the process ends: %s %s", spare, wanted, wrong)
    return spare


def restore() -> None:
    """Makes the folder that the runtime uses again, where somebody has removed it: without it nothing compiles."""
    named = os.environ.get("POCL_CACHE_DIR")
    if named and not os.path.isdir(named) and flaw(Path(named)) is None:
        adopt(Path(named))


COPIED = frozenset({"last_accessed"})
"""What the runtime writes to although it is there."""


def adopt(folder: Path) -> None:
    """Lets `folder` hold what the folder named by `LICHEN_KERNELS` holds, except what it has itself."""
    named = os.environ.get("LICHEN_KERNELS")
    source = Path(named) if named else None
    if source is None or not source.is_dir() or source.resolve() == folder.resolve():
        return
    for root, _, names in os.walk(source):
        place = folder / Path(root).relative_to(source)
        place.mkdir(mode=0o700, exist_ok=True)
        for name in names:
            link = place / name
            if os.path.lexists(link):
                continue
            with contextlib.suppress(FileExistsError):  # of another process that starts
                if name in COPIED:
                    shutil.copyfile(Path(root, name), link)
                else:
                    link.symlink_to(Path(root, name))
