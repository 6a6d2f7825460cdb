"""The parts of a batch by themselves: manifests, places, the journal and the loop. No process is started."""

from __future__ import annotations

import json
import signal
import zipfile
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from threading import Barrier, Event
from typing import Any

import numpy as np
import pytest

from lichen_batch import manifest, places
from lichen_batch.item import Item, Outcome, Problem, failure
from lichen_batch.journal import Journal, JournalError, remaining
from lichen_batch.keeping import Keeper
from lichen_batch.manifest import Defaults, InvalidManifest
from lichen_batch.run import Rules, Stop, run
from lichen_batch.settled import Unusable, settled
from lichen_batch.summary import Account, distribution


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """A folder of three tiny pictures."""
    for name in ("a", "b", "c [1]"):
        np.save(tmp_path / f"{name}.npy", np.ones((4, 5, 3), np.float32))
    return tmp_path


def lines(folder: Path, *said: Any, name: str = "items.jsonl") -> str:
    path = folder / name
    path.write_text("".join((each if isinstance(each, str) else json.dumps(each)) + "\n" for each in said))
    return str(path)


def flaws_of(source: str, defaults: Defaults | None = None) -> set[tuple[int, str]]:
    with pytest.raises(InvalidManifest) as raised:
        manifest.load(source, defaults or Defaults(), "out")
    return {(flaw.line, flaw.pointer) for flaw in raised.value.flaws}


# -------------------------------------------------------------------------------------------------------- the manifest


def test_a_line_becomes_an_item_with_places_seen_from_where_they_belong(photos: Path) -> None:
    source = lines(
        photos,
        {"id": "x", "operation": "gaussian", "input": "a.npy", "output": "soft/a.png", "parameters": {"sigma": 2}},
        {"op": "gaussian", "input": "b.npy", "output": "/tmp/b.exr", "params": {"sigma": "3", "max_error": 0.1}},
    )
    first, second = manifest.load(source, Defaults(), "out")
    assert (first.id, first.operation, first.inputs) == ("x", "gaussian", {"image": f"{photos}/a.npy"})
    assert (first.outputs, first.formats, first.values) == (
        {"result": "out/soft/a.png"},
        {"result": "png"},
        {"sigma": 2},
    )
    assert (second.id, second.outputs, second.formats) == ("b.npy", {"result": "/tmp/b.exr"}, {"result": "exr"})


def test_csv_and_patterns_say_the_same_as_lines_of_json(photos: Path) -> None:
    table = lines(photos, "id,input,output,sigma,storage", "a,a.npy,a.tif,2,float32", "b,b.npy,b.tif,3,", name="t.csv")
    first, second = manifest.load(table, Defaults(operation="gaussian"), "out")
    assert (first.values, second.values) == ({"sigma": "2", "storage": "float32"}, {"sigma": "3"})
    template = Defaults(operation="gaussian", parameters={"sigma": "2"}, output="{number}-{stem}.png")
    found = manifest.load(f"{photos}/*.npy", template, "out")
    assert [each.outputs["result"] for each in found] == ["out/1-a.png", "out/2-b.png", "out/3-c [1].png"]
    assert all(Path(each.inputs["image"]).is_file() for each in found)


def test_pipelines_and_several_places_have_names(photos: Path) -> None:
    graph = {
        "nodes": {
            "soft": {"operation": "gaussian", "parameters": {"sigma": 2}, "inputs": {"image": "input.photo"}},
            "more": {"operation": "levels", "inputs": {"image": "soft"}},
        },
        "outputs": {"one": {"node": "soft", "crop": [0, 0, 2, 2]}, "two": "more"},
    }
    places = {"inputs": {"photo": "a.npy"}, "outputs": {"one": "1.png", "two": "2.exr"}}
    text = {"pipeline": "gaussian:sigma=2|levels:gamma=2", "input": "b.npy", "output": "b.png"}
    first, second = manifest.load(lines(photos, {"id": "g", "pipeline": graph, **places}, text), Defaults(), "out")
    assert first.formats == {"one": "png", "two": "exr"}
    assert first.pipeline is not None
    assert first.pipeline["outputs"]["one"] == {"node": "soft", "format": "png", "crop": (0, 0, 2, 2)}
    assert second.outputs == {"result": "out/b.png"}


