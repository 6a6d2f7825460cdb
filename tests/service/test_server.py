"""The whole service as a process: it starts from the command line, answers over a socket, and ends when told to."""

from __future__ import annotations

import http.client
import http.server
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from lichen.files import decode
from lichen_cli.main import main

from .conftest import form

BLUR = "/v1/operations/gaussian"
TRACE, PARENT = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"


@contextmanager
def served(**environment: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A server on a free port, ready to be asked; ended when left, and in order unless it was killed."""
    command = [sys.executable, "-m", "lichen_service", "--port", "0", "--workers", "1", "--threads", "2"]
    data = tempfile.mkdtemp(prefix="lichen-test-")
    process = subprocess.Popen(
        [*command, "--max-body", "1000000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"LICHEN_DATA": data} | environment,
    )
    try:
        assert process.stdout is not None
        announced = re.search(r"http://127\.0\.0\.1:(\d+)", process.stdout.readline())
        assert announced
        port = int(announced[1])
        wait_until_ready(port)
        yield process, port
    finally:
        killed = process.poll() == -signal.SIGKILL
        process.terminate()
        assert killed or process.wait(30) == 0
        process.stdout.close()
        shutil.rmtree(data, ignore_errors=True)


def wait_until_ready(port: int) -> None:
    for _ in range(9000):
        if ask(port, "GET", "/readyz")[0] == 200:
            return
        time.sleep(0.1)
    raise AssertionError("the service did not become ready")


def ask(
    port: int, method: str, target: str, body: bytes = b"", headers: dict[str, str] | None = None
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request(method, target, body or None, headers or {})
        response = connection.getresponse()
        return response.status, {name.lower(): value for name, value in response.getheaders()}, response.read()
    finally:
        connection.close()


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with served() as (_, port):
        yield port


def test_pixels_go_in_and_come_out(port: int, png: bytes) -> None:
    for method in ("POST", "QUERY"):
        status, headers, body = ask(port, method, f"{BLUR}?sigma=2", png, {"Content-Type": "image/png"})
        assert status == 200
        assert headers["content-type"] == "image/png"
        assert {"server-timing", "lichen-method", "lichen-error", "etag", "content-digest", "x-request-id"} <= set(
            headers
        )
        assert decode(body).pixels.shape == decode(png).pixels.shape


def test_the_server_computes_what_the_routes_compute(port: int, png: bytes) -> None:
    target = f"{BLUR}?sigma=2&method=fir&device=numpy&format=npy&storage=float32"
    first, second = (ask(port, "POST", target, png)[2] for _ in range(2))
    assert first == second


def test_a_known_tag_is_answered_without_a_body(port: int, png: bytes) -> None:
    tag = ask(port, "POST", f"{BLUR}?sigma=3", png)[1]["etag"]
    status, headers, body = ask(port, "POST", f"{BLUR}?sigma=3", png, {"If-None-Match": tag})
    assert (status, headers["etag"], body) == (304, tag, b"")


def test_a_form_crosses_the_wire(port: int, png: bytes) -> None:
    body, headers = form({"image": (png, "image/png")})
    assert ask(port, "POST", f"{BLUR}?sigma=1", body, headers)[0] == 200


def test_head_and_options_have_no_body(port: int) -> None:
    status, headers, body = ask(port, "HEAD", "/v1/operations")
    assert (status, body) == (200, b"")
    assert int(headers["content-length"]) == len(ask(port, "GET", "/v1/operations")[2])
    status, headers, body = ask(port, "OPTIONS", BLUR)
    assert (status, headers["allow"], body) == (204, "GET, HEAD, OPTIONS, POST, QUERY", b"")


def test_refusals_leave_the_server_answering(port: int, png: bytes) -> None:
    refused = [
        (ask(port, "POST", f"{BLUR}?sigma=-1&nonsense=1", png), 422),
        (ask(port, "POST", f"{BLUR}?sigma=1", png[:50]), 422),
        (ask(port, "POST", f"{BLUR}?sigma=1", bytes(1_000_001)), 413),
        (ask(port, "POST", f"{BLUR}?sigma=1", b"{}", {"Content-Type": "application/json"}), 415),
        (ask(port, "POST", f"{BLUR}?sigma=1", png, {"Accept": "text/html"}), 406),
        (ask(port, "PUT", BLUR, png), 405),
        (ask(port, "GET", "/nowhere"), 404),
    ]
    for (status, headers, body), expected in refused:
        assert status == expected
        assert headers["content-type"] == "application/problem+json"
        assert json.loads(body)["request_id"] == headers["x-request-id"]
        assert headers["x-problem-code"] == json.loads(body)["code"]
    assert ask(port, "POST", f"{BLUR}?sigma=1", png)[0] == 200


def test_figures_add_up_what_was_answered(port: int, png: bytes) -> None:
    def count() -> float:
        text = ask(port, "GET", "/metrics")[2].decode()
        lines = [line for line in text.splitlines() if line.startswith("lichen_runs_total{") and "levels" in line]
        return sum(float(line.rpartition(" ")[2]) for line in lines)

    before = count()  # of an operation that no other test runs: an answer is counted a moment after it has left
    assert ask(port, "POST", "/v1/operations/levels?gamma=2", png)[0] == 200
    for _ in range(600):
        if count() == before + 1:
            break
        time.sleep(0.1)
    assert count() == before + 1


def test_a_doctor_examines_a_running_service(port: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json", "--url", f"http://127.0.0.1:{port}"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["sound"]
    assert {each["name"] for each in found["checks"]} >= {"answers", "is ready", "computes what we compute", "counts"}
    assert main(["doctor", "--json", "--url", "http://127.0.0.1:9"]) == 1
    assert json.loads(capsys.readouterr().out)["checks"][0]["works"] is False


@pytest.fixture
def collector() -> Iterator[tuple[int, list[Any]]]:
    """Something that speaks OTLP: its port, and the spans it has been sent."""
    found: list[Any] = []

    class Collector(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            sent = ExportTraceServiceRequest.FromString(body)
            found.extend(span for each in sent.resource_spans for scope in each.scope_spans for span in scope.spans)
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Collector) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port, found
        server.shutdown()


def test_numpy_serves_alone_and_what_spans_were_not_sent_are_sent_at_the_end(
    collector: tuple[int, list[Any]], png: bytes
) -> None:
    port, found = collector
    traces = {"LICHEN_TRACES": "on", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": f"http://127.0.0.1:{port}/v1/traces"}
    header = {"traceparent": f"00-{TRACE}-{PARENT}-01"}
    with served(LICHEN_DEVICE="numpy", **traces) as (process, own):
        status, headers, body = ask(own, "POST", f"{BLUR}?sigma=2&format=npy&storage=float32", png, header)
        assert (status, headers["lichen-device"]) == (200, "numpy")
        assert np.isfinite(decode(body).pixels).all()
        version = json.loads(ask(own, "GET", "/v1/version")[2])
        assert version["opencl"]["available"] is False
        assert version["opencl"]["reason"]
        refused = ask(own, "POST", f"{BLUR}?sigma=2&device=opencl", png)
        assert (refused[0], refused[1]["x-problem-code"]) == (503, "device-failure")
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
    mine = [each for each in found if each.trace_id.hex() == TRACE]
    (request,) = (each for each in mine if each.parent_span_id.hex() == PARENT)
    assert request.name == "POST /v1/operations/{name}"
    assert {"queue", "decode", "kernel", "encode"} <= {each.name for each in mine}
