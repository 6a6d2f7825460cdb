"""Transfer functions: signal to linear light and back.

Truth: the curve as its standard prints it, in float64, for every colour channel; coverage passes untouched.

* srgb: IEC 61966-2-1, toe up to and including 0.04045 (light 0.0031308).
* gamma: light = signal^gamma.
* bt709: ITU-R BT.709-6, the camera curve. The standard prints one direction and its rounded constants leave a gap of
  2.5e-4 in the signal; decoding takes the gap to its knee, 0.018.
* bt1886: ITU-R BT.1886 Annex 1, the reference display, divided by `white`, so that signal 1 is light 1.
* pq: SMPTE ST 2084, the reference display, 10000 cd/m2 at signal 1, divided by `white`.
* hlg: ITU-R BT.2100, the camera curve per channel, light 1 at signal 1. The display's system gamma is no part of it.

Outside the standards' domains. Above 1 every curve is continued by its own formula. PQ has a pole at signal 1.992:
decoding saturates at 1e10 cd/m2 (signal 1.840), and encoding tends to 1.992. Signals below PQ's black, 7.3e-7, decode
to 0. Negative values are mirrored (f(-x) = -f(x); BT.1886 about its own zero, which lies below signal 0 where black is
not 0) or clamped to no light. NaN stays; infinity stays but in PQ's encoding, which has a limit; light beyond float32's
range becomes infinite.

Methods: `exact` evaluates the curve; `table` interpolates linearly in 256 to 65536 cells and evaluates what lies above
the table's top.
"""

from __future__ import annotations

import math
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image, Space
from lichen.memory import Array
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.tone import curves
from lichen.operations.tone.curves import FLOAT_MAX, Curve, Direction, Form
from lichen.operations.tone.evaluate import evaluate
from lichen.operations.tone.tables import Table, tabulate
from lichen.operations.tone.transfer_cases import CASES
from lichen.operations.tone.transfer_launch import constants, definitions, launch
from lichen.stage import Stage

if TYPE_CHECKING:
    from lichen.opencl.device import Device

Luminance = Annotated[float, Field(json_schema_extra={"unit": "cd/m2"})]

KNOWN = 1024
"""Answers that predictions keep: a planner asks for the same many times over."""
WHITE = {Curve.PQ: 203.0, Curve.BT1886: 100.0}
"""cd/m2 of linear 1 where the caller names none: graphics white of ITU-R BT.2408, the reference display of BT.2035"""


class Negative(StrEnum):
    """What becomes of negative values."""

    MIRROR = "mirror"
    CLAMP = "clamp"


class Parameters(OperationParameters):
    curve: Curve = Curve.SRGB
    """the transfer function"""
    direction: Direction = Direction.DECODE
    """decode: signal to linear light; encode: linear light to signal"""
    gamma: float = Field(2.2, ge=0.1, le=10)
    """decoding exponent, for curve=gamma; encoding takes its reciprocal"""
    white: Luminance | None = Field(None, ge=1, le=10000)
    """luminance that linear 1 stands for, for curve=pq (203 unless given) and curve=bt1886 (100 unless given)"""
    black: Luminance = Field(0, ge=0, le=1000)
    """luminance of the display's black, for curve=bt1886; below white"""
    negative: Negative = Negative.MIRROR
    """negative values: mirror keeps them by odd extension, clamp makes them no light"""

    @property
    def nominal_white(self) -> float:
        return WHITE.get(self.curve, 1.0) if self.white is None else self.white

    @property
    def clamped(self) -> bool:
        return self.negative is Negative.CLAMP


@lru_cache(maxsize=64)
def form(p: Parameters) -> Form:
    """The parameters' curve as computed."""
    return curves.form(p.curve, p.direction, gamma=p.gamma, white=p.nominal_white, black=p.black)


# ------------------------------------------------------------------------------------------------------ declaration


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    """Parameters that belong to another curve are refused: they would silently do nothing."""
    flaws = []
    if p.gamma != 2.2 and p.curve is not Curve.GAMMA:
        flaws.append(Flaw("/parameters/gamma", f"applies to curve=gamma only (curve={p.curve})"))
    if p.white is not None and p.curve not in WHITE:
        flaws.append(Flaw("/parameters/white", f"applies to curve=pq and curve=bt1886 only (curve={p.curve})"))
    if p.black and p.curve is not Curve.BT1886:
        flaws.append(Flaw("/parameters/black", f"applies to curve=bt1886 only (curve={p.curve})"))
    elif p.black and p.black >= p.nominal_white / 2:
        flaws.append(
            Flaw("/parameters/black", f"must be below half of white (got {p.black:g} and {p.nominal_white:g})")
        )
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    extent = facts["image"].extent
    if p.curve is not Curve.GAMMA or p.gamma != 1:
        return None
    if p.clamped and (extent.low < 0 or extent.nonfinite):
        return None
    return "gamma is 1"


def _bounds(p: Parameters, facts: Facts) -> tuple[float, float]:
    """The input's range as the curve sees it."""
    shape = form(p)
    low, high = facts.extent.low, facts.extent.high
    if p.clamped:
        low, high = max(low, -shape.shift), max(high, -shape.shift)
    return low, high


