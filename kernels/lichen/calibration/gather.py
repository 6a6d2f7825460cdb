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
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

import lichen
from lichen.accuracy import times
from lichen.accuracy.precision import Precision
from lichen.calibration import by_value, studies, sweep
from lichen.calibration.corpus import Case, typical
from lichen.calibration.examples import SIZE, default_example, facts_of
from lichen.calibration.peers import peers
from lichen.calibration.report import Report, Setting
from lichen.calibration.rivals import MISSING, rivals
from lichen.calibration.table import Entry, load
from lichen.calibration.turns import FULL, QUICK, Effort, Timed, once, timed
from lichen.kind import kind
from lichen.opencl.device import default_device
from lichen.operation import Operation, OperationParameters
from lichen.planning.choose import DOUBLE_ROUNDING
from lichen.planning.graph import TRUTH

# ---------------------------------------------------------------------------------------------------------- predicted


def predicted(
    operation: Operation[Any], example: int | None = None, *, size: int = SIZE, backend: str | None = None
) -> Report:
    """What the table and the time model say of one example. Computes no pixel."""
    number = default_example(operation) if example is None else example
    backend = backend or sweep.backends()[0]
    parameters, facts = operation.validate(operation.examples[number]), facts_of(operation, number, size)
    entries = load().of(operation.name, number)
    rates, own = times.current(backend), kind(parameters, facts)
    settings = []
    for each in sweep.settings(operation):
        rate = rates.get((operation.name, each.method.name), each.method.rates[backend])
        seconds = rate.seconds(each.method.work(parameters, each.knob or 0.0, facts), own)
        settings.append(_setting(each, Timed(seconds, failed=each.method.unfit(parameters, facts)), entries))
    settings += _variants(settings, entries)
    settings.append(_doubles(Timed(operation.truth_seconds(parameters, facts))))
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
    others = rivals(wanted, parameters, case, side)
    tell("times")
    calls = {each.setting.label: each.call for each in others if each.call is not None}
    effort = QUICK if quick else FULL
    timings = _times(wanted, parameters, case, backend, calls, effort)
    guessed = wanted.truth_seconds(parameters, case.facts) > effort.longest / 2
    settings = [_setting(each, timings[_label(each)], entries) for each in sweep.settings(wanted)]
    settings += _variants(settings, entries)
    settings.append(_doubles(timings[TRUTH]))
    for rival in others:
        took = timings.get(rival.setting.label, Timed(math.nan))
        failed = rival.setting.failed or took.failed
        settings.append(dataclasses.replace(rival.setting, seconds=took.seconds, spread=took.spread, failed=failed))
    first = next(iter(case.facts.values()), None) or wanted.result(parameters, case.facts)
    channels = first.channels
    source = (
        f"Errors: worst and median over the corpus, {side} px. "
        f"Times: lower quartiles of interleaved runs, {size} x {size} px, {channels} channels; "
        f"that of the exact result is {'a guess' if guessed else 'one run'}."
    )
    versions = {peer.distribution: peer.version for peer in peers(wanted, parameters)}
    report = _report(wanted, number, values, backend, size, settings, source, versions)
    return dataclasses.replace(report, study=report.study or by_value.study(wanted, parameters))


def _label(setting: sweep.Setting) -> str:
    nan = math.nan
    return Setting(setting.method.name, setting.knob, nan, nan, nan, nan).label


def _times(
    operation: Operation[Any], parameters: OperationParameters, case: Case, backend: str,
    others: Mapping[str, Callable[[], object]], effort: Effort,
) -> dict[str, Timed]:  # fmt: skip
    """By label: our settings, those of `others`, and truth. What would take too long is predicted."""
    calls: dict[str, Callable[[], object]] = {}
    found: dict[str, Timed] = {}
    for each in sweep.settings(operation):
        unfit = each.method.unfit(parameters, case.facts)
        seconds = each.method.seconds(backend, parameters, each.knob or 0.0, case.facts)
        if unfit is not None or seconds > effort.longest:
            found[_label(each)] = Timed(seconds, failed=unfit)
        else:
            calls[_label(each)] = partial(each.compute, backend, case.inputs, parameters)
    found[TRUTH] = Timed(operation.truth_seconds(parameters, case.facts))
    if found[TRUTH].seconds <= effort.longest / 2:
        found[TRUTH] = once(partial(operation.evaluate_truth, case.inputs, parameters))
    return found | timed({**calls, **others}, effort)


# ------------------------------------------------------------------------------------------------------------- common


def _setting(each: sweep.Setting, took: Timed, entries: Sequence[Entry]) -> Setting:
    """One of ours in the working precision."""
    wanted = (each.method.name, each.knob, sweep.PRECISION)
    entry = next((entry for entry in entries if (entry.method, entry.knob, entry.precision) == wanted), None)
    failed = took.failed or (None if entry else MISSING)
    if failed is not None or entry is None:
        nan = math.nan
        return Setting(each.method.name, each.knob, nan, nan, nan, nan, failed=failed)
    return _from(entry, took.seconds, took.spread)


def _variants(settings: Sequence[Setting], entries: Sequence[Entry]) -> Iterator[Setting]:
    """In stores of less precision: what is computed is the same, and so is its time."""
    known = {(each.method, each.knob): each for each in settings if each.failed is None}
    for entry in entries:
        if entry.precision != sweep.PRECISION and (working := known.get((entry.method, entry.knob))):
            yield _from(entry, working.seconds, working.spread)


def _doubles(took: Timed) -> Setting:
    """The definition itself, in doubles: `precision=float64`."""
    nothing = math.nan if took.failed else 0.0
    stated, precision = DOUBLE_ROUNDING, Precision.FLOAT64
    return Setting(
        TRUTH, None, took.seconds, nothing, nothing, nothing, stated, "bound", precision, took.spread,
        failed=took.failed,
    )  # fmt: skip


def _from(entry: Entry, seconds: float, spread: float) -> Setting:
    return Setting(
        entry.method, entry.knob, seconds, entry.largest, entry.typical_rms, entry.p999, entry.stated, entry.kind,
        entry.precision, spread, delta_e=entry.delta_e, flip=entry.flip,
    )  # fmt: skip


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
        study=studies.of(operation.name, None if values is not None else number),
        expected={
            method.name: method.knob.order for method in operation.methods.values() if method.knob and method.knob.order
        },
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
