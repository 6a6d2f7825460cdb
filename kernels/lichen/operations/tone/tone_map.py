"""Tone mapping: scene light brought into the range of a display.

Truth: scene-linear light times 2^exposure, then y = f(x), for every colour channel by itself or, for on=luminance, with
the ratios of the channels kept: y = x f(L) / L. L is the weighted sum of what light the channels hold; a negative
channel holds none, so that L never cancels. The result is display-linear light, limited to [0, 1] where clamp is set;
otherwise f is continued oddly to negative light. Coverage passes untouched. Colour is taken straight: what covers half
a pixel is as bright as what covers all of it.

* exposure: the factor alone.
* reinhard: x / (1 + x).
* reinhard_extended: x (1 + x / white^2) / (1 + x), which is 1 at white.
* hable: the filmic curve of Uncharted 2, divided by its value at white. Its author doubles the exposure beforehand.
* aces_narkowicz: x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), per channel.
* aces_hill: a rational fit between two matrices, from and to BT.709; what is negative before the fit counts as 0.

The sources and the forms that are computed stand in operators.py.
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.tone.operators import HILL, HILL_INTO, HILL_OUT_OF, Operator, hill, rational, steepest
from lichen.operations.tone.pointwise import FLOAT_MAX, blockwise, carried, launch_flat, spanned, within

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lichen.opencl.device import Device

HILL_RANGE = 2.5
"""The largest magnitude that the second matrix makes of the fit's values, which are below 1.02"""


class On(StrEnum):
    """What the curve is applied to."""

    CHANNELS = "channels"
    LUMINANCE = "luminance"


class Parameters(OperationParameters):
    operator: Operator = Operator.REINHARD_EXTENDED
    """the tone curve"""
    exposure: float = Field(0.0, ge=-24, le=24, json_schema_extra={"unit": "stops"})
    """light is multiplied by 2^exposure first"""
    white: float = Field(4.0, ge=0.1, le=1e4)
    """light that becomes 1, for reinhard_extended and hable, after exposure"""
    on: On = On.CHANNELS
    """channels: every channel by itself; luminance: their ratios stay"""
    weights: tuple[float, float, float] = (0.2126, 0.7152, 0.0722)
    """of red, green and blue in luminance: not negative, together 1; those of BT.709"""
    clamp: bool = True
    """whether the result is limited to [0, 1]"""

    @property
    def factor(self) -> float:
        return float(2.0**self.exposure)

    @property
    def by_pixel(self) -> bool:
        return self.operator is Operator.ACES_HILL or self.on is On.LUMINANCE


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    colours = image.channels - (image.alpha is not Alpha.NONE)
    flaws = []
    if p.by_pixel and colours != 3:
        field = "operator" if p.operator is Operator.ACES_HILL else "on"
        flaws.append(Flaw(f"/parameters/{field}", f"needs 3 colour channels; the image has {colours}"))
    if p.operator is Operator.ACES_HILL and p.on is On.LUMINANCE:
        flaws.append(Flaw("/parameters/on", "has no part in operator=aces_hill, which mixes the channels itself"))
    if p.white != 4.0 and p.operator not in (Operator.REINHARD_EXTENDED, Operator.HABLE):
        flaws.append(Flaw("/parameters/white", f"applies to reinhard_extended and hable only (operator={p.operator})"))
    if min(p.weights) < 0 or abs(sum(p.weights) - 1) > 1e-3:
        flaws.append(Flaw("/parameters/weights", "must not be negative and must sum to 1"))
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    plain = p.operator is Operator.EXPOSURE and p.exposure == 0
    return "the exposure is 0" if plain and (not p.clamp or within(facts["image"], 0, 1)) else None


def _far(p: Parameters, facts: Facts) -> float:
    """The largest light after exposure."""
    return min(facts.extent.magnitude * p.factor, FLOAT_MAX)


