"""What the service does before clients that send nothing or mean harm, and when something dies.

    python tests/service/load.py half-open|bombs|decoders|hang-up|failures ...        (all of them without a name)

More load than it can bear is offered by `overload.py`. Half-open: 2000 connections that never finish their head.
Bombs: how soon files made to harm are answered, and what memory they cost. Decoders: how long photographs of 12
megapixels take in a decoder, and where nothing is between. Hang-up: how soon the place of a client that hangs up within
a step of a second or more is another's. Failures: what was accepted before is asked for after, and the time until the
service answers again is taken.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import re
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import soak

from lichen.files import Limits, decode, encode
from lichen.image import Image, Space, Storage
from lichen_service.decoding.pool import Decoders
from lichen_service.http.limits import Bounds

PHOTO = bytes(encode(Image(np.random.default_rng(1).random((64, 64, 3), np.float32)), "png").data)
HEAD, BODY, PATIENCE = 5, 65536, Bounds().patience
BLUR = "/v1/operations/gaussian?sigma=2&format=png"


class Service:
    """`lichen serve` in a process of its own, on a port that outlives it."""

    def __init__(self, data: Path, **settings: object) -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = int(probe.getsockname()[1])
        self.data, self.settings = data, settings
        self.process: subprocess.Popen[bytes] | None = None
        self._said = Path(tempfile.mkstemp(prefix="lichen-load-", suffix=".log")[1])

    def start(self, **environment: str) -> float:
        """Seconds until it is ready."""
        began = time.monotonic()
        flags = [each for name, value in self.settings.items() for each in (f"--{name.replace('_', '-')}", str(value))]
        said = self._said.open("wb")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lichen_service", "--port", str(self.port), "--workers", "1", *flags],
            env={**os.environ, "LICHEN_DATA": str(self.data), "LICHEN_CALIBRATE": "off", **environment},
            stdout=subprocess.DEVNULL,
            stderr=said,
        )
        said.close()
        self.until_ready()
        return time.monotonic() - began

    def until_warm(self) -> None:
        """Until every operation has run once: building kernels takes what is to be measured."""
        while not re.search(rb'"event": ?"warm"', self._said.read_bytes()):
            time.sleep(0.2)

    def until_ready(self) -> float:
        began = time.monotonic()
        while self.ask("GET", "/readyz")[0] != 200:
            time.sleep(0.005)
        return time.monotonic() - began

    def ask(self, method: str, target: str, body: bytes | None = None, **headers: str) -> tuple[int, Any, bytes]:
        """Status 0 where nobody answers."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request(method, target, body, headers)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        except (OSError, http.client.HTTPException):
            return 0, {}, b""
        finally:
            connection.close()

    def children(self, module: str) -> list[int]:
        """Processes below it that run a module."""
        assert self.process is not None
        found, waiting = [], [self.process.pid]
        while waiting:
            pid = waiting.pop()
            for task in Path(f"/proc/{pid}/task").iterdir():
                waiting += map(int, (task / "children").read_text().split())
            if module.encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
                found.append(pid)
        return found

    def stop(self) -> None:
        assert self.process is not None
        self.process.terminate()
        self.process.wait(60)
        self._said.unlink(missing_ok=True)


@contextlib.contextmanager
def served(**settings: object) -> Iterator[Service]:
    data = Path(tempfile.mkdtemp(prefix="lichen-load-"))
    service = Service(data, **settings)
    try:
        service.start()
        yield service
    finally:
        service.stop()
        shutil.rmtree(data, ignore_errors=True)


def share(times: list[float], part: float) -> float:
    """In ms."""
    return sorted(times)[min(len(times) - 1, int(part * len(times)))] * 1e3 if times else 0.0


# ----------------------------------------------------------------------------------------------------------- half-open


