"""Stored inputs at a URL: memory://, whose files appear whole, and file://, where they are moved into place."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fsspec
import pytest

from lichen_service import durable
from lichen_service.app import Service
from lichen_service.assets import ABANDONED, Assets, Full, InUse
from lichen_service.assets_elsewhere import open_assets
from lichen_service.refusals import Refusal
from lichen_service.settings import Settings

from .conftest import Caller, problem_of, read_json
from .test_assets import BLUR, name_of

Open = Callable[..., Assets]


@pytest.fixture(params=["memory", "file"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return f"memory://{uuid.uuid4().hex}/assets" if request.param == "memory" else f"file://{tmp_path}/store/assets"


@pytest.fixture
def opened(url: str, tmp_path: Path) -> Open:
    return lambda account="account", capacity=1000: open_assets(url, tmp_path / account, capacity)


def place(url: str, name: str) -> tuple[fsspec.AbstractFileSystem, str]:
    digest = name.partition(":")[2]
    files, path = fsspec.core.url_to_fs(f"{url}/{digest[:2]}/{digest}")
    return files, path


def test_storing_twice_is_storing_once_and_others_find_it(opened: Open, url: str) -> None:
    assets = opened()
    assert assets.put(b"some bytes") == (name_of(b"some bytes"), True)
    assert assets.put(b"some bytes") == (name_of(b"some bytes"), False)
    assert assets.stored() == 10
    assert assets.read(name_of(b"other bytes")) is None
    other = opened("another service")
    assert other.stored() == 0
    other.clean()
    assert other.stored() == 10
    assert other.read(name_of(b"some bytes")) == b"some bytes"
    assert other.delete(name_of(b"some bytes"))
    assert not other.delete(name_of(b"some bytes"))
    assets.clean()
    assert assets.stored() == 0


def test_what_was_used_longest_ago_gives_way_and_what_is_held_does_not(opened: Open, tmp_path: Path) -> None:
    assets, mark = opened(), tmp_path / "mark"
    names = [assets.put(bytes([at]) * 300)[0] for at in range(3)]
    assert assets.read(names[0]) is not None
    assert assets.hold(names[1], mark)
    names.append(assets.put(b"d" * 300)[0])
    assert [assets.read(name) is not None for name in names] == [True, True, False, True]
    with pytest.raises(InUse):
        assets.delete(names[1])
    with pytest.raises(Full):
        assets.put(b"e" * 800)
    mark.unlink()
    assert assets.put(b"e" * 1000)[1]
    assert not assets.hold(names[1], mark)
    assert not mark.exists()
    with pytest.raises(Full):
        assets.put(b"f" * 1001)


def test_damaged_bytes_are_missing_and_can_be_stored_again(opened: Open, url: str) -> None:
    assets = opened()
    name = assets.put(b"whole")[0]
    files, path = place(url, name)
    for damaged in (b"wh0le", b""):
        files.pipe_file(path, damaged)
        assert assets.read(name) is None
        assert not files.exists(path)
        assert assets.put(b"whole") == (name, True)
        assert assets.read(name) == b"whole"


def test_a_store_that_fails_keeps_nothing_and_is_told(opened: Open, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assets = opened()
    kept = assets.put(b"before")[0]
    files, path = place(url, name_of(b"whole"))

    def fail(*_: object, **__: object) -> None:
        raise PermissionError("no")

    with monkeypatch.context() as patch:
        patch.setattr(type(files), "pipe_file" if url.startswith("memory") else "mv", fail)
        with pytest.raises(OSError, match="PermissionError"):
            assets.put(b"whole")
    assert not files.exists(path)
    assert not [each for each in files.find(path.rpartition("/")[0]) if durable.UNFINISHED in each]
    assert assets.stored() == 6
    with monkeypatch.context() as patch:
        patch.setattr(type(files), "cat_file", fail)
        with pytest.raises(Refusal) as refused:
            assets.read(kept)
    assert (refused.value.status, refused.value.code) == (503, "store-silent")


def test_what_was_not_finished_is_removed(tmp_path: Path) -> None:
    assets = open_assets(f"file://{tmp_path}/store", tmp_path / "account", 1000)
    assets.put(b"whole")
    old, young = (tmp_path / "store" / "ab" / f"{durable.UNFINISHED}{name}" for name in ("old", "young"))
    old.parent.mkdir(exist_ok=True)
    for each in (old, young):
        each.touch()
    os.utime(old, (time.time() - 2 * ABANDONED,) * 2)
    assets.clean()
    assert young.exists()
    assert not old.exists()
    assert assets.stored() == 5


def test_runs_and_jobs_take_their_inputs_from_there(url: str, tmp_path: Path, settings: Settings, png: bytes) -> None:
    chosen = replace(settings, data=str(tmp_path / "data"), assets=url, asset_store=1 << 20)
    call = Caller(Service(chosen), chosen)
    name = read_json(call("PUT", "/v1/assets", png))["id"]
    assert bytes(call("GET", f"/v1/assets/{name}").body) == png
    run = call("GET", f"{BLUR}&image={name}")
    assert (run.status, bytes(run.body)) == (200, bytes(call("POST", BLUR, png).body))
    location = call("POST", f"{BLUR}&image={name}", headers={"prefer": "respond-async"}).headers["Location"]
    problem_of(call("DELETE", f"/v1/assets/{name}"), 409, "in-use")
    assert call("DELETE", location).status == 200
    assert call("DELETE", f"/v1/assets/{name}").status == 204
