"""Shadow: which share of a light reaches what a camera sees, by a map of the depths that the light sees.

Truth: every point is looked up in the light's map, which `light_eye` to `light_extent` say how to find (see
`lichen.operations.scene.camera`). A texel lets light through where the receiver is no deeper than it by its own
quantum; `lichen.operations.shadow.comparing` derives what a slope and a filter add to that from the receiver's normal,
so there is no bias to set. Without normals, `slope` says which receivers must not shadow themselves.

    filter 0     the nearest texel
    pcf          the mean of the comparisons over a square of `filter` texels, every texel by its share of it
    pcss         the same over a square as wide as the penumbra of what was found to stand before the receiver, in a
                 square of `filter` texels, in which it also ends: the `source`'s width times (1 / blocker - 1 /
                 receiver)
    variance     Chebyshev's bound on the share of depths in the square that lie behind the receiver

1 is light and 0 shadow. Points are positions in any axes, with the light in the same, or a camera's depths, with the
light in the camera's. What is infinitely far is lit. What the map cannot show (beyond its edge, behind the light) is as
`outside` says. Surfaces that face away are dark. Where `tiles` leave the light out (see the operation tiles), shares
are 0 and the map is not read. NaN in the map darkens nothing: it is the result where it is read.

Shares are computed in doubles, in one order, and rounded to float32 once: that rounding is part of the definition.

Methods: `exact` does as the definition does and errs by nothing; `sampled` compares with some texels of the square
only; `linear` and `window` take the map as stored in few bits, as frame buffers once had them: of depth itself, or of a
window's depth; `float` and `reversed` as stored in floats of few bits, as buffers have them now. Of an edge that moves
the error is the whole light, so all that can be said of these is that, and how far they are off as a rule.

Sources: L. Williams, Casting curved shadows on curved surfaces, SIGGRAPH 1978; W. Reeves, D. Salesin and R. Cook,
Rendering antialiased shadows with depth maps, SIGGRAPH 1987; W. Heidrich, High-quality shading and lighting,
dissertation, 1999, section 6.3; R. Fernando, Percentage-closer soft shadows, 2005; W. Donnelly and A. Lauritzen,
Variance shadow maps, 2006.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    ROUNDING,
    WHOLE,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import row_blocks
from lichen.operations.scene.lists import by_pixel, left_out, listing
from lichen.operations.shadow.cases import CASES, EXAMPLES
from lichen.operations.shadow.comparing import Map, receivers, share
from lichen.operations.shadow.launch import launched, places
from lichen.operations.shadow.parameters import Kind, Parameters, check
from lichen.operations.shadow.storing import Store, Stored

if TYPE_CHECKING:
    from lichen.opencl.device import Device


def _receivers(facts: InputFacts) -> Facts:
    return facts.get("depth") or facts["map"]


def _result(p: Parameters, facts: InputFacts) -> Facts:
    where = _receivers(facts)
    spoilt = any(each.extent.nonfinite for each in facts.values())
    return Facts(where.height, where.width, 1, extent=Extent(0.0, 1.0, where.pixels if spoilt else 0))


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """Of the map all may be read; of what lies pixel by pixel nothing else."""
    return WHOLE


shadow = Operation(
    name="shadow",
    family="shadow",
    summary="Tells which share of a light reaches every point, by the depths that the light sees.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("map", "the depths that the light sees", (1, 1), picture=False),
        Input("depth", "how far from the camera each pixel is, or, of three channels, where", (1, 3), picture=False),
        Input("normal", "the points' normals, of any length", (3, 3), required=False, picture=False),
        listing("the light, which then counts as 0,"),
    ),
    light=Light.STORED,
    footprint=_footprint,
    result=_result,
    propagate=lambda p, facts, error: 1.0 if error else 0.0,
    implied=lambda p, facts: "where the map is read has nothing to do with where a pixel lies",
    check=check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


@shadow.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    height = inputs["depth"].height
    made = share(inputs, p, slice(0, height))[..., None].astype(np.float32).astype(np.float64)
    return _without(made, inputs, p)


def _without(made: Array, inputs: Inputs, p: Parameters) -> Array:
    """The shares, 0 where the light is left out."""
    height, width, _ = made.shape
    out = left_out(inputs, p.effect, 1, height, width)
    return made if out is None else np.where(by_pixel(out, height, width), made.dtype.type(0), made)


def _taps(p: Parameters) -> float:
    """Texels that are read for a receiver."""
    square = float((math.ceil(p.filter) + 1) ** 2) if p.filter else 1.0
    return square * (2 if p.kind is Kind.PCSS and p.filter else 1)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    return _receivers(facts).pixels * (2 + _taps(p))


def _by_rows(inputs: Inputs, p: Parameters, body: Callable[[slice], Array]) -> Array:
    where = inputs["depth"]
    out = aligned_empty((where.height, where.width, 1))
    for rows in row_blocks(where.height, where.width):
        out[rows, :, 0] = body(rows)
    return aligned(_without(out, inputs, p))


@shadow.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=_work,
    rates={"opencl": Rate(3e-4, 9e-10), "numpy": Rate(1e-3, 4e-8)},
)
class Exact:
    """All texels of the filter, in doubles; of a single one, in float32 wherever doubles would find the same. On a
    device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return launched(device, inputs, p) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _by_rows(inputs, p, lambda rows: share(inputs, p, rows))


