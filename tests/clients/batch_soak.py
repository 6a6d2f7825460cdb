"""Kills a batch again and again, resumes it each time, and shows that nothing was lost and nothing was done twice.

    .venv/bin/python tests/clients/batch_soak.py --items 500 --kills 100
    .venv/bin/python tests/clients/batch_soak.py --folder soak --seconds 150      again and again, until all is told

Kills are SIGKILL at random moments, to the command or to one of the processes that do its items: three of four while
items are done, the fourth while the command still starts. At the end every item must have one line in the journal, and
every output the bytes that a run without kills gives it. A batch in a `--folder` of its own can be left after so many
seconds and gone on with later.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from lichen_client import Client

STARTING = 4.0
"""Seconds in which a command starts, about."""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--items", type=int, default=500)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", help="where the batch lies, to be gone on with (default: a new one)")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="to leave it after")
    given = parser.parse_args()
    os.environ.setdefault("LICHEN_DEVICE", "numpy")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # modules are compiled once, as an installation leaves them
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as compiled:
        os.environ.setdefault("PYTHONPYCACHEPREFIX", compiled)
        # By the same times everywhere, or processes with other processors may choose other methods.
        os.environ |= {"LICHEN_TIMES": str(Path(folder) / "times"), "LICHEN_CALIBRATE": "off"}
        return _soak(Path(given.folder or folder), given)


def _soak(folder: Path, given: argparse.Namespace) -> int:
    began = time.monotonic()
    tally = folder / "kills.json"
    if not tally.exists():
        _manifest(folder, given.items)
        _keep(tally, {"command": 0, "hand": 0, "seconds": 0.0})
    told = json.loads(tally.read_text())
    before, draws = told["seconds"], random.Random(f"{given.seed} {told}")
    manifest, out = folder / "items.jsonl", folder / "out"
    while (killed := told["command"] + told["hand"]) < given.kills:
        if time.monotonic() - began > given.seconds:
            print(json.dumps({**told, "done": len(_lines(out))}))
            return 0
        left = given.items - len(_lines(out))
        if left <= 2:
            sys.exit(f"the batch has ended after {killed} kills: more items are wanted")
        victim = _kill_once(manifest, out, draws, max(1, left // (given.kills - killed)))
        if victim in told:
            told[victim] += 1
        told["seconds"] = round(before + time.monotonic() - began, 1)
        _keep(tally, told)
    last = _start(manifest, out)
    last.wait()
    wrong = _compare(folder, out, given.items)
    print(json.dumps({"items": given.items, "kills": told, **wrong, "status": last.returncode}))
    return 0 if last.returncode == 0 and not any(wrong.values()) else 1


def _keep(tally: Path, told: dict[str, Any]) -> None:
    tally.write_text(json.dumps(told))


def _kill_once(manifest: Path, out: Path, draws: random.Random, most: int) -> str:
    """Starts the batch, kills it or one of its processes when it has done up to `most` more items; returns which."""
    process = _start(manifest, out)
    if draws.random() < 0.25:
        time.sleep(draws.uniform(0, STARTING))
    else:
        wanted = len(_lines(out)) + draws.randint(1, most)
        while process.poll() is None and len(_lines(out)) < wanted:
            time.sleep(0.002)
        time.sleep(draws.uniform(0, 0.02))
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
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "items.jsonl"
    lines = []
    for number in range(count):
        np.save(folder / f"{number}.npy", np.random.default_rng(number).random((40, 60, 3), np.float32))
        line = {"id": str(number), "operation": "gaussian", "input": f"{number}.npy", "output": f"{number}.tif"}
        lines.append(json.dumps({**line, "parameters": {"sigma": 1 + number % 7}}))
    path.write_text("\n".join(lines))


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
    with Client(local=True) as client:
        for number in range(count):
            path = out / f"{number}.tif"
            made = client.gaussian(folder / f"{number}.npy", sigma=1 + number % 7, format="tiff").content
            wrong += not path.exists() or path.read_bytes() != made
    return {
        "lost": sum(str(number) not in lines for number in range(count)),
        "twice": sum(each > 1 for each in lines.values()),
        "failed": sum(line["status"] != "ok" for line in _lines(out)),
        "wrong": wrong,
        "leftovers": sum(path.name.startswith(".") for path in out.iterdir()),
    }


if __name__ == "__main__":
    sys.exit(main())
