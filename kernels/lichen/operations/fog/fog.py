"""Fog: what is far away fades into the fog's own light.

Truth: a pixel of colour c, of which t comes through fog of colour f, shows  t c + (1 - t) f, with, at the distance d,

    linear        t = (end - d) / (end - start), within [0, 1]
    exponential   t = e^(-density d)
    squared       t = e^(-(density d)^2)
    layered       t = e^(-density d mean), the mean of a profile over height between the eye and the point; see `column`
    height        the same for the density e^(-(h - base) / falloff) at the height h, whose mean has a closed form:
                  e^(lift + max(-u, 0)) (1 - e^-|u|) / |u|,  u = rise / falloff,  lift = (base - eye) / falloff

d is the distance from the eye, or the depth along the viewing direction, which hides less at a picture's edges and
makes seams between views in two directions. Points come as depth, whose kind and angle of view are parameters (see
`lichen.operations.scene.view`), or as positions in any axes with the eye among them. Heights are those along `up`.

What is infinitely far is hidden as far as fog goes: wholly, but for layers that end above or below. `background = keep`
leaves it as it is. An infinite position has no direction and counts as level. Points behind the eye have no fog before
them. Of objects that shine, `emissive` says which share is not hidden. Coverage, where there is any, is kept, and fog
covers as much.

Methods: `exact` computes the formulas in float32, rises of rays in doubles; `table` looks up what comes through by
distance, or mean densities by height, as pixel textures did.

Sources: W. Heidrich et al., Applications of pixel textures in visualization and realistic image synthesis, I3D 1999,
section 5; J. Legakis, Fast multi-layer fog, SIGGRAPH 1998; C. Wenzel, Real-time atmospheric effects in games, 2006, for
height fog.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    Facts,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import row_blocks
from lichen.operations.fog import errors
from lichen.operations.fog.cases import CASES, EXAMPLES
from lichen.operations.fog.launch import launched, reach_of, table_of
from lichen.operations.fog.optics import paths, shown, transmittance
from lichen.operations.fog.parameters import Background, Kind, Parameters, check
from lichen.operations.scene.view import pointed

if TYPE_CHECKING:
    from lichen.opencl.device import Device


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    return "there is no fog anywhere" if p.clear else None


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    if p.clear:
        return image
    light = p.colour if isinstance(p.colour, tuple) else (p.colour,)
    low, high = min(image.extent.low, *light), max(image.extent.high, *light)
    if image.alpha is not Alpha.NONE:
        _, fog = errors.brightness(p, facts)
        low, high = min(low, -fog), max(high, fog)
    slack = errors.exact(p, 0.0, facts).value
    low, high = max(low - slack, -errors.FLOAT_MAX), min(high + slack, errors.FLOAT_MAX)
    spoilt = any(each.extent.nonfinite for each in facts.values())
    return dataclasses.replace(image, extent=Extent(low, high, image.samples if spoilt else 0))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """What comes through counts less; coverage counts with the fog's light."""
    if facts["image"].alpha is Alpha.NONE:
        return error
    light = p.colour if isinstance(p.colour, tuple) else (p.colour,)
    return error * max(1.0, *map(abs, light))


def _implied(p: Parameters, facts: InputFacts) -> dict[str, Array] | str:
    return {} if pointed(facts["depth"]) else "how far a pixel's ray is slanted depends on where the pixel lies"


fog = Operation(
    name="fog",
    family="fog",
    summary="Fades a picture into fog with distance: even, in layers, or thinning with height.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture"),
        Input("depth", "how far away each pixel is, or, of three channels, where", (1, 3), picture=False),
        Input("emissive", "how much of each pixel fog does not hide, 0 to 1", (1, 1), required=False, picture=False),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: POINTWISE,
    identity=_identity,
    departure=errors.departure,
    result=_result,
    propagate=_propagate,
    implied=_implied,
    check=check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


@fog.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    rows = slice(0, inputs["image"].height)
    return shown(inputs, p, rows, transmittance(inputs, p, rows))


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Sixteenths of a pixel's layers, over what every pixel takes."""
    each = 1 + len(p.heights) / 8 if p.kind is Kind.LAYERED else 1.0
    return facts["image"].pixels * each


@fog.method(
    "exact",
    error=errors.exact,
    work=_work,
    rates={"opencl": Rate(2e-4, 1.5e-9), "numpy": Rate(2e-4, 5e-8)},
)
class Exact:
    """The formulas in float32; on a device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if p.clear:
            return aligned(inputs["image"].pixels)
        return launched(device, inputs, p) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        out = aligned_empty(image.pixels.shape)
        for rows in row_blocks(image.height, image.width):
            out[rows] = shown(inputs, p, rows, transmittance(inputs, p, rows, np.float32))
        return out


def _unfit(p: Parameters, facts: InputFacts) -> str | None:
    if p.kind in (Kind.LINEAR, Kind.HEIGHT):
        return "a table would take longer than the formula"
    return None


def _looked_up(inputs: Inputs, p: Parameters, rows: slice, entries: int) -> Array:
    """What comes through by a table; linear between its entries."""
    table = table_of(p, entries)
    distance, rise, _ = paths(inputs, p, rows)
    if p.kind is Kind.LAYERED:
        far, reach = np.abs(rise), reach_of(p)
        at = np.linspace(0.0, reach, entries)
        mean = np.where(rise >= 0, np.interp(far, at, table[:entries]), np.interp(far, at, table[entries:]))
        beyond = np.isfinite(far) & (far > reach)
        mean[beyond] = p.column.mean(rise[beyond])
        exact = transmittance(inputs, p, rows, np.float32)
        through = np.where(np.isinf(distance), exact, np.exp(-p.density * mean * distance))
    else:
        through = np.interp(distance, np.linspace(0.0, reach_of(p), entries), table)
        through = np.where(np.isinf(distance), 1.0 if p.background is Background.KEEP else 0.0, through)
    return np.where(np.isnan(distance), np.nan, through).astype(np.float32)


@fog.method(
    "table",
    knob=Knob("entries", (32, 64, 256, 1024), "of the table", 2, 65536, order=-2),
    orderly=True,
    error=errors.table,
    work=lambda p, knob, facts: facts["image"].pixels + knob,
    rates={"opencl": Rate(2e-4, 2e-9), "numpy": Rate(2e-4, 8e-8)},
    unfit=_unfit,
)
class Table:
    """Looked up in a table of `entries`, linear between them."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if p.clear:
            return aligned(inputs["image"].pixels)
        if not device.has_fp64:
            return Table.numpy(inputs, p, knob)
        return launched(device, inputs, p, errors.entries(knob))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if p.clear:
            return aligned(image.pixels)
        out = aligned_empty(image.pixels.shape)
        with np.errstate(all="ignore"):
            for rows in row_blocks(image.height, image.width):
                out[rows] = shown(inputs, p, rows, _looked_up(inputs, p, rows, errors.entries(knob)))
        return out
