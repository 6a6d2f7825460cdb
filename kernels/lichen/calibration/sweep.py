"""Every method at every setting of its knob, on every backend: how far from truth, and how long.

Errors are taken over the corpus at a small size, since truth is slow; times on its typical image at the size asked for,
all settings in turn and again in turn, so that what else the machine does meets all of them alike.

Errors are in output units for pictures within [0, 1]. An image whose exact result is larger than 1 somewhere counts
divided by that magnitude, stated error and all: 1 in 10 000 is the same accuracy as 0.0001 in 1.
"""

from __future__ import annotations

import gc
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lichen.accuracy.metrics import Difference, difference
from lichen.calibration.corpus import Case, cases, typical
from lichen.calibration.table import Entry, load
from lichen.calibration.variants import Stored
from lichen.catalogue import operation as named
from lichen.errors import LichenError
from lichen.memory import Array
from lichen.opencl.device import default_device
from lichen.operation import Error, Inputs, Method, Operation, OperationParameters

PRECISION = "float32"
SIDES = (256, 128, 64, 48, 32, 24)
AFFORDABLE = 0.05
"""Declared seconds of the most accurate method with NumPy, at most, where truth shall not take minutes."""
LONGEST = 2.0
"""Predicted seconds above which a setting is not timed but predicted."""
UNDERFLOW = float(np.finfo(np.float32).tiny)


@dataclass(frozen=True, slots=True)
class Point:
    """One setting on one backend: its time at `size`, and its errors as in the table."""

    operation: str
    method: str
    knob: float | None
    precision: str
    backend: str
    size: int
    """side of the image that was timed, px"""
    seconds: float
    """median"""
    spread: float
    """half the range in which the middle half of the timings lie, over the median; 0 where the time is predicted"""
    largest: float
    p999: float
    rms: float
    typical_rms: float
    worst_image: str
    stated: float
    kind: str
    failed: str | None = None


@dataclass(frozen=True, slots=True)
class Setting:
    """A method and a value of its knob."""

    method: Method[Any]
    knob: float | None

    def compute(self, backend: str, inputs: Inputs, parameters: OperationParameters) -> Array:
        """The method's result; the device is the default one."""
        knob = self.knob if self.knob is not None else 0.0
        with np.errstate(all="ignore"):
            if backend == "numpy":
                return self.method.implementation.numpy(inputs, parameters, knob)
            device = default_device()
            if device is None:
                raise LichenError("there is no OpenCL device")
            return self.method.implementation.opencl(device, inputs, parameters, knob)

    def error(self, case: Case, parameters: OperationParameters) -> Error:
        return self.method.error(parameters, self.knob or 0.0, case.facts)

    def work(self, case: Case, parameters: OperationParameters) -> float:
        return self.method.work(parameters, self.knob or 0.0, case.facts)


def settings(operation: Operation[Any]) -> Iterator[Setting]:
    """All methods at all declared values of their knobs."""
    for method in operation.methods.values():
        for knob in method.knob.values if method.knob else (None,):
            yield Setting(method, knob)


def backends() -> tuple[str, ...]:
    """Those that work here."""
    return ("numpy",) if default_device() is None else ("opencl", "numpy")


# ------------------------------------------------------------------------------------------------------------ errors


def error_size(operation: Operation[Any], parameters: OperationParameters) -> int:
    """The side at which truth is affordable; it follows from the declaration alone, so it is the same everywhere."""
    for side in SIDES:
        parameters = operation.sized(parameters, side, side)
        case = typical(operation, parameters, side)
        slowest = max(
            setting.method.seconds("numpy", parameters, setting.knob or 0.0, case.facts)
            for setting in settings(operation)
            if setting.method.unfit(parameters, case.facts) is None
        )
        if slowest <= AFFORDABLE:
            return side
    return SIDES[-1]


@dataclass(frozen=True, slots=True)
class _Found:
    """What one setting did to one image, the worse backend counting; all errors over `unit`."""

    image: str
    difference: Difference
    stated: Error
    unit: float

    @property
    def largest(self) -> float:
        return max(0.0, self.difference.largest - UNDERFLOW) / self.unit


Key = tuple[str, float | None, str]
"""Method, knob and precision."""


def errors(operation: Operation[Any], number: int, size: int | None = None) -> list[Entry]:
    """The errors of all settings at the operation's example `number`, over the corpus at `size`.

    The most accurate setting comes in stores of less precision, too.
    """
    example = operation.examples[number]
    parameters = operation.validate(example)
    size = size or error_size(operation, parameters)
    if operation.generates:
        example = {**example, "height": size, "width": size}
    parameters = operation.validate(example)
    found: dict[Key, list[_Found]] = {}
    finest: Setting | None = None
    for case in cases(operation, parameters, size):
        truth = operation.evaluate_truth(case.inputs, parameters)
        beyond = np.abs(truth) > np.finfo(np.float32).max
        truth = np.where(beyond, np.copysign(np.inf, truth), truth)
        finite = np.abs(truth[np.isfinite(truth)])
        unit = max(1.0, float(finite.max(initial=0.0)))
        able = [each for each in settings(operation) if each.method.unfit(parameters, case.facts) is None]
        for setting, backend in product(able, backends()):
            apart = difference(setting.compute(backend, case.inputs, parameters), truth)
            key = (setting.method.name, setting.knob, PRECISION)
            found.setdefault(key, []).append(_Found(case.name, apart, setting.error(case, parameters), unit))
        finest = finest or min(able, key=lambda each: each.error(case, parameters).usual, default=None)
        if finest is None or case.name.startswith("hard: "):
            continue
        stored = Stored(operation, example, finest.method.name, finest.knob)
        for backend in backends():
            for precision, result in stored.runs(case, truth, backend):
                apart = difference(result.image.pixels, truth, result.image.alpha)
                key = (finest.method.name, finest.knob, str(precision))
                found.setdefault(key, []).append(_Found(case.name, apart, result.error, unit))
    return [_entry(operation, number, key, size, each) for key, each in found.items()]


