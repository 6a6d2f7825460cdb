"""Every method at every setting of its knob, on every backend: how far from truth.

Errors are taken over the corpus at a small size, since truth is slow.

Errors are in output units for pictures within [0, 1]. An image whose exact result is larger than 1 somewhere counts
divided by that magnitude, stated error and all: 1 in 10 000 is the same accuracy as 0.0001 in 1.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lichen.accuracy.metrics import Difference, difference
from lichen.calibration.corpus import Case, cases, typical
from lichen.calibration.table import Entry
from lichen.calibration.variants import Known, Stored, telling
from lichen.calibration.viewing import Look, viewer
from lichen.errors import LichenError
from lichen.memory import Array
from lichen.opencl.device import default_device
from lichen.operation import Error, Inputs, Method, Operation, OperationParameters

PRECISION = "float32"
SIDES = (256, 128, 64, 48, 32, 24)
AFFORDABLE = 0.05
"""Declared seconds of the most accurate method with NumPy, at most, where truth shall not take minutes."""
UNDERFLOW = float(np.finfo(np.float32).tiny)


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


def ends(operation: Operation[Any]) -> Iterator[Setting]:
    """All methods at the last declared value of their knobs, and one of them at its first."""
    coarse = True
    for method in operation.methods.values():
        values = method.knob.values if method.knob else (None,)
        if coarse and len(values) > 1:
            yield Setting(method, values[0])
            coarse = False
        yield Setting(method, values[-1])


def errors(
    operation: Operation[Any],
    number: int,
    size: int | None = None,
    tried: Callable[[Operation[Any]], Iterable[Setting]] = settings,
) -> list[Entry]:
    """The errors of all settings that are `tried` at the operation's example `number`, over the corpus at `size`.

    The most accurate setting comes in stores of less precision, too.
    """
    example = operation.examples[number]
    parameters = operation.validate(example)
    size = size or error_size(operation, parameters)
    if operation.generates:
        example = {**example, "height": size, "width": size}
    parameters = operation.validate(example)
    found: dict[Key, list[_Found]] = {}
    looks: dict[Key, Look | None] = {}
    known: list[Known] = []
    for case in cases(operation, parameters, size):
        truth = operation.evaluate_truth(case.inputs, parameters)
        beyond = np.abs(truth) > np.finfo(np.float32).max
        truth = np.where(beyond, np.copysign(np.inf, truth), truth)
        known.append((case, truth))
        looking = viewer(operation, parameters, case, truth)
        able = (each for each in tried(operation) if each.method.unfit(parameters, case.facts) is None)
        for setting, backend in product(able, backends()):
            pixels = setting.compute(backend, case.inputs, parameters)
            key = (setting.method.name, setting.knob, PRECISION)
            stated = setting.error(case, parameters)
            found.setdefault(key, []).append(_Found(case.name, difference(pixels, truth), stated, _unit(truth)))
            if looking and backend == backends()[0]:
                looks[key] = looking.look(pixels)
    for key, one, look in _stored(operation, example, known):
        if one:
            found.setdefault(key, []).append(one)
        looks[key] = look or looks.get(key)
    return [_entry(operation, number, key, size, each, looks.get(key)) for key, each in found.items()]


def _able(operation: Operation[Any], parameters: OperationParameters, case: Case) -> list[Setting]:
    return [each for each in settings(operation) if each.method.unfit(parameters, case.facts) is None]


def _unit(truth: Array) -> float:
    """What errors count divided by."""
    return max(1.0, float(np.abs(truth[np.isfinite(truth)]).max(initial=0.0)))


def _stored(
    operation: Operation[Any], example: Mapping[str, Any], known: Sequence[Known]
) -> Iterator[tuple[Key, _Found | None, Look | None]]:
    """The setting that is the most accurate of those that take the first picture, in stores of less precision: what it
    does to pictures that tell, and how that one looks that is looked at."""
    parameters = operation.validate(example)
    offered = ((case, _able(operation, parameters, case)) for case, _ in known)
    first, able = next(((case, able) for case, able in offered if able), (None, []))
    if first is None:
        return
    finest = min(able, key=lambda each: each.error(first, parameters).usual)
    stored = Stored(operation, example, finest.method.name, finest.knob)
    told = [case for case, _ in telling(known)]
    for case, truth in known:
        tells, looking = case in told, viewer(operation, parameters, case, truth)
        for precision, result in stored.runs(case, backends()[0]) if tells or looking else ():
            pixels = result.image.pixels
            apart = difference(pixels, truth, result.image.alpha)
            one = _Found(case.name, apart, result.error, _unit(truth)) if tells else None
            look = looking.look(pixels) if looking else None
            yield (finest.method.name, finest.knob, str(precision)), one, look


def _entry(
    operation: Operation[Any], number: int, key: Key, size: int, found: Sequence[_Found], look: Look | None
) -> Entry:
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
        delta_e=look and look.delta_e,
        flip=look and look.flip,
    )
