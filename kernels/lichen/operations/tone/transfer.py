"""Transfer functions: signal to linear light and back.

Truth: the curve as its standard prints it, in float64, for every colour channel; coverage passes untouched.

* srgb: IEC 61966-2-1, toe up to and including 0.04045 (light 0.0031308).
* gamma: light = signal^gamma, with one exponent or one for each colour channel.
* bt709: ITU-R BT.709-6, the camera curve, which BT.601 prints too. The standard prints one direction and its rounded
  constants leave a gap of 2.5e-4 in the signal; decoding takes the gap to its knee, 0.018.
* bt1886: ITU-R BT.1886 Annex 1, the reference display, divided by `white`, so that signal 1 is light 1.
* pq: SMPTE ST 2084, the reference display, 10000 cd/m2 at signal 1, divided by `white`.
* hlg: ITU-R BT.2100, the camera curve per channel, light 1 at signal 1. The display's system gamma is no part of it.
* st428: SMPTE ST 428-1, digital cinema, and dicom_gsdf: NEMA PS3.14, grey displays (signal 1 is JND index 1023): light
  in units of `white`.
* All others, television, film scans and the logarithms of cameras, as definitions.py prints them. Cameras' curves give
  0.18 for mid grey and signals as code values over the largest; arri_logc3 is that of `exposure_index`, SUP 3.x.

ACESproxy is no curve: it is ACEScc cut into integers, which quantise does. Of FiLMiC Pro 6, whose publisher prints no
inverse, decoding solves the equation.

Outside the standards' domains. Above 1 every curve is continued by its own formula (the standards hold decoded ACEScc
to 65504, and DICOM's to its ends). PQ has a pole at signal 1.992: decoding saturates at 1e10 cd/m2 (signal 1.840), and
encoding tends to 1.992. Signals below PQ's black, 7.3e-7, decode to 0. Negative light goes on as the standard says: by
a line in most logarithms of cameras. Where it says nothing, values are mirrored (f(-x) = -f(x); BT.1886 about its own
zero, which lies below signal 0 where black is not 0). Or `negative` makes it no light. NaN stays; infinity stays where
a curve has no limit; light beyond float32's range becomes infinite.

Methods: `exact` evaluates the curve; `table` interpolates linearly in 256 to 65536 cells and evaluates what lies above
the table's top. Curves of logarithms and exponentials alone have no table, which would save nothing (tabled.py).
`cubic` and `sextic` take powers behind a toe, and PQ's signal, as polynomials of samples up to 1 (fitted.py).
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array
from lichen.once import latest
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
    Rate,
)
from lichen.operations.tone import standards, tables
from lichen.operations.tone.curves import FLOAT_MAX, WHOLE, Curve, Direction, Form
from lichen.operations.tone.evaluate import evaluate
from lichen.operations.tone.piecewise import held
from lichen.operations.tone.shapes import Pieced, Powers, Whole
from lichen.operations.tone.tabled import Tabled, pays, tabled
from lichen.operations.tone.tabled import numpy as by_pieces_numpy
from lichen.operations.tone.tabled import opencl as by_pieces_opencl
from lichen.operations.tone.transfer_cases import CASES
from lichen.operations.tone.transfer_launch import constants, definitions, fitted, launch
from lichen.operations.tone.transfer_parameters import WHITE, Parameters, form, shape, stated
from lichen.stage import Stage

if TYPE_CHECKING:
    from lichen.opencl.device import Device

HALF_MAX = 65504.0
"""Light up to which tables reach at most."""
SHORT, LONG = 3, 6
"""Degrees of fitted polynomials."""
KNOWN = 1024
"""Answers that predictions keep: a planner asks for the same many times over."""

# ------------------------------------------------------------------------------------------------------ declaration


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    """Parameters that belong to another curve are refused: they would silently do nothing."""
    flaws = []
    if p.gamma != 2.2 and p.curve is not Curve.GAMMA:
        flaws.append(Flaw("/parameters/gamma", f"applies to curve=gamma only (curve={p.curve})"))
    elif isinstance(p.gamma, tuple) and len(p.gamma) != (colours := _colours(facts["image"])):
        flaws.append(Flaw("/parameters/gamma", f"has {len(p.gamma)} numbers for {colours} colour channel(s)"))
    if p.exposure_index != 800 and p.curve is not Curve.ARRI_LOGC3:
        flaws.append(Flaw("/parameters/exposure_index", f"applies to curve=arri_logc3 only (curve={p.curve})"))
    if p.white is not None and p.curve not in WHITE:
        flaws.append(Flaw("/parameters/white", f"applies to curve={' and '.join(WHITE)} only (curve={p.curve})"))
    if p.black and p.curve is not Curve.BT1886:
        flaws.append(Flaw("/parameters/black", f"applies to curve=bt1886 only (curve={p.curve})"))
    elif p.black and p.black >= p.nominal_white / 2:
        flaws.append(
            Flaw("/parameters/black", f"must be below half of white (got {p.black:g} and {p.nominal_white:g})")
        )
    return flaws


def _colours(facts: Facts) -> int:
    return facts.channels - (facts.alpha is not Alpha.NONE)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    extent = facts["image"].extent
    if p.curve is not Curve.GAMMA or any(g != 1 for g in (p.gamma if isinstance(p.gamma, tuple) else (p.gamma,))):
        return None
    if p.clamped and (extent.low < 0 or extent.nonfinite):
        return None
    return "gamma is 1"


def _result(p: Parameters, facts: InputFacts) -> Facts:
    return facts["image"] if _identity(p, facts) else _converted(p, facts["image"])


@lru_cache(maxsize=KNOWN)
def _converted(p: Parameters, image: Facts) -> Facts:
    curve = shape(p)
    slack = _exact_error(p, image).value
    low, high = curve.span(image.extent.low, image.extent.high)
    if image.extent.nonfinite:
        low, high = min([low, *curve.limits]), max([high, *curve.limits])
    low, high = low - slack, high + slack
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
    image = facts["image"]
    ends = image.extent.low, image.extent.high
    if image.alpha is Alpha.NONE:
        return shape(p).modulus(*ends, error)
    # Colour counts multiplied by its coverage a. With |c'a' - ca| and |a' - a| at most e, (c' - c) a' is at most
    # (1 + |c|) e, and f(c')a' - f(c)a = (f(c') - f(c)) a' + f(c) (a' - a).
    colour, result = image.extent.magnitude, _converted(p, image).extent.magnitude
    return max(shape(p).modulus(*ends, (1 + colour) * error) + result * error, error)


def _inverse(p: Parameters) -> Parameters | None:
    """The other direction, where no two values have the same result: not clamped, not decoding into a plateau."""
    if p.clamped or (p.direction is Direction.DECODE and p.curve in (Curve.PQ, Curve.BT709)):
        return None
    if p.curve not in WHOLE and not stated(p).undone(p.direction is Direction.ENCODE):
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
        *({"curve": str(curve), "direction": str(way)} for curve in WHOLE for way in Direction),
        *({"curve": "bt1886", "direction": str(way), "black": 0.05} for way in Direction),
        {"curve": "gamma", "gamma": 0.8, "negative": "clamp"},
        {"curve": "pq", "direction": "encode", "white": 100, "negative": "clamp"},
        {"curve": "arri_logc3", "direction": "encode", "exposure_index": 400},
        {"curve": "acescc", "direction": "decode"},
        {"curve": "canon_log3", "direction": "encode", "negative": "clamp"},
        {"curve": "nikon_nlog", "direction": "encode"},
        {"curve": "dicom_gsdf", "direction": "decode"},
    ),
    hard_cases=CASES,
)

# ------------------------------------------------------------------------------------------------------------ truth


@transfer.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The standards' formulas: of the table, or those of standards.py."""
    image = inputs["image"]
    x, decode = image.pixels[..., : image.colours], p.direction is Direction.DECODE
    result = image.pixels.copy()
    with np.errstate(all="ignore"):
        if p.curve is Curve.BT1886:
            y = standards.bt1886(x, decode, p.nominal_white, p.black, p.clamped)
        elif p.curve in WHOLE:
            size = np.maximum(x, 0) if p.clamped else np.abs(x)
            y = standards.STANDARDS[p.curve](size, decode, p.gamma, p.nominal_white)
            y = np.where(x < 0, -y, y) if not p.clamped else y
        else:
            curve = stated(p).curve(not decode)
            y = (held(curve, not decode) if p.clamped else curve)(x)
    result[..., : image.colours] = y
    return result


