"""What the house tests look at: the tree as it is committed."""

from __future__ import annotations

import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def tracked() -> list[Path]:
    """Every file under version control, relative to the root; files made beside them do not count."""
    if not (ROOT / ".git").exists() or not shutil.which("git"):
        pytest.skip("not a checkout, or no git to read it with")
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [Path(name) for name in listing.split("\0") if name and (ROOT / name).is_file()]


@pytest.fixture(scope="session")
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.fixture(scope="session")
def asked(project: dict[str, Any]) -> Callable[..., list[Requirement]]:
    """What pyproject.toml asks for: the dependencies, and a dependency group with all it includes, if one is named."""

    def of_group(group: str) -> list[Requirement]:
        found = []
        for entry in project["dependency-groups"][group]:
            found += [Requirement(entry)] if isinstance(entry, str) else of_group(entry["include-group"])
        return found

    dependencies = [Requirement(text) for text in project["project"]["dependencies"]]
    return lambda group="": dependencies + (of_group(group) if group else [])
