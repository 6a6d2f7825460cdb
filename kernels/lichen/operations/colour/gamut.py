"""Gamut: what lies outside a gamut, and bringing it inside.

The picture is scene-linear light of the primaries `source`; the gamut is that of the primaries `target`: colours whose
linear RGB there has no negative value, and none above `peak` where it is given. Colours are taken there by a matrix
(white adapted by Bradford) and back.

* clip: each value is held to 0 and to `peak`. What is inside stays; hue and detail outside are lost.
* compress: the Academy's reference gamut compression. With top the largest of a pixel's values, a channel lies
  d = (top - x) / |top| below it; d stays up to `threshold` and is drawn together above it so that `limit` lands on 1,
  the gamut's wall: f(d) = t + (d - t) / (1 + ((d - t) / s)^p)^(1/p), with s such that f(limit) = 1. Then
  x' = top - f(d) |top|. Thresholds and limits are those of cyan, magenta and yellow, for the distances of red, green
  and blue. Colours up to `threshold` stay as they are. It is the same at every exposure.
* expand: the inverse of compress, of distances that come from up to 4; beyond it the tangent goes on, since the curve
  has a pole there.
* report: 1 where a pixel is outside, in one channel.

Every action reports as findings which share of the picture is outside, by which channel, and how far the farthest
colour is: `distance` is the largest d, above 1 outside.

Numbers: d overflows next to black, so f is written as t + s (1 + u^-p)^(-1/p) where u = (d - t) / s is large, and the
tangent needs no quotient. A NaN makes its pixel NaN. There is no trade of accuracy for time in either.

Source: Academy Color Encoding System, Reference Gamut Compression specification S-2020-001, 2021.
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.colour.gamut_cases import CASES
from lichen.operations.colour.gamut_outside import outside, told, worthwhile
from lichen.operations.colour.primaries import Primaries, between
from lichen.processors import each

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from lichen.opencl.device import Device

Threshold = Annotated[float, Field(ge=0, le=0.99)]
Limit = Annotated[float, Field(ge=1.001, le=4)]
FARTHEST = 4.0
"""The distance up to which expand undoes compress."""
FLOAT_MAX = float(np.finfo(np.float32).max)
BLOCK = 1 << 14


class Action(StrEnum):
    """What is done with colours outside the gamut."""

    CLIP = "clip"
    COMPRESS = "compress"
    EXPAND = "expand"
    REPORT = "report"


class Parameters(OperationParameters):
    action: Action = Action.COMPRESS
    """what is done with colours outside"""
    target: Primaries = Primaries.BT709
    """the gamut, by its primaries"""
    source: Primaries = Primaries.BT709
    """the primaries of the picture's linear light"""
    peak: float | None = Field(None, gt=0, le=1e6)
    """light above it is outside too, for clip and report; none is unless given"""
    threshold: tuple[Threshold, Threshold, Threshold] = (0.815, 0.803, 0.88)
    """distances of red, green and blue up to which colours stay, for compress and expand"""
    limit: tuple[Limit, Limit, Limit] = (1.147, 1.264, 1.312)
    """distances that land on the gamut's wall"""
    power: float = Field(1.2, ge=1, le=5)
    """how sharply the curve bends: 1 is softest"""

    @property
    def moves(self) -> bool:
        return self.action in (Action.COMPRESS, Action.EXPAND)

    @property
    def scales(self) -> tuple[float, ...]:
        """s of each channel, with which the limit lands on 1."""
        p = self.power
        return tuple(
            (m - t) / (((1 - t) / (m - t)) ** -p - 1) ** (1 / p)
            for t, m in zip(self.threshold, self.limit, strict=True)
        )


def compressed(d: Array, t: float, s: float, p: float) -> Array:
    """f(d), in the precision of d."""
    kind = d.dtype.type
    u = (d - kind(t)) / kind(s)
    large = u > 1
    w = np.maximum(np.where(large, 1 / np.where(large, u, 1), u), 0)
    root = np.power(1 + np.power(w, kind(p)), kind(-1 / p))
    y: Array = np.where(u > 0, root * np.where(large, kind(1), w) * kind(s) + kind(t), d)
    return y


