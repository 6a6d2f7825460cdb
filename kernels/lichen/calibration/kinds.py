"""How the kinds of requests of a method compare, as measured on some machine.

What a mask or another border costs beside the plain request hardly depends on the machine, while to measure every kind
of every method takes many minutes. So that comparison belongs to the code, as the error table does: rates by backend,
operation, method and kind (`lichen.kind`), those of one machine. On another the runs of one kind tell by how much its
constant cost and its steps differ, and those of all kinds count as much as much more.

`lichen calibrate --kinds` writes the table from what a thorough calibration has found.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from lichen.accuracy import times
from lichen.calibration.fit import Sample, fit
from lichen.operation import Rate

NAME = "kinds.json"
BACKENDS = ("opencl", "numpy")
SHOWN = 0.25
"""The share of the shortest run that a constant cost must be, for its own ratio to be told from runs."""

Kinds = Mapping[str, Rate]
"""By kind."""


def known(backend: str, operation: str, method: str) -> Kinds:
    """The table's; empty where it has none."""
    return _table().get((backend, operation, method), {})


def compared(kinds: Kinds, measured: str, samples: Sequence[Sample]) -> dict[str, Rate]:
    """The rates of all kinds on a machine where one of them, `measured`, took the samples; nothing where that one is
    not known.

    >>> told = {"plain": Rate(1e-3, 1e-9), "masked": Rate(2e-3, 5e-9)}
    >>> runs = [Sample(work, 2e-3 + 3e-9 * work) for work in (1e4, 1e7)]
    >>> {kind: f"{rate.start:.2g} {rate.step:.2g}" for kind, rate in compared(told, "plain", runs).items()}
    {'plain': '0.002 3e-09', 'masked': '0.004 1.5e-08'}
    """
    base = kinds.get(measured)
    if base is None:
        return {}
    start, step = _ratios(base, samples)
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


def save() -> Path:
    """The table of this checkout, from the times of this machine; methods of one kind have nothing to compare. What
    was not measured stays as it is."""
    told = dict(_table())
    for backend in BACKENDS:
        for (operation, method), rate in times.current(backend).items():
            if len(rate.kinds) > 1:
                told[backend, operation, method] = rate.kinds
    lines = [
        json.dumps([*name, {kind: [_short(each.start), _short(each.step)] for kind, each in sorted(kinds.items())}])
        for name, kinds in sorted(told.items())
    ]
    path = Path(__file__).with_name(NAME)
    path.write_text("[\n" + ",\n".join(lines) + "\n]\n")
    _table.cache_clear()
    return path


def _short(number: float) -> float:
    """Three digits."""
    return float(f"{number:.3g}")


@cache
def _table() -> Mapping[tuple[str, str, str], Kinds]:
    """By backend, operation and method."""
    path = Path(__file__).with_name(NAME)
    listed = json.loads(path.read_text()) if path.exists() else []
    return {
        (backend, operation, method): {kind: Rate(start, step) for kind, (start, step) in kinds.items()}
        for backend, operation, method, kinds in listed
    }
