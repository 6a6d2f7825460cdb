"""Serves for a while under mixed load, and shows that memory, threads and open files stay what they were.

    python tests/service/soak.py --seconds 600 [--pause 0.2]

The load is what a service meets: images in several formats, whole and broken; stored inputs; jobs; clients that hang
up. After a fifth of the time the process is warm; from then on its memory is fitted with a line, which may rise
by one megabyte for each thousand requests at most. A control run follows, of the same service made to leak, which
must be caught: a test that cannot fail shows nothing.

Only what the load asks for is warmed up, and few answers are kept, so that kernels of others and a cache that fills are
not taken for a leak. A pause between requests
leaves the processor to others, at the price of fewer requests.
"""

from __future__ import annotations

import argparse
import contextlib
import http.client
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.files import encode
from lichen.image import Image, Space, Storage

if TYPE_CHECKING:
    from lichen_service.app import Service

RISE = 1.0
"""megabytes for each thousand requests"""
LEAK = 20_000
"""bytes that the control run keeps of each request"""
MORE = 8
"""threads or files that may come and go"""
BLUR = "/v1/operations/gaussian?sigma=2"
_START = """
import json, os, sys, tempfile
from lichen_service import app
from lichen_service.http import server
from lichen_service.serving import in_memory
from lichen_service.settings import FIGURES, SHARED, Settings
settings = Settings(**json.loads(sys.argv[3]), port=0, workers=1, spare="off", threads=2, data=sys.argv[1],
                    calibrate="off", request_timeout=600.0, idle_timeout=600.0)
with tempfile.TemporaryDirectory(prefix="lichen-", dir=in_memory()) as shared:
    os.environ.update(settings.environment() | {SHARED: shared, FIGURES: shared})
    sys.exit(server.serve(sys.argv[2], settings))
"""


def create() -> Service:
    """The service, ready when one operation has run."""
    from lichen_service import app, readiness

    whole = readiness.warm_up
    readiness.warm_up = lambda: islice(whole(), 1)  # type: ignore[assignment]
    return app.create_application()


def create_leaking() -> Service:
    """The same, which keeps a little of each request."""
    service = create()
    kept: list[bytes] = []
    answered = service.answered

    def leak(lines: Sequence[Mapping[str, Any]]) -> None:
        kept.extend(os.urandom(LEAK) for _ in lines)
        answered(lines)

    service.answered = leak  # type: ignore[method-assign]
    return service


@dataclass
class Samples:
    requests: list[int] = field(default_factory=list)
    megabytes: list[float] = field(default_factory=list)
    threads: list[int] = field(default_factory=list)
    files: list[int] = field(default_factory=list)

    def take(self, pid: int, requests: int) -> None:
        status = Path(f"/proc/{pid}/status").read_text()
        self.requests.append(requests)
        self.megabytes.append(int(_number(status, "VmRSS")) / 1024)
        self.threads.append(int(_number(status, "Threads")))
        self.files.append(len(os.listdir(f"/proc/{pid}/fd")))

    @property
    def rise(self) -> float:
        """Megabytes for each thousand requests, by least squares."""
        return float(np.polyfit(np.array(self.requests) / 1000, self.megabytes, 1)[0])

    def flaws(self) -> list[str]:
        found = []
        if self.rise > RISE:
            found.append(f"memory rises by {self.rise:.2f} MB for each thousand requests")
        for name, each in (("threads", self.threads), ("files", self.files)):
            half = len(each) // 2
            if max(each[half:]) > max(each[:half]) + MORE:
                found.append(f"{name} rise from {max(each[:half])} to {max(each[half:])}")
        return found


def _number(status: str, name: str) -> str:
    match = re.search(rf"^{name}:\s+(\d+)", status, re.MULTILINE)
    assert match, name
    return match[1]


@contextlib.contextmanager
def served(maker: str, **settings: int) -> Iterator[tuple[int, int]]:
    """The port, and the process that answers there."""
    with tempfile.TemporaryDirectory(prefix="lichen-soak-", ignore_cleanup_errors=True) as data:
        process = subprocess.Popen(
            [sys.executable, "-c", _START, data, maker, json.dumps(settings)],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        )
        try:
            assert process.stdout is not None
            announced = re.search(r":(\d+)$", process.stdout.readline().strip())
            assert announced
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            yield int(announced[1]), int(children[0])
        finally:
            process.terminate()
            process.wait(60)


