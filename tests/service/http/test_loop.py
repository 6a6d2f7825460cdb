"""The wire over real sockets: framing, persistence, deadlines, overload, defects behind it."""

from __future__ import annotations

import contextlib
import io
import json
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from malformed import REQUESTS
from wire_harness import PATIENCE, Client, Running, Toy, WireConfig, get, post, post_chunked

from lichen_service.http.access_log import AccessLog
from lichen_service.http.chunked import MOST_CHUNKS
from lichen_service.http.crowd import Crowd, shared
from lichen_service.http.limits import Bounds
from lichen_service.http.loop import Loop

Serve = Callable[..., Running]


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


# Framing


def test_no_malformed_request_is_dispatched(server: Running) -> None:
    before = len(server.toy.heads)
    for name, data, status in REQUESTS:
        with server.connect() as client:
            client.send(data)
            reply = client.reply()
            assert reply.status == status, name
            assert reply.headers["connection"] == "close", name
            assert reply.headers["content-type"] == "application/problem+json"
            document = reply.document()
            assert document["status"] == status
            assert document["code"] == reply.headers["x-problem-code"]
            assert document["request_id"] == reply.headers["x-request-id"]
            assert client.rest() == b"", name
    assert len(server.toy.heads) == before
    assert server.ask(get()).status == 200


@pytest.mark.parametrize(
    "first",
    [get("/a?b=c"), post("/echo", b"hello"), post_chunked("/echo", b"hel", b"lo", end=b"0\r\nX-Sum: 1\r\n\r\n")],
    ids=["without body", "with length", "chunked"],
)
def test_every_split_gives_the_same_answers(server: Running, first: bytes) -> None:
    data = first + post("/echo", b"next") + get("/last")

    def answers(*pieces: bytes) -> list[tuple[int, bytes]]:
        with server.connect() as client:
            for piece in pieces:
                client.send(piece)
                time.sleep(0.0005)  # so that most pieces travel alone; the answers may not depend on it
            return [(reply.status, reply.body) for reply in (client.reply() for _ in range(3))]

    whole = answers(data)
    assert [status for status, _ in whole] == [200] * 3
    for at in range(1, len(data)):
        assert answers(data[:at], data[at:]) == whole
    assert answers(*(data[at : at + 1] for at in range(len(data)))) == whole


def test_what_the_application_sees(server: Running) -> None:
    server.ask(
        get("/a%20b?x=1&x=2&y=%C3%A9", "Accept: a/b", "ACCEPT: c/d", "Cookie: a=1", "Cookie: b=2", "X-Request-ID: me-1")
    )
    head = server.toy.heads[-1]
    assert (head.method, head.path, head.query) == ("GET", "/a b", (("x", "1"), ("x", "2"), ("y", "\u00e9")))
    assert head.headers == {"host": "a", "accept": "a/b, c/d", "cookie": "a=1; b=2", "x-request-id": "me-1"}
    assert (head.request_id, head.peer, head.length) == ("me-1", "127.0.0.1", 0)
    assert head.received < head.deadline


