"""What an expression may compute: each function for NumPy, for OpenCL, and for ranges with errors.

A `Known` says of a term's value that it lies in [low, high] by definition and that float32 makes it wrong by at most
`error`. `sure` is lost where that cannot be said: where a value near zero divides, where a root or a logarithm may meet
negative numbers by rounding alone. Functions of rounded values multiply the error by their slope and add their own
rounding (ULP as measured in numeric.clh); what jumps (comparisons, floor) may be off by the whole jump, unless what it
is applied to is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.operation import ROUNDING

U = ROUNDING * 1.01
FAR = float(np.finfo(np.float32).max)


@dataclass(frozen=True, slots=True)
class Known:
    """Range of a value, how far float32's may be from it, and whether that is sure."""

    low: float
    high: float
    error: float = 0.0
    sure: bool = True

    @property
    def size(self) -> float:
        return max(abs(self.low), abs(self.high))

    @property
    def bottom(self) -> float:
        return self.low - self.error

    @property
    def top(self) -> float:
        return self.high + self.error


def limited(low: float, high: float, error: float, sure: bool) -> Known:
    """With all that leaves float32's range, or is none, as unsure."""
    if math.isnan(low) or math.isnan(high) or max(abs(low), abs(high)) > FAR or not error <= FAR:
        return Known(max(low, -FAR) if low == low else -FAR, min(high, FAR) if high == high else FAR, FAR, False)
    return Known(low, high, error, sure)


def _sum(x: Known, y: Known) -> Known:
    low, high = x.low + y.low, x.high + y.high
    return limited(low, high, x.error + y.error + U * (max(abs(low), abs(high)) + x.error + y.error), x.sure and y.sure)


def _product(x: Known, y: Known) -> Known:
    ends = [p * q for p in (x.low, x.high) for q in (y.low, y.high)]
    error = x.size * y.error + y.size * x.error + x.error * y.error
    return limited(min(ends), max(ends), error + U * (max(map(abs, ends)) + error), x.sure and y.sure)


def _quotient(x: Known, y: Known) -> Known:
    if y.bottom <= 0 <= y.top:
        return Known(-FAR, FAR, FAR, False)
    least = min(abs(y.bottom), abs(y.top))
    ends = [p / q for p in (x.low, x.high) for q in (y.low, y.high)]
    size = max(map(abs, ends))
    error = (x.error + size * y.error) / least
    return limited(min(ends), max(ends), error + U * (size + error), x.sure and y.sure)


def _negated(x: Known) -> Known:
    return Known(-x.high, -x.low, x.error, x.sure)


def _compared(*given: Known) -> Known:
    """0 or 1; exactly so where what is compared is exact."""
    exact = all(each.error == 0 for each in given)
    return Known(0, 1, 0.0 if exact else 1.0, all(each.sure for each in given))


def _selected(c: Known, x: Known, y: Known) -> Known:
    low, high = min(x.low, y.low), max(x.high, y.high)
    error = max(x.error, y.error) if c.error == 0 else high - low + max(x.error, y.error)
    return Known(low, high, error, c.sure and x.sure and y.sure)


def _least(x: Known, y: Known) -> Known:
    return Known(min(x.low, y.low), min(x.high, y.high), max(x.error, y.error), x.sure and y.sure)


def _most(x: Known, y: Known) -> Known:
    return Known(max(x.low, y.low), max(x.high, y.high), max(x.error, y.error), x.sure and y.sure)


def _absolute(x: Known) -> Known:
    low = 0.0 if x.low <= 0 <= x.high else min(abs(x.low), abs(x.high))
    return Known(low, x.size, x.error, x.sure)


def _stepped(rule: Callable[[float], float]) -> Callable[[Known], Known]:
    def step(x: Known) -> Known:
        return limited(rule(x.low), rule(x.high), 0.0 if x.error == 0 else 1 + x.error, x.sure)

    return step


def _root(x: Known) -> Known:
    if x.bottom < 0:
        return Known(
            0, math.sqrt(max(x.high, 0)), FAR if x.error else U * math.sqrt(max(x.high, 0)), x.error == 0 and x.sure
        )
    error = min(math.sqrt(x.error), x.error / (math.sqrt(x.bottom) or 1e-300) if x.error else 0.0)
    return limited(math.sqrt(x.low), math.sqrt(x.high), error + U * (math.sqrt(x.high) + error), x.sure)


def _safe(function: Callable[[float], float], value: float) -> float:
    try:
        return function(value)
    except OverflowError:
        return math.inf


def _exponential(base: float) -> Callable[[Known], Known]:
    def grown(x: Known) -> Known:
        low, high, top = (_safe(lambda v: base**v, v) for v in (x.low, x.high, x.top))
        return limited(low, high, top * _safe(math.expm1, x.error * math.log(base)) + 3 * U * top, x.sure)

    return grown


def _logarithm(base: float) -> Callable[[Known], Known]:
    def found(x: Known) -> Known:
        if x.bottom <= 0:
            return Known(-FAR, FAR, FAR, False)
        low, high = math.log(x.low) / math.log(base), math.log(x.high) / math.log(base)
        size = max(abs(low), abs(high))
        return limited(low, high, x.error / x.bottom / math.log(base) * 1.01 + 3 * U * size, x.sure)

    return found


