"""What takes its turn beside our settings: other libraries' functions, and our best setting in fewer bits.

Both are compared with truth over the pictures of the corpus, in the units of the error table. Hard cases are left out:
only our own methods promise anything there.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable, Sequence
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np

from lichen.accuracy.metrics import difference
from lichen.accuracy.precision import PRECISIONS, Precision, stored
from lichen.calibration import sweep
from lichen.calibration.corpus import Case, cases
from lichen.calibration.peers import Peer, peers
from lichen.calibration.report import Setting
from lichen.calibration.table import Entry
from lichen.errors import LichenError
from lichen.memory import Array
from lichen.operation import Inputs, Operation, OperationParameters

FAILURES = (LichenError, RuntimeError, ValueError)
"""What ours and other libraries raise where they cannot take a case."""
MISSING = "its errors are not known: it is not in the table, or took no image of the corpus"


@dataclasses.dataclass(frozen=True, eq=False)
class Rival:
    """What takes its turn beside our settings: its errors, and the call that is timed; none where it fails."""

    setting: Setting
    call: Callable[[], object] | None


def rivals(
    operation: Operation[Any], parameters: OperationParameters, case: Case, side: int, backend: str,
    entries: Sequence[Entry],
) -> list[Rival]:  # fmt: skip
    """All rivals of an operation; errors at `side`, calls on the images of `case`. `entries` are our own errors."""
    sheet = _answers(operation, parameters, side)
    found = [_peer(peer, parameters, case, sheet) for peer in peers(operation, parameters)]
    return found + _variants(operation, parameters, case, backend, entries, sheet, side)


def entry_of(entries: Sequence[Entry], setting: sweep.Setting) -> Entry | None:
    wanted = (setting.method.name, setting.knob, sweep.PRECISION)
    return next((each for each in entries if (each.method, each.knob, each.precision) == wanted), None)


@dataclasses.dataclass(frozen=True, eq=False)
class _Answer:
    """A picture of the corpus and what is right for it; `unit` is that of the table."""

    case: Case
    truth: Array
    unit: float


def _answers(operation: Operation[Any], parameters: OperationParameters, side: int) -> list[_Answer]:
    """All pictures but the hard cases, which only ours promise anything for."""
    found = []
    parameters = operation.sized(parameters, side, side)
    for case in cases(operation, parameters, side):
        if not case.name.startswith("hard: "):
            truth = operation.evaluate_truth(case.inputs, parameters)
            unit = max(1.0, float(np.abs(truth[np.isfinite(truth)]).max(initial=0.0)))
            found.append(_Answer(case, truth, unit))
    return found


def _peer(peer: Peer, parameters: OperationParameters, case: Case, sheet: Sequence[_Answer]) -> Rival:
    def compute(inputs: Inputs) -> Array:
        job = peer.job(inputs, parameters)
        job.run()
        return job.pixels()

    setting = _compared(peer.name, None, "float32", compute, sheet)
    setting = dataclasses.replace(setting, peer=True)
    return Rival(setting, None if setting.failed else peer.job(case.inputs, parameters).run)


def _variants(
    operation: Operation[Any], parameters: OperationParameters, case: Case, backend: str,
    entries: Sequence[Entry], sheet: Sequence[_Answer], side: int,
) -> list[Rival]:  # fmt: skip
    """The most accurate setting with its inputs and its result kept in less than float32.

    Pictures that reach beyond [0, 1] are left out: fixed point clips them, which says nothing of its digits.
    """
    best = _best(operation, parameters, case, backend, entries)
    if best is None:
        return []
    rivals, small = [], operation.sized(parameters, side, side)
    for precision in PRECISIONS:
        if precision.lossless:
            continue

        def compute(inputs: Inputs, wanted: OperationParameters, precision: Precision = precision) -> Array:
            kept = {name: image.replace(pixels=stored(image.pixels, precision)) for name, image in inputs.items()}
            return stored(best.compute(backend, kept, wanted), precision)

        lowest = 0.0 if precision.levels else -math.inf
        within = [each for each in sheet if _within(each.case, lowest)]
        setting = _compared(best.method.name, best.knob, precision, partial(compute, wanted=small), within)
        if not within:
            setting = dataclasses.replace(setting, failed="fixed point holds [0, 1], and all inputs reach beyond")
        rivals.append(Rival(setting, None if setting.failed else partial(compute, case.inputs, parameters)))
    return rivals


def _best(
    operation: Operation[Any], parameters: OperationParameters, case: Case, backend: str, entries: Sequence[Entry]
) -> sweep.Setting | None:
    """The fastest of the settings whose typical error is within twice the least, and whose worst is, if any is."""
    known = [
        (each, entry)
        for each in sweep.settings(operation)
        if each.method.unfit(parameters, case.facts) is None and (entry := entry_of(entries, each))
    ]
    if not known:
        return None
    for error in (attrgetter("typical_rms"), attrgetter("largest")):
        least = min(error(entry) for _, entry in known)
        known = [(each, entry) for each, entry in known if error(entry) <= 2 * least]
    fit = [each for each, _ in known]
    return min(fit, key=lambda each: each.method.seconds(backend, parameters, each.knob or 0.0, case.facts))


def _within(case: Case, lowest: float) -> bool:
    extents = [image.extent for image in case.inputs.values()]
    return all(lowest <= each.low and each.high <= 1 for each in extents)


def _compared(
    name: str, knob: float | None, precision: str, compute: Callable[[Inputs], Array], sheet: Sequence[_Answer]
) -> Setting:
    """Largest, p999 and median RMS error of `compute`, as float32 holds its result."""
    nan, rows = math.nan, []
    for answer in sheet:
        try:
            apart = difference(compute(answer.case.inputs).astype(np.float32), answer.truth)
        except FAILURES as failure:
            return Setting(name, knob, nan, nan, nan, nan, precision=precision, failed=brief(failure))
        rows.append((apart.largest / answer.unit, apart.rms / answer.unit, apart.p999 / answer.unit))
    if not rows:
        return Setting(name, knob, nan, nan, nan, nan, precision=precision, failed=MISSING)
    largest, rms, p999 = zip(*rows, strict=True)
    return Setting(name, knob, nan, max(largest), statistics.median(rms), max(p999), precision=precision)


def brief(failure: Exception) -> str:
    return str(failure).partition("\n")[0]
