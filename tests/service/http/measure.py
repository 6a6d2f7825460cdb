"""Requests and megabytes per second of the wire on loopback, beside uvicorn where that is installed.

    python tests/service/http/measure.py [seconds]

Servers run as one process each; the client, another process, keeps 8 connections busy with small GETs, then 4 with
16 MB POSTs. The rounds of the servers alternate, so that a noisy machine disturbs both alike. The median is printed.
"""

from __future__ import annotations

import os
import selectors
import signal
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

HERE = str(Path(__file__).parent)
ROUNDS = 5
LARGE = 16_000_000

OURS = """
import sys
from lichen_service.http.message import Admission, Response
from lichen_service.http.server import serve
from wire_harness import WireConfig

class Small:
    def admit(self, head): return Admission(1 << 26)
    def handle(self, request): return Response(200, b"%d" % len(request.body), {"Content-Type": "text/plain"})

def create(): return Small()

if __name__ == "__main__":
    sys.exit(serve("measure_ours:create", WireConfig(port=int(sys.argv[1]), threads=4)))
"""
THEIRS = """
async def app(scope, receive, send):
    size, more = 0, True
    while more:
        message = await receive()
        size, more = size + len(message.get("body", b"")), message.get("more_body", False)
    body = b"%d" % size
    head = [(b"content-type", b"text/plain"), (b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": 200, "headers": head})
    await send({"type": "http.response.body", "body": body})
"""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def load(port: int, connections: int, request: bytes, seconds: float) -> float:
    """Answers per second; the body of each is the size of the request's."""
    expected = b"\r\n\r\n%d" % (len(request) - request.index(b"\r\n\r\n") - 4)
    answers: dict[socket.socket, bytes] = {}
    selector = selectors.DefaultSelector()
    unsent: dict[socket.socket, memoryview] = {}
    for _ in range(connections):
        sock = socket.create_connection(("127.0.0.1", port))
        sock.setblocking(False)
        unsent[sock], answers[sock] = memoryview(request), b""
        selector.register(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
    done, start = 0, time.monotonic()
    while time.monotonic() - start < seconds:
        for key, mask in selector.select(1.0):
            sock = key.fileobj
            if mask & selectors.EVENT_READ and not unsent[sock]:
                answers[sock] += sock.recv(65536)
                if not answers[sock].startswith(b"HTTP/1.1 200"):
                    raise RuntimeError(answers[sock][:200])
                if not answers[sock].endswith(expected):
                    continue
                done += 1
                answers[sock] = b""
                unsent[sock] = memoryview(request)
            if unsent[sock]:
                try:
                    unsent[sock] = unsent[sock][sock.send(unsent[sock]) :]
                except BlockingIOError:
                    selector.modify(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
                    continue
            wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if unsent[sock] else 0)
            if key.events != wanted:
                selector.modify(sock, wanted)
    rate = done / (time.monotonic() - start)
    for sock in unsent:
        sock.close()
    selector.close()
    return rate


def begin(folder: Path) -> dict[str, tuple[subprocess.Popen[bytes], int]]:
    (folder / "measure_ours.py").write_text(OURS)
    (folder / "measure_theirs.py").write_text(THEIRS)
    path = os.pathsep.join([str(folder), HERE, os.environ.get("PYTHONPATH", "")])
    commands = {"lichen": [str(folder / "measure_ours.py")]}
    for parser in ("httptools", "h11"):
        available = subprocess.run(
            [sys.executable, "-c", f"import uvicorn, {parser}"], capture_output=True, check=False
        )
        if not available.returncode:
            commands[f"uvicorn {parser}"] = [
                "-m",
                "uvicorn",
                "measure_theirs:app",
                "--http",
                parser,
                "--log-level",
                "error",
            ]
    servers = {}
    for name, command in commands.items():
        port = free_port()
        where = [str(port)] if name == "lichen" else ["--port", str(port)]
        process = subprocess.Popen(
            [sys.executable, *command, *where],
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        servers[name] = (process, port)
        while True:
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except ConnectionRefusedError:
                time.sleep(0.05)
    time.sleep(1.0)
    return servers


def main(seconds: float) -> None:
    import tempfile

    small = b"GET /v1/x?a=5 HTTP/1.1\r\nHost: a\r\nAccept: */*\r\nUser-Agent: measure\r\n\r\n"
    large = b"POST /v1/x HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % LARGE + bytes(LARGE)
    with tempfile.TemporaryDirectory() as folder:
        servers = begin(Path(folder))
        try:
            for title, connections, request, unit in (
                ("small GET, requests/s", 8, small, 1.0),
                ("16 MB POST, MB/s", 4, large, LARGE / 1e6),
            ):
                rates: dict[str, list[float]] = {name: [] for name in servers}
                for _ in range(ROUNDS):
                    for name, (_, port) in servers.items():
                        rates[name].append(unit * load(port, connections, request, seconds))
                print(title)
                for name, each in rates.items():
                    print(f"  {name:18} {statistics.median(each):9.0f}   ({min(each):.0f} to {max(each):.0f})")
        finally:
            for process, _ in servers.values():
                process.send_signal(signal.SIGTERM)
                process.wait(20)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
