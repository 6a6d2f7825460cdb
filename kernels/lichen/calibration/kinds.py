"""How the kinds of requests of a method compare, as measured on one machine.

What a mask or another border costs beside the plain request hardly depends on the machine, while to measure every kind
of every method takes many minutes. So that comparison belongs to the code, as the error table does: rates by backend,
operation, method and kind (`lichen.kind`), and what the tasks of `lichen.calibration.pace` took beside them.

On another machine everything takes so much more or less as the tasks do, in general. The runs of one kind tell by how
much the constant cost and the steps of a method differ from that, but with few short runs they scatter by a quarter
themselves; so half of what they tell, on a scale of decades, is believed. Of 200 random requests foretold after a quick
calibration on the machine of the first such table that foretold 82 % within a factor of 1.5, the runs alone 78 %, the
table alone 78 %.

`lichen calibrate --kinds` writes the table from what a thorough calibration has found.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from lichen.accuracy import times
from lichen.calibration.fit import Sample, fit
from lichen.operation import Rate

NAME = "kinds.json"
BELIEVED = 0.5
"""The share of what a few runs tell, as a power of it."""
SHOWN = 0.25
"""The share of the shortest run that a constant cost must be, for its own ratio to be told from runs."""
PLAIN = ""
"""The kind of all requests of a method that are of no other."""

Kinds = Mapping[str, Rate]
"""By kind."""


def known(backend: str, operation: str, method: str) -> Kinds:
    """The table's; empty where it has none."""
    return _table().get((backend, operation, method), {})


def general(backend: str, usual: Sequence[float]) -> float:
    """How many times as long as on the machine of the table everything takes, by what the tasks take."""
    told = _paces().get(backend, ())
    if len(told) != len(usual) or not told:
        return 1.0
    return math.exp(sum(math.log(now / then) for now, then in zip(usual, told, strict=True)) / len(told))


def compared(kinds: Kinds, measured: str, samples: Sequence[Sample], general: float = 1.0) -> dict[str, Rate]:
    """The rates of all kinds on a machine where one of them, `measured`, took the samples; nothing where that one is
    not known.

    >>> told = {"plain": Rate(1e-3, 1e-9), "masked": Rate(2e-3, 5e-9)}
    >>> runs = [Sample(work, 2e-3 + 4e-9 * work) for work in (1e4, 1e7)]
    >>> {kind: f"{rate.start:.2g} {rate.step:.2g}" for kind, rate in compared(told, "plain", runs, 2.0).items()}
    {'plain': '0.002 2.8e-09', 'masked': '0.004 1.4e-08'}
    """
    base = kinds.get(measured) or kinds.get(PLAIN)
    if base is None:
        return {}
    start, step = (general * (each / general) ** BELIEVED for each in _ratios(base, samples))
    return {kind: Rate(start * each.start, step * each.step) for kind, each in kinds.items()}


def _ratios(base: Rate, samples: Sequence[Sample]) -> tuple[float, float]:
    """Of the constant cost and of a step: both the same where the runs do not tell them apart."""
    found = fit(samples, base)
    shortest = min(samples, key=lambda sample: sample.work).work
    longest = max(samples, key=lambda sample: sample.work).work
    told = [base.start >= SHOWN * base.seconds(shortest), base.step * longest >= SHOWN * base.seconds(longest)]
    if all(told) and found.start > 0:
        return found.start / base.start, found.step / base.step
    alone = fit([Sample(base.seconds(each.work), each.seconds) for each in samples], Rate(0.0, 1.0))
    middle = base.seconds(longest)
    both = alone.seconds(middle) / middle
    return both, both


def save(path: Path | None = None) -> Path:
    """The table of this checkout, from the times of this machine, to `path` or its place. What was not measured stays
    as it is, and what was measured is put down as it would be at the pace of the table."""
    told, paces = dict(_table()), dict(_paces())
    for backend in times.BACKENDS:
        slower = 1.0
        if usual := times.pace(backend):
            slower = general(backend, usual)
            paces.setdefault(backend, usual)
        for (operation, method), rate in times.current(backend).items():
            found = {PLAIN: rate, **rate.kinds}
            told[backend, operation, method] = {
                kind: Rate(each.start / slower, each.step / slower) for kind, each in found.items()
            }
    lines = [json.dumps([backend, [_short(each) for each in paces[backend]]]) for backend in sorted(paces)]
    lines += [
        json.dumps([*name, {kind: [_short(each.start), _short(each.step)] for kind, each in sorted(kinds.items())}])
        for name, kinds in sorted(told.items())
    ]
    path = path or Path(__file__).with_name(NAME)
    path.write_text("[\n" + ",\n".join(lines) + "\n]\n")
    _listed.cache_clear()
    _table.cache_clear()
    _paces.cache_clear()
    return path


def _short(number: float) -> float:
    """Three digits."""
    return float(f"{number:.3g}")


@cache
def _listed() -> list[list[Any]]:
    path = Path(__file__).with_name(NAME)
    found: list[list[Any]] = json.loads(path.read_text()) if path.exists() else []
    return found


@cache
def _paces() -> Mapping[str, tuple[float, ...]]:
    """Seconds of the tasks by backend."""
    return {row[0]: tuple(row[1]) for row in _listed() if len(row) == 2}


@cache
def _table() -> Mapping[tuple[str, str, str], Kinds]:
    """By backend, operation and method."""
    return {
        (row[0], row[1], row[2]): {kind: Rate(start, step) for kind, (start, step) in row[3].items()}
        for row in _listed()
        if len(row) == 4
    }
