"""What the ways in cost: the Python client over a raw socket, batches by their engines, tiles by their memory.

The client and the socket ask one service for the same, by turns, and their medians are compared. Batches are of photos
that are blurred: one process, two, a service on loopback, and a cluster. Kernels and codecs of every process that does
items run on one thread, in the runs that are compared with one another: on a machine of two processors one process
would otherwise use both of them. Beside them, by turns, bare processes do the same items in a loop, with no batch
around it: where two of them are not twice as fast as one, no batch can be. All are warm, and a round's figures are
compared with one another, since the machine's speed changes from round to round; medians of rounds are told.
"""

from __future__ import annotations

import contextlib
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
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import serving
from measuring import quick
from sections import Section, table

from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen_batch.engines import Engine
from lichen_batch.hands import Limits, LocalEngine
from lichen_batch.item import Item
from lichen_batch.journal import Journal
from lichen_batch.run import Rules, Stop, run
from lichen_batch.summary import Account
from lichen_client import Client

TITLE = "Clients and batches"
PHOTOS = int(os.environ.get("LICHEN_PHOTOS", "16" if quick() else "120"))
ROUNDS = 10 if quick() else 200
SIDE = int(os.environ.get("LICHEN_SIDE", "1024" if quick() else "8192"))
"""Of the array that is done in tiles."""
ROUNDS_OF_BATCHES = int(os.environ.get("LICHEN_ROUNDS", "1" if quick() else "9"))
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


class Bare:
    """So many processes that do items in a loop, without a batch around them: what this machine can give."""

    def __init__(self, processes: int) -> None:
        self._next, self._given = os.pipe()  # numbers of items, each read by whichever process comes first
        code = f"""
import json, os, sys
from lichen_batch import places
from lichen_batch.item import Item
from lichen_batch.work import perform
from lichen_client import Client
with Client(local=True) as client:
    for line in sys.stdin:
        items, outcomes = json.loads(line), []
        while number := int(os.read({self._next}, 8)):
            item = Item.from_json(items[number - 1])
            outcomes.append(perform(client, item, str(os.getpid())))
            places.keep(item.outputs.values(), str(os.getpid()))
        assert all(each.ok for each in outcomes)
        print(sum(each.whole for each in outcomes), flush=True)
"""
        environment = {**os.environ, **ALONE, "MALLOC_ARENA_MAX": "2"}
        command, pipe, given = [sys.executable, "-c", code], subprocess.PIPE, (self._next,)
        # In a session of its own as those of a batch are: the system shares its processors out to sessions.
        self._running = [
            subprocess.Popen(
                command, stdin=pipe, stdout=pipe, text=True, env=environment, pass_fds=given, start_new_session=True
            )
            for _ in range(processes)
        ]

    def do(self, items: list[Item]) -> float:
        """Seconds that the stages of all items took together."""
        for each in self._running:
            assert each.stdin
            each.stdin.write(json.dumps([item.to_json() for item in items]) + "\n")
            each.stdin.flush()
        numbers = [*range(1, len(items) + 1), *(0 for _ in self._running)]
        os.write(self._given, b"".join(b"%8d" % each for each in numbers))
        return sum(float(each.stdout.readline()) for each in self._running if each.stdout)

    def end(self) -> None:
        for each in self._running:
            each.communicate()
        os.close(self._next)
        os.close(self._given)


class Batch:
    """The loop of a batch, with its journal."""

    def __init__(self, engine: Engine, folder: Path) -> None:
        self._engine, self._folder = engine, folder

    def do(self, items: list[Item]) -> float:
        account = Account(len(items))
        with Journal(self._folder / f"{time.monotonic_ns()}.jsonl") as journal:
            todo = [(item, 0) for item in items]
            left = run(todo, len(items), self._engine, journal, Rules(), Stop(), account.add)
        assert (left, account.failed) == (0, 0)
        return sum(account.seconds["item"])

    def end(self) -> None:
        self._engine.end()


