"""The tree is what a stranger expects: few entries at the top, short modules, nothing about one machine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TOP = {
    *("kernels", "service", "clients", "tests", "docs"),
    *("README.md", "LICENSE", "CHANGELOG.md", "Makefile", "Containerfile"),
    *("pyproject.toml", "requirements.lock", "requirements-dev.lock"),
}
CODE = ("kernels", "service", "clients")
LONGEST = 400
MADE = (Path("clients/python/lichen_client/operations.py"),)
"""Files that a program writes."""


def test_the_top_holds_nothing_unexpected(tracked: list[Path]) -> None:
    top = {path.parts[0] for path in tracked}
    assert {name for name in top if not name.startswith(".")} <= TOP


def test_modules_are_short(root: Path, tracked: list[Path]) -> None:
    code = [path for path in tracked if path.parts[0] in CODE and path.suffix in (".py", ".cl", ".clh")]
    lengths = {str(path): len((root / path).read_text().splitlines()) for path in code if path not in MADE}
    assert lengths
    assert {path: length for path, length in lengths.items() if length > LONGEST} == {}


@pytest.mark.parametrize(
    ("what", "pattern"),
    [
        ("a folder of one machine", r"(?<![\w.{}$)])/(?:work|root|home|Users|workspace|mnt)/[\w.]"),
        ("an address of one network", r"\b(?:10\.\d+|192\.168|172\.(?:1[6-9]|2\d|3[01]))\.\d+\.\d+\b"),
        ("a package index by its host", r"(?:index-url|find-links|trusted-host)\s*[= ]\s*\S"),
    ],
)
def test_nothing_is_said_about_one_machine(root: Path, tracked: list[Path], what: str, pattern: str) -> None:
    found = []
    for path in tracked:
        try:
            text = (root / path).read_text()
        except UnicodeDecodeError:
            continue
        found += [f"{path}: {match.group()} is {what}" for match in re.finditer(pattern, text)]
    assert found == []


def test_every_package_is_typed(root: Path) -> None:
    for package in (
        "kernels/lichen",
        "service/lichen_service",
        "clients/python/lichen_client",
        "clients/batch/lichen_batch",
        "clients/cli/lichen_cli",
    ):
        assert (root / package / "__init__.py").exists(), package
        assert (root / package / "py.typed").exists(), package
