"""Holds plans to random pipelines, piece after piece with a seed of its own each, and counts them.

    .venv/bin/python tests/kernels/planning/plan_fuzz.py --cases 2000
    .venv/bin/python tests/kernels/planning/plan_fuzz.py --tally plans.json --seconds 150     until all are held

A piece that fails is shown, and its seed kept: `--piece 200 --seed 7 --cases 200` draws it once more. With a `--tally`
the count is kept in a file, so that it can be left after so many seconds and gone on with later.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HELD = Path(__file__).with_name("test_metamorphic.py")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=2000, help="pipelines; a scene for every eight of them besides")
    parser.add_argument("--piece", type=int, default=200, help="of them drawn by one seed")
    parser.add_argument(
        "--seed", type=int, default=time.time_ns() % 2**31, help="of the first piece (default: another)"
    )
    parser.add_argument("--tally", type=Path, help="file that keeps the count")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="to begin no piece after")
    given = parser.parse_args()
    began = time.monotonic()
    told: dict[str, Any] = {"held": 0, "next": given.seed, "failed": []}
    if given.tally is not None and given.tally.exists():
        told = json.loads(given.tally.read_text())
    while told["held"] < given.cases and time.monotonic() - began < given.seconds:
        seed, count = told["next"], min(given.piece, given.cases - told["held"])
        held = _held(seed, count)
        told = {
            "held": told["held"] + count * held,
            "next": seed + 1,
            "failed": [*told["failed"], *([] if held else [{"seed": seed, "piece": count}])],
        }
        if given.tally is not None:
            given.tally.write_text(json.dumps(told))
        if not held:
            break
    print(json.dumps(told))
    return 1 if told["failed"] else 0


def _held(seed: int, count: int) -> bool:
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", str(HELD), f"--hypothesis-seed={seed}"]
    done = subprocess.run(
        command, env={**os.environ, "LICHEN_PIPELINES": str(count)}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        print(done.stdout, done.stderr, file=sys.stderr)
    return done.returncode == 0


if __name__ == "__main__":
    sys.exit(main())
