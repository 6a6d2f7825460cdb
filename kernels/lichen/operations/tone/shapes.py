"""What `transfer` computes for its parameters: one of three shapes behind one face.

* `Whole`: a curve with a form of its own (curves.py), which transfer.cl and evaluate.py compute.
* `Pieced`: a curve of several pieces (piecewise.py), which piecewise.cl computes.
* `Powers`: a pure power of another exponent for each channel.

A shape tells the range of its results, how far a change carries, the error that float32 makes, and computes both ways.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lichen.image import Alpha, Image
from lichen.memory import Array, aligned
from lichen.operation import ROUNDING
from lichen.operations.tone.bodies import JND_OF_LUMINANCE, LUMINANCE_OF_JND, ROOTLOG, polynomial, solved
from lichen.operations.tone.curves import FLOAT_MAX, Form
from lichen.operations.tone.evaluate import ceiling32, evaluate
from lichen.operations.tone.piecewise import Piece, Piecewise, computed_error
from lichen.operations.tone.pointwise import blockwise, launch_flat
from lichen.operations.tone.transfer_launch import launch

if TYPE_CHECKING:
    from lichen.opencl.device import Device

F = np.float32


class Shape(Protocol):
    """A curve as computed, with what becomes of negative light."""

    @property
    def cost(self) -> float:
        """In powers, for each sample."""

    @property
    def limits(self) -> list[float]:
        """Finite results of infinite samples."""

    def span(self, low: float, high: float) -> tuple[float, float]:
        """The results' range, for samples in [low, high]."""

    def modulus(self, low: float, high: float, change: float) -> float:
        """The largest change of the result for a change of a sample in [low, high]."""

    def error(self, low: float, high: float) -> float:
        """The largest error of float32 for samples in [low, high]."""

    def opencl(self, device: Device, image: Image) -> Array: ...

    def numpy(self, image: Image) -> Array: ...


# ------------------------------------------------------------------------------------------------------------ whole

POWERS = {"power": 1.0, "exponential": 0.7, "logarithm": 0.7, "pq_encode": 2.0, "pq_decode": 2.2}
"""What a sample of each body costs, in powers."""
PQ_FOOT = 1.2e-10
"""How far the signal of light below 2^-126 lies from PQ's (pq.clh)."""
ROUNDINGS = 3.0
"""Roundings of the worst sample: of the result itself, and of the argument, which the curve's steepness amplifies."""


@dataclass(frozen=True)
class Whole:
    """A form; `clamped` where negative light is none."""

    form: Form
    clamped: bool

    @property
    def cost(self) -> float:
        return POWERS[self.form.body]

    @property
    def limits(self) -> list[float]:
        limit = float(self.form.magnitude(math.inf))
        made = [limit, -limit] if math.isfinite(limit) else []
        return [*made, self.form.offset] if self.clamped else made

    def seen(self, low: float, high: float) -> tuple[float, float]:
        """The samples' range as the curve sees it."""
        if self.clamped:
            return max(low, -self.form.shift), max(high, -self.form.shift)
        return low, high

    def span(self, low: float, high: float) -> tuple[float, float]:
        low, high = (self.form.value(x) for x in self.seen(low, high))
        return low - self.form.jump, high + self.form.jump

    def modulus(self, low: float, high: float, change: float) -> float:
        return self.form.modulus(*self.seen(low, high), change)

    def error(self, low: float, high: float) -> float:
        """Rounding x steepness x size of the result at the far end of the range, where the product is largest.

        NumPy also rounds a power's exponent, by half a rounding at most, which the logarithm of the base amplifies.
        """
        form = self.form
        far = min(max(abs(x + form.shift) for x in self.seen(low, high)), form.reach)
        size = min(float(form.magnitude(far)), FLOAT_MAX)
        roundings = ROUNDINGS * (1 + form.steepness(max(far, form.knee)))
        if form.body == "power" and far > 0:
            roundings += 0.5 * abs(math.log(far))
        denormal = PQ_FOOT if form.body == "pq_encode" else 0.0
        return roundings * ROUNDING * max(size, abs(form.drop)) + 2 * ROUNDING * abs(form.offset) + denormal

    def opencl(self, device: Device, image: Image) -> Array:
        return launch(device, image, self.form, self.clamped, "exact")

    def numpy(self, image: Image) -> Array:
        out = evaluate(image.pixels, self.form, clamped=self.clamped)
        if image.alpha is not Alpha.NONE:
            out[..., -1] = image.pixels[..., -1]
        return out