def _size(p: Parameters, facts: Facts) -> float:
    """The largest result before it is limited."""
    far = _far(p, facts)
    if p.operator is Operator.ACES_HILL:
        return HILL_RANGE
    curve = rational(p.operator, p.white)
    if p.on is On.LUMINANCE:
        return min(far * curve.most_gain * 1.01, FLOAT_MAX)
    # Narkowicz's and Hable's curves and Reinhard's rise to their limits, the extended one without one.
    return min(float(curve(np.array([far]))[0]), FLOAT_MAX)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """No step cancels, so roundings are relative to the result: x f'/f lies in [-2, 2], and a curve has ten steps.

    Where channels of both signs meet in the fit's first matrix, what they lose is relative to the light instead.
    """
    image = facts["image"]
    size = _size(p, image)
    value = 40 * ROUNDING * (min(size, 1.1) if p.clamp else size)
    if p.operator is Operator.ACES_HILL and image.extent.low < 0:
        lost = 8 * ROUNDING * _far(p, image) * steepest(p.operator, p.white)[0] * HILL_RANGE
        value += min(lost, 1.0 if p.clamp else 2 * HILL_RANGE)
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if _identity(p, facts):
        return image
    size = _size(p, image)
    low, high = (-size if image.extent.low < 0 else 0.0), size
    if p.operator is Operator.ACES_HILL:
        low = -size
    if image.extent.nonfinite and not p.by_pixel:
        limit = min(float(rational(p.operator, p.white)(np.array([np.inf]))[0]), FLOAT_MAX)
        low, high = min(low, -limit), max(high, limit)
    bad = image.extent.nonfinite * (image.channels if p.by_pixel else 1)
    slack = _error(p, 0.0, facts).value
    if p.clamp:
        low, high, slack = max(low, 0.0), min(max(high, 0.0), 1.0), 0.0
        if image.extent.nonfinite:
            high = 1.0
    extent = spanned(image, low, high, slack, nonfinite=min(bad, image.samples))
    return dataclasses.replace(image, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    image = facts["image"]
    slope, gain_slope = (p.factor * each for each in steepest(p.operator, p.white))
    if p.operator is Operator.ACES_HILL:
        slope *= HILL_RANGE
    elif p.on is On.LUMINANCE:
        slope = p.factor * rational(p.operator, p.white).most_gain + gain_slope * _far(p, image)
    magnitude = _result(p, facts).extent.magnitude
    return carried(image, magnitude, lambda change: min(slope * change, 2 * magnitude), error)


# ------------------------------------------------------------------------------------------------------- hard cases


def _pixel(*values: float) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.array(values, dtype=np.float32).reshape(1, -1, 3)}


def _holds(*expected: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, np.array(expected), rtol=1e-5, atol=1e-6, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


LARGE = (1e30, 3e38, np.inf)

tone_map = Operation(
    name="tone_map",
    family="tone",
    summary="Brings scene light into the range of a display: exposure, then a tone curve.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a scene-linear picture; its coverage channel, if it has one, passes unchanged"),),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"operator": "reinhard_extended", "white": 4},
        {"operator": "hable", "white": 11.2, "exposure": 1},
        {"operator": "reinhard", "exposure": -1.5, "clamp": False},
        {"operator": "aces_narkowicz", "exposure": 0.5},
        {"operator": "exposure", "exposure": 2.3},
        {"operator": "reinhard_extended", "white": 2, "on": "luminance", "clamp": False},
        {"operator": "hable", "white": 6, "clamp": False},
        {"operator": "aces_hill", "exposure": 1},
        {"operator": "aces_narkowicz", "on": "luminance"},
        {"operator": "aces_hill", "clamp": False},
    ),
    hard_cases=(
        HardCase(
            name="light without end",
            why="x^2 overflows at 2e19, and infinity over infinity is NaN",
            inputs=_pixel(*LARGE),
            parameters={"operator": "aces_narkowicz", "clamp": False},
            holds=_holds(*(2.51 / 2.43,) * 3),
        ),
        HardCase(
            name="limit of Reinhard's curve",
            why="x / (1 + x) of an infinity is NaN",
            inputs=_pixel(*LARGE),
            parameters={"operator": "reinhard", "clamp": False},
            holds=_holds(1, 1, 1),
        ),
        HardCase(
            name="black by its luminance",
            why="f(L) / L is 0 / 0",
            inputs=_pixel(0, 0, 0, -1, -2, -0.5, np.nan, 1, 1),
            parameters={"operator": "reinhard", "on": "luminance", "clamp": False},
            holds=_holds(0, 0, 0, -1, -2, -0.5, np.nan, np.nan, np.nan),
        ),
        HardCase(
            name="deep shadow of the filmic curve",
            why="its printed form is the difference of two numbers near E / F",
            inputs=_pixel(1e-12, 1e-20, 0),
            parameters={"operator": "hable", "white": 11.2, "exposure": 20},
            holds=_holds(2.0**20 * 1e-12 * (0.5 * (0.1 - 0.02 / 0.3) / 0.06) / 0.7253, 0, 0),
        ),
        HardCase(
            name="negative light beside the pole of 1 + x",
            why="x / (1 + x) at -1 is infinite",
            inputs=_pixel(-1, -0.999, -5),
            parameters={"operator": "reinhard", "clamp": False},
            holds=_holds(-0.5, -0.999 / 1.999, -5 / 6),
        ),
    ),
)


