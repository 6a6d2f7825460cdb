"""Where a pointwise operation errs: its largest error by the value that it reads, and how its errors are distributed.

It is given colours whose largest sample is swept from -16 to 16384, half of them grey, half of shares of it drawn for
each: as many of every half octave above 0 and of every octave below. What is told is the worse of the backends, of all
methods at their finest and one at its coarsest: the largest error in output units and in units in the last place (ULP)
of the exact result as float32, and the quantiles of the latter below 0, in [0, 1] and beyond. Where the exact result is
small by cancellation it has few digits in float32 and many ULP.

Studied are operations that read one picture without coverage, each pixel by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from lichen.accuracy.metrics import deviations, units_apart
from lichen.calibration import sweep
from lichen.calibration.corpus import Case, typical
from lichen.calibration.report import scientific, short
from lichen.image import Alpha, as_image
from lichen.memory import Array, aligned
from lichen.operation import POINTWISE, Operation, OperationParameters
from lichen.study import Chart, Study

LEAST, LOW, HIGH = 2.0**-14, -16.0, 2.0**14
DRAWS = 256
"""Colours of every part of the range."""
SHARES = (0.5, 0.99, 0.999, 1.0)
SPANS: Mapping[str, tuple[float, float]] = {"in [0, 1]": (0.0, 1.0), "beyond": (1.0, HIGH), "below 0": (LOW, 0.0)}


def study(operation: Operation[Any], parameters: OperationParameters) -> Study | None:
    """None where the operation reads something else than one picture, or more than a pixel of it."""
    case = _case(operation, parameters)
    if case is None:
        return None
    errors = dict(_errors(operation, parameters, case))
    if not errors:
        return None
    return Study(
        sentences=tuple(_told(name, *found) for name, found in errors.items()),
        numbers={
            "shares": list(SHARES),
            "ulp": {
                name: {span: _quantiles(units[_rows(span)]) for span in SPANS} for name, (_, units) in errors.items()
            },
        },
        charts=(
            _chart("largest error, in output units", {name: apart for name, (apart, _) in errors.items()}),
            _chart("largest error, in ULP of float32", {name: units for name, (_, units) in errors.items()}),
        ),
    )


@cache
def parts() -> tuple[tuple[float, float], ...]:
    """The parts of the range, from below."""
    below = -(2.0 ** np.arange(4, -15, -1))
    return tuple(pairwise([*below.tolist(), *(2.0 ** np.arange(-14, 14.5, 0.5)).tolist()]))


def places() -> tuple[float, ...]:
    """Their middles."""
    return tuple(0.0 if low < 0 < high else float(np.copysign(np.sqrt(low * high), low)) for low, high in parts())


def colours(channels: int) -> Array:
    """A row for each part, float32 (parts, `DRAWS`, channels). The first is grey of its lower end."""
    rng = np.random.default_rng(17)
    rows = []
    for low, high in parts():
        at = rng.uniform(size=(DRAWS, 1))
        at[0] = 0
        straight = low < 0 < high
        values = low + at * (high - low) if straight else np.copysign(abs(low) * (high / low) ** at, low)
        shares = rng.uniform(size=(DRAWS, channels))
        shares[np.arange(DRAWS), rng.integers(channels, size=DRAWS)] = 1
        shares[::2] = 1
        rows.append(values * shares)
    return aligned(np.stack(rows), np.float32)


def _case(operation: Operation[Any], parameters: OperationParameters) -> Case | None:
    found = typical(operation, parameters, sweep.SIDES[-1])
    given = [each for each in operation.inputs if each.name in found.inputs]
    if len(given) != 1 or not given[0].picture or operation.footprint(parameters, found.facts) != POINTWISE:
        return None
    image = found.inputs[given[0].name]
    case = Case("values", {given[0].name: as_image(colours(image.channels))})
    refused = operation.check(parameters, case.facts) or operation.identity(parameters, case.facts)
    return None if image.alpha is not Alpha.NONE or refused else case


def _errors(
    operation: Operation[Any], parameters: OperationParameters, case: Case
) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """By method and knob: the errors of all samples in output units, and in ULP; NaN where there is none."""
    with np.errstate(all="ignore"):
        truth = operation.evaluate_truth(case.inputs, parameters)
    if truth.shape[:2] != (len(parts()), DRAWS):
        return
    truth = np.where(np.abs(truth) > np.finfo(np.float32).max, np.nan, truth)
    for setting in sweep.ends(operation):
        if setting.method.unfit(parameters, case.facts) is None:
            made = [setting.compute(backend, case.inputs, parameters) for backend in sweep.backends()]
            apart = np.fmax.reduce([deviations(each, truth)[0] for each in made])
            units = np.fmax.reduce([units_apart(each, truth) for each in made])
            name = setting.method.name if setting.knob is None else f"{setting.method.name}, {short(setting.knob)}"
            yield name, (apart, units)


def _rows(span: str) -> slice:
    """The parts that lie in a span. What straddles 0 counts to neither side."""
    low, high = SPANS[span]
    within = [i for i, part in enumerate(parts()) if low <= part[0] and part[1] <= high]
    return slice(within[0], within[-1] + 1)


def _quantiles(units: Array) -> list[float] | None:
    found = units[np.isfinite(units)]
    return [_brief(each) for each in np.quantile(found, SHARES)] if found.size else None


def _told(name: str, apart: Array, units: Array) -> str:
    spans = [f"{_list(found)} {span}" for span in SPANS if (found := _quantiles(units[_rows(span)]))]
    if not spans:
        return f"{name} has no finite result."
    within = zip(_largest(apart)[_rows("in [0, 1]")], places()[_rows("in [0, 1]")], strict=True)
    worst, at = max(((error, at) for error, at in within if error is not None), default=(0.0, 0.0))
    most = f" Its largest error in [0, 1] is {scientific(worst)}, near {scientific(at)}." if worst else ""
    return f"{name}: half, 99 %, 99.9 %, all of its results lie within {'; '.join(spans)} ULP of float32.{most}"


def _list(found: list[float]) -> str:
    return ", ".join(scientific(each) for each in found)


def _chart(up: str, errors: Mapping[str, Array]) -> Chart:
    return Chart("value that is read", up, places(), {name: _largest(each) for name, each in errors.items()})


def _largest(errors: Array) -> tuple[float | None, ...]:
    """Of every part; None where nothing is finite."""
    found = np.fmax.reduce(errors.reshape(len(errors), -1), axis=1)
    return tuple(None if np.isnan(each) else _brief(each) for each in found)


def _brief(value: float) -> float:
    return float(f"{value:.2g}")
