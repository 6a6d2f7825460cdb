"""One item done: its inputs read, a service asked, or the same service inside this process, and its outputs written.

Whatever goes wrong becomes an outcome that says what, and whether another try may help. Outputs are laid beside their
places, and who is told the outcome keeps them (see `keeping`).
"""

from __future__ import annotations

import hashlib
import resource
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from lichen_batch import places
from lichen_batch.item import OK, Item, Outcome, Problem, failure

if TYPE_CHECKING:
    from lichen_client import Client, Result
    from lichen_client.results import Results


class Failed(Exception):
    """The item cannot be done; carries why."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.detail)
        self.problem = problem


def perform(client: Client, item: Item, token: str) -> Outcome:
    """What came of one try, whose outputs were laid under `token`. Raises nothing that a try can bring about."""
    seconds: dict[str, float] = {}
    try:
        with _timed(seconds, "read"):
            data = {name: _read(place) for name, place in item.inputs.items()}
        with _timed(seconds, "ask"):
            made, findings = _ask(client, item, data)
        with _timed(seconds, "write"):
            outputs = {name: _lay(place, made[name], token) for name, place in item.outputs.items()}
    except Failed as failed:
        return failure(item, failed.problem, seconds, _peak())
    except MemoryError:
        return failure(item, Problem("out-of-memory", "The memory of the process was used up."), seconds, _peak())
    first = next(iter(made.values()), None)
    if first is None:
        return Outcome(item.id, item.digest, OK, seconds, findings=findings, peak_bytes=_peak())
    report = first.report
    return Outcome(
        item.id,
        item.digest,
        OK,
        {**seconds, **{f"ask.{name}": round(taken, 6) for name, taken in report.timing.items() if "." not in name}},
        report.method,
        report.device,
        None if report.error is None else report.error.value,
        "" if report.error is None else report.error.kind,
        None if report.measured is None else report.measured.largest,
        report.skipped,
        outputs,
        findings,
        peak_bytes=_peak(),
    )


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    began = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = round(time.perf_counter() - began, 6)


def _read(place: str) -> bytes:
    try:
        return places.read(place)
    except FileNotFoundError:
        raise Failed(Problem("missing-input", f"{place}: there is no such file")) from None
    except Exception as wrong:  # every kind of file system has errors of its own
        raise Failed(Problem("unreadable-input", f"{place}: {_said(wrong)}", retryable=True)) from wrong


def _lay(place: str, result: Result, token: str) -> dict[str, Any]:
    body = memoryview(result.body)
    try:
        places.lay(place, body, token)
    except Exception as wrong:  # as above
        raise Failed(unwritable(place, wrong)) from wrong
    return {
        "place": place,
        "bytes": len(body),
        "sha256": hashlib.sha256(body).hexdigest(),
        "media_type": result.media_type,
    }


def _ask(client: Client, item: Item, data: Mapping[str, bytes]) -> tuple[Mapping[str, Result], Any]:
    """What was made by the names of outputs, and findings."""
    from lichen_client import ConnectionFailed, StatusError

    try:
        if item.scene is not None:
            format = next(iter(item.formats.values()))
            picture = client.render(item.scene, images=data, format=format, **item.values)
            return dict.fromkeys(item.outputs, picture), None
        if item.operation is None:
            assert item.pipeline is not None, "an item has an operation or a pipeline"
            results: Results = client.run_pipeline(item.pipeline, images=data, **item.values)
            return results, results.findings or None
        if not item.outputs:
            return {}, client.find(item.operation, images=data, **item.values)
        format = next(iter(item.formats.values()))
        result = client.run(item.operation, images=data, format=format, **item.values)
        return dict.fromkeys(item.outputs, result), result.findings or None
    except StatusError as refused:
        errors = tuple({"pointer": each.pointer, "detail": each.detail} for each in refused.errors)
        detail = refused.detail or refused.title or f"status {refused.status}"
        raise Failed(Problem(refused.code or str(refused.status), detail, errors, refused.retryable)) from refused
    except ConnectionFailed as failed:
        raise Failed(Problem("no-answer", str(failed), retryable=True)) from failed


def unwritable(place: str, wrong: Exception) -> Problem:
    return Problem("unwritable-output", f"{place}: {_said(wrong)}", retryable=True)


def _said(wrong: Exception) -> str:
    return str(getattr(wrong, "strerror", None) or wrong or type(wrong).__name__)


def _peak() -> int:
    """The most memory this process has held, in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
