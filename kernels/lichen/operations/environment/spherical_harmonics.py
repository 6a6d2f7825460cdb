"""Spherical harmonics: an environment by its first few coefficients, and the picture these make.

Truth. With L(d) the light of the texels, w their solid angles (`lichen.operations.environment.solid`), M their mean and
Y_lm the real functions of `lichen.operations.environment.harmonics`, for all l below `bands`,

    c_lm = sum of w (L - M) Y_lm(d),    c_00 + sqrt(4 pi) M in place of c_00

The mean is taken out first, so a constant has one coefficient and no others, however few its texels. `bands` 2, 3 and 5
are the customary 4, 9 and 25 coefficients. The result is a picture of all directions, as `target` says:

    radiance      sum of c_lm Y_lm(d)
    irradiance    the same with each degree times what max(cos, 0) / pi makes of it: what a white matt surface shows
                  that faces d

Sums of few degrees swing below 0 beside what is bright; that is theirs, and not clamped. The findings are the
coefficients of the radiance, one row for each function in the order l^2 + l + m, one number for each channel.

Methods: `all` sums over every texel. `reduced` puts texels together first, until as many are left as the knob says.

Sources: R. Ramamoorthi and P. Hanrahan, An efficient representation for irradiance environment maps, SIGGRAPH 2001;
P.-P. Sloan, Stupid spherical harmonics tricks, GDC 2008.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
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
from lichen.operations.environment import framed
from lichen.operations.environment.harmonics import basis, by_degree, cosine
from lichen.operations.environment.solid import Texels, default_size, reduced, shown, texels
from lichen.operations.warp.charts import LAYOUT, Chart

if TYPE_CHECKING:
    from lichen.opencl.device import Device

CHUNK = 4096
"""Texels that one work-item sums up."""


class Output(StrEnum):
    """What the picture shows."""

    RADIANCE = "radiance"
    IRRADIANCE = "irradiance"


class Parameters(OperationParameters):
    chart: Chart = Field(Chart.LATLONG, description="how the image holds all directions")
    bands: int = Field(3, ge=1, le=10, description="degrees; their square is the number of coefficients")
    output: Output = Field(Output.RADIANCE, description="the light by its coefficients, or what a matt surface shows")
    target: Chart = Field(Chart.LATLONG, description="how the result holds all directions")
    width: int | None = Field(None, ge=1, le=4096, description="columns of the result; by the target if left out")
    height: int | None = Field(None, ge=1, le=4096, description="rows of the result; by the target if left out")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return default_size(self.target, self.width, self.height, 32)

    @property
    def factors(self) -> Array:
        """What each degree is multiplied by."""
        return _factors(self.bands, self.output)


@lru_cache(maxsize=20)
def _factors(bands: int, output: Output) -> Array:
    return np.array([cosine(degree) if output is Output.IRRADIANCE else 1.0 for degree in range(bands)])


def check_charts(p: Any, facts: InputFacts, size: tuple[int, int]) -> list[Flaw]:
    """Of operations from a chart to a chart, with parameters of these names."""
    flaws = [
        Flaw(f"/parameters/{name}", "a fisheye does not hold all directions; convert it by panorama")
        for name in ("chart", "target")
        if getattr(p, name) is Chart.FISHEYE
    ]
    if flaws:
        return flaws
    for name, count, each in zip(("width", "height"), LAYOUT[p.target], size, strict=True):
        if each % count:
            flaws.append(Flaw(f"/parameters/{name}", f"must be a multiple of {count}, the charts of a {p.target}"))
    return flaws + framed.flaws_of("image", p.chart, facts["image"])


def _most(p: Parameters) -> float:
    """How much of a deviation from the mean the result can be: its kernel is largest straight ahead."""
    return _most_of(p.bands, p.output)


@lru_cache(maxsize=20)
def _most_of(bands: int, output: Output) -> float:
    return float(np.sum((2 * np.arange(bands) + 1) * np.abs(_factors(bands, output))))


def _rounding(p: Parameters, facts: InputFacts) -> float:
    """Everything is in doubles but for the result."""
    extent = facts["image"].extent
    return min(2 * ROUNDING * (extent.magnitude + _most(p) * extent.spread), FLOAT_MAX)


def _all_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounding(p, facts)
    return Error(value, "bound", value)


def _reduced_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of two sums of which each is a mean and at most `_most` times what the light is from it; usually by far less."""
    if facts["image"].pixels <= knob:
        return _all_error(p, knob, facts)
    spread, rounding = facts["image"].extent.spread, _rounding(p, facts)
    value = min(2 * _most(p) * spread + rounding, FLOAT_MAX)
    return Error(value, "bound", rounding, min(p.bands * spread / knob + rounding, value))


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, (width, height) = facts["image"], p.size
    extent = image.extent
    far = _most(p) * extent.spread + 2 * _rounding(p, facts)
    low, high = max(extent.low - far, -FLOAT_MAX), min(extent.high + far, FLOAT_MAX)
    bad = extent.nonfinite or max(abs(low), abs(high)) >= FLOAT_MAX
    count = height * width * image.channels if bad else 0
    low, high = (min(low, 0.0), max(high, 0.0))  # nothing around discs
    return Facts(height, width, image.channels, image.space, image.alpha, Extent(low, high, count))


