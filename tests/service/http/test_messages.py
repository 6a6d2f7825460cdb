"""What leaves: finished answers, problem documents, log lines."""

from __future__ import annotations

import io
import json
import re
import time
from dataclasses import dataclass
from datetime import datetime

import pytest

from lichen_service.http.access_log import LONGEST_QUERY, AccessLog, shown_query
from lichen_service.http.exchange import Exchange
from lichen_service.http.finish import BadResponse, choose_request_id, finish
from lichen_service.http.message import Response
from lichen_service.problems import problem, to_json


def finished(response: Response, method: str = "GET", keep_alive: bool = True) -> tuple[str, dict[str, str], bytes]:
    wire = finish(response, request_id="id", method=method, keep_alive=keep_alive)
    first, *lines = wire.head.decode("latin-1").removesuffix("\r\n\r\n").split("\r\n")
    return first, dict(line.split(": ", 1) for line in lines), bytes(wire.body)


def test_headers_are_completed() -> None:
    first, headers, body = finished(
        Response(200, b"hello", {"Content-Type": "text/plain", "server": "x/1", "date": "y"})
    )
    assert first == "HTTP/1.1 200 OK"
    assert headers.pop("Date").endswith(" GMT")
    assert headers == {
        "X-Request-ID": "id",
        "X-Content-Type-Options": "nosniff",
        "Content-Security-Policy": "sandbox; default-src 'none'",
        "Content-Type": "text/plain",
        "Content-Length": "5",
        "Connection": "keep-alive",
    }
    assert body == b"hello"


def test_a_policy_of_the_routes_own_is_the_only_one() -> None:
    policy = "default-src 'self'"
    _, headers, _ = finished(Response(200, b"", {"content-security-policy": policy}))
    assert {name.lower(): value for name, value in headers.items()}["content-security-policy"] == policy
    assert "Content-Security-Policy" not in headers


def test_head_keeps_the_length_and_drops_the_body() -> None:
    _, headers, body = finished(Response(200, b"hello"), method="HEAD", keep_alive=False)
    assert (headers["Content-Length"], headers["Connection"], body) == ("5", "close", b"")


@pytest.mark.parametrize("status", [204, 304])
def test_answers_without_body_have_no_length(status: int) -> None:
    _, headers, body = finished(Response(status, b"hello"))
    assert "Content-Length" not in headers
    assert body == b""


@pytest.mark.parametrize(
    "response",
    [
        Response(200, headers={"X-Note": "a\r\nb"}),
        Response(200, headers={"X-Note": "a\nb"}),
        Response(200, headers={"X-Note": "a\0b"}),
        Response(200, headers={"X-Note": "\u20ac"}),
        Response(200, headers={"X Note": "a"}),
        Response(200, headers={"": "a"}),
        Response(200, headers={"A": "1", "a": "2"}),
        Response(405),
        Response(401),
        Response(100),
        Response(600),
    ],
)
def test_what_must_not_leave(response: Response) -> None:
    with pytest.raises(BadResponse):
        finished(response)


def test_allow_suffices_for_405() -> None:
    assert finished(Response(405, headers={"Allow": "GET"}))[0] == "HTTP/1.1 405 Method Not Allowed"


def test_fresh_request_ids_are_never_the_same() -> None:
    drawn = [choose_request_id(None) for _ in range(1000)]
    assert len(set(drawn)) == 1000
    assert all(re.fullmatch("[0-9a-f]{32}", each) for each in drawn)


@pytest.mark.parametrize("offered", ["abc", "A.b_c-9", "x" * 128])
def test_harmless_request_ids_are_kept(offered: str) -> None:
    assert choose_request_id(offered) == offered


@pytest.mark.parametrize("offered", [None, "", "x" * 129, "a b", "a\nb", "a\n", "\u00e9", "a/b", "a, b"])
def test_other_request_ids_are_replaced(offered: str | None) -> None:
    fresh = choose_request_id(offered)
    assert fresh != offered
    assert len(fresh) == 32
    assert choose_request_id(offered) != fresh


def test_bodies_of_any_shape_leave_whole() -> None:
    np = pytest.importorskip("numpy")
    pixels = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    for array in (pixels, pixels[:, ::2], np.asfortranarray(pixels), pixels[:0]):
        exchange = Exchange("id", method="GET")
        exchange.answer(Response(200, memoryview(array)))
        assert b"".join(exchange.out).split(b"\r\n\r\n", 1)[1] == array.tobytes()


@dataclass(frozen=True)
class Bad:
    pointer: str
    detail: str


def test_problem_documents() -> None:
    response = problem(
        413,
        "too-large",
        "Too large",
        "At most 10 bytes.",
        request_id="id",
        errors=[Bad("/parameters/sigma", "must be finite")],
        limit=10,
        actual=float("inf"),
        headers={"Retry-After": "1"},
    )
    assert json.loads(bytes(response.body)) == {
        "type": "/problems/too-large",
        "title": "Too large",
        "status": 413,
        "detail": "At most 10 bytes.",
        "instance": "urn:lichen:request:id",
        "code": "too-large",
        "request_id": "id",
        "retryable": False,
        "errors": [{"pointer": "/parameters/sigma", "detail": "must be finite"}],
        "limit": 10,
        "actual": None,
    }
    assert response.headers == {
        "Content-Type": "application/problem+json",
        "X-Problem-Code": "too-large",
        "Cache-Control": "no-store",
        "Retry-After": "1",
    }
    assert "errors" not in json.loads(bytes(problem(404, "x", "y", "z", request_id="id").body))


def test_json_never_holds_nan() -> None:
    nan, inf = float("nan"), float("inf")
    assert (
        to_json({"a": [nan, (inf, -inf)], "b": {"c": nan}, "d": 1.5})
        == b'{"a":[null,[null,null]],"b":{"c":null},"d":1.5}'
    )
    assert to_json("\ud800\u20ac") == '"?\u20ac"'.encode()


@dataclass
class Line:
    """An exchange as the log sees it."""

    fields: dict[str, object]

    def record(self) -> dict[str, object]:
        return self.fields


def test_log_lines_cannot_be_forged() -> None:
    stream = io.StringIO()
    log = AccessLog(stream)
    log.answered(Line({"path": '/a\n{"event":"forged"}\x1b[2J', "error": float("nan"), "odd": {1}, "raw": object}))
    log.flush()
    (line,) = stream.getvalue().splitlines()
    written = json.loads(line)
    assert written["path"] == '/a\n{"event":"forged"}\x1b[2J'
    assert (written["error"], written["odd"], written["event"]) == (None, [1], "request")
    assert written["raw"] == str(object)
    assert datetime.fromisoformat(written["time"]).timestamp() == pytest.approx(time.time(), abs=60)


def test_a_line_that_is_not_unicode_is_written_all_the_same() -> None:
    stream, told = io.StringIO(), []
    log = AccessLog(stream, tell=told.extend)
    for path in ("/a", "/\ud800"):
        log.answered(Line({"path": path}))
    log.flush()
    assert [json.loads(line)["path"] for line in stream.getvalue().splitlines()] == ["/a", "/?"]
    assert [line["path"] for line in told] == ["/a", "/\ud800"]


def test_queries_are_shown_short_and_without_secrets() -> None:
    assert shown_query("sigma=5&token=a&X-Api-Key=b&c=d") == "sigma=5&token=***&X-Api-Key=***&c=d"
    assert len(shown_query("a=" + "b" * 4000)) == LONGEST_QUERY + 3
