"""Colour difference between two pictures, pixel by pixel.

Truth: both pictures' L*a*b* (D65), and of each pair of colours the distance by the chosen formula, one channel. Numbers
are linear light with BT.709 primaries unless `source` says that they are L*a*b*. Channels after the third, coverage
among them, take no part: colour associated with coverage is compared as it is seen over black. A distance of about 1
can just be told apart.

* cie76: the Euclidean distance.
* cie94: chroma and hue weighted by the chroma of `reference`; not symmetric. Graphic arts' weights.
* ciede2000: weights that follow lightness, chroma and hue; its C^7 is written as a ratio, so no chroma overflows it. It
  is not continuous where hues are opposite: there the mean hue turns about.

`exact` computes in doubles. `single` computes in float32, in half of the time, but for what rounding could turn about.

Sources: CIE 15:2004; CIE 116-1995; G. Sharma, W. Wu and E. N. Dalal, Color Research and Application 30, 2005.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.accuracy.colour import delta_e
from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
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
from lichen.operations.colour.primaries import Primaries, White, to_xyz
from lichen.operations.colour.stages import FLOAT_MAX, LIGHTNESS

if TYPE_CHECKING:
    from lichen.opencl.device import Device

TO_RATIO = to_xyz(Primaries.BT709) / White.D65.xyz[:, np.newaxis]
"""From linear light to XYZ over that of white."""


SINGLE, LIGHT = 20.0, 200.0
"""Roundings of the farthest that colours may lie apart that float32 is wrong by; a distance whose roundings are those
of L*a*b* near black, where a* and b* are differences of what is not near 0."""


class Formula(StrEnum):
    """How far apart two colours are."""

    CIE76 = "cie76"
    CIE94 = "cie94"
    CIEDE2000 = "ciede2000"


class Source(StrEnum):
    """What the numbers of pictures mean that do not say so themselves."""

    LINEAR = "linear_bt709"
    LAB = "lab"


class Parameters(OperationParameters):
    formula: Formula = Formula.CIEDE2000
    """the distance"""
    source: Source = Field(Source.LINEAR)
    """what the numbers of both are, where they do not say it themselves: linear light, or L*a*b*"""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    first, second = facts["image"], facts["reference"]
    flaws = []
    if (first.height, first.width) != (second.height, second.width):
        sizes = f"{second.width}x{second.height}, and image {first.width}x{first.height}"
        flaws.append(Flaw("/inputs/reference", f"is {sizes}"))
    if p.source is Source.LAB and any(each.space is not Space.DATA for each in facts.values()):
        flaws.append(Flaw("/parameters/source", "is lab, and a picture says that it is light"))
    return flaws


def lab(pixels: Array, p: Parameters) -> Array:
    """L*a*b* of the first three channels, float64; sums written out, since equal pixels are to have equal bits."""
    colours = pixels[..., :3].astype(np.float64)
    if p.source is Source.LAB:
        return colours
    x, y, z = LIGHTNESS.run([sum(colours[..., i] * share for i, share in enumerate(row)) for row in TO_RATIO])
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def cie94(first: Array, reference: Array) -> Array:
    """Distance from the reference; hue is what is left of the Euclidean distance, never less than nothing."""
    c1, c2 = np.hypot(first[..., 1], first[..., 2]), np.hypot(reference[..., 1], reference[..., 2])
    apart = first - reference
    chroma = c1 - c2
    hue = np.maximum(np.square(apart[..., 1]) + np.square(apart[..., 2]) - chroma * chroma, 0)
    squares = np.square(apart[..., 0]) + np.square(chroma / (1 + 0.045 * c2)) + hue / np.square(1 + 0.015 * c2)
    distance: Array = np.sqrt(squares)
    return distance


def distances(inputs: Inputs, p: Parameters) -> Array:
    """The definition in float64, shape (height, width, 1)."""
    with np.errstate(all="ignore"):
        first, second = lab(inputs["image"].pixels, p), lab(inputs["reference"].pixels, p)
        match p.formula:
            case Formula.CIE76:
                made = np.sqrt(np.square(first - second).sum(axis=-1))
            case Formula.CIE94:
                made = cie94(first, second)
            case _:
                made = delta_e(first, second)
    plane: Array = made[..., np.newaxis]
    return plane


@latest
def _farthest(p: Parameters, facts: InputFacts) -> float:
    """No two colours are farther apart: CIE94 divides by 1 at least; CIEDE2000 too, and it stretches a* by 1.5 at most,
    and its mixed term at most doubles the squares."""
    low = min(each.extent.low for each in facts.values())
    high = max(each.extent.high for each in facts.values())
    if p.source is Source.LAB:
        sides = [high - low] * 3
    else:
        ends = [[float(pick(row * low, row * high).sum()) for pick in (np.minimum, np.maximum)] for row in TO_RATIO]
        spans = LIGHTNESS.intervals([(bottom, top) for bottom, top in ends])
        x, y, z = (top - bottom for bottom, top in spans)
        sides = [116 * y, 500 * (x + y), 200 * (y + z)]
    return float(np.linalg.norm(sides)) * (1.5 * 2**0.5 if p.formula is Formula.CIEDE2000 else 1.0)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    far = _farthest(p, facts) * (1 + 1e-6)
    spoilt = far > FLOAT_MAX or any(each.extent.nonfinite for each in facts.values())
    extent = Extent(0.0, min(far, FLOAT_MAX), image.pixels if spoilt else 0)
    return Facts(image.height, image.width, 1, Space.DATA, Alpha.NONE, extent)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """One rounding to float32, and what cancels in float64 between colours that are nearly alike."""
    far = _farthest(p, facts)
    size = max(each.extent.magnitude for each in facts.values()) if p.source is Source.LAB else far
    value = min(1.01 * ROUNDING * far + 1e-7 * max(size, 1e-30), FLOAT_MAX)
    return Error(value, "estimate", rounding=value)


def _single_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Roundings of L*a*b*, whose a* and b* are differences times 500 and 200, and of what is made of them: the worst
    seen, with a margin of ten."""
    exact = _error(p, knob, facts)
    light = 0.0 if p.source is Source.LAB else LIGHT
    value = min(exact.value + SINGLE * ROUNDING * (_farthest(p, facts) + light), FLOAT_MAX)
    return Error(value, "estimate", rounding=exact.rounding)


