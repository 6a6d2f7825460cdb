"""The blocking client's own sockets: how an answer may come, or not come, and what becomes of the connection."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from lichen_client import Client, ConnectionFailed, Retries, TimedOut, TooLarge
from lichen_client.transport import direct

Serve = Callable[..., str]
ONCE = Retries(count=0)
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"


@pytest.fixture
def serve(monkeypatch: pytest.MonkeyPatch) -> Iterator[Serve]:
    """serve(*scripts) -> the address of a server that treats its nth connection by the nth script."""
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    with contextlib.ExitStack() as stack:

        def start(*scripts: Callable[[socket.socket], None]) -> str:
            listening = stack.enter_context(socket.create_server(("127.0.0.1", 0)))

            def run() -> None:
                for script in scripts:
                    connection, _ = listening.accept()
                    with connection, contextlib.suppress(OSError):
                        script(connection)

            thread = threading.Thread(target=run, daemon=True)
            thread.start()
            stack.callback(thread.join, 10.0)
            return f"http://127.0.0.1:{listening.getsockname()[1]}"

        yield start


def asked(connection: socket.socket) -> bytes:
    """The next request; its body is what was announced."""
    got = b""
    while b"\r\n\r\n" not in got:
        piece = connection.recv(1 << 16)
        if not piece:
            return got
        got += piece
    head, _, body = got.partition(b"\r\n\r\n")
    length = int(head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0] or 0)
    while len(body) < length:
        body += connection.recv(1 << 16)
    return head + b"\r\n\r\n" + body


def answering(*answers: bytes) -> Callable[[socket.socket], None]:
    def script(connection: socket.socket) -> None:
        for answer in answers:
            asked(connection)
            connection.sendall(answer)
        connection.settimeout(10.0)
        connection.recv(1)  # until the other side ends it

    return script


WHOLE = {
    "announced": HEAD + b'Content-Length: 8\r\n\r\n{"a": 1}',
    "in chunks": HEAD + b'Transfer-Encoding: chunked\r\n\r\n4\r\n{"a"\r\n4;x=y\r\n: 1}\r\n0\r\nT: v\r\n\r\n',
    "after a hint": b"HTTP/1.1 103 Early Hints\r\n\r\n" + HEAD + b'Content-Length: 8\r\n\r\n{"a": 1}',
}


@pytest.mark.parametrize("answer", WHOLE.values(), ids=WHOLE.keys())
def test_a_whole_answer_leaves_the_connection_for_the_next(serve: Serve, answer: bytes) -> None:
    with Client(serve(answering(answer, answer)), retries=ONCE) as client:
        assert client.version() == client.version() == {"a": 1}


def test_an_answer_up_to_the_end_of_its_connection_is_whole(serve: Serve) -> None:
    def script(connection: socket.socket) -> None:
        asked(connection)
        connection.sendall(HEAD + b'Connection: close\r\n\r\n{"a":')
        connection.sendall(b" 1}")

    with Client(serve(script, script), retries=ONCE) as client:
        assert client.version() == client.version() == {"a": 1}


HALF = {
    "nothing": b"",
    "half a line": b"HTTP/1.1 200",
    "half a head": HEAD,
    "another protocol": b"nonsense\r\n\r\n",
    "half a body": HEAD + b"Content-Length: 9\r\n\r\n{",
    "half a chunk": HEAD + b"Transfer-Encoding: chunked\r\n\r\n4\r\n{",
    "an endless line": HEAD + b"X: " + b"y" * 70_000 + b"\r\n\r\n",
}


@pytest.mark.parametrize("answer", HALF.values(), ids=HALF.keys())
def test_half_an_answer_is_none_and_the_connection_is_dropped(serve: Serve, answer: bytes) -> None:
    def script(connection: socket.socket) -> None:
        asked(connection)
        connection.sendall(answer)

    with Client(serve(script, answering(WHOLE["announced"])), retries=ONCE) as client:
        with pytest.raises(ConnectionFailed):
            client.run("gaussian", b"x", format="png")
        assert client.version() == {"a": 1}


def test_a_connection_that_ended_meanwhile_is_not_used_again(serve: Serve) -> None:
    ended = threading.Event()

    def script(connection: socket.socket) -> None:
        asked(connection)
        connection.sendall(WHOLE["announced"])
        connection.close()
        ended.set()

    with Client(serve(script, answering(WHOLE["announced"])), retries=ONCE) as client:
        assert client.version() == {"a": 1}
        assert ended.wait(10.0)
        time.sleep(0.05)
        assert client.version() == {"a": 1}


def test_a_refusal_before_all_was_sent_is_heard(serve: Serve) -> None:
    """The service refuses what is too large by its head alone, and reads no more of it."""

    def script(connection: socket.socket) -> None:
        connection.recv(1 << 10)
        connection.sendall(b"HTTP/1.1 413 X\r\nContent-Length: 2\r\nConnection: close\r\n\r\nno")

    with Client(serve(script), retries=ONCE) as client, pytest.raises(TooLarge):
        client.gaussian(np.zeros((2000, 2000, 3), np.float32), sigma=2)


def test_a_service_that_is_started_anew_in_the_middle_of_an_upload_is_asked_again(serve: Serve) -> None:
    seen: list[bytes] = []

    def dies(connection: socket.socket) -> None:
        connection.recv(1 << 10)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset, not an end

    def lives(connection: socket.socket) -> None:
        seen.append(asked(connection))
        connection.sendall(WHOLE["announced"])

    image = np.random.default_rng(1).random((700, 700, 3), np.float32)
    with Client(serve(dies, lives), retries=Retries(first=0.001)) as client:
        assert client.explain("gaussian", image, sigma=2) == {"a": 1}
    assert image.tobytes() in seen[0]


@pytest.mark.parametrize("part", ["head", "body"])
def test_an_answer_that_trickles_is_given_up_at_the_deadline(serve: Serve, part: str) -> None:
    def script(connection: socket.socket) -> None:
        asked(connection)
        connection.sendall(b"HTTP/1.1 200 OK\r\n" if part == "head" else HEAD + b"Content-Length: 999\r\n\r\n")
        for _ in range(400):
            connection.sendall(b"x")
            time.sleep(0.01)

    with Client(serve(script), timeout=0.3, retries=ONCE) as client, pytest.raises(TimedOut):
        client.version()


def test_a_call_waits_for_a_connection_no_longer_than_it_may(serve: Serve) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow(connection: socket.socket) -> None:
        asked(connection)
        begun.set()
        go_on.wait(10.0)
        connection.sendall(WHOLE["announced"])
        answering(WHOLE["announced"])(connection)

    with Client(serve(slow), connections=1, retries=ONCE) as client:
        at_work = threading.Thread(target=lambda: client.with_raw_response.get("v1", "version"))
        at_work.start()
        assert begun.wait(10.0)
        with pytest.raises(TimedOut):
            client.with_options(timeout=0.1).version()
        go_on.set()
        at_work.join(10.0)
        assert client.version() == {"a": 1}


def test_a_closed_client_says_so(serve: Serve) -> None:
    with Client(serve(answering(WHOLE["announced"])), retries=ONCE) as client:
        client.version()
    with pytest.raises(RuntimeError, match="closed"):
        client.version()


def test_a_header_field_is_one_line(serve: Serve) -> None:
    with Client(serve(), headers={"X-A": "b\r\nX-C: d"}) as client, pytest.raises(ValueError, match="one line"):
        client.version()


def test_an_array_is_sent_from_where_it_lies(serve: Serve) -> None:
    from lichen_client.npy import npy_pieces

    image = np.ones((4, 5, 3), np.float32)
    head, samples = npy_pieces(image)
    assert np.shares_memory(np.frombuffer(samples, np.float32), image)
    got: list[bytes] = []

    def script(connection: socket.socket) -> None:
        got.append(asked(connection))
        connection.sendall(WHOLE["announced"])

    with Client(serve(script), retries=ONCE) as client:
        client.explain("gaussian", image, sigma=2)
    assert got[0].endswith(head + image.tobytes())


@pytest.mark.parametrize(
    ("url", "environment", "short"),
    [
        ("http://a:1", {}, True),
        ("https://a", {}, False),
        ("http://name:word@a", {}, False),
        ("http://a", {"http_proxy": "http://b"}, False),
        ("http://a", {"ALL_PROXY": "http://b"}, False),
        ("http://a", {"https_proxy": "http://b"}, True),
    ],
)
def test_what_needs_more_goes_through_httpx2(
    url: str, environment: dict[str, str], short: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert direct(url) is short
    with Client(url) as client:
        assert (client._lanes is None, hasattr(client, "_http")) == (not short, not short)


def test_a_proxy_is_asked_where_the_environment_names_one(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    got: list[bytes] = []

    def script(connection: socket.socket) -> None:
        got.append(asked(connection))
        connection.sendall(WHOLE["announced"])

    monkeypatch.setenv("http_proxy", serve(script))
    with Client("http://service.invalid", retries=ONCE) as client:
        assert client.version() == {"a": 1}
    assert got[0].startswith(b"GET http://service.invalid/v1/version ")