def _power(x: Known, y: Known) -> Known:
    """exp(y ln x): its relative error is y dx / x + |ln x| dy, and the power's own."""
    if x.bottom <= 0:
        exact = x.error == 0 == y.error and x.low >= 0 and y.low > 0
        top = _safe(lambda v: max(x.high, 0.0) ** v, max(y.high, 0)) + 1 if exact else FAR
        return limited(0, top, 4 * U * top, True) if exact else Known(-FAR, FAR, FAR, False)
    logs = [math.log(x.low), math.log(x.high)]
    ends = [_safe(math.exp, l * e) for l in logs for e in (y.low, y.high)]  # noqa: E741
    relative = _safe(math.expm1, y.size * x.error / x.bottom + max(map(abs, logs)) * y.error + 1e-7 * y.error)
    return limited(min(ends), max(ends), max(ends) * (relative + 4 * U * (1 + relative)), x.sure and y.sure)


def _wave(x: Known) -> Known:
    return Known(-1, 1, min(x.error + 3 * U, 2.0), x.sure and x.size < FAR)


def _angle(y: Known, x: Known) -> Known:
    return Known(-math.pi, math.pi, 8 * U if x.error == 0 == y.error else 2 * math.pi, x.sure and y.sure)


def _arc(x: Known) -> Known:
    return Known(-math.pi / 2, math.pi / 2, x.error + 4 * U, x.sure)


@dataclass(frozen=True, slots=True)
class Function:
    """One function on both backends and on ranges; `opencl` is text with {0}, {1}, ... for what it is applied to."""

    arguments: int
    numpy: Callable[..., Any]
    opencl: str
    known: Callable[..., Known]
    called: bool = True


def _truthful(function: Callable[..., Any]) -> Callable[..., Any]:
    """A condition as 1 or 0 of the type that it was asked of."""
    return lambda *given: function(*given).astype(np.result_type(*given))


def _raised(x: Any, y: Any) -> Any:
    """x^y for x >= 0; NaN below it, and where either is NaN."""
    return np.where((x >= 0) & (y == y), np.power(np.maximum(x, 0), y), x.dtype.type(math.nan))


FUNCTIONS: Mapping[str, Function] = {
    "add": Function(2, np.add, "({0} + {1})", _sum, called=False),
    "subtract": Function(2, np.subtract, "({0} - {1})", lambda x, y: _sum(x, _negated(y)), called=False),
    "multiply": Function(2, np.multiply, "({0} * {1})", _product, called=False),
    "divide": Function(2, np.divide, "({0} / {1})", _quotient, called=False),
    "negate": Function(1, np.negative, "(-{0})", _negated, called=False),
    "less": Function(2, _truthful(np.less), "({0} < {1} ? ONE : ZERO)", _compared, called=False),
    "at_most": Function(2, _truthful(np.less_equal), "({0} <= {1} ? ONE : ZERO)", _compared, called=False),
    "greater": Function(2, _truthful(np.greater), "({0} > {1} ? ONE : ZERO)", _compared, called=False),
    "at_least": Function(2, _truthful(np.greater_equal), "({0} >= {1} ? ONE : ZERO)", _compared, called=False),
    "equal": Function(2, _truthful(np.equal), "({0} == {1} ? ONE : ZERO)", _compared, called=False),
    "unequal": Function(2, _truthful(np.not_equal), "({0} != {1} ? ONE : ZERO)", _compared, called=False),
    "and": Function(
        2, _truthful(np.logical_and), "(({0} != ZERO) & ({1} != ZERO) ? ONE : ZERO)", _compared, called=False
    ),
    "or": Function(
        2, _truthful(np.logical_or), "(({0} != ZERO) | ({1} != ZERO) ? ONE : ZERO)", _compared, called=False
    ),
    "not": Function(1, _truthful(np.logical_not), "({0} == ZERO ? ONE : ZERO)", _compared, called=False),
    "select": Function(3, lambda c, x, y: np.where(c != 0, x, y), "({0} != ZERO ? {1} : {2})", _selected),
    "min": Function(2, np.minimum, "num_min({0}, {1})", _least),
    "max": Function(2, np.maximum, "num_max({0}, {1})", _most),
    "clamp": Function(
        3, lambda x, low, high: np.minimum(np.maximum(x, low), high), "num_min(num_max({0}, {1}), {2})",
        lambda x, low, high: _least(_most(x, low), high),
    ),
    "abs": Function(1, np.abs, "fabs({0})", _absolute),
    "sign": Function(
        1, np.sign, "({0} > ZERO ? ONE : ({0} < ZERO ? -ONE : {0}))",
        lambda x: Known(-1, 1, 0.0 if x.error == 0 else 2.0, x.sure),
    ),
    "floor": Function(1, np.floor, "floor({0})", _stepped(math.floor)),
    "ceil": Function(1, np.ceil, "ceil({0})", _stepped(math.ceil)),
    "round": Function(1, np.rint, "rint({0})", _stepped(round)),
    "sqrt": Function(1, np.sqrt, "sqrt({0})", _root),
    "exp": Function(1, np.exp, "num_exp({0})", _exponential(math.e)),
    "exp2": Function(1, np.exp2, "num_exp2({0})", _exponential(2.0)),
    "log": Function(1, np.log, "num_log({0})", _logarithm(math.e)),
    "log2": Function(1, np.log2, "num_log2({0})", _logarithm(2.0)),
    "pow": Function(2, _raised, "num_pow({0}, {1})", _power),
    "sin": Function(1, np.sin, "num_sin({0})", _wave),
    "cos": Function(1, np.cos, "num_cos({0})", _wave),
    "atan2": Function(2, np.arctan2, "num_atan2({0}, {1})", _angle),
    "atan": Function(1, np.arctan, "num_atan2({0}, ONE)", _arc),
}  # fmt: skip
"""By name; those that are not `called` are what operators become."""
