"""Stored inputs: named by their content, whole or not there, never evicted while in use, and good as inputs of runs."""

from __future__ import annotations

import fcntl
import hashlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from lichen.files import decode, encode
from lichen_service import durable
from lichen_service.app import Service
from lichen_service.assets import ABANDONED, Assets, Full, InUse
from lichen_service.documents import content_digest
from lichen_service.settings import Settings

from .conftest import Caller, form, picture, pointers, problem_of, read_json

BLUR = "/v1/operations/gaussian?sigma=2&device=numpy"


def name_of(data: bytes) -> str:
    return "sha256:" + hashlib.sha256(data).hexdigest()


@pytest.fixture
def assets(tmp_path: Path) -> Assets:
    return Assets(tmp_path / "assets", 1000)


# ------------------------------------------------------------------------------------------------------- the store


def test_storing_twice_is_storing_once(assets: Assets) -> None:
    assert assets.put(b"some bytes") == (name_of(b"some bytes"), True)
    assert assets.put(b"some bytes") == (name_of(b"some bytes"), False)
    assert assets.stored() == 10
    assert assets.read(name_of(b"some bytes")) == b"some bytes"
    assert assets.read(name_of(b"other bytes")) is None


def test_what_was_used_longest_ago_gives_way(assets: Assets) -> None:
    names = [assets.put(bytes([at]) * 300)[0] for at in range(3)]
    for at, name in enumerate(names):
        os.utime(assets._path(name), (at, at))
    assert assets.read(names[0]) is not None
    names.append(assets.put(b"d" * 300)[0])
    assert [assets.read(name) is not None for name in names] == [True, False, True, True]
    with pytest.raises(Full):
        assets.put(b"e" * 1001)
    assert assets.stored() <= assets.capacity


def test_what_is_in_use_stays(assets: Assets, tmp_path: Path) -> None:
    read, held = assets.put(b"a" * 400)[0], assets.put(b"b" * 400)[0]
    assert assets.hold(held, tmp_path / "input")
    with assets.request():
        assert assets.read(read) is not None
        with pytest.raises(Full):
            assets.put(b"c" * 300)
        for name in (read, held):
            with pytest.raises(InUse):
                assets.delete(name)
    assert assets.put(b"c" * 300)[1]
    assert assets.read(read) is None
    (tmp_path / "input").unlink()
    assert assets.delete(held)
    assert not assets.delete(held)
    assert not assets.hold(held, tmp_path / "input")


def test_a_damaged_file_is_missing_and_can_be_stored_again(assets: Assets) -> None:
    name = assets.put(b"whole")[0]
    assets._path(name).write_bytes(b"wh0le")
    assert assets.read(name) is None
    assert not assets._path(name).exists()
    assert assets.put(b"whole") == (name, True)
    assets._path(name).write_bytes(b"")
    assert assets.put(b"whole") == (name, True)
    assert assets.read(name) == b"whole"


def test_no_lock_outlives_a_request(assets: Assets) -> None:
    name = assets.put(b"a")[0]
    before = len(os.listdir("/proc/self/fd"))
    with assets.request():
        assets.read(name)
        assert len(os.listdir("/proc/self/fd")) > before
    assert len(os.listdir("/proc/self/fd")) == before
    with assets._path(name).open() as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


WRITER = """
import sys
from pathlib import Path
from lichen_service.assets import Assets
assets = Assets(Path(sys.argv[1]), 1 << 30)
print("ready", flush=True)
for at in range(10**9):
    assets.put(at.to_bytes(8, "little") * 50_000)
"""


def test_a_writer_that_is_killed_leaves_whole_files_or_none(tmp_path: Path) -> None:
    folder = tmp_path / "assets"
    for _ in range(3):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(folder)], stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        writer.stdout.readline()
        before = len(list(folder.glob("??/*")))
        while len(list(folder.glob("??/*"))) < before + 3:
            time.sleep(0.001)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
    files = [path for path in folder.glob("??/*") if not path.name.startswith(durable.UNFINISHED)]
    assert files
    for path in files:
        assert hashlib.sha256(path.read_bytes()).hexdigest() == path.name
    assets = Assets(folder, 1 << 30)
    unfinished = folder / files[0].parent.name / f"{durable.UNFINISHED}old"
    unfinished.touch()
    os.utime(unfinished, (time.time() - 2 * ABANDONED,) * 2)
    assets.clean()
    assert not unfinished.exists()
    assert assets.put(b"the lock is free")[1]