def test_a_scene_is_a_line_too(photos: Path) -> None:
    ball = {"objects": [{"shape": "sphere"}], "lights": [{"kind": "point"}], "camera": {"width": 8, "height": 8}}
    source = lines(photos, {"id": "s", "scene": ball, "output": "s.exr", "parameters": {"max_error": 0.1}})
    (item,) = manifest.load(source, Defaults(operation="gaussian"), "out")
    assert (item.operation, item.scene, item.formats) == (None, ball, {"result": "exr"})
    wrong = lines(photos, {"id": "s", "scene": {**ball, "mist": 1, "camera": {"fov": 500}}, "output": "s.exr"})
    assert flaws_of(wrong) == {(1, "/mist"), (1, "/camera/fov")}
    assert flaws_of(lines(photos, {"id": "s", "scene": "{", "output": "s.exr"})) == {(1, "/scene")}


def test_a_scene_is_said_for_all_lines_too(photos: Path) -> None:
    said = {"camera": {"width": 5, "height": 4}, "buffers": {"depth": "far"}, "fog": {"density": 0.2}}
    for_all = Defaults(scene=json.dumps(said), output="{stem}-{number}.exr")
    first, second = manifest.load(f"{photos}/[ab].npy", for_all, "out")
    assert (first.scene, second.scene, first.operation) == (said, said, None)
    assert [each.inputs for each in (first, second)] == [{"far": str(photos / name)} for name in ("a.npy", "b.npy")]
    own = {"id": "own", "operation": "gaussian", "parameters": {"sigma": 1}, "input": "a.npy"}
    lost = {"id": "lost", "inputs": {"near": "b.npy"}}
    (one,) = manifest.load(lines(photos, own), for_all, "out")
    assert (one.operation, one.scene) == ("gaussian", None)
    assert flaws_of(lines(photos, own, lost), for_all) == {(2, "/inputs/near"), (2, "/inputs/far")}
    wrong = Defaults(scene=json.dumps({**said, "mist": 1}), output="{stem}.exr")
    assert flaws_of(f"{photos}/[ab].npy", wrong) == {(1, "/mist"), (2, "/mist")}
    both = Defaults(operation="gaussian", scene=for_all.scene, output="{stem}.exr")
    assert flaws_of(f"{photos}/a.npy*", both) == {(1, "/operation")}


def test_every_flaw_of_every_line_is_found_at_once(photos: Path) -> None:
    good = {"operation": "gaussian", "input": "a.npy", "output": "a.png", "parameters": {"sigma": 2}}
    source = lines(
        photos,
        {**good, "id": "same"},
        {**good, "id": "same", "output": "other.png"},
        {**good, "id": "3"},
        {**good, "id": "4", "output": "4.xyz", "parameters": {"sigma": -1, "sgima": 2}},
        {**good, "id": "5", "input": "nowhere.npy", "output": "5.png", "colour": 1},
        {**good, "id": "6", "operation": "gausian", "output": "6.png"},
        "{not json",
        {"id": "8", "input": "a.npy", "output": "8.png"},
        {**good, "id": "9", "output": "9.png", "pipeline": "levels"},
        {"id": "10", "pipeline": "gaussian:sigma=x|blur", "input": "a.npy", "output": "10.png"},
        {"id": "11", "operation": "gaussian", "parameters": {"sigma": 2, "explain": True}},
        [1],
        {**good, "id": "13", "output": 7},
        '{"id": "14", "operation": "gaussian", "parameters": {"sigma": NaN}}',
    )
    assert flaws_of(source) == {
        (2, "/id"),
        (3, "/output"),
        (4, "/parameters/sigma"),
        (4, "/parameters/sgima"),
        (4, "/outputs/result"),
        (5, "/colour"),
        (6, "/operation"),
        (7, ""),
        (8, "/operation"),
        (9, "/operation"),
        (10, "/nodes/gaussian/parameters/sigma"),
        (10, "/nodes/blur/operation"),
        (11, "/parameters/explain"),
        (11, "/inputs/image"),
        (11, "/outputs/result"),
        (12, ""),
        (13, "/output"),
        (14, ""),
    }


