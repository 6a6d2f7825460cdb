"""Levels: scale, bias, window and gamma.

Truth, for every colour channel, coverage untouched:

    t = (x - black) / (white - black)
    t = min(max(t, 0), 1)                      where clamp is set
    t = sign(t) |t|^(1 / gamma)                where gamma is not 1
    y = out_black + t (out_white - out_black)

Each level is one number, or one for each colour channel. A scale s and a bias b are out_black = b, out_white = s + b. A
window, as radiology states it, is its centre and width: black = centre - width / 2, white = centre + width / 2. White
below black inverts.

Black is carried as two floats, so that a window of a few thousandths at 1e4 is as accurate as one at 0. Clamping keeps
NaN and takes infinities to the ends.

Source: McReynolds and Blythe, Advanced Graphics Programming Using OpenGL, 2005, section 12.2.2; DICOM PS3.3 C.11.2.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha
from lichen.memory import Array, aligned
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
from lichen.operations.colour.affine import Affine, Scaling
from lichen.operations.tone.pointwise import FLOAT_MAX, blockwise, carried, launch_flat, spanned, within
from lichen.stage import Stage

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lichen.opencl.device import Device

Level = Annotated[float, Field(ge=-1e9, le=1e9)]
Levels = Level | Annotated[tuple[Level, ...], Field(min_length=1, max_length=64)]
COLOURS = 3
"""Of a picture that a matrix takes."""
NARROWEST = 1e-6
"""White and black differ by this much of the larger, or a window would be narrower than float32 resolves."""


class Parameters(OperationParameters):
    black: Levels = 0.0
    """what becomes out_black; one number, or one for each colour channel"""
    white: Levels = 1.0
    """what becomes out_white; not black"""
    gamma: float | Annotated[tuple[float, ...], Field(min_length=1, max_length=64)] = 1.0
    """between the levels, t^(1 / gamma): above 1 lifts the middle; 0.01 to 100"""
    out_black: Levels = 0.0
    """the result at black"""
    out_white: Levels = 1.0
    """the result at white"""
    centre: Level | None = None
    """middle of the window; with width, in place of black and white"""
    width: float | None = Field(None, gt=0, le=1e9)
    """width of the window"""
    clamp: bool = False
    """whether what lies outside the levels is brought to them"""


@dataclasses.dataclass(frozen=True)
class Channel:
    """The levels of one colour channel."""

    black: float
    white: float
    gamma: float
    low: float
    high: float

    def share(self, x: float) -> float:
        return (x - self.black) / (self.white - self.black)


def channels(p: Parameters, colours: int) -> list[Channel]:
    """The levels of each colour channel."""
    black, white = p.black, p.white
    if p.centre is not None and p.width is not None:
        black, white = p.centre - p.width / 2, p.centre + p.width / 2
    each = [v if isinstance(v, tuple) else (v,) * colours for v in (black, white, p.gamma, p.out_black, p.out_white)]
    return [Channel(*values) for values in zip(*each, strict=True)]


def _curved(p: Parameters) -> int:
    """1 where there is a power, 2 where a quick one serves (levels.cl)."""
    each = p.gamma if isinstance(p.gamma, tuple) else (p.gamma,)
    return 0 if all(g == 1 for g in each) else 2 if all(0.25 <= g <= 4 for g in each) else 1


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image = facts["image"]
    colours = image.channels - (image.alpha is not Alpha.NONE)
    flaws = []
    if (p.centre is None) != (p.width is None):
        missing = "centre" if p.centre is None else "width"
        flaws.append(Flaw(f"/parameters/{missing}", "a window needs both centre and width"))
    if p.width is not None and (p.black != 0 or p.white != 1):
        flaws.append(Flaw("/parameters/black", "black and white, or centre and width: not both"))
    for name in ("black", "white", "gamma", "out_black", "out_white"):
        value = getattr(p, name)
        if isinstance(value, tuple) and len(value) != colours:
            flaws.append(Flaw(f"/parameters/{name}", f"has {len(value)} numbers for {colours} colour channel(s)"))
    if flaws:
        return flaws
    for channel in channels(p, colours):
        if not 0.01 <= channel.gamma <= 100:
            flaws.append(Flaw("/parameters/gamma", f"must be from 0.01 to 100 (got {channel.gamma:g})"))
        apart, larger = abs(channel.white - channel.black), max(abs(channel.white), abs(channel.black))
        if apart < NARROWEST * larger or apart < 1e-20:
            what = "white" if p.width is None else "width"
            flaws.append(Flaw(f"/parameters/{what}", f"white and black differ by {apart:g}, which is too little"))
    return flaws


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image = facts["image"]
    colours = image.channels - (image.alpha is not Alpha.NONE)
    same = all(c == Channel(0.0, 1.0, 1.0, 0.0, 1.0) for c in channels(p, colours))
    return "every level is where it was" if same and (not p.clamp or within(image, 0, 1)) else None


def _departure(p: Parameters, facts: InputFacts) -> dict[str, float]:
    """At an end or a corner of the broken line, where it is one. Straight colour counts as it shows, times its
    coverage w: of a line, at an end of w and of what shows; what is cut off a broken one shows by any amount."""
    image = facts["image"]
    low, high = image.extent.low, image.extent.high
    if _curved(p):
        return {}
    if image.alpha is not Alpha.NONE:
        if p.clamp or not 0 <= low <= high <= 1:
            return {}
        lines = [
            (c.low + c.share(0.0) * (c.high - c.low), (c.high - c.low) / (c.white - c.black) - 1)
            for c in channels(p, _colours(image))
        ]
        return {"image": max(abs(w * bias + slope * x) for bias, slope in lines for w in (0, 1) for x in (0.0, high))}
    most = 0.0
    for channel in channels(p, _colours(image)):
        corners = [x for x in (channel.black, channel.white) if p.clamp and low < x < high]
        for x in (low, high, *corners):
            t = channel.share(x)
            t = min(max(t, 0.0), 1.0) if p.clamp else t
            most = max(most, abs(channel.low + t * (channel.high - channel.low) - x))
    return {"image": most}


def _link(p: Parameters, facts: InputFacts) -> Scaling | None:
    """Factors alone, where black stays black and nothing bends: an exposure, which a matrix beside it takes in."""
    image = facts["image"]
    if _curved(p) or p.clamp or image.alpha is Alpha.ASSOCIATED or _colours(image) != COLOURS:
        return None
    each = channels(p, COLOURS)
    if any(channel.black or channel.low for channel in each):
        return None
    return Scaling(Affine.of(np.diag([channel.high / channel.white for channel in each])), image.channels)


def _power(t: float, gamma: float) -> float:
    try:
        return math.copysign(abs(t) ** (1 / gamma), t)
    except OverflowError:
        return math.copysign(math.inf, t)


def _shares(p: Parameters, channel: Channel, facts: Facts) -> tuple[float, float]:
    """t at both ends of the picture's range."""
    first, last = channel.share(facts.extent.low), channel.share(facts.extent.high)
    if p.clamp:
        first, last = min(max(first, 0.0), 1.0), min(max(last, 0.0), 1.0)
    return min(first, last), max(first, last)


