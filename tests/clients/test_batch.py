"""Batches as they are run: a command, processes that do the items, and whatever may happen to either."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.files import decode, encode
from lichen.image import Image, Space, Storage
from lichen.processors import processors
from lichen_batch.hands import Hand, Limits
from lichen_batch.item import Item
from lichen_cli.main import main
from lichen_client import Client

PATIENCE = 60.0
"""Seconds; generous, since only a hang should fail here."""
ENVIRONMENT = {**os.environ, "LICHEN_DEVICE": "numpy"}


@pytest.fixture(scope="module", autouse=True)
def without_a_device() -> Iterator[None]:
    """NumPy is warm at once; that all devices serve alike is shown elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LICHEN_DEVICE", "numpy")
        yield


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve pictures, no two alike."""
    folder = tmp_path_factory.mktemp("photos")
    for number in range(12):
        pixels = np.random.default_rng(number).random((90, 120, 3), np.float32)
        (folder / f"{number}.png").write_bytes(encode(Image(pixels, Space.SRGB, storage=Storage.UINT8), "png").data)
    return folder


def arguments(photos: Path, out: Path, *further: object) -> list[str]:
    soft = ("--operation", "gaussian", "--set", "sigma=3", "--set", "device=numpy", "--output", "{stem}.tif")
    return ["batch", "run", f"{photos}/*.png", "--out", str(out), *soft, *map(str, further)]


def started(photos: Path, out: Path, *further: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "lichen_cli", *arguments(photos, out, *further)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True)


def journal(out: Path, name: str = "results.jsonl") -> list[dict[str, Any]]:
    path = out / name
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")] if path.exists() else []


def until(condition: Callable[[], bool]) -> None:
    limit = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.002)


@pytest.fixture(scope="module")
def expected(photos: Path) -> dict[str, bytes]:
    """What the library makes of each of them."""
    return all_softened(photos)


def all_softened(photos: Path) -> dict[str, bytes]:
    asked: Any = {"sigma": 3, "device": "numpy", "format": "tiff"}
    with Client(local=True) as client:
        return {f"{each.stem}.tif": client.gaussian(each, **asked).content for each in photos.iterdir()}


def made(out: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in out.iterdir() if each.suffix not in (".jsonl", ".json")}


# ------------------------------------------------------------------------------------------------------- whole batches


def test_killed_at_any_moment_and_resumed_nothing_is_lost_and_nothing_is_done_twice(
    photos: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    """And all is done by the method that was the quickest when the batch was begun."""
    draws = random.Random(5)
    for workers, quickest in ((2, "deriche"), (1, "fir")):
        measured(quickest)
        known = len(journal(tmp_path))
        process = started(photos, tmp_path, "--workers", workers, "--resume")
        wanted = known + draws.randint(1, 4)
        while len(journal(tmp_path)) < wanted and process.poll() is None:
            time.sleep(0.002)
        time.sleep(draws.uniform(0, 0.01))
        process.kill()
        process.communicate()
        assert not [line for line in journal(tmp_path) if line["status"] != "ok"]
    finished = {line["id"] for line in journal(tmp_path)}
    assert main(arguments(photos, tmp_path, "--workers", 1, "--resume")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["done_before"], summary["ok"]) == (len(finished), 12 - len(finished))
    lines = journal(tmp_path)
    assert len({line["id"] for line in lines}) == len(lines) == 12
    assert {line["method"].partition(";")[0] for line in lines} == {"deriche"}
    assert made(tmp_path) != all_softened(photos), "this machine knows better by now"
    measured("deriche")
    assert made(tmp_path) == all_softened(photos)
    measured("fir")
    assert main(arguments(photos, tmp_path, "--workers", 1, "--overwrite")) == 0
    assert json.loads(capsys.readouterr().out)["done_before"] == 0
    assert made(tmp_path) == all_softened(photos)


def test_told_to_end_it_finishes_what_was_begun(
    photos: Path, tmp_path: Path, expected: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    def tell() -> None:
        until(lambda: len(journal(tmp_path)) >= 1)
        os.kill(os.getpid(), signal.SIGTERM)

    teller = threading.Thread(target=tell)
    before = signal.signal(signal.SIGTERM, lambda *_: None)  # should it be told when all is done
    try:
        teller.start()
        status = main(arguments(photos, tmp_path, "--workers", 1))
        teller.join()
    finally:
        signal.signal(signal.SIGTERM, before)
    summary = json.loads(capsys.readouterr().out)
    if summary["left"]:
        assert (status, summary["stopped"]) == (143, "SIGTERM")
    assert summary["ok"] + summary["left"] == 12
    done = made(tmp_path)
    assert done == {name: expected[name] for name in done}
    assert len(done) == summary["ok"] == len(journal(tmp_path))


def test_failures_are_told_and_can_be_tried_again(
    photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, bad = tmp_path / "good.npy", tmp_path / "bad.npy"
    np.save(good, np.ones((8, 8, 3), np.float32))
    np.save(tmp_path / "grey.npy", np.ones((8, 8, 1), np.float32))
    bad.write_bytes(b"\x93NUMPY but not much of it")
    rows = [
        {"id": "good", "operation": "gaussian", "input": "good.npy", "output": "g.exr", "params": {"sigma": 1}},
        {"id": "bad", "operation": "gaussian", "input": "bad.npy", "output": "b.exr", "params": {"sigma": 1}},
        {"id": "few", "operation": "lic", "input": "grey.npy", "output": "l.exr", "params": {"length": 2}},
        {"id": "found", "operation": "statistics", "input": "good.npy"},
        {"id": "two", "pipeline": {"nodes": {"a": {"operation": "gaussian", "parameters": {"sigma": 1}},
                                             "b": {"operation": "levels", "inputs": {"image": "a"}}},
                                   "outputs": {"a": "a", "b": "b"}},
         "input": "good.npy", "outputs": {"a": "a.npy", "b": "b.tif"}},
    ]  # fmt: skip
    manifest = tmp_path / "items.jsonl"
    manifest.write_text("\n".join(json.dumps(row) for row in rows))
    out = tmp_path / "out"
    command = ["batch", "run", str(manifest), "--out", str(out), "--workers", "1"]
    assert main(command) == 2
    summary = json.loads(capsys.readouterr().out)
    assert (summary["ok"], summary["failed"]) == (3, 2)
    lines = {line["id"]: line for line in journal(out)}
    assert lines["bad"]["problem"]["code"] == "unreadable-image"
    assert lines["few"]["problem"]["errors"][0]["pointer"] == "/inputs/field"
    assert lines["found"]["findings"]["channels"]
    assert set(lines["two"]["outputs"]) == {"a", "b"}
    np.testing.assert_array_equal(np.load(out / "a.npy"), np.load(good))
    assert main(command) == 3, "the journal is there, and nobody said what to do with it"
    np.save(bad, np.zeros((8, 8, 3), np.float32))
    assert main([*command, "--resume"]) == 2
    assert main([*command, "--retry-failed"]) == 2
    capsys.readouterr()
    lines = {line["id"]: line for line in journal(out)}
    assert (lines["bad"]["status"], lines["bad"]["attempts"], lines["few"]["status"]) == ("ok", 2, "failed")
    assert len(journal(out)) == 7
    assert decode((out / "b.exr").read_bytes()).pixels.shape == (8, 8, 3)
    kept = json.loads((out / "summary.json").read_text())
    assert (kept["ok"], kept["done_before"], kept["failed"]) == (1, 3, 1)


def test_an_invalid_manifest_does_nothing(
    photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = arguments(photos, tmp_path / "out", "--set", "sigma=-1", "--set", "bordr=wrap")
    assert main(command) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("/parameters/sigma") == said.err.count("/parameters/bordr") == 12
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("JOB_COMPLETION_INDEX", "0")
    assert main(arguments(photos, tmp_path / "out")) == 3, "nobody says how many shards there are"
    monkeypatch.setenv("LICHEN_SHARDS", "2")
    assert main(command) == 42
    assert main([*arguments(photos, tmp_path / "out", "--check")]) == 0
    assert json.loads(capsys.readouterr().out) == {"items": 12, "share": 6}


@pytest.mark.parametrize(
    "wrong",
    [
        ["--shard", "3/3"],
        ["--workers", "0"],
        ["--item-memory", "much"],
        ["--item-seconds", "-1"],
        ["--max-failure-rate", "2"],
        ["--engine", "abacus"],
        ["--set", "sigma"],
        ["--pipeline", "@nowhere.json"],
        ["--scene", "nowhere.json"],
        ["--nonsense"],
    ],
)
def test_a_command_that_makes_no_sense_ends_with_three(
    wrong: list[str], photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(photos, tmp_path, *wrong)) == 3
    assert capsys.readouterr().err.startswith("lichen: ")


def test_one_scene_is_rendered_for_every_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = {"camera": {"width": 12, "height": 8}, "buffers": {"depth": "far"}, "fog": {"density": 0.2}}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    depths = {name: np.full((8, 12, 1), far, np.float32) for name, far in (("near", 1.0), ("away", 9.0))}
    for name, depth in depths.items():
        np.save(tmp_path / f"{name}.npy", depth)
    command = ["batch", "run", f"{tmp_path}/*.npy", "--out", str(tmp_path), "--scene", f"{tmp_path}/scene.json"]
    assert main([*command, "--set", "device=numpy", "--output", "{stem}.png"]) == 0, capsys.readouterr()
    assert json.loads(capsys.readouterr().out)["ok"] == 2
    with Client(local=True) as local:
        for name, depth in depths.items():
            expected = local.render(scene, images={"far": depth}, device="numpy", format="png").content
            assert (tmp_path / f"{name}.png").read_bytes() == expected
    (tmp_path / "scene.json").write_text(json.dumps({**scene, "mist": 1}))
    assert main([*command, "--output", "{stem}.png", "--overwrite"]) == 3, "before anything is done"
    assert capsys.readouterr().err.count("/mist") == 2


# -------------------------------------------------------------------------------------------------------- other places


def test_a_service_makes_the_same_bytes(
    photos: Path, tmp_path: Path, expected: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    command = [sys.executable, "-m", "lichen_cli", "serve", "--port", "0", "--workers", "1"]
    service = subprocess.Popen(
        command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        assert service.stdout is not None
        url = (
            next(line for line in service.stdout if "listens on" in line).split("listens on ")[1].split()[0].strip('",')
        )
        threading.Thread(target=service.stdout.read, daemon=True).start()
        share = arguments(photos, tmp_path, "--url", url, "--shard")
        shares = [*share, "0/2", "--workers", "3"], [*share, "1/2"]
        assert [main(share) for share in shares] == [0, 0]
    finally:
        service.terminate()
        service.wait(PATIENCE)
    capsys.readouterr()
    assert made(tmp_path) == expected
    names = ("results-0-of-2.jsonl", "results-1-of-2.jsonl")
    ids = [{line["id"] for line in journal(tmp_path, name)} for name in names]
    assert [len(each) for each in ids] == [6, 6]
    assert not ids[0] & ids[1]
    summaries = [json.loads((tmp_path / name.replace("results", "summary")[:-1]).read_text()) for name in names]
    assert [each["engine"] for each in summaries] == [f"{url}, {n} at a time" for n in (3, 2 * processors())]


# --------------------------------------------------------------------------------------------------------------- hands


def waiting_item(tmp_path: Path) -> Item:
    """An item that waits for an input that never comes."""
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    return Item("slow", "gaussian", None, {"image": str(pipe)}, {"result": "x.png"}, {"result": "png"}, {"sigma": 1})


def quick_item(tmp_path: Path) -> Item:
    np.save(tmp_path / "quick.npy", np.ones((8, 8), np.float32))
    places = {"image": str(tmp_path / "quick.npy")}, {"result": str(tmp_path / "quick.exr")}
    return Item("quick", "gaussian", None, *places, {"result": "exr"}, {"sigma": 1})


def test_an_item_that_hangs_or_dies_costs_itself_alone(tmp_path: Path) -> None:
    hand = Hand(Limits(seconds=0.3))
    slow = waiting_item(tmp_path)
    try:
        quick = quick_item(tmp_path)
        assert hand.do(quick).ok
        # Each is handed to the process while it does the one before: so is the last, which ends with the process.
        following = iter([slow, quick])
        said = list(hand.each(quick, lambda: next(following, None)))
        assert [item.id for item, _ in said] == ["quick", "slow", "quick"]
        before, late, after = (outcome for _, outcome in said)
        assert before.ok
        assert after.ok
        assert late.problem is not None
        assert (late.problem.code, late.problem.retryable) == ("too-slow", False)
        hand._limits = Limits()
        hand.start()

        def kill() -> None:
            until(lambda: hand._warm)
            time.sleep(0.05)
            assert hand._process is not None
            os.kill(hand._process.pid, signal.SIGSEGV)

        killer = threading.Thread(target=kill)
        killer.start()
        dead = hand.do(slow)
        killer.join()
        assert dead.problem is not None
        assert (dead.problem.code, dead.problem.retryable) == ("died", True)
        assert "signal 11" in dead.problem.detail
    finally:
        hand.end()


def test_behind_an_item_that_will_be_short_the_next_is_handed_over_with_it(tmp_path: Path) -> None:
    hand = Hand(Limits())
    quick = quick_item(tmp_path)
    further = [quick, quick]
    try:
        assert hand.do(quick).ok  # which started the process
        assert hand.do(quick).ok
        doing = hand.each(quick, lambda: further.pop() if further else None)
        assert next(doing)[1].ok
        assert len(further) == 1, "nothing was handed over with the first"
        assert [outcome.ok for _, outcome in doing] == [True, True]
    finally:
        hand.end()


def test_an_item_that_takes_too_much_memory_is_ended(tmp_path: Path) -> None:
    hand = Hand(Limits(memory=600 << 20))
    noise = {"width": 16384, "height": 16384}
    large = Item("l", "white_noise", None, {}, {"result": str(tmp_path / "l.exr")}, {"result": "exr"}, noise)
    try:
        planned = hand.do(large)
        assert planned.problem is not None
        assert planned.problem.code == "too-large", "which is known before anything is computed"
        hand._limits = Limits(memory=10 << 20)  # less than any process holds
        held = hand.do(waiting_item(tmp_path))
        assert held.problem is not None
        assert held.problem.code == "out-of-memory"
    finally:
        hand.end()


def test_a_hand_ends_with_whoever_started_it(tmp_path: Path) -> None:
    code = "import sys, time; from lichen_batch.hands import Hand, Limits; h = Hand(Limits()); h.start(); "
    code += "print(h._process.pid, flush=True); time.sleep(100)"
    owner = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
    assert owner.stdout is not None
    hand = int(owner.stdout.readline())
    owner.kill()
    owner.communicate()
    until(lambda: not Path(f"/proc/{hand}").exists() or "Z" in Path(f"/proc/{hand}/stat").read_text().split()[2])


def test_the_engine_here_and_the_library_make_the_same_pixels(photos: Path, expected: dict[str, bytes]) -> None:
    image = decode((photos / "3.png").read_bytes())
    result = lichen.run("gaussian", image, sigma=3, storage="uint8", device="numpy")
    assert encode(result.image, "tiff", storage=Storage.UINT8).data == expected["3.tif"]
