"""Processors counted from a control-group tree as each version lays it out."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from lichen.processors import LIMIT, cgroup_quota, processors, threads, vector_width


def write(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text + "\n")


@pytest.mark.parametrize(
    ("own", "parent", "quota"), [("150000 100000", "max 100000", 1.5), ("max 100000", "50000 100000", 0.5)]
)
def test_second_version(tmp_path: Path, own: str, parent: str, quota: float) -> None:
    write(tmp_path / "a" / "b", cpu__max=own)
    write(tmp_path / "a", cpu__max=parent)
    (tmp_path / "membership").write_text("0::/a/b\n")
    assert cgroup_quota(tmp_path, tmp_path / "membership") == quota


def test_first_version(tmp_path: Path) -> None:
    write(tmp_path / "cpu,cpuacct" / "docker", cpu__cfs_quota_us="250000", cpu__cfs_period_us="100000")
    write(tmp_path / "cpu,cpuacct", cpu__cfs_quota_us="-1", cpu__cfs_period_us="100000")
    (tmp_path / "membership").write_text("3:memory:/docker\n2:cpu,cpuacct:/docker\n0::/\n")
    assert cgroup_quota(tmp_path, tmp_path / "membership") == 2.5


def test_no_quota(tmp_path: Path) -> None:
    (tmp_path / "membership").write_text("0::/nowhere\n")
    assert cgroup_quota(tmp_path, tmp_path / "membership") is None
    assert cgroup_quota(tmp_path, tmp_path / "absent") is None


def test_this_machine() -> None:
    assert 1 <= processors() <= (os.cpu_count() or 1)
    assert vector_width() in (4, 8, 16)


def test_a_process_that_shares_them_takes_its_part(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lichen.processors.processors", lambda: 8)
    for said, taken in (("", 8), ("3", 3), ("20", 8), ("0", 1), ("all", 8)):
        monkeypatch.setenv(LIMIT, said)
        assert threads() == taken