def _channel_error(p: Parameters, channel: Channel, facts: Facts) -> float:
    """Roundings of t's relative error, at the far end; the power adds its own and what its exponent's rounding makes.

    t carries four roundings, relative to itself: both differences, the scale and the product. x^(1/g) magnifies them by
    1/g and adds four, and where it is the quick one two over g; half a rounding of the exponent counts by |log t| / g,
    at most 1/e below t = 1.
    """
    far = max(map(abs, _shares(p, channel, facts)))
    span = abs(channel.high - channel.low)
    if _curved(p):
        relative = 5 + (6 + 0.5 * max(math.log(far), 0.0) if far > 0 else 6) / channel.gamma
        size, least = _power(far, channel.gamma), 1 / math.e
    else:
        relative, size, least = 6.0, far, 0.0
    size = min(size * span, FLOAT_MAX)
    return ROUNDING * (relative * size + least * span + 2 * abs(channel.low) + size)


def _colours(facts: Facts) -> int:
    return facts.channels - (facts.alpha is not Alpha.NONE)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    image = facts["image"]
    value = max(_channel_error(p, channel, image) for channel in channels(p, _colours(image)))
    return Error(value, "estimate" if _curved(p) else "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if _identity(p, facts):
        return image
    ends = []
    for channel in channels(p, _colours(image)):
        shares = [0.0, 1.0] if p.clamp and image.extent.nonfinite else [*_shares(p, channel, image)]
        ends += [channel.low + _power(t, channel.gamma) * (channel.high - channel.low) for t in shares]
    extent = spanned(image, min(ends), max(ends), _error(p, 0.0, facts).value)
    return dataclasses.replace(image, extent=extent)


def _rise(p: Parameters, channel: Channel, facts: Facts, change: float) -> float:
    """The largest change of one channel's result for a change of its input.

    A power's is largest where it is steepest: at zero for an exponent below 1, where |a^r - b^r| <= 2 (|a - b| / 2)^r
    for values of either sign; at the far end for one above 1, where the mean value theorem bounds it.
    """
    step = change / abs(channel.white - channel.black)
    span = abs(channel.high - channel.low)
    if p.clamp:
        step = min(step, 1.0)
    exponent = 1 / channel.gamma
    if exponent == 1 or step == 0:
        return step * span
    if exponent < 1:
        return float(2 * (step / 2) ** exponent * span)
    far = max(map(abs, _shares(p, channel, facts))) + step
    steepest: float = exponent * abs(_power(far, 1 / (exponent - 1)))
    return min(steepest * step * span, FLOAT_MAX)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    image = facts["image"]

    def modulus(change: float) -> float:
        return max(_rise(p, channel, image, change) for channel in channels(p, _colours(image)))

    return carried(image, _result(p, facts).extent.magnitude, modulus, error)


# ------------------------------------------------------------------------------------------------------- hard cases


def _row(*values: float) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.array(values, dtype=np.float32).reshape(1, -1, 1)}