# ------------------------------------------------------------------------------------------------------ the routes


def store(call: Caller, data: bytes) -> str:
    response = call("PUT", "/v1/assets", data)
    assert response.status in (200, 201), bytes(response.body)
    assert response.headers["Location"] == f"/v1/assets/{name_of(data)}"
    return name_of(data)


def test_an_image_is_stored_and_comes_back_as_it_was(call: Caller, png: bytes) -> None:
    response = call("PUT", "/v1/assets", png, {"content-type": "image/png"})
    assert read_json(response) == {
        "id": name_of(png),
        "bytes": len(png),
        "media_type": "image/png",
        "width": 16,
        "height": 12,
        "channels": 3,
    }
    path = response.headers["Location"]
    found = call("GET", path)
    assert (found.status, bytes(found.body)) == (200, png)
    assert found.headers["Content-Type"] == "image/png"
    assert found.headers["Content-Digest"] == content_digest(png)
    assert "immutable" in found.headers["Cache-Control"]
    assert "Content-Security-Policy" not in found.headers, "that of the wire holds, which lets nothing run"
    assert call("HEAD", path).headers == found.headers
    assert call("GET", path, headers={"if-none-match": found.headers["ETag"]}).status == 304
    assert call("PUT", "/v1/assets", png).status == 200
    assert call("DELETE", path).status == 204
    for method in ("GET", "HEAD", "DELETE"):
        problem_of(call(method, path), 404, "unknown-asset")


@pytest.mark.parametrize(
    ("asked", "status", "part"),
    [
        ("bytes=0-4", 206, slice(0, 5)),
        ("bytes=5-", 206, slice(5, None)),
        ("bytes=-7", 206, slice(-7, None)),
        ("bytes=-999999", 206, slice(None)),
        ("Bytes=0-999999", 206, slice(None)),
        ("bytes=999999-", 416, None),
        ("bytes=-0", 416, None),
        ("bytes=5-4", 416, None),
        ("bytes=-", 416, None),
        ("bytes=0-1,3-4", 416, None),
        ("bytes=99999999999999999999999999999999-", 416, None),
        ("lines=0-1", 200, slice(None)),
        ("bytes=a-b", 200, slice(None)),
        ("", 200, slice(None)),
    ],
)
def test_one_range_of_what_is_stored(call: Caller, png: bytes, asked: str, status: int, part: slice | None) -> None:
    path = f"/v1/assets/{store(call, png)}"
    response = call("GET", path, headers={"range": asked})
    if part is None:
        problem_of(response, 416, "range-not-satisfiable")
        assert response.headers["Content-Range"] == f"bytes */{len(png)}"
        return
    assert (response.status, bytes(response.body)) == (status, png[part])
    if status == 206:
        first, last = range(len(png))[part][0], range(len(png))[part][-1]
        assert response.headers["Content-Range"] == f"bytes {first}-{last}/{len(png)}"
    tag = response.headers["ETag"]
    assert call("GET", path, headers={"range": asked, "if-range": tag}).status == status
    assert call("GET", path, headers={"range": asked, "if-range": '"other"'}).status == 200


def test_computed_answers_have_no_ranges(call: Caller, png: bytes) -> None:
    response = call("POST", BLUR, png, {"range": "bytes=0-4"})
    assert response.status == 200
    assert "Accept-Ranges" not in response.headers


def test_only_images_are_stored(call: Caller, png: bytes) -> None:
    problem_of(call("PUT", "/v1/assets", b"<html>"), 415, "unsupported-format")
    problem_of(call("PUT", "/v1/assets", png, {"content-type": "text/html"}), 415, "unsupported-format")
    body, headers = form({"image": png})
    problem_of(call("PUT", "/v1/assets", body, headers), 415, "unsupported-format")
    problem_of(call("PUT", "/v1/assets", png, {"content-type": "image/jpeg"}), 422, "unreadable-image")
    problem_of(call("PUT", "/v1/assets"), 422, "unreadable-image")
    wrong = {"content-digest": content_digest(png + b"x")}
    problem_of(call("PUT", "/v1/assets", png, wrong), 400, "digest-mismatch")
    assert call("PUT", "/v1/assets", png, {"content-digest": content_digest(png)}).status in (200, 201)