def expanded(d: Array, t: float, s: float, p: float) -> Array:
    """The inverse of f, for d below its pole."""
    kind = d.dtype.type
    w = np.maximum((d - kind(t)) / kind(s), 0)
    y: Array = np.where(d > t, w * np.power(1 - np.power(w, kind(p)), kind(-1 / p)) * kind(s) + kind(t), d)
    return y


@lru_cache(maxsize=64)
def _ends(p: Parameters) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Where expand's tangents start, and their slopes."""
    lasts, slopes = [], []
    for t, s in zip(p.threshold, p.scales, strict=True):
        u = (FARTHEST - t) / s
        lasts.append(float(compressed(np.array(FARTHEST), t, s, p.power)))
        slopes.append((1 + u**p.power) ** (1 + 1 / p.power))
    return tuple(lasts), tuple(slopes)


# ------------------------------------------------------------------------------------------------------ declaration


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, flaws = facts["image"], []
    if image.channels - (image.alpha is not Alpha.NONE) < 3:
        flaws.append(Flaw("/inputs/image", "must have 3 colour channels"))
    if p.peak is not None and p.moves:
        flaws.append(Flaw("/parameters/peak", f"applies to clip and report only (action={p.action})"))
    steepest = max(_ends(p)[1]) if p.action is Action.EXPAND else 0.0
    if steepest > 1e5:
        flaws.append(Flaw("/parameters/power", f"the inverse's slope would reach {steepest:.2g}, more than 1e5"))
    return flaws


def _gain(matrix: Array) -> float:
    return float(np.abs(matrix).sum(axis=1).max())


def _steepest(p: Parameters) -> float:
    """How much larger a change may become between the matrices: |f| and d f' are at most t + s."""
    far = max(t + s for t, s in zip(p.threshold, p.scales, strict=True))
    if p.action is Action.CLIP:
        return 1.0
    if p.action is Action.COMPRESS:
        return 3 + 2 * far
    return (3 + 2 * FARTHEST) * max(_ends(p)[1])


def _magnitude(p: Parameters, facts: Facts) -> float:
    """The largest value after the action, in the target's primaries."""
    far = _gain(between(p.source, p.target)[0]) * facts.extent.magnitude
    return min(far * (1.0 if p.action is Action.CLIP else _steepest(p)), FLOAT_MAX)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Roundings of the action relative to the largest value, magnified by its steepness; matrices add theirs."""
    image = facts["image"]
    if p.action is Action.REPORT:
        return Error(0.0, "bound")
    there, back = between(p.source, p.target)
    far, made, turned = image.extent.magnitude, _magnitude(p, image), p.source is not p.target
    before = 5 * ROUNDING * _gain(there) * far if turned else 0.0
    if p.action is Action.CLIP:
        own = ROUNDING * min(p.peak or 0.0, made)  # of the peak itself
    else:
        own = 24 * ROUNDING * _gain(there) * far * _steepest(p)
    after = before * _steepest(p) + own
    value = _gain(back) * (after + 5 * ROUNDING * made) if turned else after
    value = min(value, FLOAT_MAX)
    return Error(value, "estimate", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if p.action is Action.REPORT:
        return Facts(image.height, image.width, 1, extent=Extent(0.0, 1.0, 0))
    far = _gain(between(p.source, p.target)[1]) * _magnitude(p, image) + _error(p, 0.0, facts).value
    far = max(far, image.extent.magnitude)
    low = 0.0 if p.action is Action.CLIP and p.source is p.target and image.channels == 3 else -far
    overflow = far >= FLOAT_MAX or image.extent.nonfinite
    extent = Extent(max(low, -FLOAT_MAX), min(far, FLOAT_MAX), image.samples if overflow else 0)
    return dataclasses.replace(image, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    if p.action is Action.REPORT:
        return float(error > 0)
    there, back = between(p.source, p.target)
    whole = max(_gain(back) * _steepest(p) * _gain(there), 1.0)
    image = facts["image"]
    if image.alpha is Alpha.NONE:
        return min(whole * error, FLOAT_MAX)
    far = image.extent.magnitude
    return min(whole * (1 + far) * error + _result(p, facts).extent.magnitude * error, FLOAT_MAX)


gamut = Operation(
    name="gamut",
    family="colour",
    summary="Clips or compresses colours into a gamut, expands them again, or reports what lies outside.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after the third pass unchanged", channels=(3, None)),),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"action": "compress"},
        {"action": "clip", "source": "bt2020"},
        {"action": "report", "source": "p3_d65", "peak": 1.0},
        {"action": "expand", "source": "ap1", "target": "ap1"},
    ),
    hard_cases=CASES,
)

# ------------------------------------------------------------------------------------------------------------ bodies


def _turned(x: Array, matrix: Array) -> Array:
    """Every pixel's first three channels times a matrix."""
    return np.stack(_planes_turned([x[..., c] for c in range(3)], matrix.astype(x.dtype)), axis=-1)