def half_open() -> None:
    with soak.served("soak:create", header_timeout=HEAD, body_rate=BODY) as (port, worker):
        threads = Path(f"/proc/{worker}/task")
        waits = {"alone": _asked(port), "among them": []}
        before, began = len(list(threads.iterdir())), time.monotonic()
        silent = [_opened(port, b"GET / HTTP/1.1\r\nHost: a\r\nX-Slow:") for _ in range(2000)]
        opened = time.monotonic() - began
        waits["among them"] = _asked(port)
        held = len(list(threads.iterdir()))
        heads = _until_cut(silent)
        trickling = [_opened(port, b"GET / HTTP/1.1\r\nHost: a\r\nX-Slow:") for _ in range(20)]
        dripped = _until_cut(trickling, b"x")
        bodies = _until_cut(
            [_opened(port, b"POST /v1/operations/box HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\n")]
        )
    print(f"2000 half-open connections (made in {opened:.2f} s): threads {before} before, {held} meanwhile")
    for where, each in waits.items():
        print(f"a good request {where}: median {share(each, 0.5):.1f}, p99 {share(each, 0.99):.1f} ms")
    for what, each, due in (
        ("silent heads", heads, HEAD),
        ("heads of a byte each half second", dripped, HEAD),
        ("a silent body", bodies, PATIENCE),
    ):
        print(f"{what}: cut {min(each):.2f} to {max(each):.2f} s after they began, of {due:.0f} s allowed")


def _opened(port: int, sent: bytes) -> tuple[socket.socket, float]:
    sock = socket.create_connection(("127.0.0.1", port))
    sock.sendall(sent)
    return sock, time.monotonic()


def _asked(port: int, count: int = 200) -> list[float]:
    """How long runs take, from one client."""
    connection, times = http.client.HTTPConnection("127.0.0.1", port), []
    for at in range(count + 20):
        began = time.monotonic()
        connection.request("POST", f"{BLUR}&max_ms={1000 + at}", PHOTO)
        assert connection.getresponse().read()
        times.append(time.monotonic() - began)
    return times[20:]


def _until_cut(slow: list[tuple[socket.socket, float]], drip: bytes = b"") -> list[float]:
    """Seconds from the beginning of each until the service has closed it."""
    selector, cut, dripped = selectors.DefaultSelector(), [], 0.0
    for sock, began in slow:
        sock.setblocking(False)
        selector.register(sock, selectors.EVENT_READ, began)
    while selector.get_map():
        for key, _ in selector.select(0.05):
            assert isinstance(key.fileobj, socket.socket)
            if b"408" in key.fileobj.recv(4096)[:20]:
                cut.append(time.monotonic() - key.data)
                selector.unregister(key.fileobj)
                key.fileobj.close()
        if drip and time.monotonic() > dripped + 0.5:
            dripped = time.monotonic()
            for key in selector.get_map().values():
                assert isinstance(key.fileobj, socket.socket)
                key.fileobj.send(drip)
    return cut


# --------------------------------------------------------------------------------------------------------------- bombs


def resident(pids: Sequence[int]) -> dict[int, float]:
    """Megabytes, now."""
    found = (re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text()) for pid in pids)
    return {pid: int(each[1]) / 1024 for pid, each in zip(pids, found, strict=True) if each}


