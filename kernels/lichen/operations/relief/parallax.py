"""Parallax: a picture of a flat surface, moved as its relief would be seen from aside.

Heights h run from 0 to 1, `scale` px high; what lies outside counts as the nearer end. `view` points to the viewer, x
to the right, y up, z out of the surface; (s, t) = (x, -y) / |view| x scale is how far a point of height 1 moves in the
picture, over its cosine z / |view| if need be. Parts of the height `reference` stay where they are. Truth, by `mode`:

    limited   the picture at p + (h(p) - reference) (s, t)                no cosine: never far, and wrong when grazing
    divided   the picture at p + (h(p) - reference) (s, t) / cosine       right where the relief is even march     the
    picture at p + (z - reference) (s, t) / cosine          z: where the ray to the viewer leaves the relief

For z, the ray is followed from height 1 down in 256 levels to the first at which the relief reaches it, h >= z, and
taken between that level and the one above by the straight line between their h - z. So what is in front hides what is
behind. Pictures and heights are linear between pixels. NaN met on the way makes the pixel NaN.

Methods: `shift` computes limited and divided parallax; `march` follows rays in `levels`. Where a ray grazes an edge,
any rounding decides between what is in front and behind, so no error less than the picture's range can be promised.

Sources: T. Kaneko et al., Detailed shape representation with parallax mapping, ICAT 2001; T. Welsh, Parallax mapping
with offset limiting, 2004; N. Tatarchuk, Dynamic parallax occlusion mapping, SIGGRAPH course 2006.
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    Border,
    Error,
    Facts,
    Footprint,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Pixels,
    Rate,
)
from lichen.operations.convolution.borders import OUTSIDE, continued

if TYPE_CHECKING:
    from collections.abc import Mapping

    from lichen.opencl.device import Device

LEVELS = 256
FARTHEST = 1024.0
"""px that anything moves at most."""
BORDERS = list(Border)


class Mode(StrEnum):
    """How a pixel's place is found."""

    LIMITED = "limited"
    DIVIDED = "divided"
    MARCH = "march"


class Parameters(OperationParameters):
    mode: Mode = Mode.MARCH
    """limited, divided or march"""
    view: tuple[float, float, float] = (0.5, 0.5, 1.0)
    """direction to the viewer: x to the right, y up, z out of the surface, which is above 0"""
    scale: Pixels = Field(8.0, ge=-1000, le=1000)
    """how high the height 1 is; for march not below 0"""
    reference: float = Field(0.0, ge=0, le=1)
    """the height that stays in place"""
    border: Border = Border.CLAMP
    """how picture and heights continue beyond their edges"""
    value: float = Field(0.0, ge=-1e6, le=1e6)
    """what lies beyond a constant border of the picture; heights are 0 there"""

    @property
    def slide(self) -> tuple[float, float]:
        """px to the right and down by which a height of 1 moves."""
        x, y, z = self.view
        over = self.scale / (z if self.mode is not Mode.LIMITED else math.hypot(x, y, z))
        return x * over, -y * over

    @property
    def reach(self) -> float:
        return math.hypot(*self.slide) * max(self.reference, 1 - self.reference)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, height = facts["image"], facts["height"]
    flaws = []
    if (image.width, image.height) != (height.width, height.height):
        given = f"is {height.width}x{height.height}; image is {image.width}x{image.height}"
        flaws.append(Flaw("/inputs/height", given))
    if not all(abs(each) <= 1e6 for each in p.view) or p.view[2] <= 1e-6:
        flaws.append(Flaw("/parameters/view", f"must be within 1e6 and point out of the surface (z is {p.view[2]:g})"))
    elif p.reach > FARTHEST:
        flaws.append(Flaw("/parameters/view", f"moves parts by {p.reach:g} px; {FARTHEST:g} is the most"))
    if p.mode is Mode.MARCH and p.scale < 0:
        flaws.append(Flaw("/parameters/scale", f"must not be below 0 to march (got {p.scale:g})"))
    return flaws


