"""Ambient occlusion: how much of an evenly bright sky a relief, or a scene's depths, lets through to each pixel.

Truth: with the horizon's angle from the zenith h_k in each of the `directions` k (horizons.py), the normal's component
n_k along it and n_z towards the viewer,

    seen = sum of n_z (1 - cos 2 h_k) + n_k (2 h_k - sin 2 h_k), over the same sum for the surface's own plane

each term of which is the integral of the sky's light times the cosine at the surface over half a slice. No horizon is
lower than the surface's own plane, so the result is 1 where nothing rises above it, however few the directions. Without
the input `normal` surfaces face the viewer, and a term is 2 sin^2 h_k: the sky view factor of a relief. The result is
1 - `strength` (1 - seen).

Normals are of any length, y up. One that faces away counts as one across the view; one that has no direction then sees
everything.

Methods: `march` looks at every `spacing`-th pixel of a direction; at 1 it is exact to rounding. Peaks that are narrower
than the spacing may be missed, whatever their height, so nothing less than the whole range can be promised beyond it.

Sources: J. Jimenez et al., Practical realtime strategies for accurate indirect occlusion, SIGGRAPH course 2016 (the
integral of a slice); J. Dozier and J. Frew, Rapid calculation of terrain parameters for radiation modeling from digital
elevation data, IEEE Trans. Geoscience and Remote Sensing 28, 1990.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array, aligned
from lichen.operation import (
    ROUNDING,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.relief.directions import unit
from lichen.operations.relief.horizons import launch, slopes
from lichen.operations.relief.rings import (
    SPACING,
    RingParameters,
    all_are,
    column_is,
    footprint,
    looked_at,
    nan_in_reach,
    nothing,
    slope_rounding,
    spoilt,
    step,
)

if TYPE_CHECKING:
    from lichen.opencl.device import Device


class Parameters(RingParameters):
    strength: float = Field(1.0, ge=0, le=1)
    """how much of what is hidden is taken away"""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    height = facts["height"]
    if "normal" in facts and (facts["normal"].height, facts["normal"].width) != (height.height, height.width):
        given = facts["normal"]
        return [Flaw("/inputs/normal", f"is {given.width}x{given.height}; height is {height.width}x{height.height}")]
    return []


def _error(p: Parameters, spacing: float, facts: InputFacts) -> Error:
    """A side changes by no more than three times its slope, and all of them are half of what they are over at least."""
    rounding = min(p.strength * (6 * slope_rounding(p, facts) + 80 * ROUNDING) + 4 * ROUNDING, 1.0)
    if spacing <= 1:
        return Error(rounding, "bound", rounding)
    return Error(p.strength + rounding, "bound", rounding, p.strength * 0.02 * (spacing - 1))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    height, slack = facts["height"], 100 * ROUNDING
    spoilt_pixels = height.pixels if any(each.extent.nonfinite for each in facts.values()) else 0
    extent = Extent(1 - p.strength - slack, 1 + slack, spoilt_pixels)
    return Facts(height.height, height.width, 1, Space.DATA, Alpha.NONE, extent)


ambient_occlusion = Operation(
    name="ambient_occlusion",
    family="relief",
    summary="Shows how much of the sky each pixel of a relief or of a scene's depths sees.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("height", "heights, or depths, in one channel", (1, 1), picture=False),
        Input("normal", "which way surfaces face: x, y up, z", (3, 3), required=False, picture=False),
    ),
    light=Light.STORED,
    footprint=footprint,
    result=_result,
    propagate=lambda p, facts, error: 0.0,
    check=_check,
    examples=(
        {},
        {"directions": 5, "radius": 7.5, "scale": 20, "strength": 0.7, "border": "wrap"},
        {"source": "depth", "radius": 6, "directions": 6, "border": "reflect101"},
    ),
    hard_cases=(
        HardCase(
            "below a cliff",
            "half of the sky behind a wall of 45 degrees",
            step,
            {"scale": 1, "directions": 4, "radius": 4},
            column_is(7, 1 - 0.5 / 4),
        ),
        HardCase("a missing height", "a maximum hides NaN", spoilt, {"radius": 2}, nan_in_reach(2)),
        HardCase(
            "holes in depth",
            "inf - inf is NaN; depths of 0 divide",
            nothing,
            {"source": "depth", "radius": 5, "border": "reflect"},
            all_are(1.0),
        ),
        HardCase(
            "a wall across the view, and one that faces away",
            "a tangent of 90 degrees; 0 / 0; a wall on a plane sees half",
            lambda: {
                "height": np.zeros((2, 3, 1), np.float32),
                "normal": np.array([[[5, 0, 0]] * 3, [[1, 0, -1]] * 3], np.float32),
            },
            {"directions": 64},
            lambda inputs, pixels: None if np.abs(pixels - 0.5).max() < 1e-3 else f"{pixels.tolist()}",
        ),
    ),
)


def _side(slope: Array, z: Array, along: Array) -> Array:
    """Half a slice of the sky, above a horizon."""
    kind, whole = slope.dtype.type, 1 + slope * slope
    twice = np.where(np.abs(slope) > 1e15, kind(0), 2 * slope / whole)
    return np.asarray(z * 2 / whole + along * (2 * np.arctan2(kind(1), slope) - twice))


def _seen(inputs: Inputs, p: Parameters, spacing: float) -> Array:
    image, ring = inputs["height"], p.ring(spacing)
    kind = image.pixels.dtype.type
    total, whole = (np.zeros((image.height, image.width), kind) for _ in range(2))
    with np.errstate(all="ignore"):
        if "normal" in inputs:
            n = inputs["normal"].pixels.astype(kind, copy=False)
            n = unit(np.concatenate([n[..., :2], np.where(n[..., 2:] <= 0, kind(0), n[..., 2:])], axis=-1))
        for k in range(ring.directions):
            if "normal" not in inputs:
                slope = slopes(image, ring, k, 0.0)
                total += 2 / (1 + slope * slope)
                whole += 2
                continue
            cosine, sine = (kind(each) for each in ring.turn(k))
            along = n[..., 0] * cosine + n[..., 1] * sine
            least = np.where(along == 0, kind(0), -along / n[..., 2])
            slope = slopes(image, ring, k, least)
            total += _side(slope, n[..., 2], along)
            whole += _side(least, n[..., 2], along)
        seen = np.where(whole == 0, kind(1), total / whole)
    made = 1 - p.strength * (1 - seen)
    return np.asarray(made[..., None].astype(kind, copy=False))


@ambient_occlusion.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _seen(inputs, p, 1.0)


@ambient_occlusion.method(
    "march",
    error=_error,
    work=lambda p, spacing, facts: looked_at(p, spacing, facts) * (2.0 if "normal" in facts else 1.0),
    rates={"opencl": Rate(5e-4, 2e-10), "numpy": Rate(1e-3, 3e-9)},
    knob=SPACING,
)
class March:
    """The largest slope over every `spacing`-th pixel of each direction."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, spacing: float) -> Array:
        return launch(device, "occlusion", inputs["height"], p.ring(spacing), inputs.get("normal"), 1, p.strength)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, spacing: float) -> Array:
        return aligned(_seen(inputs, p, spacing))