def bombs() -> None:
    sys.path.insert(0, str(Path(__file__).parents[1] / "kernels"))
    from test_files_hostile import claims, hollow, long_chain, ring, valid

    files = {f"{name} of gigapixels": data for name, data in claims().items()}
    files["a TIFF of 100,000 directories"] = long_chain(valid("tiff uint8"), 100_000)
    files["a TIFF of directories without end, in 3 kB"] = ring(valid("tiff uint8"))
    files["a TIFF of hollow directories, in 5 kB"] = hollow(valid("tiff uint8"))
    files["half a PNG"] = PHOTO[: len(PHOTO) // 2]
    with served(threads=2, spare="off", decoders=1) as service:
        for kind in ("png uint8", "jpeg uint8", "tiff uint8", "exr float32", "webp uint8", "npy uint8"):
            assert service.ask("POST", BLUR, valid(kind))[0] == 200
        pids = service.children("lichen_service.http.worker") + service.children("lichen_service.decoding.child")
        for name, data in files.items():
            before, times = resident(pids), []
            for _ in range(5):
                began = time.monotonic()
                status = service.ask("POST", BLUR, data)[0]
                times.append(time.monotonic() - began)
            grown = max(after - before[pid] for pid, after in resident(pids).items())
            print(f"{name}: {status}, median {share(times, 0.5):.1f} ms, most {share(times, 1):.1f}, {grown:+.1f} MB")


# ------------------------------------------------------------------------------------------------------------ decoders


def decoders() -> None:
    coarse = np.random.default_rng(3).random((300, 400, 3), np.float32)
    photo = np.kron(coarse, np.ones((10, 10, 1), np.float32))
    photo += np.random.default_rng(4).normal(0, 0.002, photo.shape).astype(np.float32)
    image = Image(np.clip(photo, 0, 1), Space.SRGB)
    files = {
        "a JPEG": encode(image, "jpeg").data,
        "a PNG of 16 bits": encode(image, "png", storage=Storage.UINT16).data,
    }
    pool = Decoders(1, 4 << 30, 60.0)
    ways: dict[str, Callable[[bytes], Image]] = {"here": decode, "in a decoder": partial(pool.decode, limits=Limits())}
    times: dict[str, list[float]] = {}
    for _ in range(5):
        for name, data in files.items():
            for where, decoded in ways.items():
                began = time.monotonic()
                decoded(data)
                times.setdefault(f"{name} of {len(data) / 1e6:.1f} MB, {where}", []).append(time.monotonic() - began)
    pool.end()
    for name, each in times.items():
        print(f"{name}: median {share(each, 0.5):.0f}, least {share(each, 0):.0f} ms")


# ------------------------------------------------------------------------------------------------------------- hang-up

LONG = "/v1/operations/worley_noise?width=6000&height=6000&format=npy&max_error=1"
SHORT = "/v1/operations/white_noise?width=8&height=8"


def hang_up() -> None:
    """The service has one place; it is taken by a long step, whose client goes, and asked for until it is free."""
    freed: list[float] = []
    whole = 0.0
    with served(threads=1, queue=0, cache=0) as service:
        for at in range(7):
            with socket.create_connection(("127.0.0.1", service.port), timeout=120) as client:
                began = time.monotonic()
                client.sendall(f"GET {LONG} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
                if at < 2:  # to the end: kernels are built, and then it is known how long it takes
                    said = client.recv(4096)
                    assert said.startswith(b"HTTP/1.1 200"), said
                    whole = time.monotonic() - began
                    continue
                time.sleep(whole / 3)
                assert service.ask("GET", SHORT)[0] == 503
            began = time.monotonic()
            while service.ask("GET", f"{SHORT}&seed={at}")[0] != 200:
                time.sleep(0.002)
            freed.append(time.monotonic() - began)
    print(f"a step of {whole:.2f} s: free after {share(freed, 0.5):.0f} ms, at most {share(freed, 1):.0f}")


# ------------------------------------------------------------------------------------------------------------ failures


def row(what: str, lost: str, seconds: float) -> None:
    print(f"| {what} | {lost} | {seconds:.2f} s |", flush=True)


def jobs(service: Service, count: int = 3) -> list[str]:
    return [
        service.ask("POST", f"{BLUR}&max_ms={1000 + at}", PHOTO, Prefer="respond-async")[1]["Location"]
        for at in range(count)
    ]


def missing(service: Service, places: list[str], seconds: float = 60.0) -> str:
    """What became of jobs."""
    ends = time.monotonic() + seconds
    left = set(places)
    while left and time.monotonic() < ends:
        left -= {each for each in left if service.ask("GET", f"{each}/result")[0] == 200}
    return f"of {len(places)} jobs {len(left)}"


def failures() -> None:
    with served(threads=2) as service:
        service.until_warm()
        for what, victim in (
            ("a worker, by kill -9", lambda: service.children("lichen_service.http.worker")[0]),
            ("a decoder, by kill -9", lambda: service.children("lichen_service.decoding.child")[0]),
        ):
            service.ask("POST", BLUR, PHOTO)
            accepted, pid = jobs(service), victim()
            os.kill(pid, signal.SIGKILL)
            began = time.monotonic()
            while service.ask("POST", BLUR, PHOTO)[0] != 200:
                time.sleep(0.002)
            row(what, missing(service, accepted), time.monotonic() - began)
        accepted = jobs(service)
        assert service.process is not None
        workers, began = service.children("lichen_service.http.worker"), time.monotonic()
        service.process.kill()
        service.process.wait()
        while any(Path(f"/proc/{pid}").exists() for pid in workers):  # they end by themselves
            time.sleep(0.002)
        service.start()
        took = time.monotonic() - began
        row("the supervisor, by kill -9, started again when its workers have gone", missing(service, accepted), took)
    _disk_full()
    with tempfile.TemporaryDirectory() as folder:
        _caches_gone(Path(folder))
    with contextlib.ExitStack() as stack:
        data = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        service = Service(data, threads=2)
        took = service.start(OCL_ICD_VENDORS="/nowhere")
        stack.callback(service.stop)
        answer = service.ask("POST", BLUR, PHOTO)
        row("PoCL is missing", f"nothing: {answer[0]} by {answer[1]['Lichen-Device']}", took)


def _disk_full() -> None:
    """On a file system of its own, of 1 MB, which needs root."""
    folder = Path(tempfile.mkdtemp(prefix="lichen-full-"))
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "lichen", str(folder)], check=False).returncode:
        print("| the disk is full | not tried: no file system could be mounted | |")
        return
    service = Service(folder, threads=2)
    try:
        service.start()
        accepted = jobs(service, 1)
        missing(service, accepted)
        filler = folder / "filler"
        with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        noise = np.random.default_rng(2).random((64, 64, 3), np.float32)
        other = bytes(encode(Image(noise), "npy").data)
        said = [service.ask("PUT", "/v1/assets", other)[0], service.ask("POST", BLUR, PHOTO, Prefer="respond-async")[0]]
        run = service.ask("POST", BLUR, PHOTO)[0]
        filler.unlink()
        began = time.monotonic()
        while service.ask("PUT", "/v1/assets", other)[0] != 201:
            time.sleep(0.002)
        lost = f"nothing: an asset {said[0]}, a job {said[1]}, a run {run}; {missing(service, accepted)}"
        row("the disk is full", lost, time.monotonic() - began)
    finally:
        service.stop()
        subprocess.run(["umount", str(folder)], check=False)
        folder.rmdir()


def _caches_gone(folder: Path) -> None:
    service = Service(folder / "data", threads=2)
    service.start(XDG_CACHE_HOME=str(folder / "cache"), POCL_CACHE_DIR=str(folder / "cache" / "pocl"))
    try:
        accepted = jobs(service)
        shutil.rmtree(folder / "cache", ignore_errors=True)
        began = time.monotonic()
        status = service.ask("POST", "/v1/operations/gaussian?sigma=7&format=png", PHOTO)[0]
        row(
            "the folder of compiled kernels is gone",
            f"{missing(service, accepted)}; the next run {status}",
            time.monotonic() - began,
        )
    finally:
        service.stop()


def main(names: list[str]) -> None:
    parts: dict[str, Callable[[], None]] = {
        "half-open": half_open,
        "bombs": bombs,
        "decoders": decoders,
        "hang-up": hang_up,
        "failures": failures,
    }
    for name in names or parts:
        parts[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