# ----------------------------------------------------------------------------------------------------------- pieces


def _split(value: float) -> tuple[float, float]:
    high = float(F(value))
    return high, value - high


@dataclass(frozen=True)
class Numbers:
    """A piece as float32 computes it: outer K(inner ((a + high) + low)) + drop. Logarithms and exponentials are of
    base e for NumPy; `binary` makes them of base 2."""

    high: float
    low: float
    inner: float
    outer: float
    drop: float
    exponent: float

    @classmethod
    def of(cls, piece: Piece) -> Numbers:
        inner, outer, drop, lift = piece.inner, piece.outer, piece.drop, piece.lift / piece.inner
        if piece.body == "line":
            inner, outer = inner * outer, 1.0
            lift, drop = lift + drop / inner, 0.0
        if piece.body == "exp":
            # The factor in front is brought to [1, 2): the exponent takes the rest.
            moved = math.floor(math.log2(abs(outer)))
            lift, outer = lift + moved * math.log(2) / inner, outer / 2.0**moved
        return cls(*_split(lift), inner, outer, drop, piece.exponent)

    def binary(self, body: str) -> tuple[float, ...]:
        inner = self.inner / math.log(2) if body == "exp" else self.inner
        outer = self.outer * math.log(2) if body == "log" else self.outer
        return (self.high, self.low, inner, outer, self.drop, self.exponent)

    def argument(self, a: Array) -> Array:
        made: Array = ((a + F(self.high)) + F(self.low)) * F(self.inner)
        return made


def _body32(body: str, t: Array, exponent: float) -> Array:
    """K in float32; GSDF's polynomials in float64."""
    match body:
        case "line":
            made: Array = t
        case "log":
            made = np.log(np.maximum(t, F(0)))
        case "exp":
            made = np.exp(t)
        case "power":
            made = np.power(np.maximum(t, F(0)), F(exponent))
        case "gsdf_signal":
            made = polynomial(JND_OF_LUMINANCE, np.log10(t).astype(np.float64)).astype(F)
        case "gsdf_light":
            j = np.log(t).astype(np.float64)
            made = np.exp2((polynomial(LUMINANCE_OF_JND[0], j) / polynomial(LUMINANCE_OF_JND[1], j)
                            * math.log2(10)).astype(F))  # fmt: skip
        case "rootlog":
            made = np.sqrt(t) + F(ROOTLOG) * np.log(t)
        case _:
            made = np.exp(F(2) * solved(t, 6))
    return made


@dataclass(frozen=True)
class Pieced:
    """Several pieces."""

    curve: Piecewise

    @property
    def cost(self) -> float:
        return 0.3 + self.curve.cost

    @property
    def limits(self) -> list[float]:
        return self.curve.limits

    def span(self, low: float, high: float) -> tuple[float, float]:
        return self.curve.span(low, high)

    def modulus(self, low: float, high: float, change: float) -> float:
        return self.curve.modulus(low, high, change)

    def error(self, low: float, high: float) -> float:
        return computed_error(self.curve, low, high)

    def opencl(self, device: Device, image: Image) -> Array:
        curve = self.curve
        numbers, calls = written(curve, 0)
        constants = aligned(np.array(numbers, F))
        return launch_flat(device, "tone/piecewise.cl", "curve", image, constants, defines=definitions(curve, calls))

    def numpy(self, image: Image) -> Array:
        return blockwise(image, self._block)

    def _block(self, x: Array) -> Array:
        return computed(self.curve, x)


def written(curve: Piecewise, at: int) -> tuple[list[float], str]:
    """The numbers that a kernel reads from place `at` on, the centre's first, and its pieces as calls."""
    centre = curve.centre or (0.0, 0.0)
    numbers: list[float] = [*_split(-centre[0]), centre[1]]
    calls: list[str] = []
    for piece in curve.pieces:
        here = at + len(numbers)
        own = Numbers.of(piece) if piece.body != "constant" else Numbers(0, 0, 0, 0, piece.drop, 1)
        numbers += [*own.binary(piece.body), float(ceiling32(min(max(piece.start, -FLOAT_MAX), FLOAT_MAX)))]
        plain = {"line": f"LINE({here})", "constant": f"CONSTANT({here})"}
        call = plain.get(piece.body, f"PIECE({piece.body}, {here})")
        calls.append(f"FROM({here}, {call})" if calls else f"y = {call};")
    return numbers, " ".join(calls)


