"""Where a pointwise operation errs: its largest error by the value that it reads, and how its errors are distributed.

It is given two pictures of colours whose largest sample is swept: one within [0, 1], the domain of displays, for which
some methods are made, and one from -16 to 16384, which only others take. Half of the colours are grey; of the others
each sample is a share of the largest, a sixteenth at least. There are as many of every half octave in [0, 1], and in
the wide range of every octave above 0 and every second one below it.

What is told is the worse of the backends, of all methods at their finest and one at its coarsest: the largest error in
output units and in units in the last place (ULP) of the exact result as float32, and the quantiles of the latter in
[0, 1], above 1 and below 0. Where the exact result is small by cancellation it has few digits in float32 and many ULP.

Studied are operations that read one picture without coverage, each pixel by itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from lichen.accuracy.metrics import deviations, units_apart
from lichen.calibration import sweep
from lichen.calibration.corpus import Case, typical
from lichen.calibration.words import scientific, short
from lichen.image import Alpha, as_image
from lichen.memory import Array, aligned
from lichen.operation import POINTWISE, Operation, OperationParameters
from lichen.study import Chart, Study, brief

DRAWS = 256
"""Colours of every part of a range."""
SHARES = (0.5, 0.99, 0.999, 1.0)
LEAST = 1 / 16
"""Share of the largest sample of a colour that its others have at least: they are of its order."""
ROUNDED = 0.5
"""ULP that the exact result is off at most when it is rounded."""


@dataclass(frozen=True, slots=True)
class Range:
    """Values that are swept, from the least to the largest."""

    name: str
    edges: tuple[float, ...]
    """where its parts meet, ascending; of a part that touches 0 neither end counts as its place"""

    @property
    def parts(self) -> tuple[tuple[float, float], ...]:
        return tuple(pairwise(self.edges))

    @property
    def places(self) -> tuple[float, ...]:
        """Of each part, where it stands in charts: 0, or the end that is further from it."""
        return tuple(0.0 if low <= 0 <= high else brief(max(low, high, key=abs)) for low, high in self.parts)

    def colours(self, channels: int) -> Array:
        """A row for each part, float32 (parts, `DRAWS`, channels). The first and the third are greys of its ends."""
        rng = np.random.default_rng(17)
        rows = []
        for low, high in self.parts:
            at = rng.uniform(size=(DRAWS, 1))
            at[0], at[2] = 0, 1
            straight = low <= 0 <= high
            values = low + at * (high - low) if straight else low * (high / low) ** at
            shares = rng.uniform(LEAST, 1, size=(DRAWS, channels))
            shares[np.arange(DRAWS), rng.integers(channels, size=DRAWS)] = 1
            shares[::2] = 1
            rows.append(values * shares)
        return aligned(np.stack(rows), np.float32)

    def rows(self, low: float, high: float) -> slice:
        """The parts that lie between two of the edges."""
        within = [i for i, part in enumerate(self.parts) if low <= part[0] and part[1] <= high]
        return slice(within[0], within[-1] + 1)


def _powers(first: float, last: float, step: float) -> list[float]:
    return [float(each) for each in 2.0 ** np.arange(first, last + step / 2, step)]


DISPLAY = Range("of pictures within [0, 1]", (0.0, *_powers(-14, 0, 0.5)))
WIDE = Range("of pictures from -16 to 16384", (*(-each for each in reversed(_powers(-14, 4, 2))), *_powers(-14, 14, 1)))
SPANS: Mapping[str, tuple[Range, float, float]] = {
    "in [0, 1]": (DISPLAY, 0.0, 1.0),
    "above 1": (WIDE, 1.0, WIDE.edges[-1]),
    "below 0": (WIDE, WIDE.edges[0], 0.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """Of all samples, float64 (parts, `DRAWS`, channels), NaN where there is none."""

    apart: Array
    """in output units"""
    units: Array
    """in ULP"""
    mismatched: int
    """how many are finite on one side only, all backends counted"""


Found = Mapping[str, Mapping[str, _Errors]]
"""By the name of a range and that of a method with its knob."""


def study(operation: Operation[Any], parameters: OperationParameters) -> Study | None:
    """Where the operation errs with these parameters, measured now on all backends.

    None where it reads something else than one picture without coverage, or more than a pixel of it, or changes
    nothing. Errors are in output units, not divided by the largest value as those of reports. Raises LichenError where
    a kernel cannot be built."""
    found = {span.name: dict(_errors(operation, parameters, span)) for span in (DISPLAY, WIDE)}
    names = [_name(each) for each in sweep.ends(operation)]
    names = [name for name in names if any(name in own for own in found.values())]
    if not names:
        return None
    quantiles = {name: dict(_quantiles(found, name)) for name in names}
    return Study(
        sentences=tuple(_told(name, found, quantiles[name]) for name in names),
        numbers={"shares": list(SHARES), "ulp": quantiles},
        charts=(*_charts("output units", found, "apart"), *_charts("ULP of float32", found, "units")),
    )


def _name(setting: sweep.Setting) -> str:
    return setting.method.name if setting.knob is None else f"{setting.method.name}, {short(setting.knob)}"


def _case(operation: Operation[Any], parameters: OperationParameters, span: Range) -> Case | None:
    found = typical(operation, parameters, sweep.SIDES[-1])
    given = [each for each in operation.inputs if each.name in found.inputs]
    if len(given) != 1 or not given[0].picture or operation.footprint(parameters, found.facts) != POINTWISE:
        return None
    image = found.inputs[given[0].name]
    case = Case("values", {given[0].name: as_image(span.colours(image.channels))})
    refused = operation.check(parameters, case.facts) or operation.identity(parameters, case.facts)
    return None if image.alpha is not Alpha.NONE or refused else case


def _errors(operation: Operation[Any], parameters: OperationParameters, span: Range) -> Iterator[tuple[str, _Errors]]:
    """Of the settings that take a picture of this range."""
    case = _case(operation, parameters, span)
    if case is None:
        return
    with np.errstate(all="ignore"):
        truth = operation.evaluate_truth(case.inputs, parameters)
    if truth.shape[:2] != (len(span.parts), DRAWS):
        return
    truth = np.where(np.abs(truth) > np.finfo(np.float32).max, np.copysign(np.inf, truth), truth)
    for setting in sweep.ends(operation):
        if setting.method.unfit(parameters, case.facts) is None:
            made = [setting.compute(backend, case.inputs, parameters) for backend in sweep.backends()]
            apart, mismatched = zip(*(deviations(each, truth) for each in made), strict=True)
            units = [units_apart(each, truth) for each in made]
            yield _name(setting), _Errors(np.fmax.reduce(apart), np.fmax.reduce(units), sum(mismatched))


def _quantiles(found: Found, name: str) -> Iterator[tuple[str, list[float]]]:
    """By span: the ULP that the `SHARES` of all samples are off at most, where there are any."""
    for label, (span, low, high) in SPANS.items():
        if name in found[span.name]:
            units = found[span.name][name].units[span.rows(low, high)]
            if (units := units[np.isfinite(units)]).size:
                yield label, [_brief(each) for each in np.quantile(units, SHARES)]


def _told(name: str, found: Found, quantiles: Mapping[str, Sequence[float]]) -> str:
    if not quantiles:
        return f"{name} has no finite result."
    if all(shares[-1] <= ROUNDED for shares in quantiles.values()):
        text = f"{name}: every result is the exact one, rounded to float32."
    else:
        (first, shares), *others = quantiles.items()
        half, _, most, largest = map(scientific, shares)
        told = [
            f"{first} half of the results lie within {half} ULP of float32, 99.9 % within {most}, all within {largest}",
            *(f"{label} all within {scientific(shares[-1])}" for label, shares in others),
        ]
        text = f"{name}: {'; '.join(told)}."
    if name not in found[WIDE.name]:
        text += " It takes no other values."
    if own := found[DISPLAY.name].get(name):
        worst, ends = max(zip(((error or 0.0) for error in _largest(own.apart)), DISPLAY.parts, strict=True))
        where = " and ".join(map(scientific, ends))
        text += f" The largest error in [0, 1] is {scientific(worst)}, between {where}." if worst else ""
    if mismatched := sum(each[name].mismatched for each in found.values() if name in each):
        text += f" {mismatched} results are finite where the exact one is not, or the other way."
    return text


def _charts(unit: str, found: Found, of: str) -> Iterator[Chart]:
    for span in (DISPLAY, WIDE):
        curves = {name: _largest(getattr(errors, of)) for name, errors in found[span.name].items()}
        if curves:
            yield Chart(f"value that is read, {span.name}", f"largest error, in {unit}", span.places, curves)


def _largest(errors: Array) -> tuple[float | None, ...]:
    """Of every part; None where nothing is finite."""
    found = np.fmax.reduce(errors.reshape(len(errors), -1), axis=1)
    return tuple(None if np.isnan(each) else _brief(each) for each in found)


def _brief(value: float) -> float:
    return float(f"{value:.2g}")