@pytest.mark.parametrize(
    ("defaults", "pointer"),
    [
        (Defaults(operation="gaussian", output="{nonsense}.png"), "/output"),
        (Defaults(operation="gaussian", output="same.png"), "/output"),
        (Defaults(), "/operation"),
    ],
)
def test_what_is_said_for_all_lines_is_checked_with_each(photos: Path, defaults: Defaults, pointer: str) -> None:
    assert (2, pointer) in flaws_of(f"{photos}/*.npy", defaults)


def test_an_empty_or_missing_manifest_is_told(photos: Path) -> None:
    for source in (lines(photos, "", ""), f"{photos}/*.jpg", f"{photos}/none.jsonl"):
        with pytest.raises(InvalidManifest):
            manifest.load(source, Defaults(operation="gaussian"), "out")


def test_a_digest_changes_with_whatever_decides_the_bytes(photos: Path) -> None:
    line = {"id": "x", "operation": "gaussian", "input": "a.npy", "output": "a.png", "parameters": {"sigma": 2}}
    changed = ({"parameters": {"sigma": 3}}, {"input": "b.npy"}, {"output": "a.exr"}, {"id": "y"})
    digests = {
        manifest.load(lines(photos, {**line, **change}), Defaults(), "out")[0].digest for change in ({}, *changed)
    }
    assert len(digests) == 5
    (item,) = manifest.load(lines(photos, line), Defaults(), "out")
    assert item.digest == manifest.load(lines(photos, line), Defaults(), "out")[0].digest
    assert item.digested("another engine") != item.digest


def test_shards_are_even_and_share_nothing() -> None:
    items = [thing(str(at)) for at in range(11)]
    shares = [manifest.shard(items, index, 3) for index in range(3)]
    assert sorted(len(each) for each in shares) == [3, 4, 4]
    assert {each.id for share in shares for each in share} == {each.id for each in items}


# ---------------------------------------------------------------------------------------------------------- the places


def test_an_object_store_is_written_by_one_request_and_others_by_a_move(tmp_path: Path) -> None:
    import fsspec

    places.write("memory://batch/a.bin", b"1")
    places.write("memory://batch/a.bin", b"22")
    assert places.read("memory://batch/a.bin") == b"22"
    assert places.matching("memory://batch/*.bin") == ["memory:///batch/a.bin"]
    places.write(f"file://{tmp_path}/deep/x.bin", b"333")
    assert (tmp_path / "deep" / "x.bin").read_bytes() == b"333"
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["x.bin"]
    fsspec.filesystem("memory").rm("/batch", recursive=True)


