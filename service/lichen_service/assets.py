"""Stored inputs: images under the SHA-256 of their bytes, on disk, shared by all worker processes.

    FOLDER/ab/abcdef...        the bytes, named by their digest

Theory. A name that is the digest of the content makes everything else simple: storing twice is storing once, nothing
is ever changed, and whoever reads can tell whether the disk still gives what was put there. A file is whole or not
there (`durable`); what does not match its name is thrown away and reported as missing.

What was used longest ago goes first when room is needed; the time of the last use is the file's own. Nothing goes that
is in use: a request holds a shared lock on the file while it works, a job holds a hard link of its own until it has
ended. Both are the kernel's to keep, so they end with a process that is killed, or outlive it, as they should.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import time
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path

from lichen_service import durable
from lichen_service.http.message import Body
from lichen_service.logs import log

PREFIX = "sha256:"
ABANDONED = 3600.0
"""Seconds after which a file that is still being written is taken for that of a process that has died."""
_ID = re.compile(r"sha256:[0-9a-f]{64}")


class Full(Exception):
    """There is no room, and everything there is in use or larger than the room there ever is."""


class InUse(Exception):
    """Somebody works with the asset."""


_held: ContextVar[list[int]] = ContextVar("held")


def is_id(text: str) -> bool:
    return _ID.fullmatch(text) is not None


class Assets:
    def __init__(self, folder: Path, capacity: int) -> None:
        """`capacity` is how many bytes all assets may take together."""
        self._folder = folder
        self.capacity = capacity

    @contextlib.contextmanager
    def request(self) -> Iterator[None]:
        """What the body reads, on this thread, stays in use until it ends."""
        token = _held.set([])
        try:
            yield
        finally:
            for descriptor in _held.get():
                os.close(descriptor)
            _held.reset(token)

    def put(self, data: Body) -> tuple[str, bool]:
        """Stores bytes; returns their name and whether they are new. Raises `Full` or `OSError`."""
        name = PREFIX + hashlib.sha256(data).hexdigest()
        path = self._path(name)
        size = memoryview(data).nbytes
        durable.private_folder(path.parent)
        with durable.locked(self._lock_path()):
            if self._is_whole(path, name):
                os.utime(path)
                return name, False
            self._make_room(size)
            durable.write(path, data)
            durable.sync_folder(self._folder)
        return name, True

    def read(self, name: str) -> bytes | None:
        """The bytes, compared with their name; None where there are none."""
        path = self._path(name)
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except (FileNotFoundError, NotADirectoryError):
            return None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH)
            with open(descriptor, "rb", buffering=0, closefd=False) as file:
                data = file.readall()
            os.utime(path)
        except FileNotFoundError:  # it went while we read it; what we have is whole all the same
            pass
        finally:
            held = _held.get(None)
            if held is None:
                os.close(descriptor)
            else:
                held.append(descriptor)
        if PREFIX + hashlib.sha256(data).hexdigest() == name:
            return data
        log.error("an asset was damaged on disk and is dropped", asset=name)
        path.unlink(missing_ok=True)
        return None

    def delete(self, name: str) -> bool:
        """Whether there was anything to delete. Raises `InUse`."""
        path = self._path(name)
        if not path.exists():
            return False
        with durable.locked(self._lock_path()):
            if not path.exists():
                return False
            if not _drop(path):
                raise InUse
        return True

    def hold(self, name: str, link: Path) -> bool:
        """Gives the asset a second name, under which it stays until that is deleted; False where there is none."""
        with durable.locked(self._lock_path()):
            try:
                os.link(self._path(name), link)
            except FileNotFoundError:
                return False
        return True

    def stored(self) -> int:
        """Bytes of all assets."""
        return sum(size for _, size, _ in self._entries())

    def clean(self) -> None:
        """Removes what processes that were killed had not finished."""
        for path in self._folder.glob(f"*/{durable.UNFINISHED}*"):
            with contextlib.suppress(OSError):
                if time.time() - path.stat().st_mtime > ABANDONED:
                    path.unlink()

    def _lock_path(self) -> Path:
        return durable.private_folder(self._folder) / "lock"

    def _path(self, name: str) -> Path:
        digest = name.removeprefix(PREFIX)
        return self._folder / digest[:2] / digest

    def _is_whole(self, path: Path, name: str) -> bool:
        """Whether the file is there and still what its name says; a damaged one is removed."""
        try:
            with path.open("rb") as file:
                same = PREFIX + hashlib.file_digest(file, "sha256").hexdigest() == name
        except FileNotFoundError:
            return False
        if not same:
            path.unlink(missing_ok=True)
        return same

    def _make_room(self, size: int) -> None:
        entries = sorted(self._entries())
        excess = sum(each for _, each, _ in entries) + size - self.capacity
        for _, freed, path in entries:
            if excess <= 0:
                return
            if _drop(path):
                excess -= freed
        if excess > 0:
            raise Full

    def _entries(self) -> Iterator[tuple[int, int, Path]]:
        """Last use, size and path of every asset."""
        for path in self._folder.glob("??/" + "[0-9a-f]" * 2 + "*"):
            with contextlib.suppress(OSError):
                status = path.stat()
                yield status.st_mtime_ns, status.st_size, path


def _drop(path: Path) -> bool:
    """Deletes an asset unless it is in use."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_nlink > 1:
            return False
        path.unlink(missing_ok=True)
        return True
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