@pytest.mark.parametrize("size", [0, 1, 65_535, 300_000, 5_000_000])
def test_bodies_come_back_whole(server: Running, size: int) -> None:
    body = bytes(range(256)) * (size // 256) + b"x" * (size % 256)
    assert server.ask(post("/echo", body)).body == body
    assert server.ask(post_chunked("/echo", *(body[at : at + 70_000] for at in range(0, size, 70_000)))).body == body


def test_pipelined_requests_are_answered_in_order(server: Running) -> None:
    with server.connect() as client:
        client.send(b"".join(post("/echo", b"%d" % number) if number % 2 else get("/refused") for number in range(50)))
        replies = [client.reply() for _ in range(50)]
    assert [reply.body for reply in replies] == [b"%d" % number if number % 2 else b"no" for number in range(50)]


def test_pipelining_far_ahead_is_bounded_and_served(serve: Serve) -> None:
    running = serve(threads=1)
    requests = get("/wait") + b"".join(post("/echo", b"x" * 20_000) for _ in range(100))
    with running.connect() as client:
        sender = threading.Thread(target=client.send, args=(requests,))
        sender.start()
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        running.toy.gate.set()
        assert [client.reply().status for _ in range(101)] == [200] * 101
        sender.join(PATIENCE)


def test_head_has_real_headers_and_no_body(server: Running) -> None:
    with server.connect() as client:
        client.send(get("/").replace(b"GET", b"HEAD") + get("/"))
        head, whole = client.reply("HEAD"), client.reply()
    assert int(head.headers["content-length"]) > 0
    assert head.headers["content-type"] == whole.headers["content-type"] == "application/json"


def test_options_asterisk_is_answered_by_the_wire(server: Running) -> None:
    with server.connect() as client:
        client.send(b"OPTIONS * HTTP/1.1\r\nHost: a\r\n\r\n" + get())
        assert "QUERY" in client.reply().headers["allow"]
        assert client.reply().status == 200


def test_a_target_in_absolute_form_is_served_like_its_path(server: Running) -> None:
    with server.connect() as client:
        client.send(get("http://b.example/a%20b?c=d") * 2 + get("/a%20b?c=d"))
        replies = [client.reply() for _ in range(3)]
    assert [reply.status for reply in replies] == [200] * 3
    assert replies[0].body == replies[1].body == replies[2].body
    assert server.toy.heads[-2].headers["host"] == "b.example"
    assert server.toy.heads[-1].headers["host"] == "a"


# Persistence


@pytest.mark.parametrize("request_", [get("/", "Connection: close"), b"GET / HTTP/1.0\r\n\r\n"])
def test_the_connection_closes_when_asked(server: Running, request_: bytes) -> None:
    with server.connect() as client:
        client.send(request_)
        assert client.reply().headers["connection"] == "close"
        assert client.rest() == b""


def test_a_connection_ends_after_its_last_request(serve: Serve) -> None:
    running = serve(bounds=Bounds(requests_per_connection=3))
    with running.connect() as client:
        client.send(get() * 4)
        assert [client.reply().headers["connection"] for _ in range(3)] == ["keep-alive", "keep-alive", "close"]
        assert client.rest() == b""


def test_idle_connections_close_silently(serve: Serve) -> None:
    running = serve(idle_timeout=0.1)
    with running.connect() as fresh, running.connect() as used:
        used.send(get())
        assert used.reply().status == 200
        assert fresh.rest() == b""
        assert used.rest() == b""


def test_a_half_closed_client_still_gets_its_answers(server: Running) -> None:
    with server.connect() as client:
        client.send(get("/a") + post("/echo", b"b", "Connection: close"))
        client.socket.shutdown(socket.SHUT_WR)
        assert [client.reply().status for _ in range(2)] == [200, 200]
        assert client.rest() == b""


def test_a_small_unread_body_is_dropped_and_the_connection_kept(server: Running) -> None:
    with server.connect() as client:
        client.send(post("/refused", b"x" * 100_000) + get())
        assert client.reply().status == 404
        assert client.reply().status == 200


def test_work_is_told_when_its_client_hangs_up(serve: Serve) -> None:
    running = serve(threads=1)
    with running.connect() as client:
        client.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        (head,) = running.toy.heads
        assert head.alive()
    until(lambda: not head.alive())
    running.toy.gate.set()
    until(lambda: running.loop.connections == 0)
    until(lambda: bool(running.lines()))
    assert [line["status"] for line in running.lines()] == [499]


def test_a_client_may_ask_for_less_time_and_not_for_more(serve: Serve) -> None:
    running = serve(request_timeout=30.0)
    for field, allowed in (("Request-Timeout: 1500", 1.5), ("Request-Timeout: 999999", 30.0), ("X-Other: 1", 30.0)):
        assert running.ask(get("/a", field)).status == 200
        head = running.toy.heads[-1]
        assert head.allowed == allowed
        assert head.deadline - head.received >= allowed
    for field in ("0", "-5", "1.5", "1e3", "", "soon", "1234567890"):
        assert running.ask(get("/a", f"Request-Timeout: {field}")).status == 400
    assert running.ask(get("/a", "Request-Timeout: 5", "Request-Timeout: 9")).status == 400
    assert len(running.toy.heads) == 3


# Admission


def test_413_is_readable_while_the_client_still_sends(server: Running) -> None:
    size = 8_000_000
    with server.connect() as client:
        head = b"POST /small HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % size
        client.send(head + b"x" * size)  # would fail here, were the connection reset
        reply = client.reply()
    assert reply.status == 413
    assert (reply.document()["limit"], reply.document()["actual"]) == (1000, size)
    assert reply.headers["connection"] == "close"


def test_chunked_body_over_the_limit_is_refused_while_it_arrives(server: Running) -> None:
    with server.connect() as client:
        client.send(post_chunked("/small", b"x" * 600, end=b""))
        client.send(b"%x\r\n" % 600)
        reply = client.reply()
    assert reply.status == 413
    assert reply.document()["limit"] == 1000


def test_too_many_chunks(server: Running) -> None:
    chunks = [b"x"] * (MOST_CHUNKS + 1)
    assert server.ask(post_chunked("/echo", *chunks[:-1])).status == 200
    assert server.ask(post_chunked("/echo", *chunks)).status == 413


def test_expect_is_answered_after_admission(server: Running) -> None:
    with server.connect() as client:
        client.send(b"POST /echo HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n")
        assert client.reply().status == 100
        client.send(b"hello")
        assert client.reply().body == b"hello"
        client.send(b"POST /echo HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\nExpect: 100-Continue\r\n\r\n")
        assert client.reply().status == 100
        client.send(b"2\r\nhi\r\n0\r\n\r\n")
        assert client.reply().body == b"hi"


@pytest.mark.parametrize(("path", "status"), [("/small", 413), ("/refused", 404)])
def test_expect_gets_a_final_answer_where_the_body_is_not_wanted(server: Running, path: str, status: int) -> None:
    with server.connect() as client:
        client.send(f"POST {path} HTTP/1.1\r\nHost: a\r\nContent-Length: 5000\r\nExpect: 100-continue\r\n\r\n".encode())
        reply = client.reply()
        assert (reply.status, reply.headers["connection"]) == (status, "close")
        assert client.rest() == b""


@pytest.mark.parametrize(
    "request_",
    [
        b"POST /echo HTTP/1.0\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n",
        b"POST /echo HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\nh",
        b"POST /echo HTTP/1.1\r\nHost: a\r\nContent-Length: 0\r\nExpect: 100-continue\r\n\r\n",
    ],
    ids=["version 1.0", "body already under way", "no body"],
)
def test_expect_without_need_gets_no_interim_answer(server: Running, request_: bytes) -> None:
    with server.connect() as client:
        client.send(request_)
        if b": 5" in request_:
            client.send(b"hello"[request_.endswith(b"h") :])
        assert client.reply().status == 200


def test_a_full_queue_is_refused_at_once_and_recovers(serve: Serve) -> None:
    running = serve(threads=1, queue=1)
    with running.connect() as working, running.connect() as queued, running.connect() as third:
        working.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        queued.send(post("/echo", b"queued"))
        until(lambda: running.loop.in_flight == 2)
        third.send(post("/echo", b"x" * 1000))
        reply = third.reply()
        assert (reply.status, reply.headers["retry-after"]) == (503, "1")
        assert reply.document()["retryable"] is True
        third.send(get("/refused"))
        assert third.reply().status == 404, "what needs no place in the queue is answered"
        running.toy.gate.set()
        assert working.reply().status == 200
        assert queued.reply().body == b"queued"
        third.send(post("/echo", b"again"))
        assert third.reply().body == b"again"


def test_a_request_that_waited_too_long_is_not_begun(serve: Serve) -> None:
    running = serve(threads=1, request_timeout=0.1)
    with running.connect() as working, running.connect() as queued:
        working.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        queued.send(get("/never"))
        until(lambda: running.loop.in_flight == 2)
        time.sleep(0.2)
        running.toy.gate.set()
        reply = queued.reply()
    assert (reply.status, reply.headers["retry-after"]) == (503, "1")
    assert [head.path for head in running.toy.heads] == ["/wait"]


def test_memory_for_bodies_is_bounded(serve: Serve) -> None:
    running = serve(bounds=Bounds(bodies_in_flight=1), max_body=100_000)
    with running.connect() as slow, running.connect() as other:
        slow.send(post("/echo", b"x" * 90_000)[:-10])
        until(lambda: running.loop.held > 80_000)
        other.send(post("/echo", b"x" * 30_000))
        assert other.reply().status == 503
        slow.send(b"x" * 10)
        assert slow.reply().status == 200
        until(lambda: running.loop.held == 0)
        other.send(post("/echo", b"x" * 30_000))
        assert other.reply().status == 200


# Slow and many clients


def test_a_slow_head_is_cut_while_others_are_served(serve: Serve) -> None:
    running = serve(header_timeout=0.3)
    with running.connect() as slow:
        for byte in get("/" + "a" * 1000):
            try:
                slow.send(bytes([byte]))
            except OSError:
                break
            assert running.ask(get()).status == 200
            if _readable(slow):
                break
        reply = slow.reply()
        assert reply.status == 408
        assert reply.document()["retryable"] is True
    assert all(head.path == "/" for head in running.toy.heads)


@pytest.mark.parametrize(
    "start", [post("/echo", b"x" * 1000)[:-500], post_chunked("/echo", b"x" * 500, end=b"5\r\nab")]
)
def test_a_body_that_stops_is_cut(serve: Serve, start: bytes) -> None:
    running = serve(bounds=Bounds(patience=0.2))
    with running.connect() as slow:
        slow.send(start)
        assert slow.reply().status == 408
        assert slow.rest() == b""
    until(lambda: running.loop.held == 0)


def test_a_body_that_trickles_is_cut_whatever_it_claims(serve: Serve) -> None:
    running = serve(bounds=Bounds(patience=0.2), body_rate=1000.0)
    with running.connect() as slow:
        slow.send(b"POST /echo HTTP/1.1\r\nHost: a\r\nContent-Length: 50000000\r\n\r\n")
        while not _readable(slow):
            slow.send(b"x")
            time.sleep(0.01)
        assert slow.reply().status == 408


def test_a_client_that_does_not_read_is_cut_and_holds_no_thread(serve: Serve) -> None:
    running = serve(threads=1, bounds=Bounds(patience=0.3))
    with running.connect() as slow:
        slow.send(get("/many?bytes=50000000"))
        until(lambda: running.loop.connections == 1)
        assert running.ask(get()).status == 200
        until(lambda: any(line["status"] == 499 for line in running.lines()))
        with pytest.raises(ConnectionError):
            slow.reply()


def test_a_slow_reader_that_keeps_reading_gets_everything(serve: Serve) -> None:
    running = serve(threads=1)
    with running.connect() as slow:
        slow.send(get("/many?bytes=20000000"))
        time.sleep(0.2)
        assert running.ask(get()).status == 200
        assert len(slow.reply().body) == 20_000_000


def test_many_half_open_connections_cost_no_thread(server: Running) -> None:
    threads = threading.active_count()
    clients = [server.connect() for _ in range(200)]
    try:
        for number, client in enumerate(clients):
            client.send((get(), post("/echo", b"x" * 100))[number % 2][:-1])
        until(lambda: server.loop.connections >= 200)
        assert threading.active_count() <= threads  # fewer: other tests leave threads that end by themselves
        assert server.ask(get()).status == 200
        for client in clients[:4]:
            client.send(b"\n" if clients.index(client) % 2 == 0 else b"x")
            assert client.reply().status == 200
    finally:
        for client in clients:
            client.socket.close()
    until(lambda: server.loop.connections == 0)


def test_connections_beyond_the_cap_wait_for_a_place(serve: Serve) -> None:
    running = serve(bounds=Bounds(connections=2))
    first, second, third = running.connect(), running.connect(), running.connect()
    with first, second, third:
        third.send(get())
        until(lambda: running.loop.connections == 2)
        first.socket.close()
        assert third.reply().status == 200


@contextlib.contextmanager
def sharing(running: int, count: int) -> Iterator[tuple[int, list[Loop]]]:
    """The port of a listener that so many loops share, and these, of which so many run."""
    descriptor = shared(count)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        loops = [
            Loop(listener.dup(), Toy(), WireConfig(), log=AccessLog(io.StringIO()), crowd=Crowd.at(descriptor, place))
            for place in range(count)
        ]
        for each in loops[:running]:
            threading.Thread(target=each.run, daemon=True).start()
        yield listener.getsockname()[1], loops
        for each in loops:
            each.stop()
    os.close(descriptor)


def test_a_worker_that_holds_more_connections_lets_others_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen_service.http.loop.COURTESY", PATIENCE)
    with sharing(1, 2) as (port, (many, few)), contextlib.ExitStack() as open:
        for number in range(1, 5):
            open.enter_context(Client(port))
            until(lambda number=number: many.connections == number)
        threading.Thread(target=few.run, daemon=True).start()
        for number in range(1, 5):
            open.enter_context(Client(port))
            until(lambda number=number: few.connections == number)
        assert many.connections == 4


def test_a_connection_that_nobody_else_takes_is_taken_by_who_has_many() -> None:
    with sharing(1, 2) as (port, (loop, other)), contextlib.ExitStack() as open:
        crowd = loop._crowd
        other._tell_crowd()
        assert crowd is not None
        for number in range(1, 4):
            open.enter_context(Client(port))
            until(lambda number=number: loop.connections == number)
            assert crowd.ahead()


# Defects behind the wire, clients that go away


@pytest.mark.parametrize("path", ["/defective", "/defective-admit", "/split", "/strange"])
def test_a_defect_is_a_500_that_tells_nothing_and_keeps_the_connection(server: Running, path: str) -> None:
    with server.connect() as client:
        client.send(get(path) + get("/after"))
        reply = client.reply()
        assert reply.status == 500
        assert b"secret" not in reply.body
        assert "set-cookie" not in reply.headers
        assert client.reply().status == 200
    assert any("Traceback" in str(line.get("exception")) for line in server.lines())


def test_a_client_that_leaves_frees_its_place(serve: Serve) -> None:
    running = serve(threads=1, queue=1)
    with running.connect() as client:
        client.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        _reset(client)
    with running.connect() as queued:
        queued.send(get("/gone"))
        until(lambda: running.loop.in_flight == 2)
        _reset(queued)
    until(lambda: all(each._gone for each in list(running.loop._connections)))
    running.toy.gate.set()
    until(lambda: running.loop.connections == 0)
    assert running.loop.in_flight == 0
    assert [head.path for head in running.toy.heads] == ["/wait"], "nobody waits for the second one any more"
    assert running.ask(get()).status == 200


def test_a_body_that_ends_early_is_refused(server: Running) -> None:
    before = len(server.toy.heads)
    with server.connect() as client:
        client.send(post("/echo", b"hello")[:-1])
        client.socket.shutdown(socket.SHUT_WR)
        assert client.reply().status == 400
    assert len(server.toy.heads) == before


def test_one_log_line_for_each_answer(serve: Serve) -> None:
    running = serve()
    running.ask(post("/echo?a=b&key=c", b"hello", "X-Request-ID: log-1"))
    until(lambda: len(running.lines()) == 1)
    (line,) = running.lines()
    assert {
        "request_id": "log-1",
        "method": "POST",
        "path": "/echo",
        "query": "a=b&key=***",
        "status": 200,
    }.items() <= line.items()
    assert line["bytes_in"] == 5
    assert isinstance(line["bytes_out"], int)
    assert {"time", "queue_ms", "work_ms", "total_ms", "peer"} <= line.keys()


@pytest.mark.parametrize(
    ("sent", "known"),
    [
        ("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01", True),
        ("00-00000000000000000000000000000000-b7ad6b7169203331-01", False),
        ("00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01", False),
        ("ff-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01", False),
        ("00-0AF7651916CD43DD8448EB211C80319C-b7ad6b7169203331-01", False),
        ("00-0af7651916cd43dd8448eb211c80319c", False),
    ],
)
def test_a_trace_is_carried_into_the_log(serve: Serve, sent: str, known: bool) -> None:
    running = serve()
    assert running.ask(get("/", f"traceparent: {sent}")).status == 200
    until(lambda: bool(running.lines()))
    (line,) = running.lines()
    assert line.get("trace_id") == (sent.split("-")[1] if known else None)
    assert line.get("parent_id") == (sent.split("-")[2] if known else None)


# The end


def test_draining_answers_what_has_come(serve: Serve) -> None:
    running = serve(threads=1)
    with running.connect() as working, running.connect() as idle, running.connect() as queued:
        idle.send(get())
        idle.reply()
        working.send(get("/wait") + get("/pipelined"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        queued.send(post("/echo", b"hello")[:-1])
        until(lambda: running.loop.held == 4)
        running.loop.stop()
        assert idle.rest() == b""
        with pytest.raises(ConnectionRefusedError):
            Client(running.port)
        running.toy.gate.set()
        reply = working.reply()
        assert (reply.status, reply.headers["connection"]) == (200, "close")
        queued.send(b"o")
        assert json.loads(queued.reply().body.replace(b"hello", b'"hello"')) == "hello"
    running.thread.join(PATIENCE)
    assert running.drained is True


def test_draining_ends_with_the_grace(serve: Serve) -> None:
    running = serve(threads=1, grace=0.1)
    with running.connect() as working:
        working.send(get("/wait"))
        assert running.toy.waiting.acquire(timeout=PATIENCE)
        running.loop.stop()
        running.thread.join(PATIENCE)
        assert running.drained is False


def _readable(client: Client) -> bool:
    client.socket.settimeout(0.0)
    try:
        return bool(client.socket.recv(1, socket.MSG_PEEK)) or True
    except BlockingIOError:
        return False
    finally:
        client.socket.settimeout(PATIENCE)


def _reset(client: Client) -> None:
    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    client.socket.close()
