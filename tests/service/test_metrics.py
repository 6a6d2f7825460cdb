"""Figures: they count what happened, add up over processes, and no client can make them grow without end."""

from __future__ import annotations

import dataclasses
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from lichen_service.app import Service
from lichen_service.http.message import Head, Request, Response
from lichen_service.metrics import Metrics
from lichen_service.settings import FIGURES, Settings

from .conftest import Caller, problem_of

LINE = {"route": "/v1/limits", "method": "GET", "status": 200, "total_ms": 2.0, "bytes_in": 3, "bytes_out": 5}


def figures(text: bytes) -> dict[str, float]:
    """Samples by name and labels."""
    return {
        each.name + "".join(f" {name}={value}" for name, value in sorted(each.labels.items())): each.value
        for family in text_string_to_metric_families(text.decode())
        for each in family.samples
    }


@pytest.fixture
def metrics() -> Metrics:
    made = Metrics({"gaussian"}.__contains__)
    made.routes = frozenset(("/v1/limits", "/v1/operations/{name}"))
    return made


def test_an_answer_is_counted_once_in_each_figure(metrics: Metrics) -> None:
    metrics.answered([LINE])
    run = LINE | {
        "route": "/v1/operations/{name}",
        "method": "POST",
        "operation": "gaussian",
        "method_used": "fir; tail=0.0001",
        "device": "numpy",
        "pixels": 100,
        "skipped": 1,
        "queue_ms": 1.5,
        "kept": False,
        "stages_ms": {"decode": 1.0, "kernel": 2.0, "kernel.made-up": 2.0},
    }
    metrics.answered(
        [run, LINE | {"route": "/v1/pipelines", "kept": True}, LINE | {"status": 422, "problem": "invalid-request"}]
    )
    found = figures(metrics.text())
    assert found["lichen_requests_total method=GET route=/v1/limits status=200"] == 1
    assert found["lichen_requests_total method=GET route=/v1/limits status=422"] == 1
    assert found["lichen_problems_total code=invalid-request"] == 1
    assert found["lichen_runs_total device=numpy method=fir operation=gaussian"] == 1
    assert found["lichen_pixels_total"] == 100
    assert found["lichen_runs_with_skipped_work_total"] == 1
    assert found["lichen_queue_seconds_count"] == 1
    assert (found["lichen_results_total kept=no"], found["lichen_results_total kept=yes"]) == (1, 1)
    assert found["lichen_stage_seconds_count stage=kernel"] == 1
    assert not any("made-up" in name for name in found)
    assert found["lichen_received_bytes_total"] == 12
    assert found["lichen_sent_bytes_total"] == 20


def test_counting_together_is_counting_one_by_one(metrics: Metrics) -> None:
    lines = [LINE | {"total_ms": float(each)} for each in (0.1, 1.0, 1.001, 2.5, 7.0, 59_999.0, 60_000.0, 1e6)]
    metrics.answered(lines)
    other = Metrics({"gaussian"}.__contains__)
    other.routes = metrics.routes
    for line in lines:
        other._requests.labels(line["route"], line["method"], str(line["status"])).inc()
        other._seconds.labels(line["route"]).observe(line["total_ms"] / 1e3)
    whole, single = figures(metrics.text()), figures(other.text())
    told = [name for name in whole if name.startswith(("lichen_requests_total", "lichen_request_seconds_"))]
    assert len(told) > 15
    for name in told:
        if not name.startswith("lichen_request_seconds_created"):
            assert whole[name] == pytest.approx(single[name]), name


def test_no_client_can_make_a_label(metrics: Metrics) -> None:
    for at in range(100):
        metrics.answered([LINE | {"route": f"/made/up/{at}", "method": f"MADE{at}", "operation": f"made-{at}"}])
    assert sum("lichen_requests_total" in name for name in figures(metrics.text())) == 1


def test_what_is_gauged_is_asked_for_then(metrics: Metrics) -> None:
    states = {"accepted": 2.0}
    metrics.ask("lichen_jobs", "jobs by state", "state", lambda: states)
    assert figures(metrics.text())["lichen_jobs state=accepted"] == 2
    states["running"] = 1.0
    assert figures(metrics.text())["lichen_jobs state=running"] == 1


COUNTER = """
import os, signal, sys
from lichen_service.metrics import Metrics
metrics = Metrics({}.__contains__)
metrics.routes = frozenset(("/v1/limits",))
for _ in range(int(sys.argv[1])):
    metrics.answered([{"route": "/v1/limits", "method": "GET", "status": 200, "total_ms": 2.0, "bytes_in": 0,
                       "bytes_out": 1}])
metrics.held(1000)
if sys.argv[2] == "die":
    os.kill(os.getpid(), signal.SIGKILL)
sys.stdout.buffer.write(metrics.text())
"""


def test_processes_are_added_up_and_the_dead_hold_nothing(tmp_path: Path) -> None:
    environment = os.environ | {FIGURES: str(tmp_path)}

    def count(times: int, end: str) -> bytes:
        command = [sys.executable, "-c", COUNTER, str(times), end]
        return subprocess.run(command, env=environment, capture_output=True, check=False, timeout=120).stdout

    count(3, "die")
    found = figures(count(4, "print"))
    assert found["lichen_requests_total method=GET route=/v1/limits status=200"] == 7
    assert found["lichen_image_bytes"] == 1000


def test_the_service_tells_its_figures(call: Caller, png: bytes) -> None:
    call("POST", "/v1/operations/gaussian?sigma=1&device=numpy", png)
    response = call("GET", "/metrics")
    assert response.headers["Content-Type"].startswith("text/plain")
    assert figures(bytes(response.body))["lichen_image_bytes"] == 0
    assert response.log["route"] == "/metrics"
    unknown = call("GET", "/nowhere")
    problem_of(unknown, 404, "not-found")
    assert "route" not in unknown.log


def test_what_is_told_at_an_address_of_its_own_is_told_nowhere_else(settings: Settings, tmp_path: Path) -> None:
    own = dataclasses.replace(settings, metrics="127.0.0.1:0", data=str(tmp_path), jobs="off")
    service = Service(own)

    def status(path: str, apart: bool) -> int:
        head = Head("GET", path, (), {}, "test-request", 0.0, math.inf, apart=apart)
        answer = service.admit(head)
        return (answer if isinstance(answer, Response) else service.handle(Request(head, b"", answer.caller))).status

    assert {path: status(path, False) for path in ("/metrics", "/livez", "/v1/limits")} == {
        "/metrics": 404,
        "/livez": 200,
        "/v1/limits": 200,
    }
    assert {path: status(path, True) for path in ("/metrics", "/livez", "/v1/limits", "/")} == {
        "/metrics": 200,
        "/livez": 200,
        "/v1/limits": 404,
        "/": 404,
    }
    service.drain()
    assert status("/readyz", True) == 503, "where clients can still ask whether they should come"
    assert status("/livez", True) == 200