def _result(p: Parameters, facts: InputFacts) -> Facts:
    return facts["image"] if _identity(p, facts) else _converted(p, facts["image"])


@lru_cache(maxsize=KNOWN)
def _converted(p: Parameters, image: Facts) -> Facts:
    shape = form(p)
    low, high = (shape.value(x) for x in _bounds(p, image))
    slack = shape.jump + _exact_error(p, image).value
    low, high = low - slack, high + slack
    if image.extent.nonfinite and math.isfinite(limit := float(shape.magnitude(math.inf))):
        low, high = min(low, -limit - slack), max(high, limit + slack)
    if image.extent.nonfinite and p.clamped:
        low = min(low, shape.offset)
    if image.alpha is not Alpha.NONE:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    overflow = max(abs(low), abs(high)) > FLOAT_MAX
    nonfinite = image.samples if overflow else image.extent.nonfinite
    extent = Extent(max(low, -FLOAT_MAX), min(high, FLOAT_MAX), nonfinite)
    return Facts(image.height, image.width, image.channels, _space(p, image.space), image.alpha, extent)


def _space(p: Parameters, space: Space) -> Space:
    """Only sRGB joins the two spaces; after any other curve the numbers are a signal, or light, of their own kind."""
    if p.curve is Curve.SRGB and p.direction is Direction.DECODE and space is Space.SRGB:
        return Space.LINEAR
    if p.curve is Curve.SRGB and p.direction is Direction.ENCODE and space is Space.LINEAR:
        return Space.SRGB
    return Space.DATA


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    return _carried(p, facts["image"], error)


@lru_cache(maxsize=KNOWN)
def _carried(p: Parameters, image: Facts, error: float) -> float:
    if image.alpha is Alpha.NONE:
        return form(p).modulus(*_bounds(p, image), error)
    # Colour counts multiplied by its coverage a. With |c'a' - ca| and |a' - a| at most e, (c' - c) a' is at most
    # (1 + |c|) e, and f(c')a' - f(c)a = (f(c') - f(c)) a' + f(c) (a' - a).
    colour, result = image.extent.magnitude, _converted(p, image).extent.magnitude
    return max(form(p).modulus(*_bounds(p, image), (1 + colour) * error) + result * error, error)


def _inverse(p: Parameters) -> Parameters | None:
    """The other direction, where no two values have the same result: not clamped, not decoding into a plateau."""
    if p.clamped or (p.direction is Direction.DECODE and p.curve in (Curve.PQ, Curve.BT709)):
        return None
    other = Direction.ENCODE if p.direction is Direction.DECODE else Direction.DECODE
    return p.model_copy(update={"direction": other})


transfer = Operation(
    name="transfer",
    family="tone",
    summary="Decodes a signal to linear light, or encodes light to a signal, by a standard transfer function.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=_propagate,
    inverse=_inverse,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        *({"curve": str(curve), "direction": str(way)} for curve in Curve for way in Direction),
        *({"curve": "bt1886", "direction": str(way), "black": 0.05} for way in Direction),
        {"curve": "gamma", "gamma": 0.8, "negative": "clamp"},
        {"curve": "pq", "direction": "encode", "white": 100, "negative": "clamp"},
    ),
    hard_cases=CASES,
)

# ------------------------------------------------------------------------------------------------------------ truth


@transfer.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The standards' formulas with the symbols they use."""
    image = inputs["image"]
    x = image.pixels[..., : image.colours]
    result = image.pixels.copy()
    with np.errstate(all="ignore"):
        if p.curve is Curve.BT1886:
            result[..., : image.colours] = _bt1886(x, p)
        else:
            y = STANDARDS[p.curve](np.maximum(x, 0) if p.clamped else np.abs(x), p, p.direction is Direction.DECODE)
            result[..., : image.colours] = np.where(x < 0, -y, y) if not p.clamped else y
    return result


def _srgb(x: Array, p: Parameters, decode: bool) -> Array:
    if decode:
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def _gamma(x: Array, p: Parameters, decode: bool) -> Array:
    return np.power(x, p.gamma if decode else 1 / p.gamma)


def _bt709(x: Array, p: Parameters, decode: bool) -> Array:
    if decode:
        return np.where(x <= 0.081, x / 4.5, np.maximum(((x + 0.099) / 1.099) ** (1 / 0.45), 0.018))
    return np.where(x < 0.018, 4.5 * x, 1.099 * x**0.45 - 0.099)


def _pq(x: Array, p: Parameters, decode: bool) -> Array:
    m1, m2 = 2610 / 16384, 2523 / 4096 * 128
    c1, c2, c3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
    if decode:
        root = x ** (1 / m2)
        pole = c2 - c3 * root
        y = np.where(pole <= 0, np.inf, (np.maximum(root - c1, 0) / pole) ** (1 / m1))
        light: Array = np.where(np.isinf(x), x, np.minimum(10000 * y, 1e10) / p.nominal_white)
        return light
    power = (x * p.nominal_white / 10000) ** m1
    return np.power(np.where(np.isinf(x), c2 / c3, (c1 + c2 * power) / (1 + c3 * power)), m2)


