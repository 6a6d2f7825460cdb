"""What the ways in cost: the Python client over a raw socket, batches by their engines, tiles by their memory.

The client and the socket ask one service for the same, by turns, and their medians are compared. Batches are of photos
that are blurred: one process, two, a service on loopback, and a cluster. Kernels and codecs of every process that does
items run on one thread, in the runs that are compared with one another: on a machine of two processors one process
would otherwise use both of them. Beside batches of one process and of two stands what bare processes compute that do
nothing else, by turns: where two of them are not twice as fast as one, no batch can be.
"""

from __future__ import annotations

import json
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import serving
from measuring import quick
from sections import Section, table

from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen_batch.engines import Engine
from lichen_batch.item import Outcome
from lichen_client import Client

TITLE = "Clients and batches"
PHOTOS = int(os.environ.get("LICHEN_PHOTOS", "16" if quick() else "120"))
ROUNDS = 10 if quick() else 200
SIDE = int(os.environ.get("LICHEN_SIDE", "1024" if quick() else "8192"))
"""Of the array that is done in tiles."""
ROUNDS_OF_BATCHES = int(os.environ.get("LICHEN_ROUNDS", "1" if quick() else "3"))
ALONE = dict.fromkeys(("LICHEN_PROCESSORS", "OPENCV_FOR_THREADS_NUM"), "1")
"""Lets kernels and codecs of a process run on one thread."""


def imports() -> str:
    """Of compiled modules, as an installation leaves them."""
    code = "import time; began = time.perf_counter(); import lichen_client; print(time.perf_counter() - began)"
    with tempfile.TemporaryDirectory() as compiled:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment["PYTHONPYCACHEPREFIX"] = compiled
        command = [sys.executable, "-c", code]
        times = [float(subprocess.check_output(command, env=environment)) for _ in range(10)][1:]
    return f"{statistics.median(times) * 1e3:.0f} ms"


def client() -> str:
    pixels = np.random.default_rng(1).random((296, 296, 3), np.float32)  # 1.05 MB
    with serving.lichen() as server, Client(server.url) as asking:
        call = {"gamma": 1.2, "device": "numpy"}
        expected = asking.levels(pixels, **call)
        body = bytes(encode(Image(pixels, Space.LINEAR, storage=Storage.FLOAT32), "npy").data)
        target = "/v1/operations/levels?gamma=1.2&device=numpy&format=npy"
        head = f"QUERY {target} HTTP/1.1\r\nHost: a\r\nAccept: */*\r\nContent-Type: application/x-npy\r\n"
        request = head.encode() + b"Content-Length: %d\r\n\r\n" % len(body) + body
        room = bytearray(2 << 20)
        times: dict[str, list[float]] = {"client": [], "socket": []}
        with socket.create_connection(("127.0.0.1", server.port)) as raw:
            raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for _ in range(ROUNDS):
                began = time.perf_counter()
                made = asking.levels(pixels, **call)
                times["client"].append(time.perf_counter() - began)
                began = time.perf_counter()
                got = _ask(raw, request, room)
                times["socket"].append(time.perf_counter() - began)
        assert made.content == expected.content
        assert len(got) > pixels.nbytes
    medians = {name: statistics.median(each) * 1e3 for name, each in times.items()}
    over = statistics.median(a - b for a, b in zip(times["client"], times["socket"], strict=True)) * 1e3
    return f"client {medians['client']:.2f}, socket {medians['socket']:.2f}, client over socket {over:.2f} ms"


def _ask(raw: socket.socket, request: bytes, room: bytearray) -> memoryview:
    raw.sendall(request)
    at, whole = 0, None
    view = memoryview(room)
    while whole is None or at < whole:
        at += raw.recv_into(view[at:])
        if whole is None and (end := room.find(b"\r\n\r\n", 0, at)) >= 0:
            length = re.search(rb"Content-Length: (\d+)", room[:end])
            assert length
            whole = end + 4 + int(length[1])
    return view[:at]


def photos(folder: Path, count: int, height: int = 320, width: int = 480) -> None:
    chance = np.random.default_rng(2)
    for at in range(8):
        rough = chance.random((height // 16, width // 16, 3), np.float32)
        pixels = np.kron(rough, np.ones((16, 16, 1), np.float32))
        data = bytes(encode(Image(pixels, Space.SRGB, storage=Storage.UINT8), "jpeg").data)
        for number in range(at, count, 8):
            (folder / f"{number}.jpg").write_bytes(data)


def batch_of(folder: Path, *further: str) -> float:
    """Items a second, without what starting costs: of the first tenth nothing is counted."""
    out = folder / f"out-{time.monotonic_ns()}"
    soft = ["--operation", "gaussian", "--set", "sigma=4", "--output", "{stem}.jpg", "--out", str(out)]
    command = [sys.executable, "-m", "lichen_cli", "batch", "run", f"{folder}/*.jpg", *soft, *further]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    results, count = out / "results.jsonl", len(list(folder.glob("*.jpg")))
    first = last = 0.0
    while process.poll() is None:
        done = results.read_bytes().count(b"\n") if results.exists() else 0
        if done >= count // 10 and not first:
            first, begun = time.monotonic(), done
        if done >= count and not last:
            last = time.monotonic()
        time.sleep(0.01)
    assert process.returncode == 0
    return (count - begun) / ((last or time.monotonic()) - first)


def bare(folder: Path, processes: int, seconds: float = 1.0 if quick() else 3.0) -> float:
    """Items a second that so many processes compute without a batch around them: what this machine can give."""
    code = f"""
import sys, time
from lichen_client import Client
client, photo = Client(local=True), open({str(folder / "0.jpg")!r}, "rb").read()
client.run("gaussian", photo, sigma=4, format="jpeg")
print("ready", flush=True); sys.stdin.readline()
count, until = 0, time.monotonic() + {seconds}
while time.monotonic() < until:
    client.run("gaussian", photo, sigma=4, format="jpeg"); count += 1
print(count, flush=True)
"""
    environment = {**os.environ, **ALONE, "MALLOC_ARENA_MAX": "2"}
    command, pipe = [sys.executable, "-c", code], subprocess.PIPE
    running = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment) for _ in range(processes)]
    pipes = [(each.stdin, each.stdout) for each in running if each.stdin and each.stdout]
    for _, said in pipes:
        said.readline()
    for asking, _ in pipes:
        asking.write("go\n")
        asking.flush()
    count = sum(int(said.readline()) for _, said in pipes)
    for each in running:
        each.communicate()
    return count / seconds


