"""Requests and megabytes per second of the wire on loopback, beside uvicorn where that is installed.

    python tests/service/http/measure.py [seconds] [rounds] [small|ids|large ...]

Servers run as one process each; the client, another process, keeps 8 connections busy with small GETs, then 4 with
16 MB POSTs. `service` is the whole service, keys, figures and log included, asked for `/v1/version`; uvicorn serves the
same bytes from a constant, and writes no log. `wire` is our server alone, with an application that does nothing on a
thread of the pool. Once all heads are alike, as a probe or a page sends them, and once each has an id of its own. The
rounds of the servers alternate, so that a noisy machine disturbs all alike. The median is printed, and the
processor time of the server for each request.
"""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import count, product, repeat
from pathlib import Path

HERE = str(Path(__file__).parent)
PATH = "/v1/version"
PARTS = ("small", "ids", "large")
LARGE = 16_000_000

WIRE = """
import sys
from lichen_service.http.message import Admission, Response
from lichen_service.http.server import serve
from wire_harness import WireConfig

class Small:
    def admit(self, head): return Admission(1 << 26)
    def handle(self, request): return Response(200, b"%d" % len(request.body), {"Content-Type": "text/plain"})

def create(): return Small()

if __name__ == "__main__":
    sys.exit(serve("measure_wire:create", WireConfig(port=int(sys.argv[1]), threads=4)))
"""
SERVICE = """
import os, sys, tempfile
from pathlib import Path
from lichen_service.settings import FIGURES, SHARED, Settings

def create():
    from lichen_service import app, logs
    logs.configure()
    return app.Service(Settings.load(), Path(os.environ[SHARED]))  # not warmed up meanwhile

if __name__ == "__main__":
    from lichen_service.http.server import serve
    with tempfile.TemporaryDirectory() as data:
        settings = Settings(port=int(sys.argv[1]), workers=1, spare="off", decoders=0, jobs="off", data=data)
        os.environ.update(settings.environment() | {SHARED: data, FIGURES: data})
        sys.exit(serve("measure_service:create", settings))
"""
UVICORN = """
import os
VERSION = os.environ["VERSION"].encode()
async def app(scope, receive, send):
    size, more = 0, True
    while more:
        message = await receive()
        size, more = size + len(message.get("body", b"")), message.get("more_body", False)
    body = b"%d" % size if size else VERSION
    head = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": 200, "headers": head})
    await send({"type": "http.response.body", "body": body})
"""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def load(port: int, connections: int, requests: Iterator[bytes], seconds: float) -> float:
    """Answers per second. The client waits for its connections in turn, while all the others have a request under
    way: that takes a fifth of a processor of its own, so that it is the server whose rate is found."""
    socks, size, done = [connected(port) for _ in range(connections)], 0, 0
    for sock in socks:
        sock.sendall(next(requests))
    start = time.monotonic()
    while (now := time.monotonic()) - start < seconds:
        for at, sock in enumerate(socks):
            answer = sock.recv(65536)
            if len(answer) != size or not answer.startswith(b"HTTP/1.1 200 OK"):
                answer = whole(sock, answer)
                if b"\r\nconnection: close" in answer[:1000].lower():  # after its thousandth request
                    sock.close()
                    sock = socks[at] = connected(port)
                else:
                    size = len(answer)
            sock.sendall(next(requests))
        done += connections
    for sock in socks:
        sock.close()
    return done / (now - start)


def connected(port: int) -> socket.socket:
    sock = socket.create_connection(("127.0.0.1", port))
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


def whole(sock: socket.socket, answer: bytes) -> bytes:
    """An answer that has begun. One that is as long and begins alike is whole, and need not be read."""
    while not (found := re.search(rb"(?i)^HTTP/1\.1 200.*\r\ncontent-length: (\d+).*?\r\n\r\n", answer, re.DOTALL)):
        if b"\r\n\r\n" in answer or not (more := sock.recv(65536)):
            raise RuntimeError(answer[:200])
        answer += more
    size = found.end() + int(found[1])
    while len(answer) < size:
        answer += sock.recv(65536)
    return answer


def begin(folder: Path) -> dict[str, tuple[subprocess.Popen[bytes], int]]:
    for name, source in (("wire", WIRE), ("service", SERVICE), ("uvicorn", UVICORN)):
        (folder / f"measure_{name}.py").write_text(source)
    path = os.pathsep.join([str(folder), HERE, os.environ.get("PYTHONPATH", "")])
    commands = {name: [str(folder / f"measure_{name}.py"), "{port}"] for name in ("service", "wire")}
    for parser in ("httptools", "h11"):
        imports = f"import uvicorn, {parser}"
        if not subprocess.run([sys.executable, "-c", imports], capture_output=True, check=False).returncode:
            options = ["--http", parser, "--log-level", "error", "--port", "{port}"]
            commands[f"uvicorn {parser}"] = ["-m", "uvicorn", "measure_uvicorn:app", *options]
    servers: dict[str, tuple[subprocess.Popen[bytes], int]] = {}
    version = ""
    for name, command in commands.items():
        port = free_port()
        process = subprocess.Popen(
            [sys.executable, *(each.format(port=port) for each in command)],
            env={**os.environ, "PYTHONPATH": path, "VERSION": version},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        servers[name] = (process, port)
        answered = until_answered(port)
        version = version or answered
    return servers


def until_answered(port: int) -> str:
    while True:
        client = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        try:
            client.request("GET", PATH)
            return client.getresponse().read().decode()
        except OSError:
            time.sleep(0.05)
        finally:
            client.close()


def processor_seconds(process: subprocess.Popen[bytes]) -> float:
    """Of the process that answers: the only child, or else itself."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    fields = Path(f"/proc/{children[0] if children else process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main(seconds: float, rounds: int, parts: Sequence[str]) -> None:
    plain = f"GET {PATH} HTTP/1.1\r\nHost: a\r\nAccept: */*\r\nUser-Agent: measure\r\n".encode()
    with_id = plain + b"X-Request-ID: %d\r\n\r\n"
    large = b"POST /v1/x HTTP/1.1\r\nHost: a\r\nContent-Length: %d\r\n\r\n" % LARGE + bytes(LARGE)
    with tempfile.TemporaryDirectory() as folder:
        servers = begin(Path(folder))
        try:
            for part, title, connections, requests, unit, left_out in (
                ("small", "small GETs alike, requests/s", 8, repeat(plain + b"\r\n"), 1, ""),
                ("ids", "each with an id, requests/s", 8, map(with_id.__mod__, count()), 1, ""),
                ("large", "16 MB POSTs, MB/s", 4, repeat(large), LARGE / 1e6, "service"),
            ):
                if part not in parts:
                    continue
                rates: dict[str, list[float]] = {name: [] for name in servers if name != left_out}
                spent = dict.fromkeys(rates, 0.0)
                for _, (name, each) in product(range(rounds), rates.items()):
                    process, port = servers[name]
                    before = processor_seconds(process)
                    each.append(unit * load(port, connections, requests, seconds))
                    spent[name] += processor_seconds(process) - before
                print(title)
                for name, each in rates.items():
                    answers = max(1.0, sum(each) * seconds / unit)
                    print(
                        f"  {name:18} {statistics.median(each):9.0f}   ({min(each):.0f} to {max(each):.0f}), "
                        f"{1e6 * spent[name] / answers:.0f} us of the processor each",
                        flush=True,
                    )
        finally:
            for process, _ in servers.values():
                process.send_signal(signal.SIGTERM)
                process.wait(20)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(float(given[0]) if given else 1.0, int(given[1]) if given[1:] else 5, given[2:] or PARTS)