def _hlg(x: Array, p: Parameters, decode: bool) -> Array:
    a = 0.17883277
    b, c = 1 - 4 * a, 0.5 - a * math.log(4 * a)
    if decode:
        return np.where(x <= 1 / 2, x**2 / 3, (np.exp((x - c) / a) + b) / 12)
    return np.where(x <= 1 / 12, np.sqrt(3 * x), a * np.log(12 * x - b) + c)


STANDARDS = {Curve.SRGB: _srgb, Curve.GAMMA: _gamma, Curve.BT709: _bt709, Curve.PQ: _pq, Curve.HLG: _hlg}
"""For x >= 0; the sign is put back by `truth`."""


def _bt1886(x: Array, p: Parameters) -> Array:
    """L = a max(V + b, 0)^2.4, whose power is continued oddly where negative values are mirrored."""
    gamma, white, black = 2.4, p.nominal_white, p.black
    span = white ** (1 / gamma) - black ** (1 / gamma)
    a, b = span**gamma, black ** (1 / gamma) / span
    decode = p.direction is Direction.DECODE
    base = x + b if decode else x * white / a
    if p.clamped:
        base = np.maximum(base, 0)
    power = np.sign(base) * np.power(np.abs(base), gamma if decode else 1 / gamma)
    result: Array = power * a / white if decode else power - b
    return result


# ---------------------------------------------------------------------------------------------------------- methods


def _numpy(image: Image, p: Parameters, table: Table | None) -> Array:
    out = evaluate(image.pixels, form(p), clamped=p.clamped, table=table)
    if image.alpha is not Alpha.NONE:
        out[..., -1] = image.pixels[..., -1]
    return out


POWERS = {"power": 1.0, "exponential": 0.7, "logarithm": 0.7, "pq_encode": 2.0, "pq_decode": 2.2}
"""What a sample of each body costs, in powers."""


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Powers; coverage is computed like colour and dropped."""
    return POWERS[form(p).body] * facts["image"].samples


ROUNDINGS = 3.0
"""Roundings of the worst sample: of the result itself, and of the argument, which the curve's steepness amplifies."""


@lru_cache(maxsize=KNOWN)
def _exact_error(p: Parameters, facts: Facts) -> Error:
    """Rounding x steepness x size of the result at the far end of the range, where the product is largest.

    NumPy also rounds a power's exponent, by half a rounding at most, which the logarithm of the base amplifies.
    """
    shape = form(p)
    far = min(max(abs(x + shape.shift) for x in _bounds(p, facts)), shape.reach)
    size = min(float(shape.magnitude(far)), FLOAT_MAX)
    roundings = ROUNDINGS * (1 + shape.steepness(max(far, shape.knee)))
    if shape.body == "power" and far > 0:
        roundings += 0.5 * abs(math.log(far))
    value = roundings * ROUNDING * max(size, abs(shape.drop)) + 2 * ROUNDING * abs(shape.offset)
    return Error(value, "estimate", rounding=value)


@transfer.method(
    "exact",
    error=lambda p, knob, facts: _exact_error(p, facts["image"]),
    work=_work,
    rates={"opencl": Rate(3e-4, 4.5e-10), "numpy": Rate(1e-4, 3.6e-9)},
    stage=lambda p, facts: Stage(
        "tone/transfer_stage.clh", definitions(form(p), p.clamped), tuple(map(float, constants(form(p))))
    ),
)
class Exact:
    """The curve itself in float32, written so that nothing cancels; the error is a few roundings times the
    curve's steepness."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return launch(device, inputs["image"], form(parameters), parameters.clamped, "exact")

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return _numpy(inputs["image"], parameters, None)


def _table_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The table's proved bound, unless the picture reaches beyond the table."""
    shape = form(p)
    table = tabulate(shape, round(knob))
    rounding = table.rounding + 2 * ROUNDING * abs(shape.offset)
    bound = table.bound + rounding
    far = max(abs(x + shape.shift) for x in _bounds(p, facts["image"]))
    if far <= shape.top and not facts["image"].extent.nonfinite:
        return Error(bound, "bound", rounding)
    beyond = _exact_error(p, facts["image"])
    return Error(max(bound, beyond.value), beyond.kind, max(rounding, beyond.rounding))


@transfer.method(
    "table",
    error=_table_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(3e-4, 8.5e-10), "numpy": Rate(8e-5, 5e-9)},
    knob=Knob("size", (256, 1024, 4096, 16384, 65536), "cells of the table at most", 256, 65536),
)
class Interpolated:
    """Linear interpolation in a table whose cells shrink with the sample; proved up to the table's top, computed
    above it."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        table = tabulate(form(parameters), round(knob))
        bits = (np.int32(table.first), np.int32(table.last), np.int32(table.shift))
        return launch(device, inputs["image"], form(parameters), parameters.clamped, "table", table.nodes, *bits)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return _numpy(inputs["image"], parameters, tabulate(form(parameters), round(knob)))