def _pair(*values: float) -> Array:
    return np.array(values, np.float32).reshape(1, -1, 3)


def _near(*expected: float) -> Any:
    def holds(inputs: Any, pixels: Array) -> str | None:
        got = pixels[0, :, 0]
        return None if np.allclose(got, expected, rtol=1e-5, atol=1e-4, equal_nan=True) else f"got {got.tolist()}"

    return holds


def _opposite() -> dict[str, Array]:
    """L*a*b* of hues that are opposite but for less and less, of chromas from none to much."""
    random = np.random.default_rng(4)
    hue, apart = random.uniform(0, 2 * np.pi, (40, 40)), 10.0 ** random.uniform(-9, 0, (40, 40))
    drawn = {}
    for name, turn in (("image", hue), ("reference", hue + np.pi + apart * random.choice([-1, 1], (40, 40)))):
        chroma = 10.0 ** random.uniform(-6, 2.2, (40, 40))
        lab = [random.uniform(0, 100, (40, 40)), chroma * np.cos(turn), chroma * np.sin(turn)]
        drawn[name] = np.stack(lab, -1).astype(np.float32)
    return drawn


def _turned_as_defined(inputs: Any, pixels: Array) -> str | None:
    apart = np.abs(pixels[..., 0] - delta_e(inputs["image"], inputs["reference"])).max()
    return None if apart <= 1e-3 else f"off by {apart:.3g}"


def _nearly_alike() -> dict[str, Array]:
    random = np.random.default_rng(6)
    picture = random.random((40, 40, 3))
    noisy = picture + random.normal(0, 1e-3, picture.shape)
    return {"image": picture.astype(np.float32), "reference": noisy.astype(np.float32)}