def _sized(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Range of what is mixed."""
    low, high = facts["image"].extent.low, facts["image"].extent.high
    return (min(low, p.value), max(high, p.value)) if p.border is Border.CONSTANT else (low, high)


def _moved(p: Parameters, facts: InputFacts) -> float:
    """Weights are off by the roundings of the way, and of their own; the sum by some of its largest value."""
    low, high = _sized(p, facts)
    return ROUNDING * ((6 * p.reach + 6) * 2 * (high - low) + 8 * max(abs(low), abs(high)))


def _shift_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = min(_moved(p, facts), float(np.finfo(np.float32).max))
    return Error(value, "bound", value)


def _march_error(p: Parameters, levels: float, facts: InputFacts) -> Error:
    low, high = _sized(p, facts)
    rounding = min(_moved(p, facts), float(np.finfo(np.float32).max))
    value = min(high - low + rounding, float(np.finfo(np.float32).max))
    if levels >= LEVELS:
        return Error(value, "bound", value, rounding)
    return Error(value, "bound", rounding, (high - low) * min(1.0, 0.005 * p.reach / levels))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    low, high = _sized(p, facts)
    slack = 8 * ROUNDING * max(abs(low), abs(high))
    image = facts["image"]
    spoilt = image.samples if image.extent.nonfinite or facts["height"].extent.nonfinite else 0
    return dataclasses.replace(image, extent=Extent(low - slack, high + slack, spoilt))


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    across, down = (math.ceil(abs(each)) + 2 for each in p.slide)
    return Footprint(down, across, wraps=p.border is Border.WRAP)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    flat = p.slide == (0.0, 0.0) and not facts["height"].extent.nonfinite
    return "nothing moves" if flat else None


def _box() -> Mapping[str, Any]:
    """A box on a floor, whose picture is its own column numbers."""
    height = np.zeros((5, 40, 1), np.float32)
    height[:, 18:24] = 1
    columns = np.broadcast_to(np.arange(40, dtype=np.float32)[None, :, None], (5, 40, 1))
    return {"image": columns.copy(), "height": height}


def _hides(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Seen from the right by 45 degrees, six high: the box's top is where it stood less six, its side behind it."""
    row = pixels[2, :, 0]
    top = np.abs(row[12:17] - np.arange(18, 23)).max()
    floor = max(np.abs(row[:11] - np.arange(11)).max(), np.abs(row[25:] - np.arange(25, 40)).max())
    return None if max(top, floor) < 1e-3 else f"top off by {top:g}, floor by {floor:g}"


parallax = Operation(
    name="parallax",
    family="relief",
    summary="Moves a picture as its relief would be seen from aside: limited, divided, or by following rays.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture of the surface from straight above"),
        Input("height", "its heights, from 0 to 1", (1, 1), picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    identity=_identity,
    result=_result,
    check=_check,
    examples=(
        {"view": [0.6, 0.3, 1], "scale": 6},
        {"mode": "divided", "view": [-1, 0.5, 1], "scale": 9, "reference": 0.5, "border": "reflect"},
        {"mode": "limited", "view": [3, 0, 0.1], "scale": -12, "border": "constant", "value": 0.2},
    ),
    hard_cases=(
        HardCase(
            "a box hides what is behind it",
            "moving every pixel by its own height shows parts twice and tears others",
            _box,
            {"view": [1, 0, 1], "scale": 6},
            _hides,
        ),
        HardCase(
            "heights beyond their range, and none",
            "a shift without end reads outside; NaN chooses a texel",
            lambda: {
                "image": np.ones((3, 5, 2), np.float32),
                "height": np.array([[1e30, -1e30, np.inf, -np.inf, np.nan]] * 3, np.float32)[..., None],
            },
            {"mode": "divided", "view": [1, 1, 0.01], "scale": 5},
            lambda inputs, pixels: (
                None
                if np.array_equal(pixels[:, :4], np.ones((3, 4, 2))) and np.isnan(pixels[:, 4]).all()
                else f"{pixels[0].tolist()}"
            ),
        ),
    ),
)


# ------------------------------------------------------------------------------------------------ truth and NumPy


def _taps(size: int, at: Array, way: Array, border: Border) -> tuple[Array, Array, Array]:
    """Of one axis: both neighbours' indices of the places `way` from the pixels `at`, and the share of the second."""
    whole = np.floor(way)
    first = at + np.where(np.isfinite(whole), whole, 0).astype(np.int64)
    return continued(first, size, border), continued(first + 1, size, border), way - whole


def _mixed(a: Array, b: Array, share: Array) -> Array:
    return np.asarray(np.where(share == 0, a, a + share * (b - a)))


def _sampled(
    pixels: Array, where: tuple[Array, Array], way: tuple[Array, Array], border: Border, value: float
) -> Array:
    """Linear between the pixels, of shape (n, channels), at `way` = (right, down) from those at rows and columns."""
    left, right, across = _taps(pixels.shape[1], where[1], way[0], border)
    top, bottom, down = _taps(pixels.shape[0], where[0], way[1], border)

    def corner(row: Array, column: Array) -> Array:
        outside = (row == OUTSIDE) | (column == OUTSIDE)
        return np.asarray(np.where(outside[:, None], pixels.dtype.type(value), pixels[row, column]))

    across, down = across[:, None], down[:, None]
    upper = _mixed(corner(top, left), corner(top, right), across)
    return _mixed(upper, _mixed(corner(bottom, left), corner(bottom, right), across), down)


def _levelled(heights: Array, p: Parameters, where: tuple[Array, Array], levels: int) -> Array:
    """z of every pixel of `where`, as the rays find it."""
    kind = heights.dtype.type
    across, down = (kind(each) for each in p.slide)
    count = len(where[0])
    found, above = np.full(count, kind(np.nan)), np.full(count, kind(-np.inf))
    going = np.arange(count)
    for level in range(levels + 1):
        z = kind(1 - level / levels)
        way = np.full(len(going), (z - kind(p.reference)) * across), np.full(len(going), (z - kind(p.reference)) * down)
        over = _sampled(heights, (where[0][going], where[1][going]), way, p.border, 0.0)[:, 0] - z
        hit = ~(over < 0)
        met = going[hit]
        part = over[hit] / (over[hit] - above[met]) if level else over[hit] * 0
        found[met] = z + part / levels
        above[going] = over
        going = going[~hit]
        if going.size == 0:
            break
    return found


def _seen(inputs: Inputs, p: Parameters, levels: int) -> Array:
    image: Image = inputs["image"]
    kind = image.pixels.dtype.type
    heights = np.clip(inputs["height"].pixels.astype(kind, copy=False), 0, 1)
    rows, columns = (each.ravel() for each in np.indices((image.height, image.width)))
    out = aligned_empty((rows.size, image.channels), kind)
    across, down = (kind(each) for each in p.slide)
    with np.errstate(all="ignore"):
        for start in range(0, rows.size, 1 << 14):
            where = rows[start : start + (1 << 14)], columns[start : start + (1 << 14)]
            z = _levelled(heights, p, where, levels) if p.mode is Mode.MARCH else heights[where][:, 0]
            way = (z - kind(p.reference)) * across, (z - kind(p.reference)) * down
            made = _sampled(image.pixels, where, way, p.border, p.value)
            out[start : start + (1 << 14)] = np.where(np.isnan(z)[:, None], kind(np.nan), made)
    return out.reshape(image.pixels.shape)


def _launch(device: Device, inputs: Inputs, p: Parameters, levels: int) -> Array:
    image = inputs["image"]
    out = aligned_empty(image.pixels.shape)
    across, down = p.slide
    with device.session() as session:
        session.launch(
            "relief/parallax.cl", "parallax", (-(-image.width // 64), image.height),
            aligned(image.pixels), aligned(inputs["height"].pixels), session.write(out), np.int32(image.width),
            np.int32(image.height), np.int32(image.channels), np.float32(across), np.float32(down),
            np.float32(p.reference), np.int32(levels), np.float32(p.value), local=(1, 1),
            defines={"BORDER": BORDERS.index(p.border)},
        )  # fmt: skip
    return out


@parallax.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _seen(inputs, p, LEVELS)


@parallax.method(
    "shift",
    error=_shift_error,
    work=lambda p, knob, facts: facts["image"].samples + 4.0 * facts["image"].pixels,
    rates={"opencl": Rate(3e-4, 3e-9), "numpy": Rate(1e-3, 6e-8)},
    unfit=lambda p, facts: "it does not follow rays" if p.mode is Mode.MARCH else None,
)
class Shift:
    """Every pixel from where its own height says."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launch(device, inputs, p, 0)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _seen(inputs, p, 0)


@parallax.method(
    "march",
    error=_march_error,
    work=lambda p, levels, facts: facts["image"].samples + facts["image"].pixels * (4.0 + 2.0 * levels),
    rates={"opencl": Rate(3e-4, 3e-9), "numpy": Rate(1e-3, 6e-8)},
    knob=Knob("levels", (8, 16, 32, 64, 128, LEVELS), "heights at which a ray looks at the relief", 2, LEVELS),
    unfit=lambda p, facts: None if p.mode is Mode.MARCH else f"{p.mode} parallax follows no rays",
)
class March:
    """Rays followed level by level, then by the straight line between the last two."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, levels: float) -> Array:
        return _launch(device, inputs, p, round(levels))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, levels: float) -> Array:
        return _seen(inputs, p, round(levels))