spherical_harmonics = Operation(
    name="spherical_harmonics",
    family="environment",
    summary="Takes an environment apart into spherical harmonics, and shows the light or the irradiance these make.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "light from all directions, as `chart` says", (1, 4)),),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, error: error * (1 + 2 * _most(p)),
    implied=lambda p, facts: "every direction counts, wherever the result's lie",
    check=lambda p, facts: check_charts(p, facts, p.size),
    examples=(
        {"bands": 3, "output": "irradiance", "width": 16, "height": 8},
        {"bands": 5, "width": 12, "height": 6},
        {"chart": "mirror_ball", "bands": 2, "target": "paraboloid", "width": 16, "height": 8},
    ),
    hard_cases=(
        HardCase(
            name="one texel",
            why="its direction is one of all it stands for",
            inputs=lambda: {"image": np.full((1, 1, 2), 0.7, np.float32)},
            parameters={"bands": 5, "output": "irradiance"},
            holds=lambda inputs, pixels: _constant(pixels),
        ),
        HardCase(
            name="white furnace",
            why="solid angles that miss 4 pi darken everything, functions summed over few texels shade it",
            inputs=lambda: {"image": np.full((6, 12, 1), 0.7, np.float32)},
            parameters={"chart": "paraboloid", "bands": 9},
            holds=lambda inputs, pixels: _constant(pixels),
        ),
        HardCase(
            name="the sky up is brighter",
            why="poles have no longitude",
            inputs=lambda: {"image": np.repeat(np.linspace(1, 0, 8), 16).reshape(8, 16, 1).astype(np.float32)},
            parameters={"bands": 6, "width": 16, "height": 8},
            holds=lambda inputs, pixels: (
                None if (np.diff(pixels[:, 0, 0]) < 0).all() and np.ptp(pixels, axis=1).max() < 1e-6 else "it is not"
            ),
        ),
    ),
)


def _constant(pixels: Array) -> str | None:
    off = float(np.abs(pixels - np.float32(0.7)).max())
    return None if off < 1e-6 else f"a constant is off by {off:g}"


def _mean(given: Texels) -> Array:
    mean: Array = (given.angle[:, np.newaxis] * given.light).sum(axis=0) / (4 * math.pi)
    return mean


def _coefficients(given: Texels, bands: int) -> Array:
    """(bands^2, channels), less what the mean has; float64, in chunks."""
    mean, total = _mean(given), np.zeros((bands * bands, given.light.shape[1]))
    for first in range(0, len(given.angle), CHUNK):
        part = slice(first, first + CHUNK)
        share = given.angle[part, np.newaxis] * (given.light[part] - mean)
        total += basis(given.direction[part], bands).T @ share
    return total


def _shown(given: Texels, p: Parameters) -> Array:
    direction, there = shown(p.target, *p.size)
    with np.errstate(invalid="ignore"):
        weighed = _coefficients(given, p.bands) * by_degree(list(p.factors))[:, np.newaxis]
        made = np.zeros((*there.shape, given.light.shape[1]))
        made[there] = _mean(given) + basis(direction[there], p.bands) @ weighed
    return made


@spherical_harmonics.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _shown(texels(inputs["image"].pixels, p.chart), p)


@spherical_harmonics.findings
def findings(inputs: Inputs, p: Parameters, pixels: Array) -> Mapping[str, Any]:
    """The coefficients of the radiance, a row for each function, and the mean light of all directions."""
    given = texels(inputs["image"].pixels, p.chart)
    found, mean = _coefficients(given, p.bands), _mean(given)
    found[0] += mean * math.sqrt(4 * math.pi)
    return {"coefficients": found.tolist(), "mean": mean.tolist()}


