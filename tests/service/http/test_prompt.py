"""Answers known by the bytes of their requests: the same as the long road gives, and only where they may be given."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from wire_harness import PATIENCE, Client, Reply, Running, get, post

from lichen_service.http.exchange import Exchange
from lichen_service.http.limits import Bounds
from lichen_service.http.message import Response
from lichen_service.http.policy import read_head
from lichen_service.http.prompt import MOST, Prompts

Serve = Callable[..., Running]
KNOWN = get("/lasting", "X-Bytes: 7")
MOMENTARY = ("date", "x-request-id")
NAMES = ("X-Request-ID", "x-request-id", "X-REQUEST-Id")


def ask(client: Client, request: bytes, method: str = "GET") -> Reply:
    client.send(request)
    return client.reply(method)


def test_a_repeated_request_is_answered_as_the_first_one_was(serve: Serve) -> None:
    running = serve()
    with running.connect() as client:
        replies = [ask(client, KNOWN) for _ in range(20)]
    assert running.toy.admitted == 1
    assert {reply.body for reply in replies} == {b"x" * 7}
    plain = [{name: value for name, value in each.headers.items() if name != "date"} for each in replies]
    assert len({each.pop("x-request-id") for each in plain}) == 20
    assert all(each == plain[0] for each in plain)
    assert list(replies[0].headers) == list(replies[1].headers)
    running.stop()
    lines = running.lines()
    assert len(lines) == 20
    assert {line.pop("request_id") for line in lines} == {each.headers["x-request-id"] for each in replies}
    assert all(line.pop("total_ms") < 20_000 and line.pop("time") for line in lines)  # type: ignore[operator]
    assert all(line == lines[0] for line in lines)
    assert (lines[0]["path"], lines[0]["status"], lines[0]["route"]) == ("/lasting", 200, "/lasting")


def test_an_id_of_the_clients_own_is_echoed_and_decides_nothing(serve: Serve) -> None:
    running = serve()
    offered = ["first", "second", "a" * 128, "1"]
    with running.connect() as client:
        replies = [ask(client, get("/lasting", f"{name}: {each}")) for each in offered for name in NAMES]
        fresh = ask(client, get("/lasting"))
    assert running.toy.admitted == 1
    assert [each.headers["x-request-id"] for each in replies] == [each for each in offered for _ in NAMES]
    assert len(fresh.headers["x-request-id"]) == 32
    running.stop()
    assert [each["request_id"] for each in running.lines()][:-1] == [each for each in offered for _ in NAMES]


def test_two_ids_and_ids_with_control_characters_are_refused_as_ever(serve: Serve) -> None:
    running = serve()
    with running.connect() as client:
        ask(client, get("/lasting", "X-Request-ID: a"))
    for fields in (("X-Request-ID: a", "X-Request-ID: b"), ("X-Request-ID: a\x07",), ("X-Request-ID : a",)):
        with running.connect() as client:
            assert ask(client, get("/lasting", *fields)).status == 400


def test_other_connections_know_it_too_and_head_is_not_get(serve: Serve) -> None:
    running = serve()
    head = KNOWN.replace(b"GET", b"HEAD")
    for _ in range(3):
        with running.connect() as client:
            assert ask(client, KNOWN).body == b"x" * 7
            assert ask(client, head, "HEAD").headers["content-length"] == "7"
            assert ask(client, KNOWN).body == b"x" * 7
    assert running.toy.admitted == 2


def test_requests_cut_joined_or_with_a_body_are_read_as_ever(serve: Serve) -> None:
    running = serve()
    with running.connect() as client:
        assert ask(client, KNOWN).body == b"x" * 7
        for at in range(1, len(KNOWN)):
            client.send(KNOWN[:at])
            client.send(KNOWN[at:])
            assert client.reply().body == b"x" * 7
        client.send(KNOWN * 3 + post("/echo", b"hello") + KNOWN)
        assert [client.reply().body for _ in range(5)] == [b"x" * 7] * 3 + [b"hello", b"x" * 7]
        client.send(KNOWN + b"GET / HTTP/9.9\r\n\r\n")
        assert [client.reply().status for _ in range(2)] == [200, 505]


def test_a_connection_ends_after_its_last_request_all_the_same(serve: Serve) -> None:
    running = serve(bounds=Bounds(requests_per_connection=5))
    with running.connect() as client:
        replies = [ask(client, KNOWN) for _ in range(5)]
        assert client.rest() == b""
    assert [reply.headers["connection"] for reply in replies] == ["keep-alive"] * 4 + ["close"]


def test_a_client_that_does_not_read_waits_for_its_answers_and_gets_them_whole(serve: Serve) -> None:
    running, large = serve(), get("/lasting", "X-Bytes: 65000")
    with running.connect() as client:
        ask(client, large)
        for _ in range(400):
            client.send(large)
        assert all(client.reply().body == b"x" * 65000 for _ in range(400))


@pytest.mark.parametrize(
    "request_",
    [
        get("/lasting", "X-Request-ID: not/echoed"),
        get("/lasting", "traceparent: 00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"),
        get("/lasting", "Connection: close"),
        get("/lasting", version="1.0"),
        get("/lasting?a=b"),
        get("/refused"),
        get("/lasting", "X-Bytes: 70000"),
        post("/lasting", b"hello"),
    ],
)
def test_what_may_differ_is_not_kept(serve: Serve, request_: bytes) -> None:
    running = serve()
    for _ in range(3):
        with running.connect() as client:
            ask(client, request_)
    assert running.toy.admitted == 3


def test_what_is_refused_for_want_of_a_place_need_not_be_read_again(serve: Serve) -> None:
    """Only while there is none, only where nothing but the query differs, and with the answer of the long road."""
    running = serve(threads=1, queue=0)
    with running.connect() as working, running.connect() as other:
        assert ask(other, get("/lasting", "X-Bytes: 7")).status == 200
        working.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        before = running.toy.admitted
        offered = [ask(other, get(f"/work?a={at}", "X-Request-ID: mine")) for at in range(3)]
        fresh = [ask(other, get(f"/work?a={at}&key=secret")) for at in range(10)]
        assert running.toy.admitted == before + 1
        head = ask(other, get("/work?a=1").replace(b"GET", b"HEAD"), "HEAD")
        assert (head.status, head.body) == (503, b"")
        assert ask(other, get("/work?a=1").replace(b"GET", b"HEAD"), "HEAD").headers.keys() == head.headers.keys()
        assert ask(other, get("/work")).status == 503
        assert ask(other, get("/other?a=1")).status == 503
        assert ask(other, get("/work?a=1", "Accept: text/plain")).status == 503
        assert running.toy.admitted == before + 5, "what differs is read"
        assert ask(other, get("/lasting", "X-Bytes: 7")).status == 200, "what needs no place is answered"
        running.toy.gate.set()
        assert working.reply().status == 200
        assert ask(other, get("/work?a=9")).status == 200
    assert {each.status for each in offered + fresh} == {503}
    assert all(len(each.body) == int(each.headers["content-length"]) for each in offered + fresh)
    for each in offered + fresh:
        assert each.document()["request_id"] == each.headers["x-request-id"]
    assert len({each.headers["x-request-id"] for each in fresh}) == 10
    for same in (offered, fresh):
        plain = [{name: value for name, value in each.headers.items() if name not in MOMENTARY} for each in same]
        assert all(each == plain[0] for each in plain)
    running.stop()
    lines = [line for line in running.lines() if line["path"] == "/work" and line["status"] == 503]
    assert [line.get("query") for line in lines[:4]] == ["a=0", "a=1", "a=2", "a=0&key=***"]
    assert {line["problem"] for line in lines} == {"overloaded"}


def test_answers_are_bounded_and_those_that_could_not_leave_are_not_known() -> None:
    prompts = Prompts()

    def learn(path: str, status: int) -> bytearray:
        raw = get(path)
        exchange = Exchange.opened(read_head(raw), "peer", 1.0)  # type: ignore[arg-type]
        exchange.status = status
        prompts.learn(raw, exchange, Response(200, b"a", lasting=True))
        return bytearray(raw)

    assert prompts.get(learn("/failed", 500)) is None
    first = learn("/first", 200)
    assert prompts.get(first) is not None
    for at in range(MOST):
        assert prompts.get(learn(f"/{at}", 200)) is not None
    assert prompts.get(first) is None
