"""Normals: decodes, encodes, turns, renormalises and blends normal maps.

Truth, for stored components c of `image`, and of `detail` where there is such an input:

    n = c, or 2 c - 1 where `source` is unit; y turned round where `source_convention` is directx
    n = n / |n|                                         where `renormalise` is set, or there is a detail
    n = blend(n, detail)                                where there is a detail
    result = n, or (n + 1) / 2 where `target` is unit; y turned round where `target_convention` is directx

A detail m has its slopes multiplied by `amount` first: m = (amount mx, amount my, mz) / its length. Then, before the
length is taken again,

    linear      n + m                                    flattens both
    partial     (nx mz + mx nz, ny mz + my nz, nz mz)    adds the slopes: right for heights that are added
    whiteout    (nx + mx, ny + my, nz mz)
    udn         (nx + mx, ny + my, nz)                   flattens the detail on slopes
    reoriented  t <t, u> - u tz, t = n + (0, 0, 1), u = (-mx, -my, mz): m turned as (0, 0, 1) is turned into n

A vector of no length has no direction: it stays (0, 0, 0), which `unit` stores as grey. Where two normals cancel, or n
points straight away, any rounding decides the direction of what is left, so the error stated for blends is the range.

The only method does what is asked to rounding: there is no trade.

Source: C. Barre-Brisebois and S. Hill, Blending in detail, 2012.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

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
)
from lichen.operations.relief.directions import Convention, Encoding, decoded, encoded, unit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from lichen.opencl.device import Device


class Blend(StrEnum):
    """How a detail lies on a surface."""

    LINEAR = "linear"
    PARTIAL = "partial"
    WHITEOUT = "whiteout"
    UDN = "udn"
    REORIENTED = "reoriented"


class Parameters(OperationParameters):
    source: Encoding = Encoding.UNIT
    """how the inputs' components are stored: unit, 0 to 1, or signed"""
    target: Encoding = Encoding.SIGNED
    """how those of the result are"""
    source_convention: Convention = Convention.OPENGL
    """which way y points in the inputs: opengl, up, or directx, down"""
    target_convention: Convention = Convention.OPENGL
    """which way it points in the result"""
    renormalise: bool = True
    """whether lengths are brought to 1; what is blended always is"""
    blend: Blend = Blend.REORIENTED
    """how the input detail is laid on"""
    amount: float = Field(1.0, ge=-100, le=100)
    """factor on the detail's slopes"""

    @property
    def turned(self) -> tuple[bool, bool]:
        """Whether y is turned round before and after."""
        return (
            self.source_convention is Convention.DIRECTX,
            self.target_convention is Convention.DIRECTX,
        )


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, detail = facts["image"], facts.get("detail", facts["image"])
    if (image.height, image.width) != (detail.height, detail.width):
        return [Flaw("/inputs/detail", f"is {detail.width}x{detail.height}; image is {image.width}x{image.height}")]
    return []


def _largest(p: Parameters, facts: InputFacts) -> float:
    if p.renormalise or "detail" in facts:
        return 1.0
    size = facts["image"].extent.magnitude
    return 2 * size + 1 if p.source is Encoding.UNIT else size


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    half = 0.5 if p.target is Encoding.UNIT else 1.0
    if "detail" in facts:
        value = half * (2.0 + 16 * ROUNDING)
        return Error(value, "bound", value, 32 * ROUNDING)
    value = min(half * 8 * ROUNDING * max(_largest(p, facts), 1.0), float(np.finfo(np.float32).max))
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    most = min(_largest(p, facts) * (1 + 16 * ROUNDING), float(np.finfo(np.float32).max) / 2)
    spoilt = image.pixels * 3 if any(each.extent.nonfinite for each in facts.values()) else 0
    spoilt = image.pixels * 3 if most > 1e38 else spoilt
    extent = Extent(-most, most, spoilt)
    if p.target is Encoding.UNIT:
        extent = Extent((1 - most) / 2, (1 + most) / 2, spoilt)
    return Facts(image.height, image.width, 3, Space.DATA, Alpha.NONE, extent)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    same = p.source is p.target and p.source_convention is p.target_convention and p.source is Encoding.SIGNED
    plain = same and not p.renormalise and "detail" not in facts
    return "nothing is changed" if plain and facts["image"].channels == 3 else None


def _pixels(*vectors: tuple[float, ...]) -> Array:
    return np.array([vectors], np.float32)


