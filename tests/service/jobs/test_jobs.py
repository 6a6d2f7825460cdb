"""Jobs over their paths: asked for in two ways, watched, fetched, dismissed; and on a server that is killed."""

from __future__ import annotations

import errno
import http.client
import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest

from lichen.files import decode
from lichen_service import durable, strict_json
from lichen_service.access import keys
from lichen_service.access.keys import Keys
from lichen_service.app import Service
from lichen_service.http.message import Response
from lichen_service.jobs.queue import MOST_ATTEMPTS
from lichen_service.jobs.runner import Runner
from lichen_service.openapi_storage import job_schema
from lichen_service.refusals import Refusal
from lichen_service.settings import Settings

from ..conftest import Caller, pointers, problem_of, read_json
from ..test_server import ask, served
from ..test_verifying import parts_of, payload

BLUR = "/v1/operations/gaussian?sigma=2&device=numpy&format=png"
PIPELINE = {"nodes": {"gaussian": {"operation": "gaussian", "parameters": {"sigma": 2}}}}
SCENE = {
    "camera": {"eye": [0, 1.5, 4], "target": [0, 0.6, 0], "width": 24, "height": 16},
    "objects": [{"shape": "sphere", "centre": [0, 0.8, 0], "radius": 0.8}],
    "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30}],
}
ASYNC = {"prefer": "respond-async"}
PATIENCE = 300.0


def until(holds: Callable[[], bool]) -> None:
    """Waits for a condition; a machine may be slow, but not that slow."""
    ends = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < ends, "it did not happen"
        time.sleep(0.01)


@pytest.fixture
def idle(tmp_path: Path, settings: Settings) -> Caller:
    """A service that accepts jobs and does none."""
    chosen = replace(settings, data=str(tmp_path), max_jobs_each=5)
    return Caller(Service(chosen), chosen)


@pytest.fixture
def working(idle: Caller) -> Iterator[Caller]:
    assert idle.service.jobs is not None
    idle.service.jobs.runner.start()
    yield idle
    idle.service.jobs.runner.stop(PATIENCE)


def accepted(response: Response) -> str:
    assert response.status == 202, bytes(response.body)
    assert response.headers["Preference-Applied"] == "respond-async"
    document = read_json(response)
    assert document["status"] == "accepted"
    assert response.headers["Location"] == document["links"]["self"]
    return response.headers["Location"]


def ended(call: Caller, location: str) -> dict[str, Any]:
    until(lambda: read_json(call("GET", location))["status"] in ("successful", "failed", "dismissed"))
    found = read_json(call("GET", location))
    assert isinstance(found, dict)
    return found


def test_a_result_fetched_later_is_the_one_given_at_once(working: Caller, png: bytes) -> None:
    now = working("POST", BLUR, png)
    location = accepted(working("POST", BLUR, png, {"prefer": "wait=1, respond-async"}))
    document = ended(working, location)
    assert jsonschema_rs.is_valid(job_schema(), document)
    assert not jsonschema_rs.is_valid(job_schema(), {**document, "progress": 101})
    assert (document["status"], document["progress"]) == ("successful", 100)
    assert document["created"] <= document["started"] <= document["finished"] < document["expires"]
    later = working("GET", f"{location}/result")
    assert (later.status, bytes(later.body)) == (200, bytes(now.body))
    for name in ("Content-Type", "Content-Digest", "ETag", "Lichen-Method", "Lichen-Error", "Lichen-Space"):
        assert later.headers[name] == now.headers[name]
    part = working("GET", f"{location}/result", headers={"range": "bytes=0-7"})
    assert (part.status, bytes(part.body)) == (206, bytes(now.body)[:8])
    tag = {"if-none-match": later.headers["ETag"]}
    assert working("GET", f"{location}/result", headers=tag).status == 304
    assert working("DELETE", location).status == 204
    problem_of(working("GET", location), 404, "unknown-job")
    problem_of(working("GET", f"{location}/result"), 404, "unknown-job")


