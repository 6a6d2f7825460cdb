"""Stored inputs in a store elsewhere: any URL that fsspec knows (`s3://`, `gs://`, `file://`, `memory://` ...).

    URL/ab/abcdef...             the bytes, named by their digest
    FOLDER/index.sqlite          here: sizes, when each was used last, and which jobs hold one

Theory. The names are digests, so several services may share a store: what one has put there the others find, and
nobody can change it under another's hands. Stores have no locks and no time of last use, so each service keeps its own
account of both, brought up to date from a listing of the store when it starts. Object stores show an object when it is
whole; elsewhere a file is written under another name and moved. Either way what is read is compared with its name, and
what does not match is dropped and reported as missing.

A request holds the bytes it has read, so nothing that goes meanwhile is missed. A job holds an asset by a mark in its
own folder, which ends with the job.
"""

from __future__ import annotations

import contextlib
import hashlib
import secrets
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lichen_service import durable
from lichen_service.assets import ABANDONED, PREFIX, Assets, Full, InUse, is_id
from lichen_service.http.message import Body
from lichen_service.logs import log
from lichen_service.refusals import RETRY_AFTER, Refusal

WHOLE = frozenset(("s3", "s3a", "gs", "gcs", "az", "abfs", "adl", "oci", "r2", "memory"))
"""File systems in which a file is there when it is whole, and never before."""
_SCHEMA = """
CREATE TABLE IF NOT EXISTS assets(id TEXT PRIMARY KEY, size INTEGER NOT NULL, used REAL NOT NULL) STRICT;
CREATE TABLE IF NOT EXISTS holds(id TEXT NOT NULL, mark TEXT PRIMARY KEY) STRICT;
"""


def open_assets(url: str, folder: Path, capacity: int) -> Assets:
    """Assets in a folder of this machine, or at a URL. Raises ValueError for one that fsspec does not know."""
    return AssetsElsewhere(url, folder, capacity) if "://" in url else Assets(folder, capacity)


