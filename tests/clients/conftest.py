"""A server that says exactly what a test scripts: whole answers, half ones, late ones and none."""

from __future__ import annotations

import socketserver
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import pytest

from lichen.accuracy import times
from lichen.catalogue import operation
from lichen.operation import Rate


@dataclass(frozen=True)
class Answer:
    """One scripted answer.

    `echo` sends the request's body back; `cut` sends only that many bytes of the body and hangs up; `pause` waits after
    each single byte; `hang_up` says nothing at all.
    """

    status: int = 200
    headers: Sequence[tuple[str, str]] = ()
    body: bytes = b""
    echo: bool = False
    delay: float = 0.0
    cut: int | None = None
    pause: float = 0.0
    hang_up: bool = False


@dataclass(frozen=True)
class Received:
    method: str
    target: str
    headers: dict[str, str]
    body: bytes


@dataclass
class ScriptedServer:
    """Answers requests from `script` in order; the last entry answers all that follow."""

    script: list[Answer] = field(default_factory=lambda: [Answer()])
    received: list[Received] = field(default_factory=list)
    connections: int = 0

    def __post_init__(self) -> None:
        self._lock = threading.Lock()
        scripted = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                with scripted._lock:
                    scripted.connections += 1
                while request := self._read():
                    with scripted._lock:
                        answer = scripted.script[min(len(scripted.received), len(scripted.script) - 1)]
                        scripted.received.append(request)
                    if not self._answer(answer, request):
                        return

            def _read(self) -> Received | None:
                line = self.rfile.readline().decode("latin-1").split()
                if not line:
                    return None
                headers = {}
                while (field := self.rfile.readline().decode("latin-1").strip()) != "":
                    name, _, value = field.partition(":")
                    headers[name.lower()] = value.strip()
                body = self.rfile.read(int(headers.get("content-length", 0)))
                return Received(line[0], line[1], headers, body)

            def _answer(self, answer: Answer, request: Received) -> bool:
                time.sleep(answer.delay)
                if answer.hang_up:
                    return False
                body = request.body if answer.echo else answer.body
                headers = [*answer.headers, ("Content-Length", str(len(body)))]
                head = f"HTTP/1.1 {answer.status} X\r\n" + "".join(f"{name}: {value}\r\n" for name, value in headers)
                body = body[: answer.cut]
                try:
                    self.wfile.write(head.encode("latin-1") + b"\r\n")
                    for piece in [body] if not answer.pause else [body[i : i + 1] for i in range(len(body))]:
                        self.wfile.write(piece)
                        time.sleep(answer.pause)
                except OSError:
                    return False
                return answer.cut is None

        class Server(socketserver.ThreadingTCPServer):
            daemon_threads = True
            block_on_close = False
            request_queue_size = 64

        self._server = Server(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}"

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@pytest.fixture(scope="session")
def root() -> Path:
    """The tree."""
    return Path(__file__).resolve().parents[2]


@pytest.fixture
def answer() -> type[Answer]:
    return Answer


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ScriptedServer]:
    for name in ("LICHEN_URL", "http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(name, raising=False)
    with ScriptedServer() as running:
        yield running


@pytest.fixture
def measured(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Lets this machine, and the processes that are started from now on, have found one method of blurring by far the
    quickest of all."""
    monkeypatch.setenv("LICHEN_TIMES", str(tmp_path_factory.mktemp("times")))

    def quickest(method: str) -> None:
        slow = dict.fromkeys((("gaussian", name) for name in operation("gaussian").methods), Rate(1.0, 1e-6))
        times.store("numpy", {**slow, ("gaussian", method): Rate(1e-9, 1e-15)})

    return quickest
