"""Calibration in the background: it fills in what is missing, gives way to requests, and is done by one process."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from lichen import catalogue
from lichen.accuracy import times
from lichen.calibration.sweep import backends
from lichen_service import calibrating, durable, readiness
from lichen_service.app import Service
from lichen_service.calibrating import Calibrating, Traffic
from lichen_service.settings import InvalidSettings, Settings

from .conftest import Caller


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LICHEN_TIMES", str(tmp_path))
    return tmp_path


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """A catalogue of one operation, so that measuring it takes no time."""
    monkeypatch.setattr(calibrating, "operations", lambda: {"premultiply": catalogue.operation("premultiply")})


@pytest.mark.usefixtures("few")
def test_missing_times_are_measured_once(service: Service, folder: Path) -> None:
    first = Calibrating(service.readiness, service.traffic)
    first.start()
    assert first.done.wait(60)
    files = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert set(files) == {times.path_of(backend).name for backend in backends()}
    assert ("premultiply", "exact") in times.current("numpy")
    second = Calibrating(service.readiness, service.traffic)
    second.start()
    assert second.done.wait(60)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == files


@pytest.mark.usefixtures("few", "folder")
def test_it_waits_while_a_request_is_answered(service: Service) -> None:
    traffic = Traffic()
    measured = Calibrating(service.readiness, traffic)
    with traffic.request():
        measured.start()
        assert not measured.done.wait(0.5)
        assert not times.current("numpy")
    assert measured.done.wait(60)
    assert times.current("numpy")


def test_the_warm_up_gives_way_and_does_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    traffic, begun = Traffic(), []

    def methods() -> Iterator[tuple[str, str, None]]:
        for name in ("first", "second", "third"):
            begun.append(name)
            yield name, "exact", None

    monkeypatch.setattr(readiness, "warm_up", methods)
    warming = readiness.Readiness(lambda: None, give_way=traffic.give_way)
    with traffic.request():
        warming.start()
        assert warming.able(30)
        assert not warming.wait(0.3)
        assert begun == ["first"]
        monkeypatch.setattr(readiness, "LONGEST_REST", 0.0)
    assert warming.wait(30)
    assert begun == ["first", "second", "third"]
    busy = readiness.Readiness(lambda: None, give_way=traffic.give_way)
    with traffic.request():
        busy.start()
        assert busy.wait(30), "a service that is never idle is warm some time, too"


@pytest.mark.usefixtures("few")
def test_a_stop_lets_the_method_come_back_and_begins_no_other(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    begun, resting, gate = [], threading.Event(), threading.Event()

    def methods() -> Iterator[tuple[str, str, None]]:
        for name in ("first", "second"):
            begun.append(name)
            yield name, "exact", None

    def rest(_seconds: float) -> None:
        resting.set()
        assert gate.wait(30)

    monkeypatch.setattr(readiness, "warm_up", methods)
    warming = readiness.Readiness(lambda: None, give_way=rest)
    warming.start()
    assert resting.wait(30)
    threading.Timer(0.1, gate.set).start()
    warming.stop(30)
    assert warming.wait(0)
    assert begun == ["first"]
    measured = Calibrating(warming, Traffic())
    measured.stop(30)
    measured.start()
    assert measured.done.wait(30)
    assert list(folder.iterdir()) == []


@pytest.mark.usefixtures("few")
def test_one_process_measures(service: Service, folder: Path) -> None:
    with durable.locked(folder / "measuring"):
        measured = Calibrating(service.readiness, service.traffic)
        measured.start()
        assert measured.done.wait(60)
        assert [path.name for path in folder.iterdir()] == ["measuring"]


def test_requests_are_traffic(service: Service, settings: Settings, png: bytes) -> None:
    before = service.traffic.arrivals
    assert Caller(service, settings)("POST", "/v1/operations/gaussian?sigma=1", png).status == 200
    assert service.traffic.arrivals == before + 1
    assert not service.traffic.quiet


def test_traffic_counts_requests_of_several_threads() -> None:
    traffic, inside, leave = Traffic(), threading.Barrier(4), threading.Event()

    def request() -> None:
        with traffic.request():
            inside.wait(10)
            leave.wait(10)

    threads = [threading.Thread(target=request) for _ in range(3)]
    for thread in threads:
        thread.start()
    inside.wait(10)
    assert not traffic.quiet
    leave.set()
    for thread in threads:
        thread.join()
    assert traffic.arrivals == 3
    threading.Event().wait(2 * calibrating.QUIET)
    assert traffic.quiet


def test_the_setting_is_on_or_off() -> None:
    assert Settings().calibrate == "on"
    assert Settings.load({"LICHEN_CALIBRATE": "off"}).calibrate == "off"
    with pytest.raises(InvalidSettings, match="LICHEN_CALIBRATE must be on or off"):
        Settings.load({"LICHEN_CALIBRATE": "maybe"})
