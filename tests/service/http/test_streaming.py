"""Answers that go on: they hold no thread, end when their source, their client or the service does, and are bounded."""

from __future__ import annotations

import time
from collections.abc import Callable

from wire_harness import PATIENCE, Client, Running, get

Serve = Callable[..., Running]


def begin(running: Running) -> Client:
    client = running.connect()
    client.send(get("/stream"))
    head = client.reply()
    assert (head.status, head.headers["connection"]) == (200, "close")
    assert "content-length" not in head.headers
    assert running.toy.source.opened.wait(PATIENCE)
    return client


def read(client: Client, wanted: bytes) -> None:
    while len(client.unread) < len(wanted):
        client._more()
    assert client.unread[: len(wanted)] == wanted
    client.unread = client.unread[len(wanted) :]


def test_what_is_sent_arrives_and_the_end_ends_it(serve: Serve) -> None:
    running = serve(threads=1)
    with begin(running) as client:
        read(client, b"first")
        running.toy.source.send(b"second")
        read(client, b"second")
        assert running.ask(get("/other")).status == 200, "no thread of the pool is held"
        running.toy.source.send(b"third")
        running.toy.source.end()
        assert client.rest() == b"third"
    assert running.toy.source.closed.wait(PATIENCE)
    ends = time.monotonic() + PATIENCE
    while len(running.lines()) < 2 and time.monotonic() < ends:
        time.sleep(0.01)
    assert {"/stream", "/other"} == {line["path"] for line in running.lines()}


def test_a_client_that_leaves_closes_the_source(serve: Serve) -> None:
    running = serve()
    begin(running).socket.close()
    assert running.toy.source.closed.wait(PATIENCE)
    running.toy.source.send(b"to nobody")
    assert running.ask(get()).status == 200


def test_a_client_that_does_not_read_is_cut(serve: Serve) -> None:
    running = serve()
    with begin(running):
        ends = time.monotonic() + PATIENCE
        while not running.toy.source.closed.is_set():
            running.toy.source.send(bytes(100_000))
            time.sleep(0.001)
            assert time.monotonic() < ends


def test_a_client_that_says_more_is_let_go(serve: Serve) -> None:
    running = serve()
    with begin(running) as client:
        client.send(get("/again"))
        assert running.toy.source.closed.wait(PATIENCE)
    assert [head.path for head in running.toy.heads] == ["/stream"]


def test_head_has_no_stream(serve: Serve) -> None:
    running = serve()
    reply = running.ask(b"HEAD /stream HTTP/1.1\r\nHost: a\r\n\r\n", "HEAD")
    assert (reply.status, reply.body) == (200, b"")
    assert not running.toy.source.opened.is_set()


def test_the_end_of_the_service_ends_streams(serve: Serve) -> None:
    running = serve()
    with begin(running) as client:
        running.loop.stop()
        assert client.rest() == b"first"
    running.thread.join(PATIENCE)
    assert running.drained