def _planes_turned(planes: Sequence[Array], m: Array) -> list[Array]:
    """Term by term: the same in truth and in the report."""
    r, g, b = planes
    return [(r * row[0] + g * row[1]) + b * row[2] for row in m]


def _acted(x: Array, p: Parameters) -> Array:
    """The action on linear RGB of the target, in the precision of x."""
    if p.action is Action.CLIP:
        held = np.where(x < 0, x.dtype.type(0), x)
        return held if p.peak is None else np.where(held > p.peak, x.dtype.type(p.peak), held)
    top = np.max(x, axis=-1)
    size = np.abs(top)
    lasts, slopes = _ends(p)
    made = np.empty_like(x)
    for c, (t, s) in enumerate(zip(p.threshold, p.scales, strict=True)):
        below = top - x[..., c]
        d = below / np.where(size == 0, x.dtype.type(1), size)
        if p.action is Action.COMPRESS:
            y = np.where(size == 0, top, top - compressed(d, t, s, p.power) * size)
        else:
            last, slope = x.dtype.type(lasts[c]), x.dtype.type(slopes[c])
            beyond = (top - size * x.dtype.type(FARTHEST)) - slope * (below - size * last)
            y = np.where((d > last) | (size == 0), beyond, top - expanded(d, t, s, p.power) * size)
        made[..., c] = np.where(np.isnan(below), below, y)
    return made


def _planes(block: Array, p: Parameters) -> list[Array]:
    """Red, green and blue of the target, float64, of pixels with those of the source."""
    planes = list(np.array(block[:, :3].T, np.float64, order="C"))
    return planes if p.source is p.target else _planes_turned(planes, between(p.source, p.target)[0])


def _outside(planes: Sequence[Array], p: Parameters) -> list[Array]:
    """By channel. NaN is outside nothing."""
    return [y < 0 if p.peak is None else (y < 0) | (y > p.peak) for y in planes]


def evaluate(image: Image, p: Parameters, dtype: type[np.floating]) -> Array:
    """The definition in `dtype`, in blocks; the report always in float64, so that every method draws the same line."""
    flat = image.pixels.reshape(-1, image.channels)
    there, back = between(p.source, p.target)
    channels = 1 if p.action is Action.REPORT else image.channels
    out = aligned_empty((image.height, image.width, channels), dtype)
    made = out.reshape(-1, channels)
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), BLOCK):
            block, into = flat[start : start + BLOCK], made[start : start + BLOCK]
            if p.action is Action.REPORT:
                into[:, 0] = np.logical_or.reduce(_outside(_planes(block, p), p))
                continue
            x = block[:, :3].astype(dtype)
            if p.source is p.target:
                into[:, :3] = _acted(x, p)
            else:
                into[:, :3] = _turned(_acted(_turned(x, there), p), back)
            into[:, 3:] = block[:, 3:]
    return out