# ---------------------------------------------------------------------------------------------------------- methods


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Powers; coverage is computed like colour and dropped."""
    return shape(p).cost * facts["image"].samples


@lru_cache(maxsize=KNOWN)
def _exact_error(p: Parameters, facts: Facts) -> Error:
    value = min(shape(p).error(facts.extent.low, facts.extent.high), FLOAT_MAX)
    return Error(value, "estimate", rounding=value)


def _stage(p: Parameters, facts: InputFacts, degree: int = 0) -> Stage | None:
    """For fused kernels; curves of several pieces and exponents by channel run alone."""
    if p.curve not in WHOLE or isinstance(p.gamma, tuple):
        return None
    numbers = tuple(map(float, constants(form(p), degree)))
    return Stage("tone/transfer_stage.clh", definitions(form(p), p.clamped, degree), numbers, numbers)


@transfer.method(
    "exact",
    error=lambda p, knob, facts: _exact_error(p, facts["image"]),
    work=_work,
    rates={"opencl": Rate(3e-4, 4.5e-10), "numpy": Rate(1e-4, 3.6e-9)},
    stage=_stage,
)
class Exact:
    """The curve itself in float32, written so that nothing cancels; the error is a few roundings times the
    curve's steepness."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return shape(parameters).opencl(device, inputs["image"])

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return shape(parameters).numpy(inputs["image"])


