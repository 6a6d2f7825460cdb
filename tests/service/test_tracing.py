"""Spans are what the access log says, in the trace that the client began. `test_server` has them sent."""

from __future__ import annotations

from typing import Any

import pytest
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.trace import SpanKind, StatusCode

from lichen_service import tracing
from lichen_service.tracing import Tracing

TRACE, PARENT = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"
LINE: dict[str, Any] = {
    "request_id": "a",
    "method": "POST",
    "route": "/v1/operations/{name}",
    "path": "/v1/operations/gaussian",
    "status": 200,
    "bytes_in": 12,
    "bytes_out": 34,
    "total_ms": 100.0,
    "receive_ms": 10.0,
    "operation": "gaussian",
    "stages_ms": {"queue": 1.0, "decode": 20.0, "kernel": 30.0},
}


@pytest.fixture
def spans() -> InMemorySpanExporter:
    return InMemorySpanExporter()


@pytest.fixture
def told(spans: InMemorySpanExporter) -> Tracing:
    provider = TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(spans))
    return Tracing(provider)


def test_stages_lie_inside_the_request_one_after_the_other(told: Tracing, spans: InMemorySpanExporter) -> None:
    told.answered(LINE)
    *stages, request = spans.get_finished_spans()
    assert (request.name, request.kind) == ("POST /v1/operations/{name}", SpanKind.SERVER)
    assert request.attributes is not None
    assert request.attributes["http.response.status_code"] == 200
    assert request.attributes["lichen.operation"] == "gaussian"
    assert request.parent is None
    assert [each.name for each in stages] == ["queue", "decode", "kernel"]
    assert request.start_time is not None
    assert request.end_time == request.start_time + 100_000_000
    at = request.start_time + 10_000_000
    for each, milliseconds in zip(stages, (1, 20, 30), strict=True):
        assert each.parent is not None
        assert each.parent.span_id == request.context.span_id
        assert (each.start_time, each.end_time) == (at, at + milliseconds * 1_000_000)
        at += milliseconds * 1_000_000


def test_a_trace_goes_on_where_its_client_records_it(told: Tracing, spans: InMemorySpanExporter) -> None:
    known = {**LINE, "trace_id": TRACE, "parent_id": PARENT, "trace_flags": "01"}
    told.answered(known)
    for each in spans.get_finished_spans():
        assert f"{each.context.trace_id:032x}" == TRACE
    assert f"{spans.get_finished_spans()[-1].parent.span_id:016x}" == PARENT
    spans.clear()
    told.answered({**known, "trace_flags": "00"})
    assert spans.get_finished_spans() == ()


def test_failures_are_marked_and_refusals_are_not(told: Tracing, spans: InMemorySpanExporter) -> None:
    for status, marked in ((422, StatusCode.UNSET), (500, StatusCode.ERROR)):
        told.answered({"method": "", "status": status, "total_ms": 1.0})
        assert spans.get_finished_spans()[-1].status.status_code is marked


def test_without_the_packages_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "opentelemetry.sdk.trace", None)
    with pytest.raises(tracing.InvalidSettings, match="telemetry"):
        tracing.start()
