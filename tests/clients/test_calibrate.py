"""`lichen calibrate`: what it keeps, what it says, and how it goes on after an interruption."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lichen.accuracy import times
from lichen.calibration import table
from lichen.calibration.sweep import backends
from lichen_cli.main import main


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LICHEN_TIMES", str(tmp_path / "times"))
    return tmp_path / "times"


def test_times_are_kept_and_the_files_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "--quick", "--operation", "premultiply"]) == 0
    said = capsys.readouterr().out
    for backend in backends():
        assert ("premultiply", "exact") in times.current(backend)
        assert str(times.path_of(backend)) in said
    assert "within a factor of 1.5" in said


def test_what_cannot_be_kept_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder.write_text("a file stands where the folder should")
    assert main(["calibrate", "--quick", "--operation", "premultiply"]) == 1
    assert "cannot be written" in capsys.readouterr().out


def test_errors_of_one_operation_replace_its_entries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / table.NAME
    shutil.copy(Path(table.__file__).with_name(table.NAME), copy)
    before = copy.read_text()
    monkeypatch.setattr(table, "__file__", str(tmp_path / "table.py"))
    assert main(["calibrate", "--errors", "--operation", "premultiply"]) == 0
    assert str(copy) in capsys.readouterr().out
    assert [line for line in copy.read_text().splitlines() if '"premultiply"' not in line] == [
        line for line in before.splitlines() if '"premultiply"' not in line
    ]
    assert len(copy.read_text().splitlines()) == len(before.splitlines())


def test_an_unknown_operation_is_named_with_its_neighbours(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "--operation", "gausian"]) == 2
    assert "did you mean gaussian?" in capsys.readouterr().err
