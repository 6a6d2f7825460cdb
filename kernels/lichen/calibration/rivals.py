"""What takes its turn beside our settings: other libraries' functions that compute the same.

They are compared with truth over the pictures of the corpus, in the units of the error table. Hard cases are left out:
only our own methods promise anything there.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lichen.accuracy.metrics import difference
from lichen.calibration.corpus import Case, cases
from lichen.calibration.peers import Peer, peers
from lichen.calibration.report import Setting
from lichen.calibration.turns import FAILURES, brief
from lichen.calibration.viewing import Viewer, viewer
from lichen.memory import Array
from lichen.operation import Inputs, Operation, OperationParameters

MISSING = "its errors are not known: it is not in the table, or took no image of the corpus"


@dataclasses.dataclass(frozen=True, eq=False)
class Rival:
    """Its errors, and the call that is timed; none where it fails."""

    setting: Setting
    call: Callable[[], object] | None


def rivals(operation: Operation[Any], parameters: OperationParameters, case: Case, side: int) -> list[Rival]:
    """All rivals of an operation; errors at `side`, calls on the images of `case`."""
    found = list(peers(operation, parameters))
    sheet = _answers(operation, parameters, side) if found else []
    return [_peer(peer, parameters, case, sheet) for peer in found]


@dataclasses.dataclass(frozen=True, eq=False)
class _Answer:
    """A picture of the corpus and what is right for it; `unit` is that of the table. Somebody looks at one of them."""

    case: Case
    truth: Array
    unit: float
    viewer: Viewer | None


def _answers(operation: Operation[Any], parameters: OperationParameters, side: int) -> list[_Answer]:
    """All pictures but the hard cases, which only ours promise anything for."""
    found = []
    parameters = operation.sized(parameters, side, side)
    for case in cases(operation, parameters, side):
        if not case.name.startswith("hard: "):
            truth = operation.evaluate_truth(case.inputs, parameters)
            unit = max(1.0, float(np.abs(truth[np.isfinite(truth)]).max(initial=0.0)))
            found.append(_Answer(case, truth, unit, viewer(operation, parameters, case, truth)))
    return found


def _peer(peer: Peer, parameters: OperationParameters, case: Case, sheet: Sequence[_Answer]) -> Rival:
    def compute(inputs: Inputs) -> Array:
        job = peer.job(inputs, parameters)
        job.run()
        return job.pixels()

    setting = dataclasses.replace(_compared(peer.name, compute, sheet), peer=True)
    return Rival(setting, None if setting.failed else peer.job(case.inputs, parameters).run)


def _compared(name: str, compute: Callable[[Inputs], Array], sheet: Sequence[_Answer]) -> Setting:
    """Largest, p999 and median RMS error of `compute`, as float32 holds its result, and how it looks."""
    nan, rows, look = math.nan, [], None
    for answer in sheet:
        try:
            pixels = compute(answer.case.inputs).astype(np.float32)
            apart = difference(pixels, answer.truth)
        except FAILURES as failure:
            return Setting(name, None, nan, nan, nan, nan, failed=brief(failure))
        if answer.viewer:
            look = answer.viewer.look(pixels)
        rows.append((apart.largest / answer.unit, apart.rms / answer.unit, apart.p999 / answer.unit))
    if not rows:
        return Setting(name, None, nan, nan, nan, nan, failed=MISSING)
    largest, rms, p999 = zip(*rows, strict=True)
    errors = max(largest), statistics.median(rms), max(p999)
    return Setting(name, None, nan, *errors, delta_e=look and look.delta_e, flip=look and look.flip)
