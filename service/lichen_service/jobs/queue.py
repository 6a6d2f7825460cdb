r"""The queue: one SQLite database and one folder for each job, shared by all worker processes.

    FOLDER/jobs.sqlite           states (write-ahead log; each commit is on the disk before it is believed)
    FOLDER/files/ID/body         what was sent; beside it hard links to the assets it names; later its result
    FOLDER/workers/TOKEN         locked for as long as its process lives

Theory. Files are whole before the row that speaks of them is committed, and rows go before their files do; so a process
may be killed between any two instructions, and what remains is either nothing, or a job that is whole, or files that
no row speaks of, which `clean` removes. Nobody keeps a clock to find out who has died: a process holds a lock on its
file in `workers`, which the kernel lets go of with the process. A job whose process is gone waits again. It may thus be
computed twice, but its end is one guarded update: seen from outside it happens once.

    accepted -> running -> successful | failed
        \___________\______-> dismissed                  a running job returns to accepted when its process dies
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import secrets
import shutil
import sqlite3
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lichen_service import durable
from lichen_service.assets import Assets, is_id
from lichen_service.http.message import Body
from lichen_service.jobs.job import Job, State, Stored

MOST_ATTEMPTS = 3
"""A job that was running when its process died, this often, is taken for the reason."""
ABANDONED = 3600.0
_SCHEMA = """
CREATE TABLE IF NOT EXISTS jobs(
    id TEXT PRIMARY KEY, owner TEXT NOT NULL, state TEXT NOT NULL, request TEXT NOT NULL,
    key TEXT, digest TEXT NOT NULL, size INTEGER NOT NULL, created REAL NOT NULL, started REAL, finished REAL,
    updated REAL NOT NULL, expires REAL, stage TEXT NOT NULL DEFAULT '', progress INTEGER NOT NULL DEFAULT 0,
    attempts INTEGER NOT NULL DEFAULT 0, worker TEXT, status INTEGER, headers TEXT, changes INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE UNIQUE INDEX IF NOT EXISTS jobs_by_key ON jobs(owner, key) WHERE key IS NOT NULL;
CREATE INDEX IF NOT EXISTS jobs_by_state ON jobs(state, created);
"""


class Exists(Exception):
    """The idempotency key was used before: for the same request (`same`), or for another."""

    def __init__(self, job: Job, same: bool) -> None:
        super().__init__(job.id)
        self.job = job
        self.same = same


_KEPT = "(expires IS NULL OR expires >= ?)"


class TooMany(Exception):
    """A quota is used up; the text says which."""


class Queue:
    def __init__(self, folder: Path, assets: Assets) -> None:
        self._folder = durable.private_folder(folder)
        self._files = durable.private_folder(folder / "files")
        self._workers = durable.private_folder(folder / "workers")
        self._assets = assets
        self._local = threading.local()
        with self._connection() as database:
            database.executescript(_SCHEMA)

    # Putting in and looking

    def submit(
        self, request: Stored, body: Body, *, owner: str, key: str | None, most: int, most_each: int, room: int
    ) -> Job:
        """Accepts a job; when this returns it is on the disk.

        `most` and `most_each` are how many may wait or run, in all and of one owner, `room` is bytes of all jobs.
        Raises `Exists`, `TooMany`, or `OSError`.
        """
        name = secrets.token_hex(16)
        digest = request.digest(body)
        if key is not None and (known := self._by_key(owner, key)) is not None:
            if self.find(known[0].id) is not None:
                raise Exists(known[0], known[1] == digest)
            self.forget(known[0])  # its time is over
        folder = durable.private_folder(self._files / name)
        try:
            for each in {value for _, value in request.query if is_id(value)}:
                self._assets.hold(each, folder / each.partition(":")[2])
            durable.write(folder / "body", body)
            durable.sync_folder(self._files)
            size = memoryview(body).nbytes
            now = time.time()
            with self._transaction() as database:
                self._check_quotas(database, owner, most, most_each, room - size)
                database.execute(
                    "INSERT INTO jobs(id, owner, state, request, key, digest, size, created, updated)"
                    " VALUES(?, ?, 'accepted', ?, ?, ?, ?, ?, ?)",
                    (name, owner, json.dumps(request.to_json()), key, digest, size, now, now),
                )
        except BaseException as failure:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(failure, sqlite3.IntegrityError) and key is not None:  # another was quicker with the same key
                known = self._by_key(owner, key)
                if known is not None:
                    raise Exists(known[0], known[1] == digest) from None
            raise
        found = self.find(name)
        assert found is not None, "what was committed is there"
        return found

    def find(self, name: str) -> Job | None:
        """None also for one whose time is over."""
        rows = self._select(f"SELECT * FROM jobs WHERE id = ? AND {_KEPT}", name, time.time())
        return Job.of(rows[0]) if rows else None

    def of(self, owner: str, most: int) -> list[Job]:
        """The newest jobs of an owner."""
        newest = f"SELECT * FROM jobs WHERE owner = ? AND {_KEPT} ORDER BY created DESC LIMIT ?"
        return [Job.of(row) for row in self._select(newest, owner, time.time(), most)]

    def counts(self) -> dict[str, int]:
        """How many jobs there are, by state."""
        return {row["state"]: row["n"] for row in self._select("SELECT state, COUNT(*) AS n FROM jobs GROUP BY state")}

    def body(self, job: Job) -> bytes:
        return (self._files / job.id / "body").read_bytes()

    def result(self, job: Job) -> bytes:
        return self._result(job, job.worker).read_bytes()

    def _result(self, job: Job, worker: str) -> Path:
        """Each worker writes a file of its own; the row says whose counts."""
        return self._files / job.id / f"result-{worker}"

    # Working off

    @contextlib.contextmanager
    def worker(self) -> Iterator[str]:
        """A name under which this process takes jobs; what it has not finished at the end waits again."""
        token = f"{os.getpid()}-{secrets.token_hex(8)}"
        path = self._workers / token
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield token
        finally:
            path.unlink(missing_ok=True)
            os.close(descriptor)

    def claim(self, worker: str) -> Job | None:
        """The job that has waited longest, now running; None where none waits."""
        if not self._select("SELECT 1 FROM jobs WHERE state = 'accepted' LIMIT 1"):
            return None
        with self._transaction() as database:
            row = database.execute(
                "UPDATE jobs SET state = 'running', worker = ?1, attempts = attempts + 1, started = ?2, updated = ?2,"
                " changes = changes + 1"
                " WHERE id = (SELECT id FROM jobs WHERE state = 'accepted' ORDER BY created LIMIT 1) RETURNING *",
                (worker, time.time()),
            ).fetchone()
        return Job.of(row) if row else None

    def report(self, job: Job, worker: str, stage: str, progress: int) -> bool:
        """Says how far a job is; false where it is no longer this worker's."""
        return self._update(
            "stage = ?, progress = ? WHERE id = ? AND worker = ? AND state = 'running'",
            (stage, progress, job.id, worker),
        )

    def is_running(self, job: Job, worker: str) -> bool:
        return bool(
            self._select("SELECT 1 FROM jobs WHERE id = ? AND worker = ? AND state = 'running'", job.id, worker)
        )

    def finish(self, job: Job, worker: str, status: int, headers: Mapping[str, str], body: Body, keep: float) -> bool:
        """Ends a job with its answer, kept for `keep` seconds; false where somebody dismissed it meanwhile."""
        folder = self._files / job.id
        result = self._result(job, worker)
        try:
            if not self.is_running(job, worker):
                return False
            durable.write(result, body)
        except FileNotFoundError:  # dismissed, and its files have gone
            return False
        state = State.SUCCESSFUL if status < 400 else State.FAILED
        now = time.time()
        done = self._update(
            "state = ?, status = ?, headers = ?, size = size + ?, finished = ?, expires = ?, progress = 100, stage = ''"
            " WHERE id = ? AND worker = ? AND state = 'running'",
            (
                state,
                status,
                json.dumps(dict(headers)),
                memoryview(body).nbytes,
                now,
                now + keep,
                job.id,
                worker,
            ),
        )
        if done:
            for held in folder.iterdir():
                if held.name not in ("body", result.name):
                    held.unlink()
        return done

    def release(self, job: Job, worker: str) -> None:
        """Lets a job wait again, as if it had not been begun."""
        self._update(
            "state = 'accepted', worker = NULL, attempts = attempts - 1, stage = '', progress = 0"
            " WHERE id = ? AND worker = ? AND state = 'running'",
            (job.id, worker),
        )

    def dismiss(self, job: Job, keep: float) -> bool:
        """Ends a job that has not ended; false where it has."""
        now = time.time()
        done = self._update(
            "state = 'dismissed', finished = ?, expires = ?, stage = ''"
            " WHERE id = ? AND state IN ('accepted', 'running')",
            (now, now + keep, job.id),
        )
        if done:
            shutil.rmtree(self._files / job.id, ignore_errors=True)
        return done

    def forget(self, job: Job) -> None:
        """Removes a job that has ended, and its files."""
        with self._transaction() as database:
            database.execute("DELETE FROM jobs WHERE id = ? AND state NOT IN ('accepted', 'running')", (job.id,))
        shutil.rmtree(self._files / job.id, ignore_errors=True)

    def recover(self) -> list[Job]:
        """Lets the jobs of processes that have died wait again; returns those that were running too often."""
        running = [Job.of(row) for row in self._select("SELECT * FROM jobs WHERE state = 'running'")]
        dead = {each.worker for each in running if not self._lives(each.worker)}
        given_up = []
        for job in running:
            if job.worker not in dead:
                continue
            if job.attempts >= MOST_ATTEMPTS:
                given_up.append(job)
                continue
            self._update(
                "state = 'accepted', worker = NULL, stage = '', progress = 0"
                " WHERE id = ? AND worker = ? AND state = 'running'",
                (job.id, job.worker),
            )
        return given_up

    def clean(self) -> None:
        """Forgets jobs whose time is over, and files that no row speaks of."""
        for row in self._select("SELECT * FROM jobs WHERE expires < ?", time.time()):
            self.forget(Job.of(row))
        known = {row["id"] for row in self._select("SELECT id FROM jobs")}
        for folder in self._files.iterdir():
            with contextlib.suppress(OSError):
                if folder.name not in known and time.time() - folder.stat().st_mtime > ABANDONED:
                    shutil.rmtree(folder, ignore_errors=True)
        for path in self._workers.iterdir():
            if not self._lives(path.name):
                path.unlink(missing_ok=True)

    # The database

    def _lives(self, worker: str) -> bool:
        try:
            descriptor = os.open(self._workers / worker, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            return False
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
        return False

    def _by_key(self, owner: str, key: str) -> tuple[Job, str] | None:
        rows = self._select("SELECT * FROM jobs WHERE owner = ? AND key = ?", owner, key)
        return (Job.of(rows[0]), rows[0]["digest"]) if rows else None

    @staticmethod
    def _check_quotas(database: sqlite3.Connection, owner: str, most: int, most_each: int, room: int) -> None:
        (waiting, own) = database.execute(
            "SELECT COUNT(*), COALESCE(SUM(owner = ?), 0) FROM jobs WHERE state IN ('accepted', 'running')", (owner,)
        ).fetchone()
        (stored,) = database.execute("SELECT COALESCE(SUM(size), 0) FROM jobs").fetchone()
        if waiting >= most:
            raise TooMany(f"{most} jobs wait or run already.")
        if own >= most_each:
            raise TooMany(f"{most_each} jobs of yours wait or run already.")
        if stored > room:
            raise TooMany("The disk space for jobs is used up.")

    def _update(self, rest: str, values: Sequence[Any]) -> bool:
        with self._transaction() as database:
            changed = database.execute(
                f"UPDATE jobs SET changes = changes + 1, updated = {time.time()!r}, {rest}", values
            )
            return changed.rowcount > 0

    def _select(self, statement: str, *values: Any) -> list[sqlite3.Row]:
        with self._connection() as database:
            return database.execute(statement, values).fetchall()

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._connection() as database:
            database.execute("BEGIN IMMEDIATE")
            try:
                yield database
                database.execute("COMMIT")
            except BaseException:
                if database.in_transaction:
                    database.execute("ROLLBACK")
                raise

    @contextlib.contextmanager
    def _connection(self) -> Iterator[sqlite3.Connection]:
        database: sqlite3.Connection | None = getattr(self._local, "database", None)
        if database is None:
            database = sqlite3.connect(self._folder / "jobs.sqlite", timeout=30, isolation_level=None)
            database.row_factory = sqlite3.Row
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA synchronous = FULL")
            self._local.database = database
        yield database