def _holds(*expected: float, within: float) -> Callable[[Mapping[str, Any], Array], str | None]:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        got = pixels.reshape(-1)
        same = np.allclose(got, np.array(expected), rtol=0, atol=within, equal_nan=True)
        return None if same else f"expected {list(expected)}, got {got.tolist()}"

    return holds


NARROW = tuple(10000.5 + 2.0**-10 * step for step in range(5))

levels = Operation(
    name="levels",
    family="tone",
    summary="Brings a black and a white level to others, with a gamma between: scale, bias, window and contrast.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data; its coverage channel, if it has one, passes unchanged"),),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    departure=_departure,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    link=_link,
    check=_check,
    examples=(
        {"black": 0.1, "white": 0.8},
        {"black": 0.05, "white": 0.9, "gamma": 1.8, "clamp": True},
        {"centre": 0.4, "width": 0.2, "clamp": True},
        {"black": 1, "white": 0},
        {"gamma": 0.45, "out_black": 0.1, "out_white": 0.7},
        {"black": [0.0, 0.1, 0.2], "white": [1.0, 0.9, 1.1], "gamma": [1.0, 1.2, 0.8]},
    ),
    hard_cases=(
        HardCase(
            name="narrow window far from zero",
            why="x s - black s loses all digits where the window is narrow",
            inputs=_row(*NARROW),
            parameters={"centre": 10000.502, "width": 0.004, "clamp": True},
            holds=_holds(*(min(max((x - 10000.5) / 0.004, 0), 1) for x in NARROW), within=2e-6),
        ),
        HardCase(
            name="what is not a number stays so when clamped",
            why="fmin and fmax return the number, and NaN becomes black or white",
            inputs=_row(np.nan, np.inf, -np.inf, 0.5),
            parameters={"clamp": True, "gamma": 2.0},
            holds=_holds(np.nan, 1, 0, math.sqrt(0.5), within=1e-6),
        ),
        HardCase(
            name="negative light under a gamma",
            why="a power of a negative number is NaN",
            inputs=_row(-0.25, 0.0, -0.0, 0.25),
            parameters={"gamma": 2.0},
            holds=_holds(-0.5, 0, 0, 0.5, within=1e-6),
        ),
    ),
)


@levels.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    result = image.pixels.copy()
    with np.errstate(all="ignore"):
        for at, c in enumerate(channels(p, image.colours)):
            t = (image.pixels[..., at] - c.black) / (c.white - c.black)
            if p.clamp:
                t = np.clip(t, 0, 1)
            if c.gamma != 1:
                t = np.copysign(np.abs(t) ** (1 / c.gamma), t)
            result[..., at] = c.low + t * (c.high - c.low)
    return result


def _numbers(p: Parameters, colours: int) -> Array:
    """One row for each number of the kernel, one column for each colour channel; float32."""
    split = p.clamp or _curved(p)
    columns = []
    for c in channels(p, colours):
        high, span = float(np.float32(c.black)), c.high - c.low
        scale = (1 if split else span) / (c.white - c.black)
        columns.append((high, c.black - high, scale, c.low, 1 / c.gamma, span))
    return np.array(columns, dtype=np.float32).T


def _stage(p: Parameters, facts: InputFacts) -> Stage:
    numbers = _numbers(p, _colours(facts["image"]))
    single = tuple(map(float, numbers[:, 0])) if (numbers == numbers[:, :1]).all() else None
    defines = {"CLAMPED": int(p.clamp), "CURVED": _curved(p)}
    return Stage("tone/levels_stage.clh", defines, tuple(map(float, np.ravel(numbers))), single)


@levels.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (3.0 if _curved(p) else 1.0),
    rates={"opencl": Rate(2e-4, 2.4e-10), "numpy": Rate(1e-4, 2.2e-9)},
    stage=_stage,
)
class Exact:
    """The formula in float32, black in two parts."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        numbers = np.zeros((6, image.channels), np.float32)
        numbers[:, : image.colours] = _numbers(p, image.colours)
        runs = np.take(numbers, np.arange(image.channels + 16) % image.channels, axis=1)
        defines = {"CLAMPED": int(p.clamp), "CURVED": _curved(p), "CHANNELS": image.channels}
        return launch_flat(device, "tone/levels.cl", "levels", image, aligned(runs), defines=defines)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        black, rest, scale, low, exponent, span = _numbers(p, image.colours)

        def body(x: Array) -> Array:
            t: Array = ((x - black) - rest) * scale
            if p.clamp:
                np.clip(t, 0, 1, out=t)
            if _curved(p):
                t = np.copysign(np.abs(t) ** exponent, t)
            if p.clamp or _curved(p):
                t *= span
            t += low
            return t

        return blockwise(image, body)