@pytest.mark.parametrize("form", ["query", "json"])
def test_a_verified_job_keeps_the_map_of_its_error(working: Caller, png: bytes, form: str) -> None:
    """Beside the picture, where the job was asked for in parts; what was found stands in a header in any case."""
    wanted = {"accept": "multipart/mixed"}
    now = working("POST", f"{BLUR}&verify=true", png, wanted)
    if form == "query":
        location = accepted(working("POST", f"{BLUR}&verify=true", png, {**ASYNC, **wanted}))
    else:
        name = read_json(working("PUT", "/v1/assets", png))["id"]
        said = {"sigma": 2, "device": "numpy", "format": "png", "verify": True}
        order = json.dumps({"operation": "gaussian", "parameters": said, "inputs": {"image": name}}).encode()
        location = accepted(working("POST", "/v1/jobs", order, {"content-type": "application/json", **wanted}))
    assert ended(working, location)["status"] == "successful"
    later = working("GET", f"{location}/result")
    assert later.headers["Lichen-Measured"] == now.headers["Lichen-Measured"]
    (picture, errors), at_once = parts_of(later), parts_of(now)
    assert [payload(picture), payload(errors)] == [payload(each) for each in at_once]
    assert "Lichen-Map" in errors
    assert decode(payload(errors)).pixels.shape[:2] == decode(png).pixels.shape[:2]


def test_a_job_may_come_as_json(working: Caller, png: bytes) -> None:
    name = read_json(working("PUT", "/v1/assets", png))["id"]
    order = {"operation": "gaussian", "parameters": {"sigma": 2, "device": "numpy", "format": "png"}}
    body = json.dumps({**order, "inputs": {"image": name}}).encode()
    location = accepted(working("POST", "/v1/jobs", body, {"content-type": "application/json"}))
    assert ended(working, location)["status"] == "successful"
    assert bytes(working("GET", f"{location}/result").body) == bytes(working("POST", BLUR, png).body)
    listed = read_json(working("GET", "/v1/jobs"))["jobs"]
    assert [each["links"]["self"] for each in listed] == [location]


@pytest.mark.parametrize("kind", ["pipeline", "scene"])
def test_pipelines_and_scenes_are_jobs_like_operations(working: Caller, png: bytes, kind: str) -> None:
    """Asked for by Prefer, by a document in JSON and, of pipelines, by their text: always the answer given at once."""
    name = read_json(working("PUT", "/v1/assets", png))["id"]
    said, options = (PIPELINE, {"device": "numpy"}) if kind == "pipeline" else (SCENE, {"device": "numpy"})
    target, headers = f"/v1/{kind}s?image={name}&device=numpy", {"content-type": "application/json"}
    if kind == "scene":
        target = target.replace(f"image={name}&", "")
    body = json.dumps(said).encode()
    now = working("POST", target, body, headers)
    assert now.status == 200, bytes(now.body)
    inputs = {"image": name} if kind == "pipeline" else {}
    orders = [{kind: said, "options": options, "inputs": inputs}]
    orders += [{kind: "gaussian:sigma=2", "options": options, "inputs": inputs}] if kind == "pipeline" else []
    locations = [accepted(working("POST", target, body, {**headers, **ASYNC}))]
    locations += [accepted(working("POST", "/v1/jobs", json.dumps(each).encode(), headers)) for each in orders]
    for location in locations:
        assert ended(working, location)["status"] == "successful"
        later = working("GET", f"{location}/result")
        assert (later.status, bytes(later.body)) == (200, bytes(now.body))
        assert later.headers["ETag"] == now.headers["ETag"]


