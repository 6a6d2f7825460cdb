"""Reduced lighting: surfaces lit, and seen from so far away that many of their pixels become one.

Truth: the mean of `lighting` over squares of `factor` px, counted from the upper left corner, of what is there of those
that end at an edge. Parameters and inputs are those of `lighting`.

Light is no linear function of a normal, so the mean of what many normals send is not what their mean sends: rough
ground seen from afar shines in a wide soft spot, and a normal map that was made smaller beforehand in a small bright
one.

Methods: `lit_first` lights every pixel and takes means, as the definition does. `filtered_first` takes the means of
normals, places, colours and roughness and lights them, as mip maps of normals have it: factor^2 times less to light,
and wrong where normals differ within a square. `widened` does so, too, and makes surfaces rougher by the variance of
their normals, which the length r of their mean tells: the square of the slope grows by 2 (1 - r) / r.

Sources: W. Heidrich, High-quality shading and lighting, dissertation, Erlangen 1999, section 9.1.1; A. Schilling,
Toward real-time photorealistic rendering: challenges and solutions, 1997; M. Toksvig, Mipmapping normal maps, Journal
of Graphics Tools 10, 2005.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from lichen.image import Image
from lichen.memory import Array, aligned
from lichen.once import latest
from lichen.operation import ROUNDING, WHOLE, Error, Facts, HardCase, InputFacts, Inputs, Light, Operation, Rate
from lichen.operations.lighting.errors import finite
from lichen.operations.lighting.launch import on_numpy, on_opencl
from lichen.operations.lighting.lighting import lighting
from lichen.operations.lighting.lighting import truth as lit_truly
from lichen.operations.lighting.parameters import Parameters as Lighting
from lichen.operations.lighting.reflection import SMOOTHEST, unit

if TYPE_CHECKING:
    from lichen.opencl.device import Device

USUAL = 0.02
"""Of the largest light, by which light of mean normals is off as a rule."""


class Parameters(Lighting):
    factor: int = Field(4, ge=1, le=256)
    """px; the side of the squares that become one pixel"""


def _means(pixels: Array, factor: int) -> Array:
    """Of squares, in doubles, rounded to what the pixels are."""
    down, across = (np.arange(0, size, factor) for size in pixels.shape[:2])
    with np.errstate(all="ignore"):
        sums = np.add.reduceat(np.add.reduceat(pixels.astype(np.float64), down, axis=0), across, axis=1)
    rows, columns = (np.minimum(factor, size - at) for size, at in zip(pixels.shape, (down, across), strict=False))
    return np.asarray((sums / (rows[:, None, None] * columns[:, None])).astype(pixels.dtype))


def _reduced(p: Parameters, facts: Facts) -> tuple[int, int]:
    return -(-facts.height // p.factor), -(-facts.width // p.factor)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    made = lighting.result(p, facts)
    height, width = _reduced(p, made)
    return replace(made, height=height, width=width)


@latest
def _lit(p: Parameters, facts: InputFacts) -> tuple[Error, float]:
    """The error of lighting with the mean's rounding, and the brightest that it makes."""
    made, most = lighting.methods["exact"].error(p, 0.0, facts), lighting.result(p, facts).extent.high
    more = ROUNDING * most
    return replace(made, value=finite(made.value + more), rounding=finite(made.rounding + more)), most


def _lit_first_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return _lit(p, facts)[0]


def _filtered_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Both are light that surfaces may send: no more than its range apart."""
    exact, most = _lit(p, facts)
    if p.factor == 1:
        return exact
    signed = any(facts[name].extent.low < 0 for name in ("albedo", "specular") if name in facts)
    return Error(finite(exact.value + most * (1 + signed)), "estimate", exact.rounding, finite(most * USUAL))


def _half(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    """Of two slopes that each face one of two lamps: half of the squares' pixels are lit by each."""
    expected = np.full_like(pixels, 0.5 * np.cos(np.radians(50)))
    return None if np.allclose(pixels, expected, rtol=1e-5) else f"expected {expected.ravel()}, got {pixels.ravel()}"


def _ridges() -> Mapping[str, Array]:
    tilt = np.radians(50)
    slopes = np.array([[np.sin(tilt), 0, np.cos(tilt)], [-np.sin(tilt), 0, np.cos(tilt)]], np.float32)
    return {"normal": np.tile(slopes, (4, 2, 1))}