@lru_cache(maxsize=KNOWN)
def _tabled(p: Parameters, size: int) -> Tabled:
    """The table of a curve of pieces, up to signal 1."""
    curve = shape(p)
    assert isinstance(curve, Pieced)
    reach = 1.0 if p.direction is Direction.DECODE else min(stated(p).curve(encode=False).at(1.0), HALF_MAX)
    return tabled(curve.curve, reach, size)


def _table_unfit(p: Parameters, facts: InputFacts) -> str | None:
    curve = shape(p)
    if isinstance(curve, Pieced) and not pays(curve.curve):
        return "a logarithm or an exponential is computed as fast as it is looked up"
    return "each channel has its own exponent" if isinstance(curve, Powers) else None


@latest
def _whole(p: Parameters, facts: InputFacts) -> tuple[Form, float, bool]:
    """Of a curve that is one: its form, what its tables round, and whether they reach as far as the picture."""
    whole, extent = Whole(form(p), p.clamped), facts["image"].extent
    rounding = tables.rounding(whole.form) + 2 * ROUNDING * abs(whole.form.offset)
    far = max(abs(x + whole.form.shift) for x in whole.seen(extent.low, extent.high))
    return whole.form, rounding, far <= whole.form.top


def _table_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The table's proved bound, unless the picture reaches beyond the table."""
    image = facts["image"]
    if _table_unfit(p, facts):
        return _exact_error(p, image)
    if isinstance(shape(p), Pieced):
        value, rounding, reached = _tabled(p, round(knob)).error(image.extent.low, image.extent.high)
    else:
        curve, rounding, reached = _whole(p, facts)
        value = tables.best(curve, round(knob))[2] + rounding
    if reached and not image.extent.nonfinite:
        return Error(value, "bound", rounding)
    beyond = _exact_error(p, image)
    return Error(max(value, beyond.value), "estimate", max(rounding, beyond.rounding))


