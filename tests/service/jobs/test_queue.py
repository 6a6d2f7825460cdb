"""The queue: nothing accepted is lost, nothing is done twice visibly, whatever is killed when."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from lichen_service.assets import Assets
from lichen_service.jobs.job import Job, State, Stored
from lichen_service.jobs.queue import ABANDONED, MOST_ATTEMPTS, Exists, Queue, TooMany

REQUEST = Stored("POST", "/v1/operations/gaussian", (("sigma", "2"),), {"accept": "image/png"}, "r-1")


@pytest.fixture
def queue(tmp_path: Path) -> Queue:
    return Queue(tmp_path / "jobs", Assets(tmp_path / "assets", 1 << 20))


def submit(queue: Queue, body: bytes = b"body", request: Stored = REQUEST, **changes: object) -> Job:
    asked = {"owner": "", "key": None, "most": 100, "most_each": 100, "room": 1 << 20} | changes
    return queue.submit(request, body, **asked)  # type: ignore[arg-type]


def test_a_job_goes_its_way(queue: Queue) -> None:
    first, second = submit(queue), submit(queue, b"other")
    with queue.worker() as worker:
        job = queue.claim(worker)
        assert job is not None
        assert (job.id, job.state, job.request) == (first.id, State.RUNNING, REQUEST)
        assert queue.body(job) == b"body"
        assert queue.report(job, worker, "run", 20)
        assert queue.finish(job, worker, 200, {"Content-Type": "image/png"}, b"result", 60)
        done = queue.find(job.id)
        assert done is not None
        assert (done.state, done.status, done.progress, done.headers) == (
            State.SUCCESSFUL,
            200,
            100,
            {"Content-Type": "image/png"},
        )
        assert queue.result(done) == b"result"
        assert done.changes > job.changes > first.changes
        assert not queue.finish(job, worker, 500, {}, b"again", 60)
        assert queue.result(done) == b"result"
        failed = queue.claim(worker)
        assert failed is not None
        assert failed.id == second.id
        assert queue.finish(failed, worker, 422, {}, b"problem", 60)
        assert queue.counts() == {"successful": 1, "failed": 1}
        assert queue.claim(worker) is None


def test_a_job_is_claimed_once(queue: Queue) -> None:
    names = {submit(queue).id for _ in range(20)}
    claimed: list[str] = []

    def work() -> None:
        with queue.worker() as worker:
            while (job := queue.claim(worker)) is not None:
                claimed.append(job.id)
                assert queue.finish(job, worker, 200, {}, b"", 60)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(claimed) == sorted(names)


def test_a_key_stands_for_one_request(queue: Queue) -> None:
    job = submit(queue, key="k")
    with pytest.raises(Exists) as again:
        submit(queue, key="k")
    assert (again.value.job.id, again.value.same) == (job.id, True)
    with pytest.raises(Exists) as other:
        submit(queue, b"other body", key="k")
    assert not other.value.same
    assert submit(queue, key="k", owner="somebody").id != job.id
    assert len(list((queue._files).iterdir())) == 2


def test_a_key_is_free_again_when_its_job_has_expired(queue: Queue) -> None:
    job = submit(queue, key="k")
    with queue.worker() as worker:
        claimed = queue.claim(worker)
        assert claimed is not None
        queue.finish(claimed, worker, 200, {}, b"", -1)
    assert submit(queue, b"other body", key="k").id != job.id


def test_asking_at_once_with_one_key_makes_one_job(queue: Queue) -> None:
    found: list[str] = []

    def ask() -> None:
        try:
            found.append(submit(queue, key="k").id)
        except Exists as exists:
            found.append(exists.job.id)

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert len(set(found)) == 1


def test_quotas_hold(queue: Queue) -> None:
    submit(queue, owner="a")
    with pytest.raises(TooMany, match="of yours"):
        submit(queue, owner="a", most_each=1)
    submit(queue, owner="b", most_each=1)
    with pytest.raises(TooMany, match="2 jobs wait"):
        submit(queue, owner="c", most=2)
    with pytest.raises(TooMany, match="disk"):
        submit(queue, owner="c", room=10)
    assert len(list(queue._files.iterdir())) == 2


def test_a_dismissed_job_has_no_end(queue: Queue) -> None:
    waiting, running = submit(queue), submit(queue)
    assert queue.dismiss(waiting, 60)
    with queue.worker() as worker:
        job = queue.claim(worker)
        assert job is not None
        assert job.id == running.id
        assert queue.is_running(job, worker)
        assert queue.dismiss(job, 60)
        assert not queue.is_running(job, worker)
        assert not queue.report(job, worker, "run", 20)
        assert not queue.finish(job, worker, 200, {}, b"result", 60)
        queue.release(job, worker)
        assert queue.claim(worker) is None
    assert queue.counts() == {"dismissed": 2}
    assert list(queue._files.iterdir()) == []
    assert not queue.dismiss(job, 60)


def test_an_input_stays_while_its_job_waits(tmp_path: Path) -> None:
    assets = Assets(tmp_path / "assets", 100)
    queue = Queue(tmp_path / "jobs", assets)
    name = assets.put(b"a" * 90)[0]
    submit(queue, request=Stored("POST", "/v1/operations/gaussian", (("image", name),)))
    assert not _evicted_by(assets, b"b" * 90, name)
    with queue.worker() as worker:
        job = queue.claim(worker)
        assert job is not None
        assert not _evicted_by(assets, b"b" * 90, name)
        queue.finish(job, worker, 200, {}, b"", 60)
    assert _evicted_by(assets, b"b" * 90, name)


def _evicted_by(assets: Assets, data: bytes, name: str) -> bool:
    try:
        assets.put(data)
    except Exception:
        assert assets.read(name) is not None
        return False
    return assets.read(name) is None


def test_what_has_expired_is_forgotten_and_what_no_row_speaks_of_goes(queue: Queue) -> None:
    import os

    kept, ended = submit(queue), submit(queue)
    with queue.worker() as worker:
        for _ in range(2):
            job = queue.claim(worker)
            assert job is not None
            queue.finish(job, worker, 200, {}, b"", 60 if job.id == kept.id else -1)
    assert queue.find(ended.id) is None
    assert [each.id for each in queue.of(kept.owner, 10)] == [kept.id]
    orphan = queue._files / "orphan"
    fresh = queue._files / "fresh"
    for folder in (orphan, fresh):
        folder.mkdir()
    os.utime(orphan, (time.time() - 2 * ABANDONED,) * 2)
    (queue._workers / "dead").touch()
    queue.clean()
    assert queue.find(kept.id) is not None
    assert queue.find(ended.id) is None
    assert {path.name for path in queue._files.iterdir()} == {kept.id, "fresh"}
    assert list(queue._workers.iterdir()) == []


def test_a_clock_that_is_set_loses_nothing_that_was_accepted(queue: Queue, monkeypatch: pytest.MonkeyPatch) -> None:
    now = time.time()
    jobs = []
    for jump in (0.0, -1e9, 1e9):
        monkeypatch.setattr("lichen_service.jobs.queue.time.time", lambda jump=jump: now + jump)
        jobs.append(submit(queue))
        queue.clean()
        assert queue.recover() == []
    with queue.worker() as worker:
        done = set()
        for jump in (1e9, -1e9, 0.0):
            monkeypatch.setattr("lichen_service.jobs.queue.time.time", lambda jump=jump: now + jump)
            job = queue.claim(worker)
            assert job is not None
            queue.clean()
            assert queue.recover() == []
            assert queue.finish(job, worker, 200, {}, b"result", 60)
            done.add(job.id)
    assert done == {each.id for each in jobs}


def test_released_work_waits_again(queue: Queue) -> None:
    submit(queue)
    with queue.worker() as worker:
        for _ in range(MOST_ATTEMPTS + 2):
            job = queue.claim(worker)
            assert job is not None
            assert job.attempts == 1
            queue.release(job, worker)


# Processes that are killed

CLAIMER = """
import sys, time
from pathlib import Path
from lichen_service.assets import Assets
from lichen_service.jobs.queue import Queue
queue = Queue(Path(sys.argv[1]), Assets(Path(sys.argv[2]), 1 << 20))
with queue.worker() as worker:
    print(queue.claim(worker).id, flush=True)
    time.sleep(600)
