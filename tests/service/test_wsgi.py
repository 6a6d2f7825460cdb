"""The WSGI adapter: checked by wsgiref's validator, and served by gunicorn."""

from __future__ import annotations

import contextlib
import http.client
import io
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from wsgiref.util import setup_testing_defaults
from wsgiref.validate import validator

import pytest

from lichen_service.app import Service
from lichen_service.http.access_log import AccessLog
from lichen_service.settings import InvalidSettings, Settings
from lichen_service.wsgi import Wsgi, create

from .conftest import Caller
from .test_server import ask, wait_until_ready

BLUR = "/v1/operations/gaussian"
Ask = Callable[..., tuple[int, dict[str, str], bytes]]


@pytest.fixture
def lines() -> io.StringIO:
    return io.StringIO()


@pytest.fixture
def through(service: Service, settings: Settings, lines: io.StringIO) -> Ask:
    """Sends a request through the adapter, between validators of both sides."""
    application = validator(Wsgi(service, settings, AccessLog(lines)))

    def send(
        method: str, path: str, body: bytes = b"", query: str = "", **fields: str
    ) -> tuple[int, dict[str, str], bytes]:
        environ: dict[str, Any] = {
            "REQUEST_METHOD": method,
            "SCRIPT_NAME": "",
            "PATH_INFO": path,
            "QUERY_STRING": query,
            "CONTENT_LENGTH": str(len(body)),
            "wsgi.input": io.BytesIO(body),
            "REMOTE_ADDR": "127.0.0.1",
            **fields,
        }
        setup_testing_defaults(environ)
        said: list[Any] = []
        answer = application(environ, lambda *told: said.append(told) or (lambda data: None))
        found = b"".join(answer)
        answer.close()  # type: ignore[attr-defined]
        return int(said[0][0][:3]), {name.lower(): value for name, value in said[0][1]}, found

    return send


def test_the_answer_is_that_of_our_own_wire(through: Ask, call: Caller, png: bytes, lines: io.StringIO) -> None:
    query = "sigma=2&device=numpy&format=png"
    status, headers, body = through("POST", BLUR, png, query, CONTENT_TYPE="image/png", HTTP_X_REQUEST_ID="mine")
    direct = call("POST", f"{BLUR}?{query}", png)
    assert (status, body) == (200, bytes(direct.body))
    for name in ("Content-Type", "ETag", "Content-Digest", "Lichen-Method", "Lichen-Error"):
        assert headers[name.lower()] == direct.headers[name]
    assert (headers["x-request-id"], headers["x-content-type-options"]) == ("mine", "nosniff")
    line = json.loads(lines.getvalue())
    assert (line["status"], line["bytes_in"], line["bytes_out"]) == (200, len(png), len(body))
    assert through("HEAD", "/v1/operations")[2] == b""
    again = through("POST", BLUR, png, query, HTTP_IF_NONE_MATCH=headers["etag"])
    assert (again[0], again[2]) == (304, b"")


def test_what_is_wrong_is_told_as_on_our_own_wire(through: Ask, settings: Settings, png: bytes) -> None:
    unread = io.BytesIO(b"x" * 10)
    for expected, code, answer in (
        (422, "invalid-request", through("POST", BLUR, png, "sigma=-1")),
        (404, "not-found", through("GET", "/nowhere")),
        (405, "method-not-allowed", through("PUT", BLUR)),
        (413, "too-large", through("POST", BLUR, CONTENT_LENGTH=str(settings.max_body + 1), **{"wsgi.input": unread})),
        (400, "incomplete-body", through("POST", BLUR, png, "sigma=1", CONTENT_LENGTH=str(len(png) + 1))),
        (411, "length-required", through("POST", BLUR, png, HTTP_TRANSFER_ENCODING="chunked")),
        (400, "malformed-target", through("GET", "/\xff")),
        (400, "malformed-timeout", through("GET", "/livez", HTTP_REQUEST_TIMEOUT="soon")),
    ):
        status, headers, body = answer
        assert (status, headers["x-problem-code"]) == (expected, code), body
        assert json.loads(body)["request_id"] == headers["x-request-id"]
    assert unread.tell() == 0, "it was refused before its body was read"


def test_an_application_that_anybody_may_reach_is_not_made_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LICHEN_DATA", str(tmp_path))
    with pytest.raises(InvalidSettings, match="LICHEN_INSECURE"):
        create()


@pytest.fixture
def gunicorn(tmp_path: Path) -> Iterator[int]:
    """The port of a gunicorn that serves us."""
    options = ["--worker-class", "gthread", "--threads", "2", "--bind", "127.0.0.1:0", "--graceful-timeout", "5"]
    process = subprocess.Popen(
        [sys.executable, "-m", "gunicorn", *options, "lichen_service.wsgi:create()"],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"LICHEN_DATA": str(tmp_path), "LICHEN_INSECURE": "on", "LICHEN_DEVICE": "numpy"},
    )
    try:
        assert process.stderr is not None
        port = next(int(found[1]) for line in process.stderr if (found := re.search(r"Listening at: .*:(\d+)", line)))
        wait_until_ready(port)
        yield port
    finally:
        process.terminate()
        said = process.communicate(timeout=30)[1]
    assert process.returncode == 0
    assert "SIGABRT" not in said, "a thread came back from a library to an interpreter that had gone"


def test_gunicorn_serves_it(gunicorn: int, call: Caller, png: bytes) -> None:
    target = f"{BLUR}?sigma=2&device=numpy&format=png"
    status, headers, body = ask(gunicorn, "POST", target, png, {"Content-Type": "image/png"})
    assert (status, body) == (200, bytes(call("POST", target, png).body))
    assert headers["content-length"] == str(len(body))
    location = ask(gunicorn, "POST", target, png, {"Prefer": "respond-async"})[1]["location"]
    status, headers, events = ask(gunicorn, "GET", f"{location}/events")
    assert (status, headers["content-type"]) == (200, "text/event-stream")
    assert b'"status":"successful"' in events
    ends = time.monotonic() + 60
    while ask(gunicorn, "GET", f"{location}/result")[0] != 200:
        assert time.monotonic() < ends
    assert ask(gunicorn, "GET", f"{location}/result")[2] == body
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", gunicorn, timeout=60)) as connection:
        connection.request("POST", target, iter([png[:100], png[100:]]), {"Content-Type": "image/png"})
        assert connection.getresponse().read() == body, "chunks make the same body"
