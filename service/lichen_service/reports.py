"""The account of a run as header fields.

    Lichen-Method: fir; tail=0.0001
    Lichen-Device: opencl
    Lichen-Error: 1.23e-05; bound; max           value in output units, rounded up; how it is known; metric
    Lichen-Measured: 1.2e-07; measured; max; sampled=1; p999=9.1e-08; rms=2.1e-08; mismatched=0
                                                 where `verify` was asked; "none" and the reason where it cannot be had;
                                                 of integers also codes=1, of pictures ciede2000=0.02, the largest
    Lichen-Precision: fixed8                     what values were kept in, where that is not float32
    Lichen-Skipped: identity;node="gaussian";reason="sigma is 0";bound=0
    Lichen-Nonfinite: 0                          NaN and infinite samples of the result
    Lichen-Clipped: 12                           samples beyond what integers hold, moved to the end of their range
    Lichen-Space: srgb; alpha=straight; storage=uint8

Values are single lines of ASCII. Text in quotes follows RFC 9651 (strings); what is not ASCII becomes `?`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping
from decimal import ROUND_CEILING, Decimal, localcontext
from typing import Any, Protocol

import numpy as np

from lichen.accuracy.precision import Precision
from lichen.engine import Result
from lichen.files import Encoded
from lichen.image import Storage
from lichen.operation import Operation
from lichen.verification import Verification

LONGEST = 2000
"""Characters of `Lichen-Skipped`; the entries that do not fit are counted in a last one."""
SKIPPING = ("dropped", "skipped", "not lowered")


class Deciding(Protocol):
    """What is read of a planner's decision."""

    @property
    def pass_(self) -> str: ...
    @property
    def node(self) -> str: ...
    @property
    def action(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def bound(self) -> float: ...


def table_of(operation: Operation[Any], findings: Mapping[str, Any]) -> bytes:
    """Findings that are a table, as NPY of two dimensions."""
    assert operation.table is not None
    written = io.BytesIO()
    np.save(written, operation.table(findings), allow_pickle=False)
    return written.getvalue()


def report(result: Result, storage: Storage, encoded: Encoded | None = None) -> dict[str, str]:
    """The header fields that say how a result was made. `Lichen-Skipped` is left out when nothing was, `Lichen-Clipped`
    where no picture leaves."""
    headers = {
        "Lichen-Method": _line(result.method),
        "Lichen-Device": _line(result.device),
        "Lichen-Error": f"{rounded_up(result.error.value)}; {result.error.kind}; max",
        # Who made integers of the samples has met each of them.
        "Lichen-Nonfinite": str(encoded.nonfinite if encoded is not None and storage.integer else result.nonfinite),
        "Lichen-Space": f"{result.image.space}; alpha={result.image.alpha}; storage={storage}",
    }
    if result.plan.graph.precision is not Precision.FLOAT32:
        headers["Lichen-Precision"] = result.plan.graph.precision
    if result.verification is not None:
        headers["Lichen-Measured"] = measured(result.verification)
    if storage.integer and encoded is not None:
        headers["Lichen-Clipped"] = str(encoded.clipped)
    dropped = skipped(result.decisions)
    return headers | ({"Lichen-Skipped": dropped} if dropped else {})


def measured(found: Verification) -> str:
    """What comparing with truth found. The share of pixels that were compared is rounded down, errors up."""
    difference = found.measured
    if difference is None:
        return f"none; reason={_string(found.reason)}"
    codes = "" if found.codes is None else f"; codes={found.codes}"
    seen = "" if found.seen is None else f"; ciede2000={rounded_up(found.seen)}"
    return (
        f"{rounded_up(difference.largest)}; measured; max; sampled={math.floor(difference.sampled * 1e4) / 1e4:g}; "
        f"p999={rounded_up(difference.p999)}; rms={rounded_up(difference.rms)}; mismatched={difference.mismatched}"
        f"{codes}{seen}"
    )


def skipped(decisions: Iterable[Deciding]) -> str:
    """The decisions that left work out, as one list; empty when there were none."""
    entries = [
        f"{_token(each.pass_)};node={_string(each.node)};reason={_string(each.reason)};bound={rounded_up(each.bound)}"
        for each in decisions
        if each.action in SKIPPING
    ]
    kept: list[str] = []
    for entry in entries:
        if sum(map(len, kept)) + 2 * len(kept) + len(entry) > LONGEST:
            kept.append(f"more;count={len(entries) - len(kept)}")
            break
        kept.append(entry)
    return ", ".join(kept)


def rounded_up(value: float) -> str:
    """Three significant digits, never less than `value`: a bound must stay one.

    >>> rounded_up(0.0123401)
    '0.0124'
    """
    if not math.isfinite(value):
        return str(value)
    with localcontext(prec=3, rounding=ROUND_CEILING):
        return f"{float(+Decimal(value)):.3g}"


def _line(text: str) -> str:
    return "".join(each if " " <= each <= "~" else "?" for each in text)


def _string(text: str) -> str:
    return '"' + _line(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _token(text: str) -> str:
    return "".join(each if each.isascii() and (each.isalnum() or each in "-_.") else "-" for each in text) or "-"
