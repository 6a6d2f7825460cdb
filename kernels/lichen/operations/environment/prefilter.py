"""Prefilter: an environment as surfaces that are not mirrors see it.

Truth. Every pixel of the result is a direction d, and shows the mean of the light about it,

    result(d) = sum of w K(d . l) L(l) / sum of w K(d . l)

over all texels with their directions l and solid angles w (`lichen.operations.environment.solid`). With c = d . l > 0,

    diffuse    K = c                              what a white matt surface that faces d shows; look it up by the normal
    phong      K = c^exponent                     look it up by the mirror's direction
    ggx        K = c D(h), h halfway between d and l, with D = roughness^4 / (pi t^2), t = (1 - c) / 2 +
               roughness^4 (1 + c) / 2: a rough surface seen from straight above, as is customary for split sums

and K = 0 elsewhere. A constant environment stays what it is under every lobe, since weights are divided by their sum.
A lobe narrower than the texels takes the nearest of them: K is counted relative to its value at that texel, so that it
never vanishes everywhere. Where no texel lies within 90 degrees, the mean of all is taken.

The result may be far smaller than the image: rougher lobes show less. Its light is normalised: a Phong lobe's
reflectance, or that of a matt surface, is a factor on top.

Methods: `all` sums over every texel. `reduced` puts texels together first, until as many are left as the knob says.

Sources: W. Heidrich and H.-P. Seidel, Realistic, hardware-accelerated shading and lighting, SIGGRAPH 1999; N. Greene,
Environment mapping and other applications of world projections, IEEE CG&A 6, 1986; B. Karis, Real shading in Unreal
Engine 4, SIGGRAPH course 2013, for the last lobe.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    ROUNDING,
    WHOLE,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Knob,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX
from lichen.operations.environment.solid import Texels, default_size, reduced, shown, texels
from lichen.operations.environment.spherical_harmonics import check_charts
from lichen.operations.warp.charts import Chart

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from lichen.opencl.device import Device

BLOCK = 1 << 20
"""Weights that the NumPy body holds at once."""


class Lobe(StrEnum):
    """By what the light about a direction is weighted."""

    DIFFUSE = "diffuse"
    PHONG = "phong"
    GGX = "ggx"


class Parameters(OperationParameters):
    chart: Chart = Field(Chart.LATLONG, description="how the image holds all directions")
    lobe: Lobe = Field(Lobe.DIFFUSE, description="by what the light about a direction is weighted")
    exponent: float = Field(50.0, ge=0.01, le=1e4, description="of a phong lobe")
    roughness: float = Field(0.3, ge=0.01, le=1, description="of a ggx lobe")
    target: Chart = Field(Chart.LATLONG, description="how the result holds all directions")
    width: int | None = Field(None, ge=1, le=4096, description="columns of the result; by the target if left out")
    height: int | None = Field(None, ge=1, le=4096, description="rows of the result; by the target if left out")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return default_size(self.target, self.width, self.height, 32)

    @property
    def sharpness(self) -> float:
        """The one number of a lobe."""
        return self.exponent if self.lobe is Lobe.PHONG else self.roughness**4


def weights(c: Array, p: Parameters) -> Array:
    """K relative to its value at the nearest texel, for the cosines c (targets, texels) in float64."""
    most = c.max(axis=1, keepdims=True)
    above = np.maximum(c, 0)
    if p.lobe is Lobe.DIFFUSE:
        lobe = above
    elif p.lobe is Lobe.PHONG:
        lobe = (above / np.where(most > 0, most, 1)) ** p.sharpness
    else:
        near, closest = ((1 - each) / 2 for each in (c, most))
        t, least = (n + p.sharpness * (1 - n) for n in (near, closest))
        lobe = above * (least / t) ** 2
    return np.where(most > 0, lobe, 1.0)


# ------------------------------------------------------------------------------------------------------ predictions


def _rounding(p: Parameters, facts: InputFacts) -> float:
    """Relative errors of weights move a mean by as much of the range at most. A power's is its exponent times that of
    its base; sums are doubles."""
    extent = facts["image"].extent
    base = ROUNDING * ((p.exponent if p.lobe is Lobe.PHONG else 0.0) + 16)
    return min(min(1.0, 2 * base) * extent.spread + 2 * ROUNDING * extent.magnitude, FLOAT_MAX)


def _all_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(p, facts)
    return Error(value, "estimate", value)


def _reduced_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Means of the same light differ by its range at most."""
    if facts["image"].pixels <= knob:
        return _all_error(p, knob, facts)
    spread, rounding = facts["image"].extent.spread, _rounding(p, facts)
    value = min(spread + rounding, FLOAT_MAX)
    return Error(value, "bound", rounding, min(3 * spread / knob + rounding, value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, (width, height) = facts["image"], p.size
    slack = _rounding(p, facts)
    low, high = max(image.extent.low - slack, -FLOAT_MAX), min(image.extent.high + slack, FLOAT_MAX)
    bad = image.extent.nonfinite or max(abs(low), abs(high)) >= FLOAT_MAX
    extent = Extent(min(low, 0.0), max(high, 0.0), height * width * image.channels if bad else 0)
    return Facts(height, width, image.channels, image.space, image.alpha, extent)


def _white(height: int, width: int) -> Callable[[], Mapping[str, Any]]:
    return lambda: {"image": np.full((height, width, 1), 0.7, np.float32)}


def _furnace(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    shown = pixels[pixels != 0]  # discs have nothing around them
    off = float(np.abs(shown - np.float32(0.7)).max(initial=0.0))
    return None if off < 1e-5 and shown.size > pixels.size / 2 else f"a constant is off by {off:g}"


prefilter = Operation(
    name="prefilter",
    family="environment",
    summary="Blurs an environment by what a matt, glossy or rough surface sees of it.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "light from all directions, as `chart` says", (1, 4)),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    implied=lambda p, facts: "every direction counts, wherever the result's lie",
    check=lambda p, facts: check_charts(p, facts, p.size),
    examples=(
        {"width": 16, "height": 8},
        {"lobe": "phong", "exponent": 40, "chart": "mirror_ball", "width": 12, "height": 6},
        {"lobe": "ggx", "roughness": 0.4, "target": "cube", "width": 12, "height": 8},
    ),
    hard_cases=(
        *(
            HardCase(
                name=f"white furnace, {lobe} from {chart}",
                why="what leaves the furnace is what is in it",
                inputs=_white(*size),
                parameters={"lobe": lobe, "chart": chart, "exponent": 1e4, "roughness": 0.01, "target": target},
                holds=_furnace,
            )
            for lobe, chart, size, target in (
                ("diffuse", "latlong", (8, 16), "paraboloid"),
                ("phong", "paraboloid", (8, 16), "latlong"),
                ("ggx", "cube", (8, 12), "mirror_ball"),
            )
        ),
        HardCase(
            name="lobes far narrower than a texel",
            why="0.9 to the 10000 is 0 at every texel, and 0 / 0 their mean",
            inputs=lambda: {"image": np.arange(8, dtype=np.float32).reshape(2, 4, 1)},
            parameters={"lobe": "phong", "exponent": 1e4, "width": 32, "height": 16},
            holds=lambda inputs, pixels: (
                None if np.isfinite(pixels).all() and len(np.unique(np.rint(pixels))) == 8 else "not the nearest texels"
            ),
        ),
        HardCase(
            name="one texel, half of the directions behind it",
            why="no weight at all where it lies behind the surface",
            inputs=_white(1, 1),
            parameters={},
            holds=_furnace,
        ),
    ),
)


# -------------------------------------------------------------------------------------------------------- in NumPy


def _averaged(given: Texels, p: Parameters) -> Array:
    direction, there = shown(p.target, *p.size)
    wanted = direction[there]
    found = np.empty((len(wanted), given.light.shape[1]))
    x, y, z = given.direction.T
    light, finite = given.light.astype(np.float64), bool(np.isfinite(given.light).all())
    rows = max(1, BLOCK // len(light))
    with np.errstate(all="ignore"):
        for first in range(0, len(wanted), rows):
            d = wanted[first : first + rows]
            c = x * d[:, 0:1] + y * d[:, 1:2] + z * d[:, 2:3]
            w = weights(c, p) * given.angle
            if finite:
                sums = w @ light
            else:
                terms = w[..., np.newaxis] * light
                sums = np.where(w[..., np.newaxis] == 0, 0, terms).sum(axis=1)
            found[first : first + rows] = sums / w.sum(axis=1, keepdims=True)
    made = np.zeros((*there.shape, found.shape[1]))
    made[there] = found
    return made


@prefilter.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _averaged(texels(inputs["image"].pixels, p.chart), p)


# ------------------------------------------------------------------------------------------------------- on devices


def _launched(device: Device, given: Texels, p: Parameters) -> Array:
    rest = -len(given.angle) % 64
    # What fills up the last segment lies where the last texel does, and has no weight.
    direction = np.concatenate([given.direction, np.repeat(given.direction[-1:], rest, axis=0)])
    angle = aligned(np.pad(given.angle, (0, rest)))
    light = aligned(np.pad(given.light.T, ((0, 0), (0, rest))))
    target, there = shown(p.target, *p.size)
    wanted = aligned(target[there].T, np.float64)
    count, channels = wanted.shape[1], given.light.shape[1]
    found = aligned_empty((count, channels))
    with device.session() as session:
        session.launch(
            "environment/prefilter.cl", "means", (count,),
            aligned(direction.T, np.float64), angle, light, wanted, session.write(found), np.float32(p.sharpness),
            np.int32(len(direction)), np.int32(count),
            local=(1,), defines={"LOBE": list(Lobe).index(p.lobe), "CHANNELS": channels},
        )  # fmt: skip
    out = aligned_empty((*there.shape, channels))
    out[...] = 0
    out[there] = found
    return out


def _work(p: Parameters, texels: float, channels: int) -> float:
    width, height = p.size
    return texels * width * height * (6.0 + channels)


@prefilter.method(
    "all",
    error=_all_error,
    work=lambda p, knob, facts: _work(p, facts["image"].pixels, facts["image"].channels),
    rates={"opencl": Rate(1e-3, 2e-10), "numpy": Rate(1e-3, 3e-9)},
)
class All:
    """Every texel."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        given = texels(inputs["image"].pixels, p.chart)
        return _launched(device, given, p) if device.has_fp64 else All.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_averaged(texels(inputs["image"].pixels, p.chart), p).astype(np.float32))


@prefilter.method(
    "reduced",
    knob=Knob("texels", (256, 1024, 4096, 16384), "blocks that the image is put together to", 6, 1e6),
    error=_reduced_error,
    work=lambda p, knob, facts: (
        _work(p, min(knob, facts["image"].pixels), facts["image"].channels) + 40.0 * facts["image"].samples
    ),
    rates={"opencl": Rate(1e-3, 2e-10), "numpy": Rate(1e-3, 3e-9)},
)
class Reduced:
    """Texels put together to blocks first."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        given = reduced(inputs["image"].pixels, p.chart, knob)
        return _launched(device, given, p) if device.has_fp64 else Reduced.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_averaged(reduced(inputs["image"].pixels, p.chart, knob), p).astype(np.float32))
