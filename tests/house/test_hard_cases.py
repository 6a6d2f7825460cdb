"""docs/hard-cases.md names, for every case, hard cases of operations and tests, and all of them are there."""

from __future__ import annotations

import re
from pathlib import Path

import lichen

ROW = re.compile(r"^\| (?P<case>[^|]+) \| (?P<shown>[^|]+) \|$", re.MULTILINE)
NAMED = re.compile(r"`([^`]+)`")


def test_every_hard_case_is_shown_by_what_is_there(root: Path) -> None:
    declared = {f"{each.name}: {case.name}" for each in lichen.operations().values() for case in each.hard_cases}
    rows = [row for row in ROW.finditer((root / "docs" / "hard-cases.md").read_text()) if row["case"] != "Case"]
    assert len(rows) > 60
    for row in rows:
        named = NAMED.findall(row["shown"])
        assert named, row["case"]
        for each in named:
            path, _, test = each.partition("::")
            there = re.search(rf"^def {test}\(", (root / path).read_text(), re.MULTILINE) if test else each in declared
            assert there, f"{row['case']}: there is no {each}"