def test_an_archive_can_be_read_from(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("in/a.npy", b"content")
    place = f"zip://in/a.npy::{tmp_path}/all.zip"
    assert places.read(place) == b"content"
    assert places.suffix_of(place) == ".npy"
    assert places.resolved(place, "/elsewhere") == place


def test_a_failed_write_leaves_what_was_there_and_no_trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a*.bin"
    places.write(str(target), b"old")

    def fail(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(places.os, "fsync", fail)
    with pytest.raises(OSError, match="No space"):
        places.write(str(target), b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["a*.bin"]
    assert target.read_bytes() == b"old"


def test_what_a_killed_process_left_is_swept_and_nothing_else(tmp_path: Path) -> None:
    stale = tmp_path / f".a[1].png{places.PART}00"
    for path in (stale, tmp_path / f".a1.png{places.PART}00", tmp_path / "a[1].png"):
        path.write_bytes(b"")
    places.sweep([str(tmp_path / "a[1].png")])
    assert not stale.exists()
    assert len(list(tmp_path.iterdir())) == 2


def test_an_outcome_is_told_when_its_output_is_in_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk, real = Event(), places.os.fsync
    monkeypatch.setattr(places.os, "fsync", lambda descriptor: (disk.wait(30), real(descriptor)))
    item = Item("a", "gaussian", None, {}, {"result": str(tmp_path / "a.png")}, {"result": "png"}, {}, "d")
    keeper, promised = Keeper(1), Future[Outcome]()
    try:
        places.lay(item.outputs["result"], b"pixels", "t")
        keeper.keep(item, fine(item), "t", promised)
        assert not promised.done()
        assert not (tmp_path / "a.png").exists()
        disk.set()
        assert promised.result(30) == fine(item)
        assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.png": b"pixels"}
    finally:
        disk.set()
        keeper.end()


def test_an_output_that_cannot_be_kept_is_a_failure_without_a_trace(tmp_path: Path) -> None:
    item = Item("a", "gaussian", None, {}, {"result": str(tmp_path / "a.png")}, {"result": "png"}, {}, "d")
    (tmp_path / "a.png").mkdir()
    keeper = Keeper(1)
    try:
        for outcome, code in ((fine(item), "unwritable-output"), (broken(item), "too-large")):
            places.lay(item.outputs["result"], b"pixels", "t")
            promised = Future[Outcome]()
            keeper.keep(item, outcome, "t", promised)
            problem = promised.result(30).problem
            assert problem is not None
            assert problem.code == code
            assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    finally:
        keeper.end()


# --------------------------------------------------------------------------------------------------------- the journal


def thing(id: str, digest: str = "d") -> Item:
    return Item(id, "gaussian", None, {}, {}, {}, {}, digest)


def fine(item: Item) -> Outcome:
    return Outcome(item.id, item.digest, "ok", {"read": 1.0, "ask": 2.0}, "fir", "numpy", 1e-5, "bound")


def broken(item: Item, *, retryable: bool = False) -> Outcome:
    return failure(item, Problem("too-large", "much", ({"pointer": "/x", "detail": "y"},), retryable))


def test_a_journal_says_what_is_left_to_do(tmp_path: Path) -> None:
    done, failed, changed, new = (thing(id) for id in ("done", "failed", "changed", "new"))
    with Journal(tmp_path / "results.jsonl") as journal:
        journal.add(broken(done), 1)
        journal.add(fine(done), 2)
        journal.add(broken(failed), 2)
        journal.add(fine(thing("changed", "earlier")), 1)
    with Journal(tmp_path / "results.jsonl") as journal:
        entries = journal.entries()
        items = (done, failed, changed, new)
        assert [item.id for item, _ in remaining(items, entries, retry_failed=False)] == ["changed", "new"]
        again = list(remaining(items, entries, retry_failed=True))
    assert [(item.id, entry.attempts if entry else 0) for item, entry in again] == [
        ("failed", 2),
        ("changed", 0),
        ("new", 0),
    ]


def test_an_item_whose_output_is_gone_is_done_again(tmp_path: Path) -> None:
    item = Item("a", "gaussian", None, {}, {"result": str(tmp_path / "a.png")}, {"result": "png"}, {}, "d")
    with Journal(tmp_path / "results.jsonl") as journal:
        journal.add(fine(item), 1)
        entries = journal.entries()
    assert [each.id for each, _ in remaining([item], entries, retry_failed=False)] == ["a"]
    (tmp_path / "a.png").write_bytes(b"")
    assert list(remaining([item], entries, retry_failed=False)) == []


def test_a_line_cut_short_anywhere_is_mended(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    with Journal(path) as journal:
        journal.add(fine(thing("a")), 1)
        kept = path.read_bytes()
        journal.add(fine(thing("b")), 1)
    whole = path.read_bytes()
    for cut in range(len(kept), len(whole)):
        path.write_bytes(whole[:cut])
        with Journal(path) as journal:
            assert set(journal.entries()) == {"a"}
            journal.add(fine(thing("c")), 1)
            assert set(journal.entries()) == {"a", "c"}
    path.write_bytes(b"x" * 200_000)
    with Journal(path) as journal:
        assert journal.empty


def test_two_runs_do_not_write_one_journal(tmp_path: Path) -> None:
    with Journal(tmp_path / "results.jsonl"), pytest.raises(JournalError, match="another run"):
        Journal(tmp_path / "results.jsonl")
    Journal(tmp_path / "results.jsonl").close()


def test_outcomes_survive_the_journal(tmp_path: Path) -> None:
    for outcome in (fine(thing("a")), broken(thing("b"), retryable=True)):
        assert Outcome.from_json(json.loads(json.dumps(outcome.to_json()))) == outcome


# ------------------------------------------------------------------------------------------------------------ the loop


class Scripted:
    """An engine that answers at once, or when it is told to, and counts how much it was given at a time."""

    name = "scripted"
    capacity = 3

    def __init__(self, script: dict[str, list[Outcome]], held: bool = False) -> None:
        self.script = script
        self.begun: list[str] = []
        self.waiting: list[tuple[Future[Outcome], Item]] = []
        self.most = 0
        self.held = held

    def submit(self, item: Item) -> Future[Outcome]:
        self.begun.append(item.id)
        future: Future[Outcome] = Future()
        self.waiting = [each for each in self.waiting if not each[0].done()]
        self.waiting.append((future, item))
        self.most = max(self.most, len(self.waiting))
        if not self.held:
            self.answer(future, item)
        return future

    def answer(self, future: Future[Outcome], item: Item) -> None:
        told = self.script.get(item.id)
        future.set_result(told.pop(0) if told else fine(item))

    def end(self) -> None:
        pass


def batch(
    tmp_path: Path, engine: Any, items: list[Item], rules: Rules | None = None, stop: Stop | None = None
) -> tuple[int, Account, list[dict[str, Any]]]:
    account = Account(len(items))
    with Journal(tmp_path / "results.jsonl") as journal:
        left = run(
            [(item, 0) for item in items],
            len(items),
            engine,
            journal,
            rules or Rules(),
            Stop() if stop is None else stop,
            account.add,
        )
        said = [json.loads(line) for line in journal.path.read_text().splitlines()]
    return left, account, said


def test_every_item_is_done_once_and_no_more_are_held_than_are_wanted(tmp_path: Path) -> None:
    engine = Scripted({})
    left, account, said = batch(tmp_path, engine, [thing(str(at)) for at in range(40)])
    assert (left, account.ok, account.failed) == (0, 40, 0)
    assert sorted(engine.begun, key=int) == [str(at) for at in range(40)]
    assert len({line["id"] for line in said}) == len(said) == 40
    assert engine.most <= engine.capacity


def test_only_what_may_pass_is_tried_again(tmp_path: Path) -> None:
    lost, bad, never = thing("lost"), thing("bad"), thing("never")
    script = {
        "lost": [broken(lost, retryable=True), fine(lost)],
        "bad": [broken(bad)],
        "never": [broken(never, retryable=True)] * 3,
    }
    engine = Scripted(script)
    _, account, said = batch(tmp_path, engine, [lost, bad, never], Rules(attempts=3))
    assert {line["id"]: (line["status"], line["attempts"]) for line in said} == {
        "lost": ("ok", 2),
        "bad": ("failed", 1),
        "never": ("failed", 3),
    }
    assert (account.failed, account.permanent, account.codes) == (2, 1, {"too-large": 2})


def test_too_many_failures_end_the_run_early(tmp_path: Path) -> None:
    items = [thing(str(at)) for at in range(100)]
    engine = Scripted({item.id: [broken(item)] for item in items[::2]})
    stop = Stop()
    left, account, _ = batch(tmp_path, engine, items, Rules(max_failure_rate=0.05), stop)
    assert stop.failing
    # The limit, and what was begun already.
    assert 6 <= account.failed <= 6 + engine.capacity
    assert left > 80


def test_a_signal_begins_nothing_more_and_waits_for_what_was_begun(tmp_path: Path) -> None:
    stop = Stop()

    class Told(Scripted):
        def submit(self, item: Item) -> Future[Outcome]:
            future = super().submit(item)
            if len(self.begun) == self.capacity:  # all it holds: the first is at work, the others wait
                self.waiting[0][0].set_running_or_notify_cancel()
                signal.raise_signal(signal.SIGTERM)
                self.answer(*self.waiting[0])
            return future

    engine = Told({}, held=True)
    with stop.listening():
        left, account, said = batch(tmp_path, engine, [thing(str(at)) for at in range(9)], stop=stop)
    assert (stop.signal, [line["id"] for line in said], account.ok, left) == (signal.SIGTERM, ["0"], 1, 8)
    assert engine.begun == ["0", "1", "2"]


def test_grace_has_an_end(tmp_path: Path) -> None:
    stop = Stop(signal=signal.SIGINT)
    engine = Scripted({}, held=True)
    left, account, _ = batch(tmp_path, engine, [thing("a")], Rules(grace=0.01), stop)
    assert (left, account.ok) == (1, 0)


def test_a_summary_tells_how_it_went(tmp_path: Path) -> None:
    items = [thing(str(at)) for at in range(20)]
    _, account, _ = batch(tmp_path, Scripted({"7": [broken(items[7])]}), items)
    summary = account.to_json(0, None, version="v")
    assert (summary["ok"], summary["failed"], summary["problems"]) == (19, 1, {"too-large": 1})
    assert summary["stage_seconds"]["item"] == {
        "count": 19,
        "mean": 3.0,
        "p50": 3.0,
        "p90": 3.0,
        "p99": 3.0,
        "max": 3.0,
    }
    assert summary["stated_errors"]["max"] == 1e-5
    assert summary["methods"] == {"fir": 19}
    json.dumps(summary, allow_nan=False)


def test_a_distribution_is_of_the_values_themselves() -> None:
    assert distribution([]) is None
    found = distribution([float(value) for value in range(100, 0, -1)])
    assert found == {"count": 100, "mean": 50.5, "p50": 51.0, "p90": 91.0, "p99": 100.0, "max": 100.0}


# ------------------------------------------------------------------------------------------------------ settled times


def test_times_are_settled_once_and_anew_for_another_version(tmp_path: Path, measured: Callable[[str], None]) -> None:
    path = tmp_path / "times.json"
    measured("deriche")
    first = settled(path, "1")
    measured("fir")
    again = settled(path, "1")
    assert (again.known, again.digest) == (first.known, first.digest)
    other = settled(path, "2")
    assert other.digest != first.digest
    assert settled(path, "2", anew=True).digest == other.digest, "nothing was measured meanwhile"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_of_runs_that_begin_at_once_all_take_what_one_has_settled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, numbers = tmp_path / "times.json", iter(range(1, 100))
    together = Barrier(4)

    def known() -> dict[str, list[Any]]:
        together.wait()
        return {"numpy": [["gaussian", "fir", 0.0, next(numbers), {}]]}

    monkeypatch.setattr("lichen_batch.settled._known", known)
    with ThreadPoolExecutor(4) as pool:
        assert len({each.digest for each in pool.map(lambda _: settled(path, "1"), range(4))}) == 1


@pytest.mark.parametrize("text", ["", "[]", '{"version": "1"}', '{"version": "1", "times": {"numpy": [["a"]]}}'])
def test_times_that_make_no_sense_are_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "times.json"
    path.write_text(text)
    with pytest.raises(Unusable, match="holds no times"):
        settled(path, "1")
