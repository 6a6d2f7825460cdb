"""Kernels that were compiled before are found through links, and nothing is written to where they lie."""

from __future__ import annotations

from pathlib import Path

import pytest

from lichen.opencl import cache


def test_kernels_that_were_compiled_before_are_adopted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    brought, folder = tmp_path / "brought", tmp_path / "folder"
    (brought / "AB" / "cd" / "sum").mkdir(parents=True)
    for name in ("program.bc", "last_accessed", "sum/sum.so"):
        (brought / "AB" / "cd" / name).write_text(name)
    (folder / "AB" / "cd").mkdir(parents=True)
    (folder / "AB" / "cd" / "program.bc").write_text("own")
    monkeypatch.setenv("LICHEN_KERNELS", str(brought))
    monkeypatch.setenv("POCL_CACHE_DIR", str(folder))
    assert cache.prepare() == cache.prepare() == folder
    place = folder / "AB" / "cd"
    assert (place / "program.bc").read_text() == "own"
    assert (place / "sum" / "sum.so").is_symlink()
    assert (place / "sum" / "sum.so").read_text() == "sum/sum.so"
    assert not (place / "last_accessed").is_symlink(), "the runtime writes to it"
    (place / "sum" / "new.so").write_text("compiled here")
    assert not (brought / "AB" / "cd" / "sum" / "new.so").exists()


@pytest.mark.parametrize("named", ["", "nowhere", "folder"])
def test_without_any_there_is_nothing_to_adopt(named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "folder"
    monkeypatch.setenv("LICHEN_KERNELS", str(tmp_path / named) if named else "")
    monkeypatch.setenv("POCL_CACHE_DIR", str(folder))
    assert cache.prepare() == folder
    assert list(folder.iterdir()) == []