@transfer.method(
    "table",
    error=_table_error,
    work=lambda p, knob, facts: facts["image"].samples + knob,
    rates={"opencl": Rate(3e-4, 8.5e-10), "numpy": Rate(8e-5, 5e-9)},
    knob=Knob("size", (256, 1024, 4096, 16384, 65536), "cells of the table at most", 256, 65536, order=-2),
    orderly=True,
    unfit=_table_unfit,
)
class Interpolated:
    """Linear interpolation in a table whose cells shrink with the sample; proved up to the table's top, computed
    above it."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        if parameters.curve not in WHOLE:
            return by_pieces_opencl(device, inputs["image"], _tabled(parameters, round(knob)))
        table = tables.tabulate(form(parameters), round(knob))
        bits = (np.int32(table.first), np.int32(table.last), np.int32(table.shift))
        return launch(device, inputs["image"], form(parameters), parameters.clamped, "table", table.nodes, *bits)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if parameters.curve not in WHOLE:
            return by_pieces_numpy(image, _tabled(parameters, round(knob)))
        table = tables.tabulate(form(parameters), round(knob))
        out = evaluate(image.pixels, form(parameters), clamped=parameters.clamped, table=table)
        if image.alpha is not Alpha.NONE:
            out[..., -1] = image.pixels[..., -1]
        return out


def _fitted_unfit(p: Parameters, facts: InputFacts) -> str | None:
    curve, image = shape(p), facts["image"]
    found = fitted(curve.form, SHORT) if isinstance(curve, Whole) else None
    if not isinstance(curve, Whole) or found is None:
        return "a curve of other terms than powers is computed as fast"
    far = max(abs(x + curve.form.shift) for x in curve.seen(image.extent.low, image.extent.high))
    return None if far <= found.top else "what lies beyond 1 is computed"


def _fitted_error(p: Parameters, degree: int, facts: InputFacts) -> Error:
    curve, beyond = shape(p), _exact_error(p, facts["image"])
    found = fitted(curve.form, degree) if isinstance(curve, Whole) else None
    if not isinstance(curve, Whole) or found is None:
        return beyond
    rounding = found.rounding + 2 * ROUNDING * abs(curve.form.offset)
    value = max(found.error + rounding, ROUNDING, beyond.value if _fitted_unfit(p, facts) else 0.0)
    return Error(value, "estimate", max(rounding, ROUNDING))


class Fitted:
    """The bodies of methods by polynomials of a degree."""

    degree: int

    @classmethod
    def opencl(cls, device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return launch(device, inputs["image"], form(parameters), parameters.clamped, "exact", degree=cls.degree)

    @classmethod
    def numpy(cls, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        image = inputs["image"]
        found = fitted(form(parameters), cls.degree)
        out = evaluate(image.pixels, form(parameters), clamped=parameters.clamped, found=found)
        if image.alpha is not Alpha.NONE:
            out[..., -1] = image.pixels[..., -1]
        return out


@transfer.method(
    "cubic",
    error=lambda p, knob, facts: _fitted_error(p, SHORT, facts),
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(3e-4, 3.2e-10), "numpy": Rate(8e-5, 1.2e-8)},
    unfit=_fitted_unfit,
    stage=lambda p, facts: _stage(p, facts, SHORT),
)
class Cubic(Fitted):
    """Four cubic polynomials instead of a power, chosen by the sample's bits."""

    degree = SHORT


@transfer.method(
    "sextic",
    error=lambda p, knob, facts: _fitted_error(p, LONG, facts),
    work=lambda p, knob, facts: facts["image"].samples,
    rates={"opencl": Rate(3e-4, 3.6e-10), "numpy": Rate(8e-5, 1.8e-8)},
    unfit=_fitted_unfit,
    stage=lambda p, facts: _stage(p, facts, LONG),
)
class Sextic(Fitted):
    """Four polynomials of degree 6 instead of a power: as exact as float32 for the curves of displays."""

    degree = LONG
