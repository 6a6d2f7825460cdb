"""Batches, tiles and jobs on a Dask cluster: a scheduler and workers that are processes, in two networks where the
system allows it, and one of which is killed."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import numpy as np
import pytest
from distributed import Client as Distributed

from lichen.files import encode
from lichen.image import Image, Storage
from lichen_batch import rasters
from lichen_batch.checking import VERSION
from lichen_batch.cluster import Workbench, do, given_by_dask
from lichen_batch.hands import Limits
from lichen_batch.item import Item
from lichen_cli.main import main
from lichen_client import Client
from lichen_service.app import Service
from lichen_service.http.message import Head, Request, Response
from lichen_service.settings import Settings

PATIENCE = 90.0
"""Seconds; generous, since only a hang should fail here."""
COUNT = 60


@pytest.fixture(autouse=True)
def numpy_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here as on the cluster, so that both compute the same."""
    monkeypatch.setenv("LICHEN_DEVICE", "numpy")


@pytest.fixture(scope="module")
def network() -> Iterator[tuple[str, str, list[str]]]:
    """Addresses here and elsewhere, and the command that runs a process there: in a network namespace of its own,
    joined to this one by a pair of interfaces, where the system allows to make one."""
    name, here, there = f"lichen-{os.getpid()}", "198.51.100.1", "198.51.100.2"
    ends = f"li{os.getpid() % 100000}a", f"li{os.getpid() % 100000}b"
    commands = [
        f"ip netns add {name}",
        f"ip link add {ends[0]} type veth peer name {ends[1]} netns {name}",
        f"ip addr add {here}/30 dev {ends[0]}",
        f"ip link set {ends[0]} up",
        f"ip -n {name} addr add {there}/30 dev {ends[1]}",
        f"ip -n {name} link set {ends[1]} up",
        f"ip -n {name} link set lo up",
    ]
    try:
        made = all(not subprocess.run(each.split(), capture_output=True, check=False).returncode for each in commands)
    except FileNotFoundError:
        made = False
    try:
        yield (here, there, ["ip", "netns", "exec", name]) if made else ("127.0.0.1", "127.0.0.1", [])
    finally:
        with contextlib.suppress(FileNotFoundError):
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
            subprocess.run(["ip", "link", "del", ends[0]], capture_output=True, check=False)