class AssetsElsewhere(Assets):
    def __init__(self, url: str, folder: Path, capacity: int) -> None:
        """`folder` is where the account is kept, one for all processes of a service."""
        import fsspec

        super().__init__(folder, capacity)
        self._files, self._root = fsspec.core.url_to_fs(url)
        self._root = str(self._root).rstrip("/")
        protocol = self._files.protocol
        self._whole = bool(WHOLE & {protocol, *(() if isinstance(protocol, str) else protocol)})

    def put(self, data: Body) -> tuple[str, bool]:
        name = PREFIX + hashlib.sha256(data).hexdigest()
        size = memoryview(data).nbytes
        with durable.locked(self._lock_path()):
            if self._verified(name) is not None:
                self._used(name, size)
                return name, False
            self._make_room(size)
            try:
                self._write(self._place(name), bytes(data))
            except Exception as failure:  # every kind of store has errors of its own
                raise OSError(f"{type(failure).__name__}: {failure}") from failure
            self._used(name, size)
        return name, True

    def read(self, name: str) -> bytes | None:
        """As in a folder. Raises the 503 refusal where the store does not answer."""
        data = self._verified(name)
        if data is not None:
            self._used(name, len(data))
        return data

    def delete(self, name: str) -> bool:
        with durable.locked(self._lock_path()):
            if name in self._held():
                raise InUse
            return self._remove(name)

    def hold(self, name: str, link: Path) -> bool:
        with durable.locked(self._lock_path()):
            if not self._files.exists(self._place(name)):
                return False
            link.touch(0o600)
            with self._database() as database:
                database.execute("INSERT OR REPLACE INTO holds VALUES(?, ?)", (name, str(link)))
        return True

    def stored(self) -> int:
        with self._database() as database:
            return int(database.execute("SELECT COALESCE(SUM(size), 0) FROM assets").fetchone()[0])

    def clean(self) -> None:
        """Brings the account up to date, and removes what processes that were killed had not finished."""
        try:
            found = self._files.find(self._root, detail=True) if self._files.exists(self._root) else {}
        except Exception as failure:  # as above
            log.error("the store of assets does not answer", reason=f"{type(failure).__name__}: {failure}")
            return
        there = {}
        for path, each in found.items():
            last = path.rpartition("/")[2]
            if is_id(PREFIX + last):
                there[PREFIX + last] = int(each.get("size") or 0)
            elif last.startswith(durable.UNFINISHED) and time.time() - _modified(each) > ABANDONED:
                with contextlib.suppress(Exception):
                    self._files.rm_file(path)
        with durable.locked(self._lock_path()), self._database() as database:
            gone = {row[0] for row in database.execute("SELECT id FROM assets")} - there.keys()
            database.executemany("DELETE FROM assets WHERE id = ?", [(each,) for each in gone])
            new = [(each, size, time.time()) for each, size in there.items()]
            database.executemany("INSERT OR IGNORE INTO assets VALUES(?, ?, ?)", new)

    # The store

    def _place(self, name: str) -> str:
        digest = name.removeprefix(PREFIX)
        return f"{self._root}/{digest[:2]}/{digest}"

    def _write(self, path: str, data: bytes) -> None:
        folder = path.rpartition("/")[0]
        self._files.makedirs(folder, exist_ok=True)
        if self._whole:
            self._files.pipe_file(path, data)
            return
        temporary = f"{folder}/{durable.UNFINISHED}{secrets.token_hex(8)}"
        try:
            self._files.pipe_file(temporary, data)
            self._files.mv(temporary, path)
        except BaseException:
            with contextlib.suppress(Exception):
                self._files.rm_file(temporary)
            raise

    def _verified(self, name: str) -> bytes | None:
        """The bytes, if they are there and still what their name says; damaged ones are removed."""
        try:
            data = bytes(self._files.cat_file(self._place(name)))
        except FileNotFoundError:
            return None
        except Exception as failure:  # as above
            log.error("the store of assets does not answer", reason=f"{type(failure).__name__}: {failure}")
            detail = "Where stored images are kept does not answer."
            retry = {"Retry-After": RETRY_AFTER}
            raise Refusal(
                503, "store-silent", "The store cannot be read", detail, headers=retry, retryable=True
            ) from None
        if PREFIX + hashlib.sha256(data).hexdigest() == name:
            return data
        log.error("an asset was damaged in its store and is dropped", asset=name)
        self._remove(name)
        return None

    def _remove(self, name: str) -> bool:
        """Whether there was anything to remove."""
        with self._database() as database:
            database.execute("DELETE FROM assets WHERE id = ?", (name,))
        try:
            self._files.rm_file(self._place(name))
        except FileNotFoundError:
            return False
        return True

    # The account

    def _make_room(self, size: int) -> None:
        excess = self.stored() + size - self.capacity
        if excess <= 0:
            return
        held = self._held()
        with self._database() as database:
            entries = database.execute("SELECT id, size FROM assets ORDER BY used").fetchall()
        for name, each in entries:
            if excess > 0 and name not in held:
                self._remove(name)
                excess -= each
        if excess > 0:
            raise Full

    def _held(self) -> set[str]:
        """What jobs hold whose marks are still there."""
        with self._database() as database:
            holds = database.execute("SELECT id, mark FROM holds").fetchall()
            gone = [(mark,) for _, mark in holds if not Path(mark).exists()]
            database.executemany("DELETE FROM holds WHERE mark = ?", gone)
        return {name for name, mark in holds if (mark,) not in gone}

    def _used(self, name: str, size: int) -> None:
        with self._database() as database:
            database.execute("INSERT OR REPLACE INTO assets VALUES(?, ?, ?)", (name, size, time.time()))

    @contextlib.contextmanager
    def _database(self) -> Iterator[sqlite3.Connection]:
        """The account, changed as a whole; what is lost with the power is found again by `clean`."""
        path = durable.private_folder(self._folder) / "index.sqlite"
        with contextlib.closing(sqlite3.connect(path, timeout=30)) as database:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = NORMAL")
            database.executescript(_SCHEMA)
            with database:
                yield database


def _modified(entry: Any) -> float:
    """When a file was last written, as its store tells it; now, where it does not."""
    for key in ("mtime", "LastModified", "modified", "updated", "last_modified", "created"):
        value = entry.get(key)
        if isinstance(value, int | float):
            return float(value)
        if hasattr(value, "timestamp"):
            return float(value.timestamp())
    return time.time()
