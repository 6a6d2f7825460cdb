"""Batches on a Dask cluster: a scheduler and workers that are processes, one of which is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lichen_cli.main import main
from lichen_client import Client

PATIENCE = 90.0
"""Seconds; generous, since only a hang should fail here."""
COUNT = 24


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Where a scheduler listens, and its two workers."""
    monkeypatch.setenv("LICHEN_DEVICE", "numpy")
    environment = {**os.environ, "LICHEN_DEVICE": "numpy"}
    found = tmp_path / "scheduler.json"

    def start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{module}", "--scheduler-file", str(found), *arguments]
        return subprocess.Popen(
            command, env=environment, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")]
    try:
        limit = time.monotonic() + PATIENCE
        while not found.exists():
            assert time.monotonic() < limit
            time.sleep(0.05)
        workers = [start("dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard") for _ in range(2)]
        processes += workers
        yield json.loads(found.read_text())["address"].removeprefix("tcp://"), workers
    finally:
        for each in reversed(processes):
            each.kill()
            each.wait()


def test_a_worker_killed_in_the_middle_costs_nothing(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    address, workers = cluster
    photos = tmp_path / "photos"
    photos.mkdir()
    for number in range(COUNT):
        np.save(photos / f"{number}.npy", np.random.default_rng(number).random((60, 80, 3), np.float32))
    out = tmp_path / "out"
    results = out / "results.jsonl"

    def kill() -> None:
        while not results.exists() or results.read_bytes().count(b"\n") < 3:
            time.sleep(0.005)
        os.kill(workers[0].pid, signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    soft = ["--operation", "gaussian", "--set", "sigma=3", "--set", "device=numpy", "--output", "{stem}.npy"]
    status = main(["batch", "run", f"{photos}/*.npy", "--out", str(out), "--engine", f"dask://{address}", *soft])
    killer.join(PATIENCE)
    summary = json.loads(capsys.readouterr().out)
    assert status == 0, summary
    assert workers[0].wait(PATIENCE) == -signal.SIGKILL
    lines: list[dict[str, Any]] = [json.loads(line) for line in results.read_text().splitlines()]
    assert len({line["id"] for line in lines}) == len(lines) == COUNT
    with Client(local=True) as client:
        for number in range(COUNT):
            expected = client.gaussian(photos / f"{number}.npy", sigma=3, device="numpy").content
            assert (out / f"{number}.npy").read_bytes() == expected


def test_a_cluster_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from lichen_batch import cluster as module

    monkeypatch.setattr(module, "WAITING", 0.5)
    np.save(tmp_path / "a.npy", np.ones((4, 4)))
    command = ["batch", "run", f"{tmp_path}/a.npy*", "--out", str(tmp_path / "out"), "--engine", "dask://127.0.0.1:9"]
    assert main([*command, "--operation", "gaussian", "--set", "sigma=1", "--output", "a.exr"]) == 3
    assert "lichen: " in capsys.readouterr().err
