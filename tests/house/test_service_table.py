"""The table of features in docs/service.md names tests, and the tests are there."""

from __future__ import annotations

import re
from pathlib import Path

ROW = re.compile(r"^\| (?P<feature>[^|]+) \| (?P<mark>[YPN]) \| (?P<shown>[^|]*) ?\|$", re.MULTILINE)
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def test_every_feature_that_is_there_is_shown_by_a_test_that_is_there(root: Path) -> None:
    rows = list(ROW.finditer((root / "docs" / "service.md").read_text()))
    assert len(rows) >= 44
    for row in rows:
        named = TEST.findall(row["shown"])
        assert bool(named) or row["mark"] != "Y", row["feature"]
        assert row["mark"] != "N" or not named, row["feature"]
        for path, name in named:
            source = (root / path).read_text()
            assert re.search(rf"^def {name}\(", source, re.MULTILINE), f"{row['feature']}: {path} has no {name}"