"""


def _killed_while_running(tmp_path: Path) -> str:
    process = subprocess.Popen(
        [sys.executable, "-c", CLAIMER, str(tmp_path / "jobs"), str(tmp_path / "assets")],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    claimed = process.stdout.readline().strip()
    process.kill()
    process.wait()
    process.stdout.close()
    return claimed


def test_a_job_whose_process_died_waits_again_but_not_for_ever(queue: Queue, tmp_path: Path) -> None:
    job = submit(queue)
    with queue.worker() as worker:
        living = submit(queue)
        assert queue.dismiss(living, 60)
        for attempt in range(1, MOST_ATTEMPTS + 1):
            assert _killed_while_running(tmp_path) == job.id
            running = queue.find(job.id)
            assert running is not None
            assert (running.state, running.attempts) == (State.RUNNING, attempt)
            given_up = queue.recover()
            assert [each.id for each in given_up] == ([job.id] if attempt == MOST_ATTEMPTS else [])
        assert queue.claim(worker) is None


def test_a_living_process_keeps_its_jobs(queue: Queue) -> None:
    submit(queue)
    with queue.worker() as worker:
        job = queue.claim(worker)
        assert job is not None
        assert queue.recover() == []
        assert queue.is_running(job, worker)
    queue.recover()
    found = queue.find(job.id)
    assert found is not None
    assert found.state is State.ACCEPTED


SUBMITTER = """
import sys
from pathlib import Path
from lichen_service.assets import Assets
from lichen_service.jobs.job import Stored
from lichen_service.jobs.queue import Queue
queue = Queue(Path(sys.argv[1]), Assets(Path(sys.argv[2]), 1 << 20))
for at in range(10**9):
    body = at.to_bytes(8, "little") * 1000
    job = queue.submit(Stored("POST", "/", ()), body, owner="", key=f"{sys.argv[3]}-{at}", most=10**6, most_each=10**6,
                       room=1 << 40)
    print(job.id, flush=True)
"""


def test_what_was_accepted_survives_the_kill_whole(queue: Queue, tmp_path: Path) -> None:
    told: list[str] = []
    for at in range(3):
        process = subprocess.Popen(
            [sys.executable, "-c", SUBMITTER, str(tmp_path / "jobs"), str(tmp_path / "assets"), str(at)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        told += [process.stdout.readline().strip() for _ in range(5)]
        process.send_signal(signal.SIGKILL)
        told += [line.strip() for line in process.stdout if len(line) == 33]
        process.wait()
        process.stdout.close()
    with queue.worker() as worker:
        done = set()
        while (job := queue.claim(worker)) is not None:
            body = queue.body(job)
            assert len(body) == 8000
            assert job.request.digest(body)
            done.add(job.id)
            queue.finish(job, worker, 200, {}, b"", 60)
    assert set(told) <= done
    assert sqlite3.connect(tmp_path / "jobs" / "jobs.sqlite").execute("PRAGMA integrity_check").fetchone() == ("ok",)
