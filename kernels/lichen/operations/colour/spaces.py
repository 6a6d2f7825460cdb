"""The colour spaces of `convert`, and the way from one to another.

Theory. Every space has a parent that it is defined by and steps to and from it; all ancestries end in XYZ for a white.
A conversion climbs from the source to the first ancestor it shares with the target, and descends. Where that is XYZ the
two may differ in their white, and an adaptation lies between. Neighbouring matrices are multiplied in float64.

    hsv hsl yiq ycbcr_601 ycbcr_709 cmy cmyk  ->  srgb  ->  linear_bt709  ->  xyz (D65)
    ycbcr_2020  ->  bt2020  ->  linear_bt2020  ->  xyz (D65)     bt2100_pq, display_p3, ...: through linear light
    oklch  ->  oklab  ->  xyz (D65)          lch  ->  lab  ->  xyz   xyy luv luminance luminance_scotopic  ->  xyz

Sources: IEC 61966-2-1; ITU-R BT.601-7, BT.709-6, BT.2020-2; SMPTE RP 431-2, EG 432-1; Adobe RGB (1998); SMPTE ST
2065-1; AMPAS S-2014-004; CIE 15:2004; SMPTE 170M (YIQ); B. Ottosson, A perceptual color space for image
processing, 2020; S. Pattanaik et al., A multiscale model of adaptation and spatial vision, SIGGRAPH 1998 (rods).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, lru_cache

import numpy as np

from lichen.memory import Array
from lichen.operations.colour import coordinates, stages
from lichen.operations.colour.primaries import Adaptation, Primaries, White, adapt, to_xyz
from lichen.operations.colour.stages import Linear, Scalar, Step


class Model(StrEnum):
    """A colour space: what the numbers of a pixel mean."""

    SRGB = "srgb"
    LINEAR_BT709 = "linear_bt709"
    BT2020 = "bt2020"
    LINEAR_BT2020 = "linear_bt2020"
    BT2100_PQ = "bt2100_pq"
    DISPLAY_P3 = "display_p3"
    LINEAR_P3 = "linear_p3"
    DCI_P3 = "dci_p3"
    LINEAR_DCI_P3 = "linear_dci_p3"
    ADOBE_RGB = "adobe_rgb"
    LINEAR_ADOBE_RGB = "linear_adobe_rgb"
    ACES2065_1 = "aces2065_1"
    ACESCG = "acescg"
    XYZ = "xyz"
    XYY = "xyy"
    LAB = "lab"
    LCH = "lch"
    LUV = "luv"
    OKLAB = "oklab"
    OKLCH = "oklch"
    HSV = "hsv"
    HSL = "hsl"
    YIQ = "yiq"
    YCBCR_601 = "ycbcr_601"
    YCBCR_601_NARROW = "ycbcr_601_narrow"
    YCBCR_709 = "ycbcr_709"
    YCBCR_709_NARROW = "ycbcr_709_narrow"
    YCBCR_2020 = "ycbcr_2020"
    YCBCR_2020_NARROW = "ycbcr_2020_narrow"
    CMY = "cmy"
    CMYK = "cmyk"
    LUMINANCE = "luminance"
    LUMINANCE_SCOTOPIC = "luminance_scotopic"

    @property
    def channels(self) -> int:
        return {Model.CMYK: 4, Model.LUMINANCE: 1, Model.LUMINANCE_SCOTOPIC: 1}.get(self, 3)

    @property
    def relative(self) -> bool:
        """Whether it is defined for any white."""
        relative = (Model.XYZ, Model.XYY, Model.LAB, Model.LCH, Model.LUV, Model.LUMINANCE, Model.LUMINANCE_SCOTOPIC)
        return self in relative

    @property
    def polar(self) -> bool:
        return self in (Model.LCH, Model.OKLCH, Model.HSV, Model.HSL)


LINEARS = {
    Model.LINEAR_BT709: Primaries.BT709,
    Model.LINEAR_BT2020: Primaries.BT2020,
    Model.LINEAR_P3: Primaries.P3_D65,
    Model.LINEAR_DCI_P3: Primaries.P3_DCI,
    Model.LINEAR_ADOBE_RGB: Primaries.ADOBE,
    Model.ACES2065_1: Primaries.AP0,
    Model.ACESCG: Primaries.AP1,
}
ENCODED: dict[Model, tuple[Model, Scalar, Scalar]] = {
    Model.SRGB: (Model.LINEAR_BT709, stages.SRGB_DECODE, stages.SRGB_ENCODE),
    Model.BT2020: (Model.LINEAR_BT2020, stages.BT2020_DECODE, stages.BT2020_ENCODE),
    Model.BT2100_PQ: (Model.LINEAR_BT2020, stages.PQ_DECODE, stages.PQ_ENCODE),
    Model.DISPLAY_P3: (Model.LINEAR_P3, stages.SRGB_DECODE, stages.SRGB_ENCODE),
    Model.DCI_P3: (Model.LINEAR_DCI_P3, stages.power(2.6), stages.power(1 / 2.6)),
    Model.ADOBE_RGB: (Model.LINEAR_ADOBE_RGB, stages.power(563 / 256), stages.power(256 / 563)),
}
LUMA = {601: (0.299, 0.114), 709: (0.2126, 0.0722), 2020: (0.2627, 0.0593)}
"""Shares of red and blue in luma, as the standards print them."""
RODS = np.array([-0.702, 1.039, 0.433])
"""Of X, Y and Z in what rods see, V': the linear regression of the CIE 1951 scotopic curve on the colour matching
functions. Of spectra, not of three numbers, rods make a little more of red."""


@dataclass(frozen=True, slots=True)
class Link:
    """A space, or XYZ for a white, and the steps to what it is defined by and back."""

    parent: Model
    up: tuple[Step, ...]
    down: tuple[Step, ...]


def _linear(matrix: Array, added: Sequence[float] | None = None) -> tuple[tuple[Step, ...], tuple[Step, ...]]:
    """Steps up and down, of the matrix that leads down."""
    down = Linear.of(matrix, added)
    return (down.inverse,), (down,)


def ycbcr(standard: int, narrow: bool) -> Linear:
    """From R'G'B'. Full range: Y in [0, 1], Cb and Cr in [-1/2, 1/2]. Narrow: the 8-bit codes 16 to 235, and 16 to 240
    about 128, over 255."""
    red, blue = LUMA[standard]
    luma = np.array([red, 1 - red - blue, blue])
    rows = np.stack([luma, ([0, 0, 1] - luma) / (2 - 2 * blue), ([1, 0, 0] - luma) / (2 - 2 * red)])
    if not narrow:
        return Linear.of(rows)
    return Linear.of(rows * np.array([[219], [224], [224]]) / 255, [16 / 255, 128 / 255, 128 / 255])


def yiq() -> Array:
    """From R'G'B'. Colour differences scaled for a composite signal's excursion and turned by 33 degrees."""
    luma = np.array([0.299, 0.587, 0.114])
    u, v = 0.492111 * ([0, 0, 1] - luma), 0.877283 * ([1, 0, 0] - luma)
    cos, sin = math.cos(math.radians(33)), math.sin(math.radians(33))
    return np.stack([luma, cos * v - sin * u, sin * v + cos * u])


@cache
def oklab() -> tuple[Array, Array]:
    """From XYZ (D65) to cone responses, and from their cube roots to Oklab.

    Printed for another white and rounded, they give D65's white a tint of 1e-4. The first is scaled so that white has
    responses of 1, and the second's rows are moved to sums of 1, 0 and 0: white and grey are achromatic exactly.
    """
    cones = np.array(
        [
            [0.8189330101, 0.3618667424, -0.1288597137],
            [0.0329845436, 0.9293118715, 0.0361456387],
            [0.0482003018, 0.2643662691, 0.6338517070],
        ]
    )
    rows = np.array(
        [
            [0.2104542553, 0.7936177850, -0.0040720468],
            [1.9779984951, -2.4285922050, 0.4505937099],
            [0.0259040371, 0.7827717662, -0.8086757660],
        ]
    )
    cones /= (cones @ White.D65.xyz)[:, np.newaxis]
    rows += (np.array([1, 0, 0]) - rows.sum(axis=1))[:, np.newaxis] / 3
    return cones, rows


def _link(model: Model, white: White) -> Link:
    """What a space is defined by; XYZ is the end."""
    if model in ENCODED:
        parent, decode, encode = ENCODED[model]
        return Link(parent, (decode,), (encode,))
    if model in LINEARS:
        up = Linear.of(to_xyz(LINEARS[model]))
        return Link(Model.XYZ, (up,), (up.inverse,))
    lab = np.array([[0, 116, 0], [500, -500, 0], [0, 200, -200]])
    match model:
        case Model.LAB:
            ends = _linear(lab, [-16, 0, 0])
            scale = Linear.of(np.diag(white.xyz))
            down: tuple[Step, ...] = (scale.inverse, stages.LIGHTNESS, *ends[1])
            return Link(Model.XYZ, (*ends[0], stages.LIGHTNESS_INVERSE, scale), down)
        case Model.OKLAB:
            cones, rows = (Linear.of(each) for each in oklab())
            return Link(Model.XYZ, (rows.inverse, stages.CUBE, cones.inverse), (cones, stages.CBRT, rows))
        case Model.LCH:
            return Link(Model.LAB, (coordinates.CARTESIAN,), (coordinates.polar(100.0),))
        case Model.OKLCH:
            return Link(Model.OKLAB, (coordinates.CARTESIAN,), (coordinates.polar(1.0, coordinates.DARK),))
        case Model.XYY:
            return Link(Model.XYZ, (coordinates.FROM_XYY,), (coordinates.xyy(white.xy),))
        case Model.LUV:
            return Link(Model.XYZ, (coordinates.from_luv(white.xyz),), (coordinates.luv(white.xyz),))
        case Model.LUMINANCE:
            return Link(Model.XYZ, (Linear.of(white.xyz[:, np.newaxis]),), (Linear.of(np.array([[0, 1, 0]])),))
        case Model.LUMINANCE_SCOTOPIC:
            rods = RODS / (RODS @ white.xyz)
            return Link(Model.XYZ, (Linear.of(white.xyz[:, np.newaxis]),), (Linear.of(rods[np.newaxis]),))
        case Model.HSV:
            return Link(Model.SRGB, (coordinates.FROM_HSV,), (coordinates.HSV,))
        case Model.HSL:
            return Link(Model.SRGB, (coordinates.FROM_HSL,), (coordinates.HSL,))
        case Model.CMYK:
            return Link(Model.SRGB, (coordinates.FROM_CMYK,), (coordinates.CMYK,))
        case Model.CMY:
            return Link(Model.SRGB, *_linear(-np.eye(3), [1, 1, 1]))
        case Model.YIQ:
            return Link(Model.SRGB, *_linear(yiq()))
    standard = int(model.value.split("_")[1])
    down_ = ycbcr(standard, model.value.endswith("narrow"))
    return Link(Model.BT2020 if standard == 2020 else Model.SRGB, (down_.inverse,), (down_,))


def _own_white(model: Model, white: White) -> White:
    """The white of the XYZ that a space leads to."""
    while model is not Model.XYZ and not model.relative:
        if model in LINEARS:
            return LINEARS[model].white
        if model in (Model.OKLAB, Model.OKLCH):
            return White.D65
        model = _link(model, white).parent
    return white


@lru_cache(maxsize=256)
def path(source: Model, target: Model, white: White, adaptation: Adaptation) -> tuple[Step, ...]:
    """The steps from one space to another, as few as there are."""
    climbs: list[tuple[Model, tuple[Step, ...]]] = [(source, ())]
    while climbs[-1][0] is not Model.XYZ:
        link = _link(climbs[-1][0], white)
        climbs.append((link.parent, climbs[-1][1] + link.up))
    falls: tuple[Step, ...] = ()
    here = target
    whites = _own_white(source, white), _own_white(target, white)
    climbed = dict(climbs)
    while here is not Model.XYZ and here not in climbed:
        link = _link(here, white)
        here, falls = link.parent, link.down + falls
    between: tuple[Step, ...] = ()
    if here is Model.XYZ:
        between = (Linear.of(adapt(*whites, adaptation)),)
    return stages.merged((*climbed[here], *between, *falls))