def batch() -> str:
    rates: dict[tuple[str, int], list[float]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photos(folder, PHOTOS)
        for _ in range(ROUNDS_OF_BATCHES):
            for count in (1, 2):
                made = batch_of(folder, "--workers", str(count), "--threads", "1")
                rates.setdefault(("batch", count), []).append(made)
                rates.setdefault(("bare", count), []).append(bare(folder, count))
    found = {key: statistics.median(each) for key, each in rates.items()}
    told = [
        f"{found[kind, 1]:.1f}/s by one, {found[kind, 2]:.1f}/s by two, {found[kind, 2] / found[kind, 1]:.2f} times"
        for kind in ("batch", "bare")
    ]
    return f"{told[0]}; bare processes {told[1]}"


def loopback() -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photos(folder, PHOTOS)
        with serving.lichen("--threads", "2", workers=2, **ALONE) as server:
            there = batch_of(folder, "--url", server.url, "--workers", "2")
        here = batch_of(folder, "--workers", "2", "--threads", "1")
        return f"{there:.1f}/s by two processes there, {there / here:.2f} of {here:.1f}/s by two here"


def dask() -> str:
    """The same items by two processes here and by a cluster of two, by turns."""
    from lichen_batch.cluster import DaskEngine
    from lichen_batch.hands import Limits, LocalEngine

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photos(folder, 8, 560, 760)
        engines: list[Engine] = [LocalEngine(2, Limits()), DaskEngine("", 2, Limits())]
        taken: list[list[float]] = [[], []]
        work: list[float] = []
        try:
            for number in range(1 + ROUNDS_OF_BATCHES):  # the first warms up
                for engine, seconds in zip(engines, taken, strict=True):
                    took, outcomes = _done(engine, folder, 8 if quick() or not number else 80, number)
                    if number:
                        seconds.append(took / len(outcomes))
                        work += [
                            sum(taken for stage, taken in each.seconds.items() if "." not in stage) for each in outcomes
                        ]
        finally:
            for engine in engines:
                engine.end()
    here, there = (statistics.median(each) for each in taken)
    return f"items of {statistics.mean(work) * 1e3:.0f} ms: {there / here - 1:.1%} longer than by two processes here"


def _done(engine: Engine, folder: Path, count: int, number: int) -> tuple[float, list[Outcome]]:
    """Seconds that so many items take, and what came of them."""
    from lichen_batch.item import Item

    began = time.monotonic()
    waiting, outcomes = [], []
    for at in range(count):
        places = {"image": str(folder / f"{at % 8}.jpg")}, {"result": str(folder / f"made-{at}.jpg")}
        values = {"sigma": 5 + at / 1000 + number / 10}
        waiting.append(engine.submit(Item(str(at), "gaussian", None, *places, {"result": "jpeg"}, values)))
        if len(waiting) >= engine.capacity:
            outcomes.append(waiting.pop(0).result())
    outcomes += [each.result() for each in waiting]
    return time.monotonic() - began, outcomes


def tiles() -> str:
    import zarr

    with tempfile.TemporaryDirectory() as name:
        source = f"{name}/in.zarr"
        side = SIDE
        array = zarr.create_array(source, shape=(side, side, 1), chunks=(1024, 1024, 1), dtype="float32")
        chance = np.random.default_rng(3)
        for top in range(0, side, 1024):
            array[top : top + 1024] = chance.random((1024, side, 1), np.float32)
        soft = ["--pipeline", "gaussian:sigma=8,method=fir|levels:gamma=1.2", "--memory", "1GiB"]
        command = [sys.executable, "-m", "lichen_cli", "batch", "tiles", source, f"{name}/out.zarr", *soft]
        account = json.loads(subprocess.check_output(command, stderr=subprocess.DEVNULL).splitlines()[-1])
        share = account["peak_bytes"] / (1 << 30)
        return (
            f"{side} x {side} float32 ({side * side * 4 / 2**30:.2f} GiB) in {account['seconds']:.1f} s, "
            f"tiles of {account['tile']}, peak {share:.0%} of the 1 GiB it may hold"
        )


FIGURES: dict[str, Callable[[], str]] = {
    "import lichen_client": imports,
    "an array of 1 MB there and back": client,
    f"{PHOTOS} photos in a batch, a thread each": batch,
    f"{PHOTOS} photos over loopback": loopback,
    "a Dask cluster of two workers": dask,
    "tiles": tiles,
}


def sections(tell: Callable[[str], None]) -> list[Section]:
    rows = []
    for name, work in FIGURES.items():
        try:
            rows.append([name, work()])
        except Exception as failure:  # the others are worth having
            rows.append([name, f"not measured: {failure}".splitlines()[0]])
        tell(": ".join(rows[-1]))
    return [table("", ["way in", ""], rows)]