@pytest.fixture(scope="module")
def cluster(
    tmp_path_factory: pytest.TempPathFactory, network: tuple[str, str, list[str]]
) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Where a scheduler listens, and its two workers, the second in another network; the last tests kill the first."""
    tmp_path = tmp_path_factory.mktemp("cluster")
    environment = {**os.environ, "LICHEN_DEVICE": "numpy"}
    found = tmp_path / "scheduler.json"
    here, there, elsewhere = network

    def start(module: str, host: str, *arguments: str) -> subprocess.Popen[bytes]:
        before = elsewhere if host == there else []
        common = ["--scheduler-file", str(found), "--host", host, "--no-dashboard"]
        return subprocess.Popen(
            [*before, sys.executable, "-m", f"distributed.cli.{module}", *common, *arguments],
            env=environment,
            cwd=tmp_path,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    processes = [start("dask_scheduler", here, "--port", "0")]
    try:
        until(found.exists)
        workers = [start("dask_worker", host, "--nthreads", "1", "--no-nanny") for host in (here, there)]
        processes += workers
        yield json.loads(found.read_text())["address"].removeprefix("tcp://"), workers
    finally:
        for each in reversed(processes):
            each.kill()
            each.wait()


def test_the_cluster_spans_two_networks(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], network: tuple[str, str, list[str]]
) -> None:
    with Distributed(f"tcp://{cluster[0]}", set_as_default=False) as client:
        client.wait_for_workers(2, timeout=PATIENCE)
        hosts = {each.split("//")[1].split(":")[0] for each in client.nthreads()}
    assert hosts == set(network[:2])
    if not network[2]:
        pytest.skip("no network namespace can be made here, so all of it is in one network")


def asked(service: Service, method: str, path: str, body: bytes = b"", **headers: str) -> Response:
    target, _, query = path.partition("?")
    now = time.monotonic()
    head = Head(
        method, target, tuple(parse_qsl(query)), {**headers, "content-length": str(len(body))}, "a", now, now + 60
    )
    return service.handle(Request(head, body))


def state_of(service: Service, location: str) -> str:
    return str(json.loads(bytes(asked(service, "GET", location).body))["status"])


def test_jobs_of_the_service_are_computed_there_bit_for_bit(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path, measured: Callable[[str], None]
) -> None:
    """By what the service has measured, and not by what those that compute have."""
    measured("deriche")
    service = Service(Settings(data=str(tmp_path), jobs=f"dask://{cluster[0]}", cache=0, decoders=1))
    assert service.jobs is not None
    service.jobs.runner.start()
    try:
        picture = np.random.default_rng(3).random((60, 80, 3), np.float32)
        body = bytes(encode(Image(picture), "png").data)
        stored = json.loads(bytes(asked(service, "PUT", "/v1/assets", body).body))["id"]
        run, later = "/v1/operations/gaussian?sigma=3&format=png&device=numpy", {"prefer": "respond-async"}
        expected = asked(service, "POST", run, body)
        assert expected.status == 200
        assert expected.headers["Lichen-Method"].startswith("deriche")
        graph = json.dumps(
            {
                "pipeline": "gaussian:sigma=3",
                "options": {"format": "png", "device": "numpy"},
                "inputs": {"image": stored},
            }
        )
        orders = [(run, body, later), (f"{run}&image={stored}", b"", later), ("/v1/jobs", graph.encode(), {})]
        jobs = [asked(service, "POST", path, sent, **headers) for path, sent, headers in orders]
        broken = asked(service, "POST", run, body[:-30], **later)
        for each in jobs:
            location = each.headers["Location"]
            until(lambda location=location: state_of(service, location) == "successful")
            found = asked(service, "GET", f"{location}/result")
            assert (found.status, bytes(found.body)) == (200, bytes(expected.body))
            assert found.headers["Content-Digest"] == expected.headers["Content-Digest"]
        until(lambda: state_of(service, broken.headers["Location"]) == "failed")
        refused = asked(service, "GET", f"{broken.headers['Location']}/result")
        assert (refused.status, refused.headers["X-Problem-Code"]) == (422, "unreadable-image")
    finally:
        service.jobs.runner.stop(PATIENCE)
        service.decoders.end()


def test_tiles_are_computed_there_bit_for_bit(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    """By what this machine has measured, and not by what those that compute have."""
    measured("fir")
    scene = Image(np.random.default_rng(5).random((600, 530, 3), np.float32), storage=Storage.FLOAT32)
    (tmp_path / "scene.exr").write_bytes(bytes(encode(scene, "exr").data))
    soft = ["--operation", "gaussian", "--set", "sigma=9", "--set", "device=numpy"]
    for name in ("made.exr", "made.zarr"):
        made = {}
        for place, more in (("here", []), ("there", ["--engine", f"dask://{cluster[0]}"])):
            (tmp_path / place).mkdir(exist_ok=True)
            made[place] = str(tmp_path / place / name)
            assert main(["batch", "tiles", str(tmp_path / "scene.exr"), made[place], *soft, *more]) == 0
        accounts = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [each["shape"] for each in accounts] == [[600, 530, 3]] * 2
        assert all("fir; tail" in each["method"] for each in accounts), accounts
        here, there = (rasters.open_raster(each).read(0, 0, 600, 530) for each in made.values())
        np.testing.assert_array_equal(here, there)


def test_jobs_wait_for_a_cluster_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from lichen_service.jobs import cluster as module

    monkeypatch.setattr(module, "WAITING", 0.3)
    service = Service(Settings(data=str(tmp_path), jobs="dask://127.0.0.1:9", cache=0, decoders=0))
    assert service.jobs is not None
    service.jobs.runner.start()
    try:
        body = bytes(encode(Image(np.ones((4, 4, 3), np.float32)), "png").data)
        location = asked(service, "POST", "/v1/operations/gaussian?sigma=1", body, prefer="respond-async").headers[
            "Location"
        ]
        until(lambda: json.loads(bytes(asked(service, "GET", location).body))["progress"] == 0)
        seen = set()
        until(lambda: seen.add(state_of(service, location)) or seen == {"accepted", "running"})
        assert json.loads(bytes(asked(service, "DELETE", location).body))["status"] == "dismissed"
    finally:
        service.jobs.runner.stop(PATIENCE)


def test_a_task_begins_while_the_one_before_waits_for_the_disk(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    """Of a worker with one thread, whose disk keeps nothing before a second output is there."""
    source = str(tmp_path / "a.npy")
    np.save(source, np.ones((8, 8), np.float32))
    said: Any = ({"result": "exr"}, {"sigma": 1})
    bench = Workbench(Limits(), VERSION)
    name = bench.name

    def keep_in_pairs(dask_worker: Any) -> None:
        keeper, held = dask_worker.plugins[name].keeper, []
        really = keeper.keep

        def keep(*asked: Any) -> None:
            held.append(asked)
            if len(held) == 2:
                for each in held:
                    really(*each)

        keeper.keep = keep

    with Distributed(f"tcp://{cluster[0]}", set_as_default=False) as client:
        client.wait_for_workers(1, timeout=PATIENCE)
        client.register_plugin(bench)
        worker = next(iter(client.nthreads()))
        client.run(keep_in_pairs, workers=[worker])
        items = [
            Item(id, "gaussian", None, {"image": source}, {"result": f"{tmp_path}/{id}.exr"}, *said)
            for id in ("first", "second")
        ]
        tasks = [client.submit(do, name, [each.to_json()], workers=[worker], pure=False) for each in items]
        assert [each["status"] for task in tasks for each in task.result(PATIENCE)] == ["ok", "ok"]
        client.unregister_worker_plugin(name)


def until(holds: Callable[[], bool]) -> None:
    ends = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < ends, "it did not happen"
        time.sleep(0.01)


@pytest.mark.parametrize("forgiving", [True, False])
def test_a_worker_killed_in_the_middle_costs_nothing(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    forgiving: bool,
    measured: Callable[[str], None],
) -> None:
    """Also where the scheduler gives up a task whose worker has died: what it held is then asked for item by item.
    Workers choose methods by what was known where the batch was begun."""
    measured("deriche")
    address, workers = cluster

    def forgive_nothing(dask_scheduler: Any) -> None:  # in here, for it to be sent as code and not by its name
        dask_scheduler.allowed_failures = 0

    with Distributed(f"tcp://{address}", set_as_default=False) as client:
        if not forgiving:
            client.run_on_scheduler(forgive_nothing)
            workers[0] = start_worker(address, tmp_path)
        client.wait_for_workers(2, timeout=PATIENCE)
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
    assert {line["method"].partition(";")[0] for line in lines} == {"deriche"}
    with Client(local=True) as local:
        for number in range(0, COUNT, 3):
            expected = local.gaussian(photos / f"{number}.npy", sigma=3, device="numpy").content
            assert (out / f"{number}.npy").read_bytes() == expected


def start_worker(address: str, folder: Path) -> subprocess.Popen[bytes]:
    """One more worker, in this network."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", f"tcp://{address}", "--nthreads", "1"]
    host = address.rpartition(":")[0]
    return subprocess.Popen(
        [*command, "--no-nanny", "--no-dashboard", "--host", host],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def test_a_cluster_that_is_not_there_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from lichen_batch import cluster as module

    monkeypatch.setattr(module, "WAITING", 0.5)
    np.save(tmp_path / "a.npy", np.ones((4, 4)))
    command = ["batch", "run", f"{tmp_path}/a.npy*", "--out", str(tmp_path / "out"), "--engine", "dask://127.0.0.1:9"]
    assert main([*command, "--operation", "gaussian", "--set", "sigma=1", "--output", "a.exr"]) == 3
    assert "lichen: " in capsys.readouterr().err


def test_who_does_items_has_none_of_what_dask_gives_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"MALLOC_TRIM_THRESHOLD_": "65536", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "3"}.items():
        monkeypatch.setenv(name, value)
    assert {"MALLOC_TRIM_THRESHOLD_", "OPENBLAS_NUM_THREADS"} <= given_by_dask()
    assert "OMP_NUM_THREADS" not in given_by_dask()  # somebody's own
