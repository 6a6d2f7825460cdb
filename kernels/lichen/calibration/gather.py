"""Where the numbers of a report come from.

`measured` runs everything on this machine: errors over the corpus beside the times of all settings and peers, which
take turns in one run, so that what else the machine does meets all of them alike. `predicted` computes nothing: errors
are those of the checked-in table, times those that the planner would predict here. It takes milliseconds.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from typing import Any

import numpy as np

import lichen
from lichen.accuracy import times
from lichen.calibration import studies, sweep
from lichen.calibration.corpus import Case, cases, typical
from lichen.calibration.peers import peers
from lichen.calibration.report import Report, Setting
from lichen.calibration.rivals import FAILURES, MISSING, Rival, brief, entry_of, rivals
from lichen.calibration.table import Entry, load
from lichen.opencl.device import default_device
from lichen.operation import Facts, InputFacts, Operation, OperationParameters

SIZE = 512
"""Side of the image that times are for, unless another is asked for."""
SIZES = (64, 4096)
TURN = 0.02
"""Seconds that a setting may take in each turn: a quick one runs several times, since single calls scatter more."""
LONGEST = 1.0
"""Predicted seconds above which a setting is not timed in a quick run but predicted."""


@lru_cache(256)
def default_example(operation: Operation[Any]) -> int:
    """The example that shows most: the corpus has images for it, all methods take it, another than the first leads
    clearly; of equals the first."""
    return max(range(len(operation.examples)), key=lambda number: (*_shows(operation, number), -number))


def _shows(operation: Operation[Any], number: int) -> tuple[int, bool]:
    """How many methods take an example, and whether one is predicted to be twice as fast as the first of them."""
    if next(cases(operation, operation.validate(operation.examples[number]), 32), None) is None:
        return 0, False
    parameters = operation.sized(operation.validate(operation.examples[number]), SIZE, SIZE)
    facts = _facts(operation, number, SIZE)
    fit = [each for each in operation.methods.values() if each.unfit(parameters, facts) is None]
    knobs = [each.knob.values[len(each.knob.values) // 2] if each.knob else 0.0 for each in fit]
    seconds = [each.seconds("opencl", parameters, knob, facts) for each, knob in zip(fit, knobs, strict=True)]
    return len(fit), min(seconds) < seconds[0] / 2


@lru_cache(256)
def _facts(operation: Operation[Any], number: int, size: int) -> InputFacts:
    """Of the corpus's typical image at a size, without making it so large."""
    parameters = operation.validate(operation.examples[number])
    return _enlarged(typical(operation, parameters, 32).facts, size)


def _enlarged(facts: InputFacts, size: int) -> dict[str, Facts]:
    return {name: dataclasses.replace(each, height=size, width=size) for name, each in facts.items()}


# ---------------------------------------------------------------------------------------------------------- predicted


def predicted(
    operation: Operation[Any], example: int | None = None, *, size: int = SIZE, backend: str | None = None
) -> Report:
    """What the table and the time model say of one example. Computes no pixel."""
    number = default_example(operation) if example is None else example
    backend = backend or sweep.backends()[0]
    parameters, facts = operation.validate(operation.examples[number]), _facts(operation, number, size)
    entries = load().of(operation.name, number)
    rates = times.current(backend)
    settings = []
    for each in sweep.settings(operation):
        rate = rates.get((operation.name, each.method.name), each.method.rates[backend])
        seconds = rate.start + rate.step * each.method.work(parameters, each.knob or 0.0, facts)
        unfit = each.method.unfit(parameters, facts)
        entry = entry_of(entries, each)
        settings.append(_setting(each, seconds, 0.0, entry, unfit or (None if entry else MISSING)))
    for entry in entries:
        if entry.precision != sweep.PRECISION and (kept := _kept(settings, entry)):
            settings.append(_from(entry, kept.seconds, 0.0))
    known = any(name == operation.name for name, _ in rates)
    timed = (
        "were measured on this machine" if known else "come with the library; `lichen calibrate` measures this machine"
    )
    source = (
        f"Errors: the table of this version, images of {entries[0].size if entries else 0} px. "
        f"Times: predicted for {size} x {size} px from rates that {timed}."
    )
    report = _report(operation, number, None, backend, size, settings, source, {})
    return dataclasses.replace(report, command=f"{report.command} --predict")


def _kept(settings: Sequence[Setting], entry: Entry) -> Setting | None:
    """The setting in the working precision that a variant belongs to."""
    return next((each for each in settings if (each.method, each.knob) == (entry.method, entry.knob)), None)


# ----------------------------------------------------------------------------------------------------------- measured