def _become(*expected: tuple[float, ...]) -> Any:
    def holds(inputs: Mapping[str, Any], pixels: Array) -> str | None:
        same = np.allclose(pixels[0], np.array(expected), atol=1e-6, equal_nan=True)
        return None if same else f"{pixels[0].tolist()}"

    return holds


NAN = (np.nan,) * 3
normals = Operation(
    name="normals",
    family="relief",
    summary="Decodes, encodes, turns, renormalises and blends normal maps.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "normals: x, y, z", (3, 3), picture=False),
        Input("detail", "normals of a detail to be laid on, stored as the image's are", (3, 3), False, False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    result=_result,
    propagate=lambda p, facts, error: 0.0,
    check=_check,
    examples=(
        {},
        {"source": "signed", "target": "unit", "target_convention": "directx", "amount": 2, "blend": "partial"},
        {"renormalise": False, "source_convention": "directx"},
    ),
    hard_cases=(
        HardCase(
            "directions of no length, of great length and of none",
            "0 / 0; squares that overflow or underflow",
            lambda: {"image": _pixels((0, 0, 0), (3e30, 0, 4e30), (0, 1e-42, 0), (np.inf, 0, 0), (0, np.nan, 1))},
            {"source": "signed"},
            _become((0, 0, 0), (0.6, 0, 0.8), (0, 1, 0), NAN, NAN),
        ),
        HardCase(
            "a detail on what faces away, or cancels it",
            "the common form divides by z + 1",
            lambda: {
                "image": _pixels((0, 0, -1), (0, 0, 1), (1, 0, 0), (0, 1, 0)),
                "detail": _pixels((0, 0, 1), (0.6, 0, 0.8), (0, 0, 1), (0, 1, 0)),
            },
            {"source": "signed"},
            _become((0, 0, 0), (0.6, 0, 0.8), (1, 0, 0), (0, 0, -1)),
        ),
    ),
)


def _blended(n: Array, m: Array, blend: Blend) -> Array:
    """Before the length is taken."""
    nz, mz = n[..., 2:], m[..., 2:]
    match blend:
        case Blend.LINEAR:
            return np.asarray(n + m)
        case Blend.PARTIAL:
            return np.concatenate([n[..., :2] * mz + m[..., :2] * nz, nz * mz], axis=-1)
        case Blend.WHITEOUT:
            return np.concatenate([n[..., :2] + m[..., :2], nz * mz], axis=-1)
        case Blend.UDN:
            return np.concatenate([n[..., :2] + m[..., :2], nz], axis=-1)
        case _:
            t = np.concatenate([n[..., :2], nz + 1], axis=-1)
            u = np.concatenate([-m[..., :2], mz], axis=-1)
            return np.asarray(t * (t * u).sum(axis=-1, keepdims=True) - u * t[..., 2:])


def _made(inputs: Inputs, p: Parameters) -> Array:
    kind = inputs["image"].pixels.dtype.type
    before, after = (np.array([1, -1 if turned else 1, 1], kind) for turned in p.turned)
    with np.errstate(all="ignore"):
        n = decoded(inputs["image"].pixels, p.source) * before
        if p.renormalise or "detail" in inputs:
            n = unit(n)
        if "detail" in inputs:
            m = unit(decoded(inputs["detail"].pixels.astype(kind, copy=False), p.source) * before)
            m = unit(m * np.array([p.amount, p.amount, 1], kind))
            n = unit(_blended(n, m, p.blend))
        return encoded(n * after, p.target)


@normals.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _made(inputs, p)


@normals.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels * (3.0 if "detail" in facts else 1.0),
    rates={"opencl": Rate(2e-4, 1.5e-9), "numpy": Rate(2e-4, 3e-8)},
)
class Exact:
    """The formulas in float32, sixteen pixels at a time."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned_empty(image.pixels.shape)
        pixels = image.height * image.width
        before, after = p.turned
        with device.session() as session:
            session.launch(
                "relief/normals.cl", "normals", (-(-pixels // 16),),
                aligned(image.pixels), aligned(inputs["detail"].pixels) if "detail" in inputs else None,
                session.write(out), np.uint64(pixels), np.int32(p.source is Encoding.UNIT),
                np.int32(p.target is Encoding.UNIT), np.int32(before), np.int32(after), np.int32(p.renormalise),
                np.int32(list(Blend).index(p.blend)), np.float32(p.amount),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_made(inputs, p))
