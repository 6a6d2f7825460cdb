"""Colour map: a scalar shown by the colours of a palette, with contours if wanted.

Truth, for a value v, one channel of the image:

    t = (v - low) / (high - low), brought into [0, 1] by `beyond`: clamped, repeated, or mirrored
    colour between the two entries of the palette around t (n - 1), or, in bands, entry floor(t n)

The scalar is what is interpolated, resized and filtered, and colour comes last: colours between two entries of a
palette are not colours of the palette. The palette is the first row of an input, or one of `maps`: tables of 256 sRGB
colours as OpenCV has them, of which viridis, plasma, inferno, magma and cividis rise evenly in lightness and cividis
is meant for all kinds of colour vision; twilight meets its own end. `low` and `high` are the image's extremes unless
given.

Contours are lines at offset + k spacing, `line_width` pixels wide however steep the values: with g the length of the
gradient (central differences; one-sided at the edge) and d the distance of v to the nearest of those values, the line
covers min(max(line_width / 2 + 1/2 - d / g, 0), 1) of the pixel. Where nothing rises there is no line, so plateaus are
not flooded. A NaN stays NaN, and lines beside it end.

Places in bands are computed in doubles by the definition as by the method, so that no pixel falls into another one;
between colours, where the palette ends at `low` and `high`, in pairs of floats.

Sources: M. Teschner and C. Henn, Texture mapping in technical, scientific and engineering visualization, SGI 1993,
section 3; N. Smith and S. van der Walt, A better default colormap for Matplotlib, SciPy 2015.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
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
    halo,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)
Edge = Annotated[float, Field(ge=-1e30, le=1e30)]


class Map(StrEnum):
    """Palettes by name."""

    VIRIDIS = "viridis"
    PLASMA = "plasma"
    INFERNO = "inferno"
    MAGMA = "magma"
    CIVIDIS = "cividis"
    TURBO = "turbo"
    TWILIGHT = "twilight"


class Beyond(StrEnum):
    """What the palette is beyond its ends."""

    CLAMP = "clamp"
    REPEAT = "repeat"
    MIRROR = "mirror"


class Parameters(OperationParameters):
    map: Map = Map.VIRIDIS
    """the palette, unless it is an input"""
    low: Edge | None = None
    """the value shown by the palette's first colour; the least there is unless given"""
    high: Edge | None = None
    """the value shown by its last colour; the largest there is unless given; below low turns the palette round"""
    beyond: Beyond = Beyond.CLAMP
    """beyond low and high: the end's colour, the palette again, or turned back"""
    bands: bool = False
    """whether each colour is shown as it is, in bands, instead of colours between them"""
    channel: int = Field(0, ge=0, le=63)
    """the channel of the image that is shown, from 0"""
    spacing: float | None = Field(None, gt=0, le=1e30)
    """difference of value between contours; none are drawn unless given"""
    offset: Edge = 0.0
    """the value of one of the contours"""
    line_width: float = Field(1.0, gt=0, le=64, json_schema_extra={"unit": "px"})
    """width of contours"""
    line: Annotated[tuple[Annotated[float, Field(ge=-1e6, le=1e6)], ...], Field(min_length=1, max_length=8)] = (0.0,)
    """colour of contours: one number, or one for each channel of the palette"""

    def ends(self, extent: Extent) -> tuple[float, float]:
        return (extent.low if self.low is None else self.low), (extent.high if self.high is None else self.high)


@cache
def table(name: Map) -> Array:
    """A named palette, float32 (256, 3), sRGB."""
    import cv2

    ramp = np.arange(256, dtype=np.uint8).reshape(1, 256)
    mapped = cv2.applyColorMap(ramp, getattr(cv2, f"COLORMAP_{name.upper()}"))[0, :, ::-1]
    made = aligned(mapped.astype(np.float32) / np.float32(255))
    made.flags.writeable = False
    return made


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = []
    channels = facts["palette"].channels if "palette" in facts else 3
    if p.channel >= facts["image"].channels:
        flaws.append(Flaw("/parameters/channel", f"is {p.channel}; the image has {facts['image'].channels}, from 0"))
    low, high = p.ends(facts["image"].extent)
    if low == high and p.low is not None and p.high is not None:
        flaws.append(Flaw("/parameters/high", "must differ from low"))
    if len(p.line) not in (1, channels):
        flaws.append(Flaw("/parameters/line", f"has {len(p.line)} numbers; the palette has {channels} channels"))
    return flaws


