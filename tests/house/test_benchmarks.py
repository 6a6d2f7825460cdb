"""What the benchmarks declare can be run, computes what it says, and becomes a page. Nothing is timed here."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.opencl.device import default_device

TINY = 48
COMPARED = ("convolution", "tone", "colours", "warps", "compositing", "streamlines", "noises")


@pytest.fixture(scope="module")
def suite(root: Path) -> Iterator[ModuleType]:
    """The module of the suite's command, whose neighbours can be imported meanwhile."""
    folder = str(root / "tests" / "benchmarks")
    sys.path.insert(0, folder)
    try:
        yield importlib.import_module("bench")
    finally:
        sys.path.remove(folder)


def test_every_part_is_told_of_and_says_what_it_measures(suite: ModuleType, root: Path) -> None:
    found = {path.stem for path in (root / "tests" / "benchmarks" / "parts").glob("*.py")}
    assert found == set(suite.PARTS)
    for name in suite.PARTS:
        part = importlib.import_module(f"parts.{name}")
        assert part.TITLE
        assert part.__doc__
        assert hasattr(part, "ROWS") or callable(part.sections), name


def test_reasons_are_of_rows_that_there_are(suite: ModuleType) -> None:
    known = {row.work for name in COMPARED for row in importlib.import_module(f"parts.{name}").ROWS}
    reasons = importlib.import_module("reasons")
    assert reasons.REASONS.keys() <= known
    assert reasons.BOUNDS.keys() <= lichen.operations().keys()


@pytest.mark.parametrize("name", COMPARED)
def test_rows_name_known_operations_and_keep_their_errors(suite: ModuleType, name: str) -> None:
    comparing = importlib.import_module("comparing")
    rows = importlib.import_module(f"parts.{name}").ROWS
    assert len({row.work for row in rows}) == len(rows)
    for row in rows:
        operation = lichen.operations()[row.operation]
        inputs, values = row.inputs(TINY), row.values(TINY)
        operation.validate(values)
        result = lichen.run(row.operation, **inputs, **values, **row.ask, device="numpy")
        if name == "streamlines":  # whose definition takes seconds
            continue
        error, theirs = comparing.errors(row, TINY, "numpy")
        assert error <= result.error.value, row.work
        for peer in row.peers:  # those that are installed compute the same thing, if roughly
            if peer.same and peer.name in theirs:
                assert theirs[peer.name] < 0.5, (row.work, peer.name)


def test_the_pages_are_made_from_numbers_alone(suite: ModuleType, tmp_path: Path) -> None:
    page, sections = (importlib.import_module(name) for name in ("page", "sections"))
    for document in documents(sections):
        (tmp_path / f"{document['part']}.json").write_text(json.dumps(suite.finite(document)))
    page.write(tmp_path)
    index, first, second = ((tmp_path / f"{name}.md").read_text() for name in ("README", "convolution", "growth"))
    assert "| gaussian, sigma 5, RGBA | 10 | 1e-7 | OpenCV GaussianBlur | 25 | (other) | 2.50 |" in index
    assert "1 of 22 runs" in first
    assert "[numbers](growth.json)" in second.lower()
    assert "| fir | 1.00 | 0 | linear |" in second
    pictures = {path.name for path in tmp_path.glob("*.svg")}
    assert pictures == {"convolution-2.svg", "all-highlights.svg", "growth-sigma.svg", "growth-bars.svg"}
    for text in (index, first, second):
        shown = {line.partition("](")[2].rstrip(")") for line in text.splitlines() if line.startswith("![")}
        assert shown <= pictures


def documents(sections: ModuleType) -> Iterator[dict[str, Any]]:
    figure = {"ms": 10.0, "low_ms": 9.0, "high_ms": 11.0, "kept": 11, "dropped": 0, "steady": True}
    row = {
        "work": "gaussian, sigma 5, RGBA", "operation": "gaussian", "size": "8 x 8 x 4", "method": "fir",
        "ours": figure | {"error": 1e-7, "stated": 1e-6}, "fraction": 0.5,
        "peers": [
            figure
            | {"ms": 25.0, "kept": 10, "dropped": 1, "name": "OpenCV GaussianBlur"}
            | {"alone": False, "yardstick": False, "error": None},
            {"name": "another", "alone": True, "yardstick": False, "error": None, "failed": "ImportError: no"},
        ],
    }  # fmt: skip
    able = {"threads": 2, "bandwidth": 1e10, "peak": float("nan")}
    compared = sections.comparison("", [{"threads": 2, "limits": able, "rows": [row], "failed": {}}])
    about = {"seconds": 1.0, "taken": "now", "commit": "abc", "command": "make bench", "machine": {"cpu": "one"}}
    yield {
        "part": "convolution",
        "title": "Convolution",
        "text": "A. B.",
        **about,
        "quick": False,
        "sections": [compared],
    }
    curves = sections.lines(
        "sigma", "Sigma", "px", "ms", {"fir": [(1, 1.0), (2, 2.0)]}, fits=[["fir", "0", 1.0, "linear"]]
    )
    bars = sections.bars("bars", "Bars", "ms", ["decode", "encode"], {"png": {"decode": 2.0, "encode": 1.0}})
    told = sections.table("Told", ["a", "b"], [["x", 1.5]])
    yield {"part": "growth", "title": "Growth", "text": "A.", **about, "quick": True, "sections": [curves, bars, told]}


def test_kernels_are_noted_of_the_very_runs_they_are_part_of(suite: ModuleType) -> None:
    if default_device() is None:
        pytest.skip("no device notes anything")
    measuring = importlib.import_module("measuring")
    picture = np.ones((256, 256, 3), np.float32)
    noted = measuring.Noted(lambda: lichen.run("gamma", picture, gamma=2.2, device="opencl"))
    made = [noted() for _ in range(3)]
    assert np.array_equal(made[0].image.pixels, made[2].image.pixels)
    assert 0 < noted.share < 1
    idle = measuring.Noted(lambda: None)
    idle()
    assert idle.share == 0


def test_slow_phases_are_dropped_and_counted(suite: ModuleType) -> None:
    measuring = importlib.import_module("measuring")
    samples = [
        measuring.Sample(1.0, 0.1, 0.1),
        measuring.Sample(2.0, 0.1, 0.1),
        measuring.Sample(3.0, 0.12, 0.1),
        measuring.Sample(9.0, 0.1, 0.3),
    ]
    found = measuring.figure(samples, 0.13, 0.05)
    assert (found.median, found.kept, found.dropped, found.steady) == (2.0, 3, 1, True)
    assert found.pace == pytest.approx(2)
    assert not measuring.figure(samples[2:], 0.13, 0.05).steady
    assert measuring.growth([(1, 9.0), (10, 10.0), (100, 100.0)], 10).exponent == pytest.approx(1)