def test_a_name_is_a_name_and_no_path(call: Caller) -> None:
    for name in ("..", "sha256:..%2f..", "sha256:" + "A" * 64, "sha256:" + "0" * 63, "0" * 64):
        problem_of(call("GET", f"/v1/assets/{name}"), 404, "unknown-asset")


def test_a_store_that_is_too_small_says_so(tmp_path: Path, settings: Settings) -> None:
    chosen = replace(settings, data=str(tmp_path), asset_store=1000)
    call = Caller(Service(chosen), chosen)
    small = bytes(encode(picture(8, 8), "png").data)
    large = bytes(encode(picture(40, 40), "png").data)
    problem = problem_of(call("PUT", "/v1/assets", large), 413, "too-large")
    assert (problem["limit"], problem["actual"]) == (1000, len(large))
    name = store(call, small)
    for at in range(4):
        assert call.service.assets.hold(name, tmp_path / f"held-{at}")
    (tmp_path / "assets" / "aa").mkdir(exist_ok=True)
    filler = tmp_path / "assets" / "aa" / ("aa" + "0" * 62)
    filler.write_bytes(bytes(900))
    os.link(filler, tmp_path / "held")
    problem_of(call("PUT", "/v1/assets", bytes(encode(picture(9, 9), "png").data)), 507, "no-room")


# ------------------------------------------------------------------------------------------------- as inputs of runs


def test_a_stored_image_is_an_input_like_a_sent_one(call: Caller, png: bytes) -> None:
    sent = call("POST", f"{BLUR}&format=png", png)
    name = store(call, png)
    for method in ("GET", "POST", "QUERY"):
        found = call(method, f"{BLUR}&format=png&image={name}")
        assert (found.status, bytes(found.body)) == (200, bytes(sent.body)), bytes(found.body)
        assert found.headers["ETag"] == sent.headers["ETag"]
    tag = sent.headers["ETag"]
    assert call("GET", f"{BLUR}&format=png&image={name}", headers={"if-none-match": tag}).status == 304
    assert decode(bytes(call("HEAD", f"{BLUR}&image={name}").body)).width == 16


def test_stored_and_sent_images_mix(call: Caller, png: bytes) -> None:
    other = bytes(encode(picture().replace(pixels=picture().pixels[::-1].copy()), "png").data)
    body, headers = form({"image": png})
    name = store(call, other)
    mixed = call("POST", f"/v1/operations/difference?reference={name}", body, headers)
    assert mixed.status == 200, bytes(mixed.body)
    both, headers = form({"image": png, "reference": other})
    assert bytes(mixed.body) == bytes(call("POST", "/v1/operations/difference", both, headers).body)
    missing = call("GET", f"/v1/operations/difference?reference={name}")
    assert pointers(problem_of(missing, 422, "invalid-request")) == {"/inputs/image"}


def test_names_that_name_nothing_are_told(call: Caller, png: bytes) -> None:
    name = store(call, png)
    unknown = name_of(b"never stored")
    assert pointers(problem_of(call("GET", f"{BLUR}&image={unknown}"), 422, "invalid-request")) == {"/inputs/image"}
    assert pointers(problem_of(call("POST", f"{BLUR}&image={name}", png), 422, "invalid-request")) == {"/inputs/image"}
    twice = call("GET", f"{BLUR}&image={name}&image={name}")
    assert problem_of(twice, 422, "invalid-request")["errors"]
    for wrong in ("sha256:1", "picture.png", "https://example.com/a.png"):
        problem_of(call("POST", f"{BLUR}&image={wrong}", png), 422, "invalid-request")


def test_a_run_keeps_its_inputs_from_eviction(call: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    name, seen = store(call, png), []

    def run(*arguments: object, **more: object) -> None:
        seen.append(call("DELETE", f"/v1/assets/{name}").status)
        raise RuntimeError

    monkeypatch.setattr("lichen.engine.prepare", run)
    assert call("GET", f"{BLUR}&image={name}").status == 500
    assert seen == [409]
    assert call("DELETE", f"/v1/assets/{name}").status == 204