def test_what_is_wrong_with_a_graph_is_told_before_it_is_accepted(idle: Caller, png: bytes) -> None:
    headers = {"content-type": "application/json"}
    name = read_json(idle("PUT", "/v1/assets", png))["id"]
    bad = {"nodes": {"soft": {"operation": "gaussian", "parameters": {"sigma": -1}}}}
    found = idle("POST", "/v1/pipelines", json.dumps(bad).encode(), {**headers, **ASYNC})
    assert pointers(problem_of(found, 422, "invalid-request")) == {"/nodes/soft/parameters/sigma"}
    order = json.dumps({"pipeline": bad, "inputs": {"image": name}, "options": {"max_ms": -1}}).encode()
    found = idle("POST", "/v1/jobs", order, headers)
    assert pointers(problem_of(found, 422, "invalid-request")) == {"/nodes/soft/parameters/sigma", "/query/max_ms"}
    scene = json.dumps({"scene": {**SCENE, "fog": 3}}).encode()
    assert pointers(problem_of(idle("POST", "/v1/jobs", scene, headers), 422, "invalid-request")) == {"/fog"}
    absent = json.dumps({"pipeline": PIPELINE, "inputs": {"image": f"sha256:{'0' * 64}"}}).encode()
    assert pointers(problem_of(idle("POST", "/v1/jobs", absent, headers), 422, "invalid-request")) == {"/inputs/image"}
    for wrong in ({"pipeline": 1}, {"scene": []}, {"pipeline": PIPELINE, "scene": SCENE}, {"pipeline": {}, "x": 1}):
        problem_of(idle("POST", "/v1/jobs", json.dumps(wrong).encode(), headers), 422, "invalid-job")
    assert read_json(idle("GET", "/v1/jobs"))["jobs"] == []


def test_what_is_wrong_is_told_before_it_is_accepted(idle: Caller, png: bytes) -> None:
    refused = idle("POST", "/v1/operations/gaussian?sigma=-1&nonsense=1", png, ASYNC)
    assert pointers(problem_of(refused, 422, "invalid-request")) == {"/parameters/sigma", "/query/nonsense"}
    for document in ("[]", "{}", '{"operation": 1}', '{"operation": "gaussian", "x": 1}'):
        assert idle("POST", "/v1/jobs", document.encode()).status in (404, 422)
    wrong = b'{"operation": "gaussian", "parameters": {"sigma": 1}, "inputs": {"image": "picture.png"}}'
    problem_of(idle("POST", "/v1/jobs", wrong), 422, "invalid-job")
    problem_of(idle("POST", "/v1/jobs", b'{"operation": "gausian"}'), 404, "unknown-operation")
    problem_of(idle("POST", "/v1/jobs", b'{"operation": "a", "operation": "b"}'), 400, "malformed-json")
    problem_of(idle("POST", "/v1/jobs", png, {"content-type": "image/png"}), 415, "unsupported-format")
    assert read_json(idle("GET", "/v1/jobs"))["jobs"] == []


def test_a_job_that_fails_keeps_its_problem(working: Caller, png: bytes) -> None:
    location = accepted(working("POST", "/v1/operations/gaussian?sigma=2", png[:-20], ASYNC))
    assert ended(working, location)["status"] == "failed"
    assert working("GET", f"{location}/result").status == 422
    assert working("GET", f"{location}/result").headers["X-Problem-Code"] == "unreadable-image"


def test_a_waiting_job_has_no_result_and_can_be_dismissed(idle: Caller, png: bytes) -> None:
    location = accepted(idle("POST", BLUR, png, ASYNC))
    assert problem_of(idle("GET", f"{location}/result"), 409, "not-finished")["retryable"]
    assert idle("GET", location).headers["Retry-After"] == "1"
    assert read_json(idle("DELETE", location))["status"] == "dismissed"
    problem_of(idle("GET", f"{location}/result"), 410, "dismissed")
    assert idle("DELETE", location).status == 204


def test_a_key_makes_asking_twice_safe(idle: Caller, png: bytes) -> None:
    once = {**ASYNC, "idempotency-key": "abc"}
    location = accepted(idle("POST", BLUR, png, once))
    assert accepted(idle("POST", BLUR, png, once)) == location
    problem_of(idle("POST", f"{BLUR}&prune=false", png, once), 409, "key-used")
    problem_of(idle("POST", BLUR, png, {**ASYNC, "idempotency-key": "a b"}), 400, "malformed-key")
    assert len(read_json(idle("GET", "/v1/jobs"))["jobs"]) == 1


