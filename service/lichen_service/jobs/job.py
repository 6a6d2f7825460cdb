"""A job as a value: the request it stands for, where it is, and what is told of it."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

from lichen_service.http.message import Body, Head

PATH = "/v1/jobs"
KEPT_HEADERS = ("accept", "content-type")
"""What of a request's headers decides its answer."""


class State(StrEnum):
    ACCEPTED = "accepted"
    RUNNING = "running"
    SUCCESSFUL = "successful"
    FAILED = "failed"
    DISMISSED = "dismissed"


FINAL = frozenset((State.SUCCESSFUL, State.FAILED, State.DISMISSED))


@dataclass(frozen=True, slots=True)
class Stored:
    """All of a request that decides its answer, the body aside."""

    method: str
    path: str
    query: tuple[tuple[str, str], ...]
    headers: Mapping[str, str] = field(default_factory=dict)
    request_id: str = ""

    @classmethod
    def of(cls, head: Head) -> Stored:
        kept = {name: head.headers[name] for name in KEPT_HEADERS if name in head.headers}
        return cls(head.method, head.path, head.query, kept, head.request_id)

    def digest(self, body: Body) -> str:
        said = [self.method, self.path, self.query, dict(self.headers), hashlib.sha256(body).hexdigest()]
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()

    def to_json(self) -> dict[str, Any]:
        return {
            "method": self.method,
            "path": self.path,
            "query": self.query,
            "headers": dict(self.headers),
            "request_id": self.request_id,
        }

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Stored:
        query = tuple((name, each) for name, each in value["query"])
        return cls(value["method"], value["path"], query, value["headers"], value["request_id"])


@dataclass(frozen=True, slots=True)
class Job:
    id: str
    owner: str
    state: State
    request: Stored
    created: float
    started: float | None
    finished: float | None
    updated: float
    expires: float | None
    stage: str
    progress: int
    attempts: int
    worker: str
    status: int | None
    headers: Mapping[str, str]
    changes: int
    """how often anything of it changed"""

    @classmethod
    def of(cls, row: sqlite3.Row) -> Job:
        return cls(
            row["id"],
            row["owner"],
            State(row["state"]),
            Stored.from_json(json.loads(row["request"])),
            row["created"],
            row["started"],
            row["finished"],
            row["updated"],
            row["expires"],
            row["stage"],
            row["progress"],
            row["attempts"],
            row["worker"] or "",
            row["status"],
            json.loads(row["headers"] or "{}"),
            row["changes"],
        )

    def document(self) -> dict[str, Any]:
        """What clients are told."""
        own = f"{PATH}/{self.id}"
        links = {"self": own, "events": f"{own}/events"}
        if self.state in (State.SUCCESSFUL, State.FAILED):
            links["result"] = f"{own}/result"
        return {
            "id": self.id,
            "status": self.state,
            "progress": self.progress,
            "stage": self.stage,
            "path": self.request.path,
            "created": _moment(self.created),
            "started": _moment(self.started),
            "finished": _moment(self.finished),
            "updated": _moment(self.updated),
            "expires": _moment(self.expires),
            "links": links,
        }


def _moment(seconds: float | None) -> str | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds")
