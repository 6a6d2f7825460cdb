"""Transfer curves in float32 NumPy: the twin of transfer.cl, with the same rewriting of the formulas.

A picture is worked through in blocks that stay in cache, each operation writing into a block's scratch, and the blocks
are shared out to threads; NumPy's loops release the interpreter. A sample's result does not depend on its block.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.operations.tone.curves import PQ_C3, PQ_LIMIT, PQ_M1, PQ_M2, PQ_Q, Form, pq_ceiling_signal
from lichen.operations.tone.fitted import Fit
from lichen.operations.tone.tables import Table
from lichen.processors import threads

BLOCK = 1 << 14
"""samples; a block and its scratch fit in the second-level cache"""
SHARE = 16
"""blocks that a thread takes at once"""

F = np.float32


def evaluate(
    pixels: Array, form: Form, *, clamped: bool, table: Table | None = None, found: Fit | None = None
) -> Array:
    """The curve of every sample, float32, same shape. With a table, samples up to its top are interpolated; with a fit
    they are those of its polynomials."""
    source = aligned(pixels).reshape(-1)
    out = aligned_empty(pixels.shape)
    flat = out.reshape(-1)

    def share(start: int) -> None:
        scratch = np.empty((6, min(BLOCK, flat.size)), dtype=np.float32)
        with np.errstate(all="ignore"):
            for at in range(start, min(start + SHARE * BLOCK, flat.size), BLOCK):
                x, y = source[at : at + BLOCK], flat[at : at + BLOCK]
                _block(x, y, scratch[:, : x.size], form, clamped, table, found)

    starts = range(0, flat.size, SHARE * BLOCK)
    if len(starts) == 1:
        share(0)
    else:
        with ThreadPoolExecutor(min(threads(), len(starts))) as pool:
            for _ in pool.map(share, starts):
                pass
    return out


def _block(
    x: Array, y: Array, scratch: Array, form: Form, clamped: bool, table: Table | None, found: Fit | None
) -> None:
    signed, a, *spare = scratch
    np.add(x, F(form.shift), out=signed)
    positive = bool(signed.min() >= 0)  # most blocks are, and then the sign needs no work; false where there is NaN
    if positive:
        a = signed
    elif clamped:
        np.maximum(signed, F(0), out=a)
    else:
        np.abs(signed, out=a)
    if found is not None:
        _fitted(a, y, spare, form, found)
    elif table is None:
        BODIES[form.body](a, y, spare, form)
    else:
        _interpolate(a, y, spare, form, table)
    if form.floor > -math.inf:
        np.maximum(y, F(form.floor), out=y)
    if form.knee > 0:
        _toe(a, y, spare[0], form)
    if not (clamped or positive):
        np.copysign(y, signed, out=y)
    if form.offset:
        np.add(y, F(form.offset), out=y)


def _toe(a: Array, y: Array, spare: Array, form: Form) -> None:
    if form.toe == "linear":
        np.multiply(a, F(form.toe_scale), out=spare)
    else:
        (np.sqrt if form.toe == "root" else np.square)(a, out=spare)
        np.multiply(spare, F(form.toe_scale), out=spare)
    np.putmask(y, a < ceiling32(form.knee), spare)  # twice as fast as copyto where the mask is irregular


def ceiling32(value: float) -> np.float32:
    """The smallest float32 that is not below `value`, so that comparing float32 samples with either is the same."""
    rounded = F(value)
    return rounded if float(rounded) >= value else np.nextafter(rounded, F(np.inf))


def _power(a: Array, y: Array, spare: list[Array], form: Form) -> None:
    base = a
    if form.inner != 1 or form.lift:
        base = spare[0]
        np.multiply(a, F(form.inner), out=base)
        np.add(base, F(form.lift), out=base)
    _raise(base, y, form.exponent)
    if form.outer != 1:
        np.multiply(y, F(form.outer), out=y)
    if form.drop:
        np.add(y, F(form.drop), out=y)


def _raise(base: Array, y: Array, exponent: float) -> None:
    """base^exponent into y, another array. Whole factors are multiplied, so that rounding the exponent costs little."""
    whole = math.floor(exponent)
    if exponent > whole:
        np.power(base, F(exponent - whole), out=y)
    else:
        np.copyto(y, base)
        whole -= 1
    for _ in range(whole):
        np.multiply(y, base, out=y)


def _exponential(a: Array, y: Array, spare: list[Array], form: Form) -> None:
    np.subtract(a, F(0.5), out=y)
    np.multiply(y, F(form.exponent), out=y)
    np.subtract(y, F(4), out=y)  # the factor is small: without it the power would leave float32's range sooner
    np.exp(y, out=y)
    np.multiply(y, F(form.outer * math.exp(4)), out=y)
    np.add(y, F(form.drop), out=y)


def _logarithm(a: Array, y: Array, spare: list[Array], form: Form) -> None:
    np.multiply(a, F(form.inner), out=y)
    np.add(y, F(form.lift), out=y)
    np.log(y, out=y)
    np.multiply(y, F(form.outer), out=y)
    np.add(y, F(form.drop), out=y)


def _pq_decode(a: Array, y: Array, spare: list[Array], form: Form) -> None:
    w, below, *_ = spare
    np.minimum(a, F(pq_ceiling_signal()), out=w)
    np.log(w, out=w)
    np.multiply(w, F(1 / PQ_M2), out=w)
    np.expm1(w, out=w)
    np.multiply(w, F(-PQ_C3), out=below)
    np.add(below, F(PQ_Q), out=below)
    np.add(w, F(PQ_Q), out=w)
    np.maximum(w, F(0), out=w)
    np.divide(w, below, out=w)
    _raise(w, y, 1 / PQ_M1)
    np.multiply(y, F(form.outer), out=y)
    if not a.max() < np.inf:
        np.copyto(y, a, where=np.isposinf(a))


def _pq_encode(a: Array, y: Array, spare: list[Array], form: Form) -> None:
    p, s, z, *_ = spare
    np.power(a, F(PQ_M1), out=p)
    np.multiply(p, F(form.inner**PQ_M1), out=p)
    np.subtract(p, F(1), out=s)
    np.multiply(s, F(PQ_Q), out=s)
    np.multiply(p, F(2 * PQ_C3 + PQ_Q), out=p)
    np.add(p, F(2 - PQ_Q), out=p)
    np.divide(s, p, out=s)
    np.multiply(s, s, out=z)
    np.multiply(z, F(1 / 7), out=p)
    for coefficient in (1 / 5, 1 / 3):
        np.add(p, F(coefficient), out=p)
        np.multiply(p, z, out=p)
    np.multiply(p, s, out=p)
    np.add(s, p, out=s)
    np.multiply(s, F(2 * PQ_M2), out=s)
    np.exp(s, out=y)
    np.copyto(y, F(PQ_LIMIT), where=np.isposinf(a))


BODIES: dict[str, Callable[[Array, Array, list[Array], Form], None]] = {
    "power": _power,
    "exponential": _exponential,
    "logarithm": _logarithm,
    "pq_decode": _pq_decode,
    "pq_encode": _pq_encode,
}


def _fitted(a: Array, y: Array, spare: list[Array], form: Form, found: Fit) -> None:
    """What lies beyond the fit, and NaN, is computed."""
    y[...] = found(a)
    if not a.max() <= found.top:
        part, *rest = spare
        BODIES[form.body](a, part, [*rest, np.empty_like(a)], form)
        np.copyto(y, part, where=~(a <= F(found.top)))


def _interpolate(a: Array, y: Array, spare: list[Array], form: Form, table: Table) -> None:
    """Interpolates all of the block, then mends the samples below the first node and above the last."""
    part, rise, cell, _ = spare
    index: Array = cell.view(np.int32)
    np.subtract(a.view(np.int32), np.int32(table.first), out=index)
    np.bitwise_and(index, np.int32((1 << table.shift) - 1), out=part.view(np.int32))
    np.multiply(part.view(np.int32), F(2.0**-table.shift), out=part, dtype=np.float32, casting="same_kind")
    np.right_shift(index, np.int32(table.shift), out=index)
    index = index.astype(np.intp)  # take converts it otherwise, once per call
    values, rises = table.columns
    np.take(rises, index, out=rise, mode="clip")
    np.take(values, index, out=y, mode="clip")
    np.multiply(part, rise, out=part)
    np.add(y, part, out=y)
    first, last = np.array((table.first, table.last), dtype=np.int32).view(np.float32)
    if form.knee <= 0 and not a.min() >= first:  # beside a toe the table starts below the knee
        np.copyto(y, table.nodes[0, 0] + a * table.nodes[0, 1], where=a < first)
    if not a.max() <= last:
        BODIES[form.body](a, part, [rise, *spare[2:]], form)
        np.copyto(y, part, where=~(a <= last))