def test_quotas_are_told_with_when_to_come_back(idle: Caller, png: bytes) -> None:
    for _ in range(5):
        accepted(idle("POST", BLUR, png, ASYNC))
    refused = idle("POST", BLUR, png, ASYNC)
    assert problem_of(refused, 429, "too-many-jobs")["retryable"]
    assert refused.headers["Retry-After"]


def test_a_job_is_seen_by_its_key_alone(tmp_path: Path, settings: Settings, png: bytes) -> None:
    known, _, first = Keys().add(jobs=1)
    known, _, second = known.add()
    known, _, third = known.add(("run",))
    chosen = replace(settings, data=str(tmp_path))
    keys.write(chosen.key_file, known)
    call = Caller(Service(chosen), chosen)
    mine, other, none = ({"authorization": f"Bearer {each}"} for each in (first, second, third))
    location = accepted(call("POST", BLUR, png, {**mine, **ASYNC}))
    problem_of(call("POST", BLUR, png, {**mine, **ASYNC}), 429, "too-many-jobs")
    assert call("GET", location, headers=mine).status == 200
    for method, path in (("GET", location), ("DELETE", location), ("GET", f"{location}/result")):
        problem_of(call(method, path, headers=other), 404, "unknown-job")
    problem_of(call("POST", BLUR, png, {**none, **ASYNC}), 403, "forbidden")
    problem_of(call("GET", location, headers=none), 403, "forbidden")


def test_a_service_that_ends_gives_its_job_back(idle: Caller, png: bytes) -> None:
    jobs = idle.service.jobs
    assert jobs is not None
    began: list[str] = []

    def handle(request: Any) -> Response:
        began.append(request.head.path)
        runner.stop()
        assert not request.head.alive()
        return Response(499)

    runner = Runner(jobs.queue, handle, threads=1, timeout=60, keep=60)
    location = accepted(idle("POST", BLUR, png, ASYNC))
    runner.start()
    until(lambda: bool(began))
    runner.stop(PATIENCE)
    assert read_json(idle("GET", location))["status"] == "accepted"


def test_a_disk_that_takes_no_more_loses_nothing(idle: Caller, png: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = idle.service.jobs
    assert jobs is not None
    location = accepted(idle("POST", BLUR, png, ASYNC))
    full = [True]
    write = durable.write

    def refuse(path: Path, data: Any, **more: Any) -> None:
        if full:
            failed.append(path.name)
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, data, **more)

    failed: list[str] = []
    monkeypatch.setattr("lichen_service.durable.write", refuse)
    monkeypatch.setattr("lichen_service.jobs.runner.AFTER_FAILURE", 0.01)
    problem_of(idle("POST", BLUR, png, ASYNC), 507, "no-room")
    problem_of(idle("PUT", "/v1/assets", png), 507, "no-room")
    assert idle("POST", BLUR, png).status == 200
    jobs.runner.start()
    until(lambda: sum(name.startswith("result") for name in failed) > MOST_ATTEMPTS)
    full.clear()
    assert ended(idle, location)["status"] == "successful"
    jobs.runner.stop(PATIENCE)


def test_a_service_that_cannot_keep_anything_still_computes(tmp_path: Path, settings: Settings, png: bytes) -> None:
    (tmp_path / "file").touch()
    chosen = replace(settings, data=str(tmp_path / "file" / "data"))
    call = Caller(Service(chosen), chosen)
    assert call("POST", BLUR, png).status == 200
    assert call("GET", "/v1/jobs").status == 404
    problem_of(call("PUT", "/v1/assets", png), 507, "no-room")
    problem_of(call("GET", f"/v1/assets/sha256:{'0' * 64}"), 404, "unknown-asset")
    assert call("GET", "/metrics").status == 200


