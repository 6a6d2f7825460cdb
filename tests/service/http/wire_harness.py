"""A toy application, a loop that runs in a thread, and a client that sends bytes as they are."""

from __future__ import annotations

import io
import json
import os
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from lichen_service.http import loop
from lichen_service.http.access_log import AccessLog
from lichen_service.http.limits import Bounds
from lichen_service.http.loop import Loop
from lichen_service.http.message import Admission, Head, Request, Response

PATIENCE = 20.0
"""seconds after which a test that waits has failed"""


@dataclass(frozen=True)
class WireConfig:
    host: str = "127.0.0.1"
    port: int = 0
    metrics: str = ""
    workers: int = 1
    spare: str = "off"
    silence: float = 0.0
    worker_memory: int = 0
    worker_requests: int = 0
    threads: int = 2
    queue: int = 64
    header_timeout: float = 5.0
    body_rate: float = 65536.0
    idle_timeout: float = 10.0
    request_timeout: float = 60.0
    grace: float = 5.0
    max_body: int = 1 << 26


class Source:
    """Something to stream, driven by the test."""

    def __init__(self) -> None:
        self.opened = threading.Event()
        self.closed = threading.Event()
        self.send: Callable[[bytes], None] = lambda _: None
        self.end: Callable[[], None] = lambda: None

    def open(self, send: Callable[[bytes], None], end: Callable[[], None]) -> None:
        self.send, self.end = send, end
        send(b"first")
        self.opened.set()

    def close(self) -> None:
        self.closed.set()


class Toy:
    """Answers by path; remembers what reached it."""

    def __init__(self) -> None:
        self.heads: list[Head] = []
        self.waiting = threading.Semaphore(0)
        """released once for each request that has begun to wait"""
        self.gate = threading.Event()
        self.admitted = 0
        self.source = Source()
        self.kept = b""

    def admit(self, head: Head) -> Admission | Response:
        if head.path == "/defective-admit":
            raise RuntimeError("secret of admit")
        if head.path == "/stuck":  # on the thread that serves all clients
            time.sleep(2 * PATIENCE)
        self.admitted += 1
        if head.path == "/lasting":
            body = b"x" * int(dict(head.headers).get("x-bytes", 5))
            return Response(200, body, {"ETag": '"a"'}, {"route": "/lasting"}, lasting=True)
        if head.path == "/refused":
            return Response(404, b"no", {"Content-Type": "text/plain"})
        return Admission(1000 if head.path == "/small" else 1 << 26)

    def handle(self, request: Request) -> Response:
        head, body = request.head, request.body
        self.heads.append(head)
        match head.path:
            case "/echo":
                return Response(200, body, {"Content-Type": "application/octet-stream"})
            case "/wait":
                self.waiting.release()
                self.gate.wait(PATIENCE)
            case "/sleep":
                time.sleep(float(dict(head.query)["seconds"]))
            case "/stream":
                return Response(200, headers={"Content-Type": "text/event-stream"}, stream=self.source)
            case "/grow":
                self.kept = b"x" * int(dict(head.query)["bytes"])
            case "/die":
                os._exit(9)
            case "/many":
                return Response(
                    200, bytes(int(dict(head.query)["bytes"])), {"Content-Type": "application/octet-stream"}
                )
            case "/defective":
                raise RuntimeError("secret of handle")
            case "/split":
                return Response(200, b"", {"X-Note": "a\r\nSet-Cookie: b"})
            case "/strange":
                return Response(200, 5)  # type: ignore[arg-type]
        seen = {
            "pid": os.getpid(),
            "apart": head.apart,
            "method": head.method,
            "path": head.path,
            "query": head.query,
            "length": len(body),
        }
        return Response(200, json.dumps(seen).encode(), {"Content-Type": "application/json"})


def create() -> Toy:
    return Toy()


def create_courteous() -> Toy:
    """For a worker that waits longer than a busy machine keeps another from running."""
    loop.COURTESY = 0.2
    return Toy()


def create_nothing() -> Toy:
    raise RuntimeError("no application")


class Running:
    def __init__(self, toy: Toy, settings: WireConfig, bounds: Bounds) -> None:
        self.toy = toy
        self.stream = io.StringIO()
        listener = socket.create_server(("127.0.0.1", 0), backlog=512)
        self.port: int = listener.getsockname()[1]
        self.loop = Loop(listener, toy, settings, bounds=bounds, log=AccessLog(self.stream))
        self.drained: bool | None = None
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        self.drained = self.loop.run()

    def connect(self) -> Client:
        return Client(self.port)

    def ask(self, request: bytes, method: str = "GET") -> Reply:
        with self.connect() as client:
            client.send(request)
            return client.reply(method)

    def lines(self) -> list[dict[str, object]]:
        return [json.loads(line) for line in self.stream.getvalue().splitlines()]

    def stop(self) -> None:
        self.toy.gate.set()
        self.loop.stop()
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()


@dataclass(frozen=True)
class Reply:
    status: int
    headers: dict[str, str]
    body: bytes

    def document(self) -> dict[str, object]:
        return dict(json.loads(self.body))


class Client:
    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.unread = b""

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def reply(self, method: str = "GET") -> Reply:
        """The next answer; raises `ConnectionError` where the server closes first."""
        while (end := self.unread.find(b"\r\n\r\n")) < 0:
            self._more()
        lines = self.unread[:end].decode("latin-1").split("\r\n")
        self.unread = self.unread[end + 4 :]
        status = int(lines[0].split(" ")[1])
        headers = {name.lower(): value for name, value in (line.split(": ", 1) for line in lines[1:])}
        length = 0 if method == "HEAD" or status < 200 else int(headers.get("content-length", 0))
        while len(self.unread) < length:
            self._more()
        body, self.unread = self.unread[:length], self.unread[length:]
        return Reply(status, headers, body)

    def rest(self) -> bytes:
        """Everything until the server closes."""
        while True:
            try:
                self._more()
            except ConnectionError:
                return self.unread

    def _more(self) -> None:
        data = self.socket.recv(1 << 16)
        if not data:
            raise ConnectionError("the server has closed")
        self.unread += data


def get(path: str = "/", *fields: str, version: str = "1.1") -> bytes:
    return "\r\n".join([f"GET {path} HTTP/{version}", "Host: a", *fields, "", ""]).encode("latin-1")


def post(path: str, body: bytes, *fields: str) -> bytes:
    head = [f"POST {path} HTTP/1.1", "Host: a", f"Content-Length: {len(body)}", *fields, "", ""]
    return "\r\n".join(head).encode("latin-1") + body


def post_chunked(path: str, *chunks: bytes, end: bytes = b"0\r\n\r\n") -> bytes:
    head = f"POST {path} HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n".encode()
    return head + b"".join(b"%x\r\n%s\r\n" % (len(chunk), chunk) for chunk in chunks) + end
