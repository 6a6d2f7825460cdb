"""Calibration in the background: it fills in what is missing, gives way to requests, and is done by one process."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from lichen import catalogue
from lichen.accuracy import times
from lichen.calibration.sweep import backends
from lichen_service import calibrating, durable
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