def _ends(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    low, high = (facts["palette"].extent.low, facts["palette"].extent.high) if "palette" in facts else (0.0, 1.0)
    return (min(low, *p.line), max(high, *p.line)) if p.spacing is not None else (low, high)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Roundings of the colour and, times what two entries differ by, of its place between them and of that."""
    low, high = _ends(p, facts)
    value = 1.01 * ROUNDING * (max(abs(low), abs(high)) + 2 * (high - low))
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, palette = facts["image"], facts.get("palette")
    (low, high), slack = _ends(p, facts), _error(p, 0.0, facts).value
    channels = palette.channels if palette else 3
    spoilt = image.extent.nonfinite or (palette is not None and palette.extent.nonfinite)
    extent = Extent(
        max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX), image.pixels * channels if spoilt else 0
    )
    space, alpha = (palette.space, palette.alpha) if palette else (Space.SRGB, Alpha.NONE)
    return Facts(image.height, image.width, channels, space, alpha, extent)


def _levels() -> Mapping[str, Any]:
    return {"image": np.array([[[-np.inf], [0.0], [0.5], [1.0], [np.inf], [np.nan]]], np.float32), "palette": _GREYS}


_GREYS = np.linspace(0, 1, 3, dtype=np.float32).reshape(1, 3, 1)


def _shown(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got, expected = pixels.reshape(-1), [0, 0, 0.5, 1, 1, np.nan]
    return None if np.allclose(got, expected, equal_nan=True) else f"expected {expected}, got {got.tolist()}"


def _plateau() -> Mapping[str, Any]:
    values = np.repeat(np.array([1.0, 1.0, 1.0, 1.0, 1.5, 2.5, 3.0, 3.0, 3.0], np.float32)[None, :], 5, 0)
    return {"image": values[..., None], "palette": np.ones((1, 2, 1), np.float32)}


def _not_flooded(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels[2, :, 0]
    fine = got[0] == got[1] == got[-1] == 1 and got.min() < 0.9
    return None if fine else f"got {got.tolist()}"


colour_map = Operation(
    name="colour_map",
    family="lookup",
    summary="Shows a scalar by the colours of a palette, with contours.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "values, as they are stored", picture=False),
        Input("palette", "colours in its first row, in place of a named map", required=False),
    ),
    light=Light.STORED,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE if p.spacing is None else halo(1),
    result=_result,
    propagate=lambda p, facts, error: _ends(p, facts)[1] - _ends(p, facts)[0] if error else 0.0,
    implied=lambda p, facts: (
        "the range shown is that of the whole image"
        if p.low is None or p.high is None
        else "a palette does not lie beside the pixels it is for"
        if "palette" in facts
        else {}
    ),
    check=_check,
    examples=(
        {"low": 0, "high": 1},
        {"map": "twilight", "beyond": "repeat", "low": -0.3, "high": 0.4},
        {"map": "cividis", "spacing": 0.25, "line": [1.0, 1.0, 1.0], "line_width": 1.5},
        {"map": "magma", "beyond": "mirror", "bands": True, "low": 0.7, "high": 0.2},
    ),
    hard_cases=(
        HardCase(
            name="infinite values and NaN",
            why="as an integer they are any entry, and NaN must be no colour",
            inputs=_levels,
            parameters={"low": 0, "high": 1},
            holds=_shown,
        ),
        HardCase(
            name="a plateau at a contour's value",
            why="its distance over its slope is 0 / 0, and a line by value floods it",
            inputs=_plateau,
            parameters={"spacing": 1},
            holds=_not_flooded,
        ),
    ),
)


def _slopes(v: Array, axis: int) -> Array:
    """Central differences, one-sided at the ends; 0 along an axis of one pixel."""
    size = v.shape[axis]
    before, after = np.maximum(np.arange(size) - 1, 0), np.minimum(np.arange(size) + 1, size - 1)
    shape = [1, 1]
    shape[axis] = size
    apart = np.maximum(after - before, 1).reshape(shape)
    made: Array = (np.take(v, after, axis) - np.take(v, before, axis)) / apart
    return made


def _mapped(inputs: Inputs, p: Parameters) -> Array:
    """The definition, in doubles."""
    image = inputs["image"]
    palette = (inputs["palette"].pixels[0] if "palette" in inputs else table(p.map)).astype(np.float64)
    v, (low, high) = image.pixels[..., p.channel].astype(np.float64), p.ends(image.extent)
    entries = len(palette)
    with np.errstate(all="ignore"):
        t = (v - low) / _range(low, high)
        if p.beyond is Beyond.CLAMP:
            t = np.clip(t, 0, 1)
        elif p.beyond is Beyond.REPEAT:
            t = t - np.floor(t)
        else:
            t = t - 2 * np.floor(t * 0.5)
            t = np.where(t > 1, 2 - t, t)
        place = np.where(np.isnan(t), 0, t) * (entries if p.bands else entries - 1)
        cell = np.clip(place.astype(np.int64), 0, max(entries - (1 if p.bands else 2), 0))
        part = np.zeros_like(place) if p.bands else place - cell
        here, after = palette[cell], palette[np.minimum(cell + 1, entries - 1)]
        colour = here + part[..., None] * (after - here)
        if p.spacing is not None:
            dx, dy = _slopes(v, 1), _slopes(v, 0)
            steep, u = np.sqrt(dx * dx + dy * dy), (v - p.offset) / p.spacing
            off = np.abs(u - np.rint(u)) * p.spacing
            cover = np.clip(p.line_width * 0.5 + 0.5 - off / steep, 0, 1)
            cover = np.where((steep > 0) & (steep < np.inf), cover, 0)[..., None]
            colour = colour + cover * (np.array(p.line) - colour)
    colour[np.isnan(t)] = np.nan
    return colour


def _range(low: float, high: float) -> float:
    """What values are divided by: 1 where all of them are alike."""
    return high - low if high != low else 1.0


def _in_pairs(palette: Array) -> Array:
    """Each entry and how far the one after it is from it, side by side as vectors of four; beyond both ends it goes on
    as it ends."""
    wide = np.pad(palette, ((1, 1), (0, 4 - palette.shape[1])), mode="edge")
    with np.errstate(all="ignore"):
        return aligned(np.concatenate([wide[:-1], wide[1:] - wide[:-1]], axis=1))


def _scaled(low: float, span: float, steps: int) -> list[float] | None:
    """By what places of so many steps are found in pairs of floats: the least and the largest value that counts, then
    `low` and the steps of 1, each with what a float leaves of it. None where `low` lies far out, beside what a float
    resolves there, or the steps do."""
    if not 1e-25 < abs(span) < 1e25 or abs(low) * max(steps, 1) > 2**20 * abs(span):
        return None
    slack = 0.5 * abs(span) / max(steps, 1)
    parts = [(float(np.float32(each)), each - float(np.float32(each))) for each in (low, steps / span)]
    return [min(low, low + span) - slack, max(low, low + span) + slack, *parts[0], *parts[1]]


@colour_map.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _mapped(inputs, p)


@colour_map.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels * (2.0 if p.spacing is not None else 1.0),
    rates={"opencl": Rate(3e-4, 8e-9), "numpy": Rate(2e-4, 1.6e-7)},
)
class Exact:
    """Places in doubles or pairs of floats, colours under lines in doubles; on a device without those, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        image = inputs["image"]
        palette = aligned(inputs["palette"].pixels[0]) if "palette" in inputs else table(p.map)
        entries, made = palette.shape
        if made <= 4:
            palette = _in_pairs(palette)
        low, high = p.ends(image.extent)
        line, span = np.resize(np.array(p.line), made), _range(low, high)
        plain = p.beyond is Beyond.CLAMP and not p.bands and p.spacing is None and made <= 4
        scaled = _scaled(low, span, entries - 1) if plain else None
        numbers = np.array([low, span, p.spacing or 1.0, p.offset, p.line_width, *(scaled or [0.0] * 6), *line])
        out = aligned_empty((image.height, image.width, made))
        defines: dict[str, int | float | str] = {
            "WRAP": list(Beyond).index(p.beyond), "BANDS": int(p.bands), "CONTOURS": int(p.spacing is not None),
            "PAIRS": 0 if scaled is None else 1 if low else 2, "MADE": made,
        }  # fmt: skip
        with device.session() as session:
            session.launch(
                "lookup/colour_map.cl", "map", (-(-image.width // 64), image.height),
                aligned(image.pixels), palette, session.write(out), aligned(numbers, np.float64), np.int32(entries),
                np.int32(image.channels), np.int32(p.channel), np.int32(image.width), np.int32(image.height),
                local=(1, 16), defines=defines,
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_mapped(inputs, p).astype(np.float32))
