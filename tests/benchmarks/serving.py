"""Servers in processes of their own: started, asked over HTTP, watched, and always ended.

Time on processors and peak memory are those of the whole tree of processes, read from /proc.
"""

from __future__ import annotations

import contextlib
import ctypes
import http.client
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

TICK = os.sysconf("SC_CLK_TCK")
PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Answer:
    status: int
    headers: Mapping[str, str]
    """names in small letters"""
    body: bytes
    seconds: float
    """from the first byte sent to the last received"""


@dataclass
class Server:
    """One that runs; `connection` gives every thread its own."""

    name: str
    port: int
    process: subprocess.Popen[str]
    _own: threading.local = field(default_factory=threading.local)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def ask(self, path: str, body: bytes | None = None, **headers: str) -> Answer:
        """One request over a connection that is kept, and opened anew where the server has closed it meanwhile. Raises
        `RuntimeError` unless it succeeds."""
        kept, self._own.connection = getattr(self._own, "connection", None), None
        if kept is not None:
            with contextlib.suppress(ConnectionError):
                return self._ask(kept, path, body, headers)
            kept.close()
        return self._ask(http.client.HTTPConnection("127.0.0.1", self.port, timeout=120), path, body, headers)

    def _ask(
        self, connection: http.client.HTTPConnection, path: str, body: bytes | None, headers: Mapping[str, str]
    ) -> Answer:
        began = time.perf_counter()
        sent = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request("GET" if body is None else "POST", path, body, sent)
        reply = connection.getresponse()
        data = reply.read()
        took = time.perf_counter() - began
        self._own.connection = connection
        if not 200 <= reply.status < 300:
            raise RuntimeError(f"{self.name} answers {reply.status} to {path}: {data[:200]!r}")
        return Answer(reply.status, {name.lower(): value for name, value in reply.getheaders()}, data, took)

    @property
    def processes(self) -> list[int]:
        """This one and all that descend from it."""
        parents: dict[int, list[int]] = {}
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                parents.setdefault(int(_fields(int(folder.name))[1]), []).append(int(folder.name))
        found, at = [self.process.pid], 0
        while at < len(found):
            found += parents.get(found[at], [])
            at += 1
        return found

    @property
    def seconds(self) -> float:
        """On processors so far, those of children that ended included."""
        total = 0.0
        for each in self.processes:
            with contextlib.suppress(OSError):
                total += sum(int(ticks) for ticks in _fields(each)[11:15]) / TICK
        return total

    @property
    def peak(self) -> float:
        """Bytes of memory that its processes have held at most since `forget`, each counted by itself."""
        total = 0
        for each in self.processes:
            with contextlib.suppress(OSError):
                said = re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{each}/status").read_text())
                total += 1024 * int(said[1]) if said else 0
        return float(total)

    def forget(self) -> None:
        """Let the peak begin anew."""
        for each in self.processes:
            with contextlib.suppress(OSError):
                Path(f"/proc/{each}/clear_refs").write_text("5")


def _fields(process: int) -> list[str]:
    """Of /proc/PID/stat behind the name: state, parent ... user and system ticks, those of its children."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def started(
    name: str,
    command: Callable[[int], Sequence[str]],
    path: str,
    *,
    said: str = "",
    times: int = 1,
    patience: float = 60.0,
    **environment: str,
) -> Iterator[Server]:
    """A server whose command receives its port, from when it answers at `path` with success and, where `said` names a
    word, has written that to its log so many `times`."""
    port = free_port()
    with tempfile.NamedTemporaryFile("a", suffix=".log") as log:
        process = subprocess.Popen(
            command(port),
            env={**os.environ, **environment},
            stdout=log,
            stderr=log,
            text=True,
            preexec_fn=_end_with_parent,
        )
        server = Server(name, port, process)
        try:
            _wait(server, path, (said, times), Path(log.name), time.monotonic() + patience)
            yield server
        finally:
            family = server.processes[1:]
            process.send_signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(20)
            process.kill()
            process.wait()
            for each in family:  # what it has left behind
                with contextlib.suppress(ProcessLookupError):
                    os.kill(each, signal.SIGKILL)


def _end_with_parent() -> None:
    """Ask the kernel to end this process when the one that started it is killed."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _wait(server: Server, path: str, said: tuple[str, int], log: Path, until: float) -> None:
    while True:
        try:
            server.ask(path)
            break
        except (OSError, RuntimeError, http.client.HTTPException):
            _go_on(server, log, until)
            time.sleep(0.01)
    while said[0] and log.read_text(errors="replace").count(said[0]) < said[1]:
        _go_on(server, log, until)
        time.sleep(0.2)


def _go_on(server: Server, log: Path, until: float) -> None:
    """Raises `RuntimeError` where there is nothing left to wait for."""
    if server.process.poll() is not None or time.monotonic() > until:
        raise RuntimeError(f"{server.name} did not start: {log.read_text(errors='replace')[-500:]}")


@contextlib.contextmanager
def lichen(*flags: str, workers: int = 1, **environment: str) -> Iterator[Server]:
    """Ours, warm: all kernels are built. It keeps no answers, so that every request is computed, and no process stands
    by to take over."""
    with tempfile.TemporaryDirectory() as data:
        command = [sys.executable, "-m", "lichen_service", "--workers", str(workers), "--cache", "0", "--spare", "off"]
        wanted = {"LICHEN_DATA": data, "LICHEN_CALIBRATE": "off", **environment}
        warm: Any = {"said": '"warm"', "times": workers, "patience": 300.0}
        with started(
            "Lichen", lambda port: [*command, *flags, "--port", str(port)], "/livez", **warm, **wanted
        ) as server:
            yield server


def together(work: Callable[[], Answer], clients: int, seconds: float) -> tuple[list[float], float]:
    """The seconds of every request that so many clients make, each the next as soon as it has an answer, for about so
    long; and how long it took in all."""
    until = time.perf_counter() + seconds

    def go(_: int) -> list[float]:
        taken = [work().seconds]
        while time.perf_counter() < until:
            taken.append(work().seconds)
        return taken

    began = time.perf_counter()
    with ThreadPoolExecutor(clients) as pool:
        found = [each for one in pool.map(go, range(clients)) for each in one]
    return found, time.perf_counter() - began