# ------------------------------------------------------------------------------------------------------- on devices


def _recurrence(bands: int) -> Array:
    """a and b by m and degree, and the first of every m with its norm; as in `harmonics.basis`."""
    a, b, first = np.zeros((bands, bands)), np.zeros((bands, bands)), np.zeros(bands)
    start = math.sqrt(1 / (4 * math.pi))
    for m in range(bands):
        start *= math.sqrt((2 * m + 1) / (2 * m)) if m else 1.0
        first[m] = start * (math.sqrt(2) if m else 1.0)
        for degree in range(m + 1, bands):
            a[m, degree] = math.sqrt((4 * degree**2 - 1) / (degree**2 - m**2))
            b[m, degree] = math.sqrt(max((degree - 1) ** 2 - m**2, 0) / max(4 * (degree - 1) ** 2 - 1, 1))
    return aligned(np.concatenate([a.reshape(-1), b.reshape(-1), first]), np.float64)


def _eights(each: Array, kind: type[np.floating]) -> Array:
    """Columns as rows, with zeros up to a multiple of eight."""
    rows = each.reshape(len(each), -1).T
    return aligned(np.pad(rows, ((0, 0), (0, -len(each) % 8))), kind)


def _launched(device: Device, given: Texels, p: Parameters) -> Array:
    channels, terms = given.light.shape[1], p.bands * p.bands
    mean, factor = aligned(_mean(given), np.float64), _recurrence(p.bands)
    direction, angle, light = (
        _eights(given.direction, np.float64), _eights(given.angle, np.float64), _eights(given.light, np.float32),
    )  # fmt: skip
    count, items = direction.shape[1], -(-direction.shape[1] // CHUNK)
    partial = aligned_empty((items, terms, channels), np.float64)
    defines: dict[str, int | float | str] = {"BANDS": p.bands, "CHANNELS": channels}
    with device.session() as session:
        session.launch(
            "environment/spherical_harmonics.cl", "project", (items,),
            direction, angle, light, mean, factor, session.write(partial), np.int32(count), np.int32(CHUNK),
            local=(1,), defines=defines,
        )  # fmt: skip
    weighed = aligned(partial.sum(axis=0) * by_degree(list(p.factors))[:, np.newaxis], np.float64)
    target, there = shown(p.target, *p.size)
    wanted = _eights(target[there], np.float64)
    found = aligned_empty((channels, wanted.shape[1]))
    with device.session() as session:
        session.launch(
            "environment/spherical_harmonics.cl", "evaluate", (wanted.shape[1] // 8,),
            wanted, weighed, mean, factor, session.write(found), np.int32(wanted.shape[1]),
            defines=defines,
        )  # fmt: skip
    out = aligned_empty((*there.shape, channels))
    out[...] = 0
    out[there] = found[:, : np.count_nonzero(there)].T
    return out


def _work(p: Parameters, texels: float) -> float:
    width, height = p.size
    return (texels + width * height) * (160.0 + p.bands**2 * 3)


@spherical_harmonics.method(
    "all",
    error=_all_error,
    work=lambda p, knob, facts: _work(p, facts["image"].pixels),
    rates={"opencl": Rate(1e-3, 6e-10), "numpy": Rate(1e-3, 1e-9)},
)
class All:
    """Every texel, in doubles."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        given = texels(inputs["image"].pixels, p.chart)
        return _launched(device, given, p) if device.has_fp64 else All.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_shown(texels(inputs["image"].pixels, p.chart), p).astype(np.float32))


@spherical_harmonics.method(
    "reduced",
    knob=Knob("texels", (64, 256, 1024, 4096), "blocks that the image is put together to", 6, 1e6, order=-1),
    error=_reduced_error,
    work=lambda p, knob, facts: _work(p, min(knob, facts["image"].pixels)) + 200.0 * facts["image"].pixels,
    rates={"opencl": Rate(1e-3, 1e-9), "numpy": Rate(1e-3, 1e-9)},
)
class Reduced:
    """Texels put together to blocks first."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        given = reduced(inputs["image"].pixels, p.chart, knob)
        return _launched(device, given, p) if device.has_fp64 else Reduced.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_shown(reduced(inputs["image"].pixels, p.chart, knob), p).astype(np.float32))