def measured(
    operation: Operation[Any],
    example: int | Mapping[str, Any] | None = None,
    *,
    size: int = SIZE,
    backend: str | None = None,
    quick: bool = False,
    tell: Callable[[str], None] = lambda stage: None,
) -> Report:
    """Errors and times as found now, peers included. `example` may be other parameters.

    `quick` takes the errors of our own methods from the table and fewer timings. `tell` hears what is going on.
    """
    wanted, number, values = operation, 0, None
    if isinstance(example, Mapping):
        wanted, values, quick = copy.copy(operation), dict(example), False
        wanted.examples = (values,)
    else:
        number = default_example(operation) if example is None else example
    parameters = wanted.sized(wanted.validate(wanted.examples[number]), size, size)
    backend = backend or sweep.backends()[0]
    tell("errors")
    entries = load().of(wanted.name, number) if quick else ()
    entries = entries or tuple(sweep.errors(wanted, number))
    side = entries[0].size if entries else sweep.error_size(wanted, parameters)
    case = typical(wanted, parameters, size)
    others = rivals(wanted, parameters, case, side, backend, entries)
    tell("times")
    timings = _times(wanted, parameters, case, backend, others, 9 if quick else 21, quick)
    settings = []
    for each in sweep.settings(wanted):
        seconds, spread, failed = timings[_label(each)]
        entry = entry_of(entries, each)
        settings.append(_setting(each, seconds, spread, entry, failed or (None if entry else MISSING)))
    for rival in others:
        seconds, spread, failed = timings[rival.setting.label]
        wrong = rival.setting.failed or failed
        settings.append(dataclasses.replace(rival.setting, seconds=seconds, spread=spread, failed=wrong))
    first = next(iter(case.facts.values()), None) or wanted.result(parameters, case.facts)
    channels = first.channels
    source = (
        f"Errors: worst and median over the corpus, {side} px. "
        f"Times: lower quartiles of interleaved runs, {size} x {size} px, {channels} channels."
    )
    versions = {peer.distribution: peer.version for peer in peers(wanted, parameters)}
    return _report(wanted, number, values, backend, size, settings, source, versions)


def _label(setting: sweep.Setting) -> str:
    nan = math.nan
    return Setting(setting.method.name, setting.knob, nan, nan, nan, nan).label


Timing = tuple[float, float, str | None]


def _times(
    operation: Operation[Any], parameters: OperationParameters, case: Case, backend: str,
    others: Sequence[Rival], rounds: int, quick: bool,
) -> dict[str, Timing]:  # fmt: skip
    """Seconds, spread and what went wrong, by label, of settings and rivals in turn.

    The lower quartile stands for a time: what else a machine does only ever adds.
    """
    calls: dict[int, Callable[[], object]] = {}
    names: list[str] = []
    found: dict[str, Timing] = {}

    def enter(name: str, call: Callable[[], object]) -> None:
        try:
            call()
        except FAILURES as failure:
            found[name] = (math.nan, 0.0, brief(failure))
            return
        began = time.perf_counter()
        call()
        for _ in range(max(1, min(8, int(TURN / (time.perf_counter() - began + 1e-6))))):
            calls[len(names)] = call
            names.append(name)

    for each in sweep.settings(operation):
        unfit = each.method.unfit(parameters, case.facts)
        seconds = each.method.seconds(backend, parameters, each.knob or 0.0, case.facts)
        if unfit is not None:
            found[_label(each)] = (math.nan, 0.0, unfit)
        elif seconds > (LONGEST if quick else 4 * LONGEST):
            found[_label(each)] = (seconds, 0.0, None)
        else:
            enter(_label(each), partial(each.compute, backend, case.inputs, parameters))
    for rival in others:
        if rival.call is None:
            found[rival.setting.label] = (math.nan, 0.0, None)
        else:
            enter(rival.setting.label, rival.call)
    taken: dict[str, list[float]] = {}
    for place, kept in sweep.interleaved(calls, rounds).items():
        taken.setdefault(names[place], []).extend(kept)
    for name, kept in taken.items():
        low, high = (float(each) for each in np.quantile(kept, (0.25, 0.75)))
        found[name] = (low, (high - low) / 2 / low, None)
    return found


# ------------------------------------------------------------------------------------------------------------- common


def _setting(each: sweep.Setting, seconds: float, spread: float, entry: Entry | None, failed: str | None) -> Setting:
    if failed is not None or entry is None:
        nan = math.nan
        return Setting(each.method.name, each.knob, nan, nan, nan, nan, failed=failed)
    return _from(entry, seconds, spread)


def _from(entry: Entry, seconds: float, spread: float) -> Setting:
    return Setting(
        entry.method,
        entry.knob,
        seconds,
        entry.largest,
        entry.typical_rms,
        entry.p999,
        entry.stated,
        entry.kind,
        entry.precision,
        spread,
    )


def _report(
    operation: Operation[Any], number: int, values: Mapping[str, Any] | None, backend: str, size: int,
    settings: Sequence[Setting], source: str, versions: Mapping[str, str],
) -> Report:  # fmt: skip
    parameters = operation.examples[number]
    options = "".join(f" --{name.replace('_', '-')} {value}" for name, value in (values or {}).items())
    which = options if values is not None else f" --example {number}"
    return Report(
        operation=operation.name,
        parameters=parameters,
        example=None if values is not None else number,
        device=backend,
        size=size,
        settings=tuple(settings),
        knobs={method.name: method.knob.name for method in operation.methods.values() if method.knob},
        source=source,
        machine=machine(backend, versions),
        command=f"lichen accuracy {operation.name}{which} --size {size} --device {backend}",
        study=studies.load().get(operation.name),
    )


def machine(backend: str, further: Mapping[str, str]) -> dict[str, str]:
    """The hardware and the versions that count, in words."""
    known = times.machine(backend)
    device = default_device() if backend == "opencl" else None
    number = known["processors"]
    words = {"processor": f"{known['processor']}, {number} processor{'s' if number != 1 else ''}"}
    if device is not None:
        brief = re.search(r"PoCL [\d.]+", device.runtime)
        words["runtime"] = brief.group() if brief else device.runtime.partition("  ")[0]
    words["lichen"] = f"Lichen {lichen.__version__}"
    words["numpy"] = f"NumPy {np.__version__}"
    return words | {name: f"{name} {version}" for name, version in further.items()}