@dataclass
class Turns:
    """What was found round by round, by the names of those who did the items."""

    rates: dict[str, list[float]] = field(default_factory=dict)
    """items a second"""
    processor: dict[str, list[float]] = field(default_factory=dict)
    """seconds of processor time an item, of all processes"""
    seconds: list[float] = field(default_factory=list)
    """that an item took"""

    def over(self, one: str, other: str) -> float:
        """How many times as fast the one is as the other: the median of rounds."""
        return statistics.median(a / b for a, b in zip(self.rates[one], self.rates[other], strict=True))

    def milliseconds(self, name: str) -> float:
        """Of processor time an item."""
        return statistics.median(self.processor[name]) * 1e3


def by_turns(folder: Path, count: int, rounds: int, doing: dict[str, Bare | Batch]) -> Turns:
    turns = Turns()
    for number in range(1 + rounds):  # the first warms up
        items = [_item(folder, at, number) for at in range(count if number else 16)]
        for name, each in doing.items():
            used, began = _processor_seconds(), time.monotonic()
            taken = each.do(items)
            elapsed, used = time.monotonic() - began, _processor_seconds() - used
            if number:
                turns.rates.setdefault(name, []).append(len(items) / elapsed)
                turns.processor.setdefault(name, []).append(used / len(items))
                turns.seconds.append(taken / len(items))
    return turns


def _processor_seconds() -> float:
    """What this process and all that came of it have used."""
    children: dict[int, list[tuple[int, int]]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            said = stat.read_text().rpartition(")")[2].split()
            children.setdefault(int(said[1]), []).append((int(stat.parent.name), int(said[11]) + int(said[12])))

    def below(process: int) -> int:
        return sum(ticks + below(child) for child, ticks in children.get(process, []))

    return time.process_time() + below(os.getpid()) / os.sysconf("SC_CLK_TCK")


def _item(folder: Path, at: int, number: int) -> Item:
    places = {"image": str(folder / f"{at % 8}.jpg")}, {"result": str(folder / f"made-{at}.jpg")}
    values = {"sigma": 5 + at / 1000 + number / 10}
    return Item(f"{number}-{at}", "gaussian", None, *places, {"result": "jpeg"}, values, f"{number}-{at}")


def batch() -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photos(folder, 8)
        doing: dict[str, Bare | Batch] = {}
        for count in (1, 2):
            doing[f"bare {count}"] = Bare(count)
            doing[f"batch {count}"] = Batch(LocalEngine(count, Limits()), folder)
        try:
            turns = by_turns(folder, PHOTOS, ROUNDS_OF_BATCHES, doing)
        finally:
            for each in doing.values():
                each.end()
    middle = {each: statistics.median(found) for each, found in turns.rates.items()}
    told = [
        f"{middle[f'{kind} 1']:.1f}/s by one, {middle[f'{kind} 2']:.1f}/s by two, "
        f"{turns.over(f'{kind} 2', f'{kind} 1'):.2f} times, "
        f"{turns.milliseconds(f'{kind} 2'):.1f} ms of processor time an item"
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
    """The same items by two bare processes, by two of a batch here, and by a cluster of two."""
    from lichen_batch.cluster import DaskEngine

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        photos(folder, 8, 560, 760)
        doing: dict[str, Bare | Batch] = {"bare": Bare(2), "here": Batch(LocalEngine(2, Limits()), folder)}
        try:
            doing["there"] = Batch(DaskEngine("", 2, Limits()), folder)
            turns = by_turns(folder, 2 * PHOTOS, -(-ROUNDS_OF_BATCHES // 2), doing)
        finally:
            for each in doing.values():
                each.end()
    bare, here = (turns.over(each, "there") - 1 for each in ("bare", "here"))
    used = ", ".join(f"{turns.milliseconds(each):.1f} {each}" for each in doing)
    return (
        f"items of {statistics.median(turns.seconds) * 1e3:.0f} ms: {bare:.1%} longer than by two bare processes, "
        f"{here:.1%} than by two here; ms of processor time an item: {used}"
    )


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