@gamut.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return evaluate(inputs["image"], p, np.float64)


@gamut.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """Of the picture as it came: shares of its pixels. In blocks of planes, which stay in cache."""
    image = inputs["image"]
    flat = image.pixels.reshape(-1, image.channels)
    found = each(lambda start: _found(flat[start : start + BLOCK], p), range(0, len(flat), BLOCK))
    counts = np.sum([count for count, _ in found], axis=0)
    return told(counts, len(flat), max(distance for _, distance in found))


def _find_on(device: Device, inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    if not worthwhile(device, inputs["image"]):
        return findings(inputs, p, pixels)
    return _looked_at(device, inputs["image"], p, shown=False)[1]


def _looked_at(device: Device, image: Image, p: Parameters, *, shown: bool) -> tuple[Array | None, Mapping[str, Any]]:
    there = None if p.source is p.target else between(p.source, p.target)[0]
    return outside(device, image, there, p.peak, shown=shown)


gamut.find_on = _find_on


def _found(block: Array, p: Parameters) -> tuple[list[int], float]:
    """How many pixels are outside by each channel and by any, and the largest distance; below 0 where none is known."""
    with np.errstate(all="ignore"):
        planes = _planes(block, p)
        outside = _outside(planes, p)
        top, low = np.maximum.reduce(planes), np.minimum.reduce(planes)
        distance = np.where(top != 0, (top - low) / np.abs(top), 0.0)
    counts = [int(np.count_nonzero(where)) for where in (*outside, np.logical_or.reduce(outside))]
    return counts, float(np.max(distance, where=distance < np.inf, initial=-1.0))


def _launch(device: Device, image: Image, p: Parameters) -> Array:
    pixels = image.height * image.width
    source = aligned(image.pixels)
    out = aligned_empty(source.shape)
    there, back = between(p.source, p.target)
    lasts, slopes = _ends(p)
    numbers = [*there.reshape(-1), *back.reshape(-1), p.peak or 0.0, p.power, *lasts, *slopes, *p.threshold, *p.scales]
    defines: dict[str, int | float | str] = {
        "IN": image.channels, "OUT": image.channels, "READ": 3, "MADE": 3, "PEAKED": int(p.peak is not None),
        "ACTION": list(Action).index(p.action), "TURNED": int(p.source is not p.target),
    }  # fmt: skip
    with device.session() as session:
        session.sweep(
            "colour/gamut.cl", "gamut", -(-pixels // 16),
            source, session.write(out), aligned(np.array(numbers, np.float32)), np.int32(pixels),
            defines=defines,
        )  # fmt: skip
    return out


def _reported(
    device: Device, inputs: Inputs, p: Parameters, knob: float = 0.0
) -> tuple[Array, Mapping[str, Any]] | None:
    """The report and the findings, for which pixels are looked at alike; None where there is none to make so."""
    if p.action is not Action.REPORT or not worthwhile(device, inputs["image"]):
        return None
    made, findings = _looked_at(device, inputs["image"], p, shown=True)
    return None if made is None else (made, findings)


@gamut.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels * (8.0 if p.moves else 1.0),
    rates={"opencl": Rate(3e-4, 1.2e-9), "numpy": Rate(1e-4, 3e-8)},
    finding=_reported,
)
class Exact:
    """The action in float32, sixteen pixels at a time; the report in float64."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if parameters.action is not Action.REPORT:
            return _launch(device, image, parameters)
        both = _reported(device, inputs, parameters)
        return Exact.numpy(inputs, parameters, knob) if both is None else both[0]

    @staticmethod
    def numpy(inputs: Inputs, parameters: Parameters, knob: float) -> Array:
        return evaluate(inputs["image"], parameters, np.float32)
