"""The lock pins what pyproject.toml asks for, by hash, and says nothing of where it was fetched from."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LOCKS = ("requirements.lock", "requirements-dev.lock")


def pins(text: str) -> dict[str, list[tuple[Requirement, list[str]]]]:
    """Pinned requirements with their hashes, by name: one name has several where the Python version decides."""
    entries: dict[str, list[tuple[Requirement, list[str]]]] = {}
    for line in text.replace("\\\n", " ").splitlines():
        if line.strip() and not line.startswith("#"):
            requirement, *hashes = re.split(r"\s+--hash=", line.strip())
            pinned = Requirement(requirement)
            entries.setdefault(canonicalize_name(pinned.name), []).append((pinned, hashes))
    return entries


@pytest.mark.parametrize("name", LOCKS)
def test_every_line_is_a_pin_with_hashes_and_no_address(root: Path, name: str) -> None:
    text = (root / name).read_text()
    assert "://" not in text
    for entries in pins(text).values():
        for requirement, hashes in entries:
            assert re.fullmatch(r"==[\w.+!]+", str(requirement.specifier)), requirement
            assert requirement.url is None
            assert hashes
            assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", each) for each in hashes), requirement


@pytest.mark.parametrize(("name", "group"), list(zip(LOCKS, ("build", "dev"), strict=True)))
def test_the_lock_agrees_with_the_project(
    root: Path, asked: Callable[..., list[Requirement]], name: str, group: str
) -> None:
    locked = pins((root / name).read_text())
    for requirement in asked(group):
        entries = locked.get(canonicalize_name(requirement.name), [])
        assert entries, f"{requirement} is not in {name}; run `make lock`"
        for pinned, _ in entries:
            version = str(pinned.specifier).removeprefix("==")
            assert requirement.specifier.contains(version, prereleases=True), f"{name}: {pinned} against {requirement}"


def test_what_is_tested_is_what_is_served(root: Path) -> None:
    served, tested = (
        # Versions alone: what tests need may need a package on more platforms.
        {
            name: sorted(str(pin.specifier) for pin, _ in pinned)
            for name, pinned in pins((root / lock).read_text()).items()
        }
        for lock in LOCKS
    )
    assert {name: tested.get(name) for name in served} == served


def test_the_runtime_that_cannot_build_kernels_is_kept_out(root: Path) -> None:
    for name in LOCKS:
        assert not any("pocl" in package for package in pins((root / name).read_text()))
