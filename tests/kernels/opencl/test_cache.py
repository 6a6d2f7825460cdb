"""Kernels that were compiled before are found through links, and nothing is written to where they lie."""

from __future__ import annotations

import os
import subprocess
import sys
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


GOING = """
import shutil, sys
import numpy as np
import lichen
image = np.full((4, 4, 3), 0.25, np.float32)
for operation, parameters in (("premultiply", {}), ("levels", {"gamma": 2.0})):
    result = lichen.run(operation, image, device="opencl", prune=False, **parameters)
    print(result.device, np.isfinite(result.image.pixels).all())
    shutil.rmtree(sys.argv[1])
"""


@pytest.mark.usefixtures("device")
def test_a_folder_that_goes_while_kernels_run_is_made_again(tmp_path: Path) -> None:
    folder = tmp_path / "kernels"
    folder.mkdir()
    found = subprocess.run(
        [sys.executable, "-c", GOING, str(folder)],
        env=os.environ | {"POCL_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert found.stdout.split() == ["opencl", "True"] * 2, found.stderr
