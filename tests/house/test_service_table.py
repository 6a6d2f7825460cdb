"""The tables of features, failures and properties in docs/service.md name tests, and the tests are there."""

from __future__ import annotations

import re
from pathlib import Path

ROW = re.compile(r"^\| (?P<feature>[^|]+) \| (?P<mark>[YPN]) \| (?P<shown>[^|]*) ?\|$", re.MULTILINE)
LOSS = re.compile(r"^\| (?P<dies>[^|]+) \| [^|]+ \| [^|]+ \| [^|]* \| (?P<shown>[^|]*) \|$", re.MULTILINE)
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")


def test_every_feature_that_is_there_is_shown_by_a_test_that_is_there(root: Path) -> None:
    rows = list(ROW.finditer((root / "docs" / "service.md").read_text()))
    assert len(rows) >= 44
    for row in rows:
        named = TEST.findall(row["shown"])
        assert bool(named) or row["mark"] != "Y", row["feature"]
        assert row["mark"] != "N" or not named, row["feature"]


def test_every_loss_is_shown_by_a_test(root: Path) -> None:
    _, _, table = (root / "docs" / "service.md").read_text().partition("| What dies |")
    rows = list(LOSS.finditer(table.partition("\n\n")[0]))
    assert len(rows) >= 11
    for row in rows:
        assert TEST.search(row["shown"]), row["dies"]


def test_every_property_is_shown_by_a_test(root: Path) -> None:
    _, _, table = (root / "docs" / "service.md").read_text().partition("| Property | Shown by |\n|---|---|\n")
    rows = table.partition("\n\n")[0].splitlines()
    assert len(rows) >= 25
    for row in rows:
        assert TEST.search(row), row


def test_every_test_that_is_named_is_there(root: Path) -> None:
    named = TEST.findall((root / "docs" / "service.md").read_text())
    assert len(named) > 60
    for path, name in named:
        assert re.search(rf"^def {name}\(", (root / path).read_text(), re.MULTILINE), f"{path} has no {name}"
