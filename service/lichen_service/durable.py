"""Files that are either whole or not there, whenever the power goes.

A file is written beside its place, forced to the disk, and renamed over it; then the folder is forced too, without
which the new name itself could be lost. Whoever reads sees the old file or the new one, never a part.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from lichen_service.http.message import Body

UNFINISHED = ".part-"
"""How the names of files begin that are still being written, or were when the process was killed."""


def write(path: Path, data: Body, *, mode: int = 0o600) -> None:
    """Replaces the file. Raises `OSError`, and leaves no trace then."""
    temporary = path.with_name(f"{UNFINISHED}{secrets.token_hex(8)}")
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
        with open(descriptor, "wb", buffering=0) as file:
            view = memoryview(data).cast("B") if memoryview(data).c_contiguous else memoryview(bytes(data))
            while len(view):
                view = view[file.write(view) :]
            os.fsync(file.fileno())
        os.rename(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """Forces the names in a folder to the disk."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def private_folder(path: Path) -> Path:
    """The folder, made where it is missing, open to its owner alone."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    return path


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Alone among all processes that lock this file; it is made where it is missing. The lock dies with its process."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
