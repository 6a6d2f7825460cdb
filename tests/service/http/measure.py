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
import selectors
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


def connected(port: int) -> socket.socket:
    sock = socket.create_connection(("127.0.0.1", port))
    sock.setblocking(False)
    return sock


def load(port: int, connections: int, requests: Iterator[bytes], seconds: float) -> float:
    """Answers per second."""
    selector = selectors.DefaultSelector()
    both = selectors.EVENT_READ | selectors.EVENT_WRITE
    for _ in range(connections):
        selector.register(connected(port), both, Asked(next(requests)))
    done, start = 0, time.monotonic()
    while time.monotonic() - start < seconds:
        for key, mask in selector.select(1.0):
            sock, asked = key.fileobj, key.data
            assert isinstance(sock, socket.socket)
            if mask & selectors.EVENT_READ and not asked.unsent:
                asked.answer += sock.recv(65536)
                if not asked.whole():
                    continue
                done += 1
                if b"\r\nconnection: close" in asked.answer[:1000].lower():  # after its thousandth request
                    selector.unregister(sock)
                    sock.close()
                    sock = connected(port)
                    key = selector.register(sock, both, asked)
                asked.begin(next(requests))
            if asked.unsent:
                try:
                    asked.unsent = asked.unsent[sock.send(asked.unsent) :]
                except BlockingIOError:
                    selector.modify(sock, both, asked)
                    continue
            wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if asked.unsent else 0)
            if key.events != wanted:
                selector.modify(sock, wanted, asked)
    rate = done / (time.monotonic() - start)
    for key in list(selector.get_map().values()):
        assert isinstance(key.fileobj, socket.socket)
        key.fileobj.close()
    selector.close()
    return rate


class Asked:
    """A request on its way, and what has come of its answer."""

    size = 0
    """bytes of the answer before: one that is as long and begins alike is whole, and need not be read"""

    def __init__(self, request: bytes) -> None:
        self.begin(request)

    def begin(self, request: bytes) -> None:
        self.unsent, self.answer = memoryview(request), b""

    def whole(self) -> bool:
        if len(self.answer) == self.size and self.answer.startswith(b"HTTP/1.1 200 OK"):
            return True
        head, end, _ = self.answer.partition(b"\r\n\r\n")
        if not end:
            return False
        if not head.startswith(b"HTTP/1.1 200"):
            raise RuntimeError(head[:200])
        length = re.search(rb"(?i)\r\ncontent-length: (\d+)", head)
        assert length
        self.size = len(head) + 4 + int(length[1])
        return len(self.answer) == self.size


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
