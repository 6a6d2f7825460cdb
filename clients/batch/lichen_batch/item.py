"""One piece of work, as it is handed to whoever does it, and what came of it: plain values that JSON carries."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

OK, FAILED = "ok", "failed"


@dataclass(frozen=True, slots=True)
class Item:
    """What is to be done under one id: `operation` is a name, or `pipeline` or `scene` is a document."""

    id: str
    operation: str | None
    pipeline: Mapping[str, Any] | None
    inputs: Mapping[str, str]
    """places by the names of inputs"""
    outputs: Mapping[str, str]
    """places by the names of outputs; an operation's is called result"""
    formats: Mapping[str, str]
    """formats by the names of outputs"""
    values: Mapping[str, Any] = field(default_factory=dict)
    """parameters, knobs and the service's own names"""
    digest: str = ""
    """stands for all of this and for the engine that does it"""
    scene: Mapping[str, Any] | None = None

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Item:
        return cls(**value)

    def digested(self, engine: str) -> str:
        """The digest for an engine of this version."""
        said = {**self.to_json(), "digest": engine}
        return hashlib.sha256(json.dumps(said, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Problem:
    """Why an item failed."""

    code: str
    detail: str
    errors: tuple[Mapping[str, str], ...] = ()
    retryable: bool = False
    """whether the same item may succeed another time"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one try."""

    id: str
    digest: str
    status: str
    seconds: Mapping[str, float]
    """by stage: read, ask, write; and what the engine tells of its own"""
    method: str = ""
    device: str = ""
    error: float | None = None
    """the largest error the result may have, as stated"""
    kind: str = ""
    measured: float | None = None
    skipped: str = ""
    outputs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    findings: Any = None
    problem: Problem | None = None
    peak_bytes: int = 0
    """memory its process held at most"""
    line: bytes = field(default=b"", compare=False, repr=False)
    """the JSON it was read from, where it was"""

    @property
    def ok(self) -> bool:
        return self.status == OK

    @property
    def whole(self) -> float:
        """Seconds of all stages together."""
        return sum(taken for stage, taken in self.seconds.items() if "." not in stage)

    def to_json(self) -> dict[str, Any]:
        """Without what is empty."""
        said = {name: value for name in _TOLD if (value := getattr(self, name)) or isinstance(value, float)}
        if self.problem is not None:
            said["problem"] = asdict(self.problem)
        return said

    def to_line(self) -> bytes:
        """The same as text, in one line without its end."""
        return self.line or json.dumps(self.to_json(), separators=(",", ":")).encode()

    @classmethod
    def from_json(cls, value: Mapping[str, Any], line: bytes = b"") -> Outcome:
        problem = value.get("problem")
        if problem is not None:
            value = {**value, "problem": Problem(**{**problem, "errors": tuple(problem.get("errors", ()))})}
        return cls(**{"digest": "", "seconds": {}, **value}, line=line)

    @classmethod
    def from_line(cls, line: bytes) -> Outcome:
        return cls.from_json(json.loads(line), line)


_TOLD = tuple(each.name for each in fields(Outcome) if each.name != "line")


def failure(item: Item, problem: Problem, seconds: Mapping[str, float] | None = None, peak: int = 0) -> Outcome:
    return Outcome(item.id, item.digest, FAILED, seconds or {}, problem=problem, peak_bytes=peak)