def _entry(operation: Operation[Any], number: int, key: Key, size: int, found: Sequence[_Found]) -> Entry:
    method, knob, precision = key
    worst = max(found, key=lambda each: each.largest)
    broken = [each for each in found if each.largest * each.unit > each.stated.value]
    if broken:  # what stands in the table must show it, whatever image it was
        worst = max(broken, key=lambda each: each.largest * each.unit - each.stated.value)
    return Entry(
        operation=operation.name,
        example=number,
        method=method,
        knob=knob,
        precision=precision,
        size=size,
        largest=worst.largest,
        worst_image=worst.image,
        p999=max(each.difference.p999 / each.unit for each in found),
        rms=max(each.difference.rms / each.unit for each in found),
        typical_rms=statistics.median(each.difference.rms / each.unit for each in found),
        stated=worst.stated.value / worst.unit,
        kind="bound" if all(each.stated.kind == "bound" for each in found) else "estimate",
        mismatched=sum(each.difference.mismatched for each in found),
    )


# ------------------------------------------------------------------------------------------------------------- times


def measure(
    operation: Operation[Any] | str,
    example: int = 0,
    *,
    size: int = 512,
    backends: Sequence[str] = ("opencl", "numpy"),
    quick: bool = False,
) -> list[Point]:
    """Errors and times of all settings at one of the operation's examples.

    `quick` takes the errors from the table that comes with the library, where it has them, and times each setting
    three times instead of nine. A setting that cannot run has `failed` and NaN for what it has not.
    """
    wanted = named(operation) if isinstance(operation, str) else operation
    parameters = wanted.sized(wanted.validate(wanted.examples[example]), size, size)
    known = load().of(wanted.name, example) if quick else ()
    entries = {(e.method, e.knob): e for e in known or errors(wanted, example) if e.precision == PRECISION}
    case = typical(wanted, parameters, size)
    points = []
    for backend in backends:
        timings = _times(list(settings(wanted)), backend, case, parameters, 3 if quick else 9)
        for setting, (seconds, spread, failed) in zip(settings(wanted), timings, strict=True):
            entry = entries.get((setting.method.name, setting.knob))
            points.append(_point(wanted.name, setting, backend, size, seconds, spread, entry, failed))
    return points


def _point(
    name: str, setting: Setting, backend: str, size: int, seconds: float, spread: float, entry: Entry | None,
    failed: str | None,
) -> Point:  # fmt: skip
    nan = math.nan
    return Point(
        operation=name,
        method=setting.method.name,
        knob=setting.knob,
        precision=PRECISION,
        backend=backend,
        size=size,
        seconds=seconds,
        spread=spread,
        largest=entry.largest if entry else nan,
        p999=entry.p999 if entry else nan,
        rms=entry.rms if entry else nan,
        typical_rms=entry.typical_rms if entry else nan,
        worst_image=entry.worst_image if entry else "",
        stated=entry.stated if entry else nan,
        kind=entry.kind if entry else "estimate",
        failed=failed if failed or entry else "it takes none of the images",
    )


def _times(
    chosen: Sequence[Setting], backend: str, case: Case, parameters: OperationParameters, rounds: int
) -> list[tuple[float, float, str | None]]:
    """Seconds, their spread and what went wrong, for each setting."""
    calls: dict[int, Callable[[], object]] = {}
    results: list[tuple[float, float, str | None]] = [(math.nan, 0.0, None)] * len(chosen)
    for number, setting in enumerate(chosen):
        unfit = setting.method.unfit(parameters, case.facts)
        predicted = setting.method.seconds(backend, parameters, setting.knob or 0.0, case.facts)
        if unfit is not None:
            results[number] = (math.nan, 0.0, unfit)
        elif predicted > LONGEST:
            results[number] = (predicted, 0.0, None)
        else:

            def call(setting: Setting = setting) -> object:
                return setting.compute(backend, case.inputs, parameters)

            try:
                call()
            except LichenError as failure:
                results[number] = (math.nan, 0.0, str(failure))
            else:
                calls[number] = call
    for number, kept in interleaved(calls, rounds).items():
        median = statistics.median(kept)
        low, high = np.quantile(kept, (0.25, 0.75))
        results[number] = (median, float(high - low) / 2 / median, None)
    return results


def interleaved(calls: dict[int, Callable[[], object]], rounds: int) -> dict[int, list[float]]:
    """Seconds of every call, all of them in turn, `rounds` times."""
    kept: dict[int, list[float]] = {number: [] for number in calls}
    collecting = gc.isenabled()
    gc.disable()
    try:
        for _ in range(rounds):
            for number, call in calls.items():
                began = time.perf_counter()
                call()
                kept[number].append(time.perf_counter() - began)
    finally:
        if collecting:
            gc.enable()
    return kept