def _lost(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    lost = np.asarray(np.isnan(pixels).any(axis=-1))
    return None if lost[0, 0] and np.count_nonzero(lost) == 1 else f"NaN in {lost.tolist()}"


reduced_lighting = Operation(
    name="reduced_lighting",
    family="lighting",
    summary="Lights surfaces and makes the picture smaller: first lit and then filtered, or the other way round.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=tuple(
        each for each in lighting.inputs if each.name in ("normal", "position", "albedo", "specular", "roughness")
    ),
    light=Light.LINEAR,
    footprint=lambda p, facts: WHOLE,
    result=_result,
    propagate=lambda p, facts, error: lighting.propagate(p, facts, error),
    implied=lambda p, facts: "squares are counted from the picture's corner",
    check=lambda p, facts: lighting.check(p, facts),
    examples=(
        {"lights": [{"direction": [-1, -1, -1]}], "facet_roughness": 0.3, "factor": 4},
        {"lights": [{"direction": [1, -1, -2]}], "model": "blinn_phong", "exponent": 50, "factor": 8},
    ),
    hard_cases=(
        HardCase(
            "two slopes, each lit by a lamp that the other cannot see",
            "the mean of both normals looks up, and sees neither lamp as either slope does",
            _ridges,
            {
                "lights": [{"direction": [-1, 0, 0]}, {"direction": [0, 1, 0]}],
                "model": "lambert", "diffuse": [1 / np.tan(np.radians(50))] * 3, "factor": 2,
            },
            _half,
            methods=("lit_first",),
        ),
        HardCase(
            "squares that end at the edge, and a normal that is none",
            "a mean over pixels that are not there; NaN in a sum of rows goes on to all that follow",
            lambda: {"normal": np.where(np.arange(35).reshape(5, 7, 1) == 8, np.nan, [0.0, 0.0, 1.0])},
            {"factor": 3},
            _lost,
        ),
    ),
)  # fmt: skip


@reduced_lighting.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _means(lit_truly(inputs, p), p.factor)


def _filtered(inputs: Inputs, p: Parameters, *, widened: bool = False) -> dict[str, Image]:
    """The means of all inputs, normals as unit vectors; rougher where normals differ."""
    with np.errstate(all="ignore"):
        facing = np.moveaxis(unit(np.moveaxis(inputs["normal"].pixels, -1, 0)), 0, -1)
        made = {name: image.replace(pixels=aligned(_means(image.pixels, p.factor))) for name, image in inputs.items()}
        mean = _means(facing, p.factor)
        made["normal"] = inputs["normal"].replace(pixels=aligned(mean))
        if widened:
            length = np.minimum(np.sqrt(np.sum(mean.astype(np.float64) ** 2, axis=-1, keepdims=True)), 1)
            rough = made["roughness"].pixels if "roughness" in made else np.full_like(length, p.facet_roughness)
            square = np.clip(rough, SMOOTHEST, 1) ** 4 + 2 * (1 - length) / np.where(length > 0, length, 1)
            made["roughness"] = Image(aligned(np.minimum(square, 1) ** 0.25))
    return made


def _fewer(p: Parameters, knob: float, facts: InputFacts) -> float:
    height, width = _reduced(p, facts["normal"])
    small = {name: replace(each, height=height, width=width) for name, each in facts.items()}
    return lighting.methods["exact"].work(p, knob, small) + 8.0 * facts["normal"].pixels


RATES = {"opencl": Rate(2e-3, 4e-9), "numpy": Rate(2e-3, 1.2e-7)}


@reduced_lighting.method("filtered_first", error=_filtered_error, work=_fewer, rates=RATES)
class FilteredFirst:
    """Means of normals, places, colours and roughness, lit."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_opencl(device, _filtered(inputs, p), p, p.material())

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_numpy(_filtered(inputs, p), p, p.material())


def _unwidened(p: Parameters, facts: InputFacts) -> str | None:
    if not p.shines:
        return "there are no highlights that roughness would widen"
    return "highlights are by an exponent, not by roughness" if p.exponent is not None else None


def _widened_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    made = _filtered_error(p, knob, facts)
    return made if made.typical is None else replace(made, typical=made.typical / 2)


@reduced_lighting.method("widened", error=_widened_error, work=_fewer, rates=RATES, unfit=_unwidened)
class Widened:
    """Means of normals, places and colours, lit; as much rougher as the normals differ."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_opencl(device, _filtered(inputs, p, widened=True), p, p.material())

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_numpy(_filtered(inputs, p, widened=True), p, p.material())


@reduced_lighting.method(
    "lit_first",
    error=_lit_first_error,
    work=lambda p, knob, facts: lighting.methods["exact"].work(p, knob, facts) + 4.0 * facts["normal"].pixels,
    rates=RATES,
)
class LitFirst:
    """Every pixel lit in float32, and the means of their light."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_means(on_opencl(device, inputs, p, p.material()), p.factor))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_means(on_numpy(inputs, p, p.material()), p.factor))