@tone_map.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    result = image.pixels.copy()
    with np.errstate(all="ignore"):
        result[..., : image.colours] = _mapped(image.pixels[..., : image.colours], p)
    return result


def _mapped(x: Array, p: Parameters) -> Array:
    """The definition, in the precision of x."""
    light = x * x.dtype.type(p.factor)
    if p.by_pixel and x.dtype == np.float32:
        light = np.where(np.isinf(light) & np.isfinite(x), np.copysign(np.float32(FLOAT_MAX), x), light)
    if p.operator is Operator.ACES_HILL:
        into, out_of = (matrix.astype(x.dtype) for matrix in (HILL_INTO, HILL_OUT_OF))
        inner = _product(light, into)
        y = _product(hill(np.where(inner < 0, x.dtype.type(0), inner)), out_of)
    elif p.on is On.LUMINANCE:
        held = np.where(light < 0, x.dtype.type(0), light)
        luminance = _product(held, np.array([p.weights], dtype=x.dtype))
        y = light * rational(p.operator, p.white).gain(luminance)
    else:
        y = np.copysign(rational(p.operator, p.white)(np.abs(light)), light)
    return np.clip(y, 0, 1) if p.clamp else y


def _product(x: Array, matrix: Array) -> Array:
    """Row by row, from red to blue."""
    rows = [x[..., 0] * m[0] + x[..., 1] * m[1] + x[..., 2] * m[2] for m in matrix]
    return np.stack(rows, axis=-1)


def _numbers(p: Parameters) -> Array:
    curve = rational(p.operator, p.white)
    five = HILL if p.operator is Operator.ACES_HILL else (curve.a, curve.b, curve.c, curve.d, curve.e)
    numbers = [*five, p.factor, *p.weights, *HILL_INTO.flat, *HILL_OUT_OF.flat]
    return aligned(np.array(numbers, dtype=np.float32))


@tone_map.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (2.0 if p.by_pixel else 1.0),
    rates={"opencl": Rate(2e-4, 2.5e-10), "numpy": Rate(1e-4, 2.8e-9)},
)
class Exact:
    """The curve as one fraction in float32, in a form for each side of 1, neither of which can overflow."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        curve = rational(p.operator, p.white)
        defines = {
            "DEGREE": curve.degree,
            "RISING": int(curve.a != 0),
            "CLAMPED": int(p.clamp),
            "CHANNELS": max(image.channels, 3),
        }
        if not p.by_pixel:
            return launch_flat(device, "tone/tone_map.cl", "channels", image, _numbers(p), defines=defines)
        return _by_pixel(device, image, p, defines)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return blockwise(inputs["image"], lambda x: _mapped(x, p))


def _by_pixel(device: Device, image: Image, p: Parameters, defines: Mapping[str, int]) -> Array:
    pixels = aligned(image.pixels)
    out, count = aligned_empty(pixels.shape), image.height * image.width
    with device.session() as session:
        session.launch(
            "tone/tone_map.cl", "fit" if p.operator is Operator.ACES_HILL else "luminance", (-(-count // 64),),
            pixels, session.write(out), _numbers(p), np.uint64(count),
            defines=defines,
        )  # fmt: skip
    return out