def definitions(curve: Piecewise, calls: str) -> dict[str, int | float | str]:
    """What piecewise.cl is built with for a curve whose pieces are `calls`."""
    held = {"": 0, "input": 1, "result": 2}[curve.held]
    return {"PIECES": calls, "MIRRORED": int(curve.centre is not None), "HELD": held}


def computed(curve: Piecewise, x: Array) -> Array:
    """The curve in float32 NumPy."""
    away, a = distance(curve, x)
    return finished(curve, away, pieces32(curve.pieces, a))


def distance(curve: Piecewise, x: Array) -> tuple[Array, Array]:
    """From the centre, with its sign and without; of a curve without a centre x itself, twice."""
    given = np.where(x < 0, F(0), x) if curve.held == "input" else x
    high, low = _split(-curve.centre[0]) if curve.centre else (0.0, 0.0)
    away: Array = (given + F(high)) + F(low) if high else given
    return away, np.abs(away) if curve.centre else away


def pieces32(pieces: Sequence[Piece], a: Array) -> Array:
    """What the pieces make of `a`."""
    y = _piece32(pieces[0], a)
    for piece in pieces[1:]:
        np.copyto(y, _piece32(piece, a), where=a >= ceiling32(piece.start))
    return y


def finished(curve: Piecewise, away: Array, y: Array) -> Array:
    """Mirrored about the centre, and held."""
    if curve.centre:
        y = np.where(np.signbit(away), -y, y) + F(curve.centre[1])
    return np.where(y < 0, F(0), y) if curve.held == "result" else y


def _piece32(piece: Piece, a: Array) -> Array:
    if piece.body == "constant":
        return np.where(np.isnan(a), a, F(piece.drop)).astype(F)
    own = Numbers.of(piece)
    y = _body32(piece.body, own.argument(a), own.exponent)
    if own.outer != 1:
        y = y * F(own.outer)
    made: Array = y + F(own.drop) if own.drop else y.copy() if y is a else y
    return made


# ----------------------------------------------------------------------------------------------------------- powers


@dataclass(frozen=True)
class Powers:
    """|x|^e with the sign of x, e for each colour channel in turn."""

    exponents: tuple[float, ...]
    clamped: bool

    cost = 2.0

    @property
    def limits(self) -> list[float]:
        return [0.0] if self.clamped else []

    def _each(self) -> Sequence[Whole]:
        return [Whole(Form("power", exponent=e, convex=e >= 1), self.clamped) for e in self.exponents]

    def span(self, low: float, high: float) -> tuple[float, float]:
        spans = [each.span(low, high) for each in self._each()]
        return min(low for low, _ in spans), max(high for _, high in spans)

    def modulus(self, low: float, high: float, change: float) -> float:
        return max(each.modulus(low, high, change) for each in self._each())

    def error(self, low: float, high: float) -> float:
        """As of one power, and of the whole exponent's rounding: e |ln a| a^e, which below 1 is at most 1/e."""
        far = max(abs(low), abs(high))
        worst = 0.0
        for each in self._each():
            size = min(float(each.form.magnitude(far)), FLOAT_MAX)
            swing = max(size * abs(math.log(far)) * each.form.exponent if far > 0 else 0.0, 1 / math.e)
            worst = max(worst, each.error(low, high) + 0.5 * ROUNDING * min(swing, FLOAT_MAX))
        return worst

    def opencl(self, device: Device, image: Image) -> Array:
        own = np.ones(image.channels, F)
        own[: image.colours] = self.exponents
        runs = aligned(np.take(own, np.arange(image.channels + 16) % image.channels))
        defines: dict[str, int | float | str] = {
            "PIECES": "y = a;", "MIRRORED": 0, "HELD": int(self.clamped), "CHANNELS": image.channels,
        }  # fmt: skip
        return launch_flat(device, "tone/piecewise.cl", "powers", image, runs, defines=defines)

    def numpy(self, image: Image) -> Array:
        exponents = np.array(self.exponents, F)

        def body(x: Array) -> Array:
            y: Array = np.power(np.abs(x), exponents)
            return np.where(x < 0, F(0), y) if self.clamped else np.copysign(y, x)

        return blockwise(image, body)
