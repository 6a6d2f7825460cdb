"""Kills batches again and again, resumes them each time, and shows that nothing was lost and nothing was done twice.

    .venv/bin/python tests/clients/batch_soak.py --items 500 --kills 100
    .venv/bin/python tests/clients/batch_soak.py --folder soak --seconds 150      again and again, until all is told

Kills are SIGKILL at random moments, to the command or to one of the processes that do its items: three of four while
items are done, the fourth while the command still starts. Before each run other methods are measured to be the
quickest on this machine. When a batch has ended, every item must have one line in its journal, and every output the
bytes that one process makes by what was known when the batch was begun. A batch that ends before all kills were counted
is followed by another. What lies in a `--folder` of its own can be left after so many seconds and gone on with later.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from lichen.accuracy import times
from lichen.catalogue import operation
from lichen.operation import Rate
from lichen_client import Client

STARTING = 4.0
"""Seconds in which a command starts, about."""
STEPS = 2
"""Operations of an item: a batch has to last for as long as it takes to be killed."""
TOLD = ("lost", "twice", "failed", "wrong", "leftovers")
"""What must be nought at the end of every batch."""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--items", type=int, default=500)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", help="where the batches lie, to be gone on with (default: a new one)")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="to leave it after")
    given = parser.parse_args()
    os.environ.setdefault("LICHEN_DEVICE", "numpy")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # modules are compiled once, as an installation leaves them
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as compiled:
        os.environ.setdefault("PYTHONPYCACHEPREFIX", compiled)
        os.environ["LICHEN_TIMES"] = str(Path(folder) / "measured")
        return _soak(Path(given.folder or folder), given)


def _soak(folder: Path, given: argparse.Namespace) -> int:
    began = time.monotonic()
    tally = folder / "kills.json"
    if not tally.exists():
        folder.mkdir(parents=True, exist_ok=True)
        _keep(tally, {"command": 0, "hand": 0, "batches": 0, "seconds": 0.0, **dict.fromkeys(TOLD, 0)})
    told = json.loads(tally.read_text())
    before, draws = told["seconds"], random.Random(f"{given.seed} {told}")
    while told["command"] + told["hand"] < given.kills or (folder / "batch").exists():
        if time.monotonic() - began > given.seconds:
            print(json.dumps({**told, "done": len(_lines(folder / "batch" / "out"))}))
            return 0
        _manifest(folder / "batch", given.items)
        manifest, out = folder / "batch" / "items.jsonl", folder / "batch" / "out"
        left, kills = given.items - len(_lines(out)), given.kills - told["command"] - told["hand"]
        _measure(draws)
        if left and kills:
            victim = _kill_once(manifest, out, draws, max(1, 2 * left // kills))
            if victim in told:
                told[victim] += 1
        else:
            told["failed"] += _start(manifest, out).wait() != 0
            for name, count in _compare(manifest.parent, out, given.items).items():
                told[name] += count
            told["batches"] += 1
            shutil.rmtree(manifest.parent)
        told["seconds"] = round(before + time.monotonic() - began, 1)
        _keep(tally, told)
    print(json.dumps({"items": given.items, **told}))
    return 1 if any(told[name] for name in TOLD) else 0


def _keep(tally: Path, told: dict[str, Any]) -> None:
    tally.write_text(json.dumps(told))


def _measure(draws: random.Random) -> None:
    """Finds how quick methods are, each time otherwise."""
    for name in ("gaussian", "resize"):
        rates = {(name, method): Rate(1e-6, 10 ** draws.uniform(-12, -6)) for method in operation(name).methods}
        times.store("numpy", rates)


def _kill_once(manifest: Path, out: Path, draws: random.Random, most: int) -> str:
    """Starts the batch, kills it or one of its processes when it has done up to `most` more items; returns which."""
    process = _start(manifest, out)
    if draws.random() < 0.25:
        time.sleep(draws.uniform(0, STARTING))
    else:
        journal = out / "results.jsonl"
        wanted = len(_lines(out)) + draws.randint(1, most)
        while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") >= wanted):
            time.sleep(0.002)
        time.sleep(draws.uniform(0, 0.2))
    hands = _children(process.pid)
    victim = "nobody"
    if hands and draws.random() < 0.2:
        _kill(draws.choice(hands))
        victim = "hand"
    elif process.poll() is None:
        victim = "command"
    process.kill()
    process.wait()
    return victim


def _manifest(folder: Path, count: int) -> None:
    path = folder / "items.jsonl"
    if path.exists():
        return
    folder.mkdir()
    for number in range(10):
        np.save(folder / f"{number}.npy", np.random.default_rng(number).random((240, 320, 3), np.float32))
    lines = []
    for number in range(count):
        line = {"id": str(number), "pipeline": _pipeline(number), "input": f"{number % 10}.npy"}
        lines.append(json.dumps({**line, "output": f"{number}.tif"}))
    part = folder / "part"
    part.write_text("\n".join(lines))
    part.replace(path)


def _pipeline(number: int) -> str:
    """No two items alike."""
    soft = [f"gaussian:sigma={1 + (number + step) % 7 + number / 1000}" for step in range(STEPS)]
    return "|".join([*soft, "resize:width=400,height=300"])


def _start(manifest: Path, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "lichen_cli", "batch", "run", str(manifest), "--out", str(out), "--resume"]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([*command, "--workers", "2"], **quiet)  # type: ignore[call-overload, no-any-return]


def _lines(out: Path) -> list[dict[str, Any]]:
    path = out / "results.jsonl"
    return [json.loads(line) for line in path.read_text().split("\n")[:-1]] if path.exists() else []


def _children(process: int) -> list[int]:
    try:
        return [int(each) for each in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


def _kill(process: int) -> None:
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return
    time.sleep(0.3)  # its item is given to another


def _compare(folder: Path, out: Path, count: int) -> dict[str, int]:
    """How many items were lost, done twice or failed, how many outputs are wrong, and how many leftovers there are."""
    lines = Counter(line["id"] for line in _lines(out) if line["status"] == "ok")
    wrong = 0
    known = json.loads((out / "times.json").read_text())["times"]
    with Client(local=True, timeout=1e9) as client, times.held(known):
        for number in range(count):
            path = out / f"{number}.tif"
            source = (folder / f"{number % 10}.npy").read_bytes()
            (made,) = client.run_pipeline(_pipeline(number), source, format="tiff").values()
            wrong += not path.exists() or path.read_bytes() != made.content
    return {
        "lost": sum(str(number) not in lines for number in range(count)),
        "twice": sum(each > 1 for each in lines.values()),
        "failed": sum(line["status"] != "ok" for line in _lines(out)),
        "wrong": wrong,
        "leftovers": sum(path.name.startswith(".") for path in out.iterdir()),
    }


if __name__ == "__main__":
    sys.exit(main())
