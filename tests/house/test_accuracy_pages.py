"""The folder of what accuracy costs is of one piece: numbers of this version, and an index that tells of them."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path
from types import ModuleType

import pytest

from lichen.catalogue import operations


@pytest.fixture(scope="module")
def make(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_accuracy", root / "docs/accuracy/make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_index_tells_of_the_numbers_that_lie_here(make: ModuleType) -> None:
    assert make.outdated(operations().values()) == [], "run `make accuracy`"
    assert make.index(operations()) == (make.HERE / "index.md").read_text(), "run `make accuracy`"


@pytest.mark.parametrize("part", ["converging", "study"])
def test_numbers_of_another_version_are_noticed(
    part: str, make: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("levels", "gaussian"):
        shutil.copy(make.HERE / f"{name}.json", tmp_path)
    numbers = json.loads((tmp_path / "levels.json").read_text())
    del numbers[part]
    (tmp_path / "levels.json").write_text(json.dumps(numbers))
    monkeypatch.setattr(make, "HERE", tmp_path)
    assert make.outdated(operations().values()) == ["levels"]