def _sampled(inputs: Inputs, p: Parameters, rows: slice, taps: int) -> Array:
    with np.errstate(all="ignore"):
        r, depths = receivers(inputs, p, rows), Map(inputs, p)
        total = np.zeros_like(r.u)
        for x, y in places(taps):
            total = total + depths.lit(r, np.floor(r.u + x * p.filter), np.floor(r.v + y * p.filter))
        return np.where(r.reaches, total / taps, r.missing)


@shadow.method(
    "sampled",
    knob=Knob("taps", (4, 9, 16, 32), "texels that are compared", 1, 1024),
    error=lambda p, knob, facts: Error(1.0, "bound", ROUNDING, 0.05),
    work=lambda p, knob, facts: _receivers(facts).pixels * (2.0 + round(knob)),
    rates={"opencl": Rate(3e-4, 9e-10), "numpy": Rate(1e-3, 4e-8)},
    unfit=lambda p, facts: None if p.kind is Kind.PCF and p.filter > 0 else "there is no square of comparisons",
)
class Sampled:
    """The texels at some evenly spread places of the filter's square, each counting the same; on a device found and
    compared in float32 where depths are stored as they are."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Sampled.numpy(inputs, p, knob)
        return launched(device, inputs, p, taps=round(knob))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _by_rows(inputs, p, lambda rows: _sampled(inputs, p, rows, round(knob)))


def _bits_unfit(p: Parameters, facts: InputFacts) -> str | None:
    return None if p.light_far is not None else "whole numbers need a far end: light_far"


BITS = Knob("bits", (8, 12, 16, 24), "of a stored depth", 4, 32)
DIGITS = Knob("digits", (8, 11, 16, 24), "significant bits of a stored depth: 11 as float16 has, 24 as float32", 4, 40)


def _few_bits(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return Error(1.0, "bound", ROUNDING, 2.0 ** (-round(knob) / 2))


def _stored(name: str, kind: Store, text: str, step: float, *, floats: bool = False) -> None:
    """Declares the method of a map that is kept in few bits."""

    class Body:
        @staticmethod
        def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
            if not device.has_fp64:
                return Body.numpy(inputs, p, knob)
            return launched(device, inputs, p, Stored(kind, round(knob)))

        @staticmethod
        def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
            stored = Stored(kind, round(knob))
            return _by_rows(inputs, p, lambda rows: share(inputs, p, rows, stored))

    Body.__doc__ = text
    shadow.method(
        name,
        knob=DIGITS if floats else BITS,
        orderly=True,
        error=_few_bits,
        work=_work,
        rates={"opencl": Rate(3e-4, step), "numpy": Rate(1e-3, 6e-8)},
        unfit=(lambda p, facts: None) if floats else _bits_unfit,
    )(Body)


_stored(
    "linear", Store.LINEAR, "The map stored as whole numbers that are linear in depth; its step counts as bias.", 1.1e-9
)
_stored(
    "window",
    Store.WINDOW,
    "The map stored as whole numbers of a window's depth, finer near the light; their step counts as bias.",
    1.3e-9,
)
_stored(
    "float", Store.FLOAT, "The map stored as floats of so many significant bits; their spacing counts as bias.", 1.2e-9,
    floats=True,
)  # fmt: skip
_stored(
    "reversed",
    Store.REVERSED,
    "The map stored as floats of a reversed window's depth, 1 near and 0 far; their spacing counts as bias.",
    1.5e-9,
    floats=True,
)
