"""Spans for OpenTelemetry: one for every answer, and below it one for each stage of its work.

Nothing is measured twice: what the access log says of an answer is what its spans are made of, after it has left. So a
request costs the same whether it is traced or not, and a line and a span never disagree. The trace that a client
began (`traceparent`) goes on here, and its word whether to record is kept; other requests begin traces of their own.

The packages are optional (`pip install 'lichen[telemetry]'`). Where spans go, how many are sampled and what the service
is called are said by OpenTelemetry's variables (OTEL_EXPORTER_OTLP_ENDPOINT, OTEL_TRACES_SAMPLER, OTEL_SERVICE_NAME).
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from lichen_service.settings import InvalidSettings

_ATTRIBUTES = {
    "method": "http.request.method",
    "route": "http.route",
    "path": "url.path",
    "status": "http.response.status_code",
    "bytes_in": "http.request.body.size",
    "bytes_out": "http.response.size",
    "peer": "network.peer.address",
    "client": "client.address",
    "problem": "error.type",
    "request_id": "lichen.request_id",
    "operation": "lichen.operation",
    "method_used": "lichen.method",
    "device": "lichen.device",
    "pixels": "lichen.pixels",
    "skipped": "lichen.skipped",
    "kept": "lichen.kept",
    "job": "lichen.job",
}
"""Fields of the access log and the attributes they become."""
MISSING = "traces need OpenTelemetry: pip install 'lichen[telemetry]'"


class Tracing:
    def __init__(self, provider: Any) -> None:
        """`provider` is a `TracerProvider`."""
        from opentelemetry import trace

        self._api = trace
        self._tracer = provider.get_tracer("lichen")

    def answered(self, line: Mapping[str, Any]) -> None:
        """Makes the spans of an answer that has just left, from its line in the access log."""
        api, ended = self._api, _moment(line["time"]) if "time" in line else time.time_ns()
        began = ended - _nanoseconds(line["total_ms"])
        span = self._tracer.start_span(
            f"{line['method']} {line.get('route', '')}".strip() or "malformed request",
            self._parent(line),
            api.SpanKind.SERVER,
            {name: line[field] for field, name in _ATTRIBUTES.items() if line.get(field) not in (None, "")},
            start_time=began,
        )
        if line["status"] >= 500:
            span.set_status(api.Status(api.StatusCode.ERROR))
        if span.is_recording():
            inside = api.set_span_in_context(span)
            at = began + _nanoseconds(line.get("receive_ms", 0.0))
            for stage, milliseconds in line.get("stages_ms", {}).items():
                after = at + _nanoseconds(milliseconds)
                self._tracer.start_span(stage, inside, start_time=at).end(after)
                at = after
        span.end(ended)

    def _parent(self, line: Mapping[str, Any]) -> Any:
        """The context that the client's span makes; an empty one where there is none."""
        from opentelemetry.context import Context

        if "trace_id" not in line:
            return Context()
        api = self._api
        flags = api.TraceFlags(int(line["trace_flags"], 16))
        known = api.SpanContext(
            int(line["trace_id"], 16), int(line["parent_id"], 16), is_remote=True, trace_flags=flags
        )
        return api.set_span_in_context(api.NonRecordingSpan(known), Context())


def start() -> Tracing:
    """Spans in batches to whatever speaks OTLP. What is not sent when the process ends is sent then.

    Raises `InvalidSettings` where the packages are not installed.
    """
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import SERVICE_NAME, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        raise InvalidSettings(MISSING) from None
    name = {} if "OTEL_SERVICE_NAME" in os.environ else {SERVICE_NAME: "lichen"}
    provider = TracerProvider(resource=Resource.create(name))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    return Tracing(provider)


def _moment(text: str) -> int:
    return int(datetime.fromisoformat(text).timestamp() * 1e9)


def _nanoseconds(milliseconds: float) -> int:
    return int(milliseconds * 1e6)
