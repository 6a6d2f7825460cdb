"""What the ways in cost: the Python client over a raw socket, batches by their engines, tiles by their memory.

The client and the socket ask one service for the same, by turns, and their medians are compared. Batches are of photos
of 1440 x 960 that are blurred: by one process on one processor, by two on two, by a service on loopback, which is sent
as many requests at a time as `lichen batch run` sends it unless told otherwise, and by a cluster. Kernels and codecs of
every process that does items run on one thread. Beside them bare processes do the same items in a loop, with no batch
around it: where two of them are not twice as fast as one, no batch can be. All are warm and take turns, in one order
and then in the other; a round's figures are compared with one another, since the machine's speed changes from round to
round, and medians of rounds are told. Rounds in which other work took more than a twentieth of the processors are left
out, where enough others are left.
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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import serving
from measuring import quick
from sections import Section, table

from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen_batch.engines import AT_ONCE, Engine, UrlEngine
from lichen_batch.hands import Limits, LocalEngine
from lichen_batch.item import Item
from lichen_batch.journal import Journal
from lichen_batch.run import Rules, Stop, run
from lichen_batch.summary import Account
from lichen_client import Client

TITLE = "Clients and batches"
PHOTOS = int(os.environ.get("LICHEN_PHOTOS", "16" if quick() else "50"))
ROUNDS = 10 if quick() else 200
SIDE = int(os.environ.get("LICHEN_SIDE", "1024" if quick() else "8192"))
"""Of the array that is done in tiles."""
ROUNDS_OF_BATCHES = int(os.environ.get("LICHEN_ROUNDS", "1" if quick() else "9"))
OTHERS = 0.05
"""of the processors, which what is not ours may take in a round"""
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


def photos(folder: Path) -> None:
    """Eight of them."""
    chance = np.random.default_rng(2)
    for at in range(8):
        rough = chance.random((60, 90, 3), np.float32)
        pixels = np.kron(rough, np.ones((16, 16, 1), np.float32))
        (folder / f"{at}.jpg").write_bytes(encode(Image(pixels, Space.SRGB, storage=Storage.UINT8), "jpeg").data)


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


@dataclass(frozen=True)
class Turn:
    rate: float
    """items a second"""
    processor: float
    """seconds of processor time an item, of all our processes"""
    whole: float
    """seconds that the stages of an item took"""
    others: float
    """share of the processors that was not ours"""
    idle: float
    """share of the processors that nobody used"""


@dataclass
class Turns:
    """What was found, by the names of those who did the items: a turn of each in every round."""

    rounds: list[dict[str, Turn]] = field(default_factory=list)

    @property
    def calm(self) -> list[dict[str, Turn]]:
        """Those rounds in which there was little else to do; all where they are too few."""
        calm = [each for each in self.rounds if max(turn.others for turn in each.values()) < OTHERS]
        return calm if len(calm) >= min(3, len(self.rounds)) else self.rounds

    def over(self, one: str, other: str) -> float:
        """How many times as fast the one is as the other."""
        return statistics.median(each[one].rate / each[other].rate for each in self.calm)

    def rate(self, name: str) -> float:
        return statistics.median(each[name].rate for each in self.calm)

    def milliseconds(self, name: str) -> float:
        """Of processor time an item."""
        return statistics.median(each[name].processor for each in self.calm) * 1e3

    def idle(self, name: str) -> float:
        """Share of the processors that nobody used."""
        return statistics.median(each[name].idle for each in self.calm)

    @property
    def whole(self) -> float:
        """Milliseconds of an item."""
        return statistics.median(turn.whole for each in self.calm for turn in each.values()) * 1e3

    @property
    def told(self) -> str:
        return f"{len(self.calm)} of {len(self.rounds)} rounds"


def by_turns(folder: Path, count: int, rounds: int, doing: Mapping[str, Bare | Batch]) -> Turns:
    """Those whose names end in 1 have one processor, a different one in each round."""
    turns = Turns()
    for number in range(1 + rounds):  # the first warms up
        items = [_item(folder, at, number) for at in range(count if number else 16)]
        turn: dict[str, Turn] = {}
        for name in sorted(doing, reverse=bool(number % 2)):
            with _on(number if name.endswith(" 1") else None):
                busy, used, began = _busy(), _processor_seconds(), time.monotonic()
                taken = doing[name].do(items)
                elapsed, used, busy = time.monotonic() - began, _processor_seconds() - used, _busy() - busy
            whole = elapsed * (os.cpu_count() or 1)
            shares = (busy - used) / whole, max(0.0, 1 - busy / whole)
            turn[name] = Turn(count / elapsed, used / count, taken / count, *shares)
        turns.rounds += [turn] if number else []
    return turns


@contextlib.contextmanager
def _on(number: int | None) -> Iterator[None]:
    """Leaves all our processes one processor, or all of them."""
    every = os.sched_getaffinity(0)
    chosen = every if number is None else {sorted(every)[number % len(every)]}

    def leave(processors: set[int]) -> None:
        for process in _family():
            for thread in Path(f"/proc/{process}/task").glob("*"):
                with contextlib.suppress(OSError):
                    os.sched_setaffinity(int(thread.name), processors)

    leave(chosen)
    try:
        yield
    finally:
        leave(every)


def _busy() -> float:
    """Seconds that all processors have worked for whomever, or were taken away."""
    user, nice, system, _, _, *further = map(int, Path("/proc/stat").read_text().split("\n")[0].split()[1:9])
    return (user + nice + system + sum(further)) / os.sysconf("SC_CLK_TCK")


def _family() -> dict[int, int]:
    """This process and all that came of it, with what they have used, in ticks."""
    parents: dict[int, list[int]] = {}
    used: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            said = stat.read_text().rpartition(")")[2].split()
            parents.setdefault(int(said[1]), []).append(int(stat.parent.name))
            used[int(stat.parent.name)] = int(said[11]) + int(said[12])
    found = [os.getpid()]
    for each in found:
        found += parents.get(each, [])
    return {each: used.get(each, 0) for each in found}


def _processor_seconds() -> float:
    """What this process and all that came of it have used."""
    return sum(_family().values()) / os.sysconf("SC_CLK_TCK")


def _item(folder: Path, at: int, number: int) -> Item:
    places = {"image": str(folder / f"{at % 8}.jpg")}, {"result": str(folder / f"made-{at}.jpg")}
    return Item(f"{number}-{at}", "gaussian", None, *places, {"result": "jpeg"}, {"sigma": 5}, f"{number}-{at}")


@contextlib.contextmanager
def working(**makers: Callable[[Path], Bare | Batch]) -> Iterator[tuple[Path, dict[str, Bare | Batch]]]:
    """Those who do items, by names with a space in place of _, and a folder with photos."""
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        photos(folder)
        doing = {}
        for each, make in makers.items():
            doing[each.replace("_", " ")] = made = make(folder)
            stack.callback(made.end)
        yield folder, doing


def local(count: int) -> Callable[[Path], Batch]:
    return lambda folder: Batch(LocalEngine(count, Limits()), folder)


def bare(count: int) -> Callable[[Path], Bare]:
    return lambda _: Bare(count)


def batch() -> str:
    with working(bare_1=bare(1), bare_2=bare(2), batch_1=local(1), batch_2=local(2)) as (folder, doing):
        turns = by_turns(folder, PHOTOS, ROUNDS_OF_BATCHES, doing)
    told = [
        f"{turns.rate(f'{kind} 1'):.1f}/s by one, {turns.rate(f'{kind} 2'):.1f}/s by two, "
        f"{turns.over(f'{kind} 2', f'{kind} 1'):.2f} times, {turns.milliseconds(f'{kind} 1'):.1f} and "
        f"{turns.milliseconds(f'{kind} 2'):.1f} ms of processor time an item, "
        f"{turns.idle(f'{kind} 2'):.1%} of two processors idle"
        for kind in ("batch", "bare")
    ]
    return f"{told[0]}; bare processes {told[1]}; {turns.told}"


def loopback() -> str:
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(serving.lichen("--threads", "2", workers=2, **ALONE))

        def there(folder: Path) -> Batch:
            return Batch(UrlEngine(server.url, 2 * AT_ONCE, Limits()), folder)

        folder, doing = stack.enter_context(working(here=local(2), there=there))
        turns = by_turns(folder, PHOTOS, ROUNDS_OF_BATCHES, doing)
    return (
        f"{turns.rate('there'):.1f}/s by two processes there, {2 * AT_ONCE} requests at a time, "
        f"{turns.over('there', 'here'):.2f} of {turns.rate('here'):.1f}/s by two here; "
        f"{turns.milliseconds('there'):.1f} and {turns.milliseconds('here'):.1f} ms of processor time an item; "
        f"{turns.told}"
    )


def dask() -> str:
    """The same items by two bare processes, by two of a batch here, and by a cluster of two."""
    from lichen_batch.cluster import DaskEngine

    def there(folder: Path) -> Batch:
        return Batch(DaskEngine("", 2, Limits()), folder)

    with working(bare=bare(2), here=local(2), there=there) as (folder, doing):
        turns = by_turns(folder, 2 * PHOTOS, -(-ROUNDS_OF_BATCHES // 2), doing)
    more, most = (1 / turns.over("there", each) - 1 for each in ("bare", "here"))
    used = ", ".join(f"{turns.milliseconds(each):.1f} {each}" for each in doing)
    return (
        f"items of {turns.whole:.0f} ms: {more:+.1%} of the time of two bare processes, {most:+.1%} of that of two "
        f"here; ms of processor time an item: {used}; {turns.told}"
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