def _seen_and_small(inputs: Any, pixels: Array) -> str | None:
    return None if pixels.min() > 0 and pixels.max() < 10 else f"from {pixels.min():.3g} to {pixels.max():.3g}"


difference = Operation(
    name="difference",
    family="colour",
    summary="Tells how different the colours of two pictures look, pixel by pixel.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the picture", channels=(3, None)),
        Input("reference", "what it is compared with, of the same size", channels=(3, None)),
    ),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=lambda p, facts, by: _farthest(p, facts) if by else 0.0,
    check=_check,
    examples=(
        {"formula": "ciede2000"},
        {"formula": "cie94"},
        {"formula": "cie76"},
        {"formula": "ciede2000", "source": "lab"},
        {"formula": "cie94", "source": "lab"},
    ),
    hard_cases=(
        HardCase(
            name="opposite hues",
            why="which way round the mean hue lies is decided by the last digit of a hue, and counts for half",
            inputs=_opposite,
            parameters={"source": "lab"},
            holds=_turned_as_defined,
        ),
        HardCase(
            name="nearly alike",
            why="of L*a*b* that differ little nothing but rounding may be left",
            inputs=_nearly_alike,
            parameters={},
            holds=_seen_and_small,
        ),
        HardCase(
            name="no overflow of the seventh power",
            why="C^7 leaves float32 at C = 3.2e5",
            inputs=lambda: {"image": _pair(50, 1e6, 0), "reference": _pair(50, 1e6, 0)},
            parameters={"source": "lab"},
            holds=_near(0),
        ),
        HardCase(
            name="published pairs",
            why="the blue region's turn, opposite hues, and grey, on which implementations differ",
            inputs=lambda: {
                "image": _pair(50, 2.6772, -79.7751, 50, -1.0, 2.0, 50, 2.5, 0, 50, 0, 0, np.nan, 0, 0),
                "reference": _pair(50, 0, -82.7485, 50, 0, 0, 73, 25, -18, 50, 0, 0, 50, 0, 0),
            },
            parameters={"source": "lab"},
            holds=_near(2.0425, 2.3669, 27.1492, 0, np.nan),
        ),
    ),
)


@difference.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The formulas, in float64."""
    return distances(inputs, p)


def _launched(device: Device, inputs: Inputs, p: Parameters, *, single: bool) -> Array:
    first, second = (aligned(inputs[name].pixels) for name in ("image", "reference"))
    height, width, channels = first.shape
    out = aligned_empty((height, width, 1))
    defines: dict[str, int | float | str] = {
        "FORMULA": p.formula.removeprefix("cie").removeprefix("de"),
        "LAB": int(p.source is Source.LAB),
        "SINGLE": int(single),
        "FIRST": channels,
        "SECOND": second.shape[2],
    }
    with device.session() as session:
        session.launch(
            "colour/difference.cl", "difference", (-(-height * width // 16),),
            first, second, session.write(out), aligned(TO_RATIO.reshape(-1), np.float64), np.int32(height * width),
            defines=defines,
        )  # fmt: skip
    return out


@difference.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels,
    rates={"opencl": Rate(3e-4, 3e-8), "numpy": Rate(2e-4, 4.2e-7)},
)
class Exact:
    """The formulas in double precision, eight pixels at a time, rounded once; on the host where a device has none."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, parameters, knob)
        return _launched(device, inputs, parameters, single=False)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            return aligned(distances(inputs, parameters), np.float32)


@difference.method(
    "single",
    error=_single_error,
    work=lambda p, knob, facts: facts["image"].pixels,
    rates={"opencl": Rate(3e-4, 1e-8), "numpy": Rate(2e-4, 4.2e-7)},
)
class Single:
    """The formulas in float32; in doubles where hues are opposite and rounding could turn the mean hue about."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, parameters, knob)
        return _launched(device, inputs, parameters, single=True)

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return Exact.numpy(inputs, parameters, knob)