class Load:
    """One client that asks for all kinds of things, one after the other."""

    def __init__(self, port: int) -> None:
        self._port = port
        generator = np.random.default_rng(3)
        pixels = (generator.integers(0, 256, (240, 320, 3)) / 255).astype(np.float32)
        image = Image(pixels, Space.SRGB, storage=Storage.UINT8)
        self._files = {name: bytes(encode(image, name).data) for name in ("png", "jpeg", "webp", "tiff")}
        self._files["npy"] = bytes(encode(Image(pixels), "npy").data)
        self._client = http.client.HTTPConnection("127.0.0.1", port, timeout=120)
        self._kinds: tuple[Callable[[int], None], ...] = (
            *[self._run] * 5,
            self._broken,
            self._unknown,
            self._stored,
            self._job,
            self._hang_up,
        )

    def ask(self, at: int) -> None:
        self._kinds[at % len(self._kinds)](at)

    def _send(self, method: str, target: str, body: bytes = b"", **headers: str) -> tuple[int, bytes]:
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        try:
            self._client.request(method, target, body or None, given)
            response = self._client.getresponse()
            return response.status, response.read()
        except (OSError, http.client.HTTPException):
            self._client.close()
            raise

    def _expect(self, found: tuple[int, bytes], *statuses: int) -> bytes:
        assert found[0] in statuses, found
        return found[1]

    def _run(self, at: int) -> None:
        data = list(self._files.values())[at % len(self._files)]
        self._expect(self._send("POST", f"{BLUR}&format={('png', 'jpeg', 'npy')[at % 3]}", data), 200)

    def _broken(self, at: int) -> None:
        data = list(self._files.values())[at % len(self._files)]
        self._expect(self._send("POST", BLUR, data[: len(data) // 2]), 422)

    def _unknown(self, at: int) -> None:
        self._expect(self._send("GET", f"/v1/made/up/{at}"), 404)

    def _stored(self, at: int) -> None:
        data = self._files["png"] + at.to_bytes(4, "big")
        name = json.loads(self._expect(self._send("PUT", "/v1/assets", data), 200, 201))["id"]
        self._expect(self._send("GET", f"{BLUR}&image={name}"), 200, 422)
        self._expect(self._send("DELETE", f"/v1/assets/{name}"), 204)

    def _job(self, at: int) -> None:
        answer = self._expect(self._send("POST", BLUR, self._files["npy"], Prefer="respond-async"), 202)
        own = json.loads(answer)["links"]["self"]
        while json.loads(self._expect(self._send("GET", own), 200))["status"] in ("accepted", "running"):
            time.sleep(0.02)
        self._expect(self._send("GET", f"{own}/result"), 200)
        self._expect(self._send("DELETE", own), 204)

    def _hang_up(self, at: int) -> None:
        data = self._files["npy"]
        with socket.create_connection(("127.0.0.1", self._port), timeout=60) as client:
            head = f"POST {BLUR} HTTP/1.1\r\nHost: a\r\nContent-Length: {len(data)}\r\n\r\n".encode()
            client.sendall(head + data[: len(data) if at % 2 else len(data) // 2])


def soak(maker: str, seconds: float, pause: float) -> Samples:
    with served(maker, max_pixels=1 << 22, cache=1 << 22) as (port, pid):
        load, samples, at = Load(port), Samples(), 0
        while load._send("GET", "/readyz")[0] != 200:
            time.sleep(0.2)
        begun = time.monotonic()
        warm, ends, next_sample = begun + seconds / 5, begun + seconds, 0.0
        while time.monotonic() < ends:
            load.ask(at)
            at += 1
            time.sleep(pause)
            if time.monotonic() > max(warm, next_sample):
                samples.take(pid, at)
                next_sample = time.monotonic() + seconds / 200
    return samples


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--pause", type=float, default=0.0, help="seconds between requests")
    given = parser.parse_args()
    failed = 0
    for title, maker, share, sound in (
        ("the service", "soak:create", 1.0, True),
        ("the control, which leaks", "soak:create_leaking", 0.2, False),
    ):
        samples = soak(maker, given.seconds * share, given.pause)
        flaws = samples.flaws()
        good = (not flaws) is sound
        failed += not good
        print(
            f"{title}: {samples.requests[-1]} requests, {samples.megabytes[0]:.0f} to {samples.megabytes[-1]:.0f} MB, "
            f"{samples.rise:+.2f} MB for each thousand, threads {min(samples.threads)} to {max(samples.threads)}, "
            f"files {min(samples.files)} to {max(samples.files)}: {'; '.join(flaws) or 'steady'}"
            f"{'' if good else '   <- FAILED'}",
            flush=True,
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