def test_switched_off_jobs_are_not_there(tmp_path: Path, settings: Settings, png: bytes) -> None:
    chosen = replace(settings, data=str(tmp_path), jobs="off")
    call = Caller(Service(chosen), chosen)
    assert call("POST", BLUR, png, ASYNC).status == 200
    assert call("GET", "/v1/jobs").status == 404


# ---------------------------------------------------------------------------------------------------- JSON from outside


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b'{"a": 1, "a": 2}', "twice"),
        (b"NaN", "NaN"),
        (b'{"a": -Infinity}', "Infinity"),
        (b"[1e999]", "double"),
        (b"[9007199254740993]", "2^53"),
        (b"1" * 5000, "2^53"),
        (b"[" * 65 + b"]" * 65, "64 deep"),
        (b"[" * 500_000, "64 deep"),
        (b'{"a":' * 65 + b"1" + b"}" * 65, "64 deep"),
        (b"\xff", "UTF-8"),
        (b"", "Expecting"),
        (b"{} {}", "Extra"),
        (b"{'a': 1}", "Expecting"),
    ],
)
def test_json_that_could_be_read_differently_is_refused(text: bytes, reason: str) -> None:
    with pytest.raises(Refusal) as refused:
        strict_json.read(text)
    assert (refused.value.status, refused.value.code) == (400, "malformed-json")
    assert reason in str(refused.value)


def test_json_that_is_plain_is_read() -> None:
    assert strict_json.read(b'{"a": [1, -2.5e3, "[[[[", "\\"]", null, true]}') == {
        "a": [1, -2500.0, "[[[[", '"]', None, True]
    }
    assert strict_json.read(b"[" * 64 + b"]" * 64)
    with pytest.raises(Refusal) as refused:
        strict_json.read(b" " * (strict_json.LARGEST + 1))
    assert refused.value.status == 413


# ------------------------------------------------------------------------------------------------------- a real server


def test_events_tell_a_job_until_it_ends_and_a_kill_loses_nothing(tmp_path: Path, png: bytes) -> None:
    with served(LICHEN_DATA=str(tmp_path)) as (_, port):
        worker = json.loads(ask(port, "GET", "/v1/jobs")[2])
        assert worker == {"jobs": []}
        locations = [ask(port, "POST", BLUR, png, {"Prefer": "respond-async"})[1]["location"] for _ in range(3)]
        status, headers, body = ask(port, "GET", f"{locations[-1]}/events")
        assert (status, headers["content-type"]) == (200, "text/event-stream")
        states = [json.loads(line[6:])["status"] for line in body.decode().splitlines() if line.startswith("data: ")]
        assert states[-1] == "successful"
        numbers = [int(line[4:]) for line in body.decode().splitlines() if line.startswith("id: ")]
        assert numbers == sorted(set(numbers))
        again = ask(port, "GET", f"{locations[-1]}/events", headers={"Last-Event-ID": str(numbers[-1])})[2]
        assert b"data:" not in again
        assert ask(port, "HEAD", f"{locations[-1]}/events")[0] == 200
        with_key = {"Prefer": "respond-async", "Idempotency-Key": "once"}
        slow = f"{BLUR}&verify=true"
        kept = ask(port, "POST", slow, png, with_key)[1]["location"]
        for pid in _workers_of(tmp_path):
            os.kill(pid, signal.SIGKILL)
        until(lambda: _answers(port, kept))
        until(lambda: json.loads(ask(port, "GET", kept)[2])["status"] == "successful")
        assert ask(port, "GET", f"{kept}/result")[0] == 200
        assert ask(port, "POST", slow, png, with_key)[1]["location"] == kept
        assert all(ask(port, "GET", f"{each}/result")[0] == 200 for each in locations)


def _workers_of(data: Path) -> list[int]:
    """The processes that take jobs, from the files they hold locked."""
    return [int(path.name.partition("-")[0]) for path in (data / "jobs" / "workers").iterdir()]


def _answers(port: int, path: str) -> bool:
    try:
        return ask(port, "GET", path)[0] == 200
    except (OSError, http.client.HTTPException):
        return False
