"""Lighting: what lamps make of surfaces that are given as images of their normals.

Truth, for every pixel, summed over `lamps` i with the light E_i that arrives from them (lamps.py):

    radiance = sum of E_i (diffuse u_i + highlight H_i)

where u_i is the cosine at the surface, 0 or more, and H_i what the `model` says (reflection.py). Nothing is clamped:
highlights are as bright as they are.

Inputs beside the normals, which need not be of unit length: `position`, wanted where a lamp is at a place or a viewer
near; `albedo` and `specular`, colours or grey, which multiply `diffuse` and `highlight`; `roughness` and `tangent`, in
place of `facet_roughness` and `grain`; `visibility`, how much is seen of a lamp, in one channel for all or one for
each; `slide`, what projectors show, and `slab`, what slabs do; `tiles`, which lamps are left out where (see the
operation tiles): their light counts as 0 there, and they are not looked at. What that changes, `faint`, is part of
every error.

The frame is right-handed, x to the right, y up, and the viewer looks along -z: from `eye` where there are positions and
`local_viewer` is set, from infinity along `view` otherwise.

A normal of no length is not lit; nor is a pixel whose position is infinite, where there is nothing. A NaN stays in its
pixel. A lamp that is left by half of a surface takes the highlight of `phong` with it at once, so there rounding
decides about all of it, and the error stated is the highlight.

Methods: `exact` evaluates the formulas in float32; `sparse` too, with fewer discs for each area; `coarse` for
one pixel in many, and what is like it between; `schlick` with C.
Schlick's approximation of the reflectance; `tables` looks up the factors of highlights (tables.py), as graphics
hardware did: on processors that is no faster than to compute them, unless there are exponentials in them.

Sources: see lamps.py, reflection.py and tables.py.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Space
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import POINTWISE, Error, Facts, Input, InputFacts, Inputs, Knob, Light, Operation, Rate
from lichen.operations.lighting import coarse, errors, tables
from lichen.operations.lighting.cases import CASES, EXAMPLES
from lichen.operations.lighting.lamps import WIDE, Kind, Row
from lichen.operations.lighting.launch import on_numpy, on_opencl
from lichen.operations.lighting.parameters import Parameters
from lichen.operations.lighting.reflection import SMOOTHEST, Fresnel, Model
from lichen.operations.lighting.shading import PICTURES
from lichen.operations.scene.lists import listing

if TYPE_CHECKING:
    from lichen.opencl.device import Device

MOST_ROWS = 4096
"""Discs of all lamps together."""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    normal = facts["normal"]
    flaws = [
        Flaw(f"/inputs/{name}", f"is {each.width}x{each.height}; normal is {normal.width}x{normal.height}")
        for name, each in facts.items()
        if name not in (*PICTURES, "tiles") and (each.height, each.width) != (normal.height, normal.width)
    ]
    for name in ("albedo", "specular", *PICTURES):
        if name in facts and (facts[name].channels == 2 or facts[name].alpha is not Alpha.NONE):
            flaws.append(Flaw(f"/inputs/{name}", "must be grey or a colour, without coverage"))
    seen = facts["visibility"].channels if "visibility" in facts else 1
    if seen not in (1, len(p.lights)):
        flaws.append(Flaw("/inputs/visibility", f"has {seen} channels for {len(p.lights)} lamps; one, or one for each"))
    for number, lamp in enumerate(p.lights):
        if lamp.kind is not Kind.DIRECTIONAL and "position" not in facts:
            flaws.append(Flaw(f"/parameters/lights/{number}/kind", f"{lamp.kind} needs the input position"))
        sheet = facts.get("slab") if lamp.kind is Kind.SLAB else None
        if sheet is not None and (sheet.width < lamp.cells[0] or sheet.height < lamp.cells[1]):
            said = f"are {lamp.cells[0]}x{lamp.cells[1]}; the sheet is {sheet.width}x{sheet.height} px"
            flaws.append(Flaw(f"/parameters/lights/{number}/cells", said))
    if p.discs > MOST_ROWS:
        flaws.append(Flaw("/parameters/lights", f"have more than {MOST_ROWS} samples together"))
    if not any(p.view):
        flaws.append(Flaw("/parameters/view", "has no length"))
    return flaws


def _reflected(p: Parameters, facts: InputFacts) -> errors.Reflected:
    def size(name: str, factor: tuple[float, ...]) -> float:
        return max(factor) * (facts[name].extent.magnitude if name in facts else 1.0)

    least = facts["roughness"].extent.low if "roughness" in facts else p.facet_roughness
    through = {name: facts[name].extent.magnitude if name in facts else 1.0 for name in ("visibility", *PICTURES)}
    shown = {Kind.PROJECTOR: through["slide"], Kind.SLAB: through["slab"]}
    arriving = sum(lamp.brightest * shown.get(lamp.kind, 1.0) for lamp in p.lights)
    arriving *= through["visibility"]
    slope = min(max(least, SMOOTHEST), 1.0) ** 2
    return errors.Reflected(
        arriving, size("albedo", p.diffuse), size("specular", p.highlight) if p.shines else 0.0, slope, p.discs
    )


_whole = latest(_reflected)
"""Of all lamps."""


@latest
def _by_formulas(p: Parameters, facts: InputFacts) -> Error:
    return errors.exact(_whole(p, facts), p.material(), _texels(p, facts))


def _and_left_out(
    error: Callable[[Parameters, float, InputFacts], Error],
) -> Callable[[Parameters, float, InputFacts], Error]:
    """With what tiles leave out."""

    def stated(p: Parameters, knob: float, facts: InputFacts) -> Error:
        made = error(p, knob, facts)
        if "tiles" not in facts or not p.faint:
            return made
        return dataclasses.replace(made, value=errors.finite(made.value + p.faint))

    return stated


@latest
def _texels(p: Parameters, facts: InputFacts) -> int:
    """The longer side of what projectors and slabs show, in pictures moved aside as far as they are."""
    sides = [0]
    for lamp in p.lights:
        if lamp.kind is Kind.PROJECTOR and "slide" in facts:
            sides.append(max(facts["slide"].width, facts["slide"].height))
        if lamp.kind is Kind.SLAB and "slab" in facts:
            side = max(facts["slab"].width // lamp.cells[0], facts["slab"].height // lamp.cells[1])
            sides.append(math.ceil(side * (1 + float(np.abs(lamp.rows(0)[:, Row.MOVED : Row.MOVED + 2]).max()))))
    return max(sides)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    normal = facts["normal"]
    space = facts["albedo"].space if "albedo" in facts else Space.LINEAR
    spoilt = any(each.extent.nonfinite for each in facts.values())
    extent = errors.extent(_whole(p, facts), p.material(), normal.pixels * 3 if spoilt else 0)
    return Facts(normal.height, normal.width, 3, space, Alpha.NONE, extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Colours and slides are pictures; a highlight times a change of its colour has no bound but its own."""
    reflected = _whole(p, facts)
    most = errors.gain(reflected, p.material(), shiny="specular" in facts)
    slides = errors.extent(reflected, p.material(), 0).high if facts.keys() & set(PICTURES) else 0.0
    return errors.finite(error * (most + slides))


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    each = {Model.LAMBERT: 1.0, Model.PHONG: 2.5, Model.COSINE_LOBE: 2.5}.get(p.drawn, 3.0)
    placed = 1.0 if "position" in facts else 0.3
    return facts["normal"].pixels * (1.0 + p.discs * (each + placed))


lighting = Operation(
    name="lighting",
    family="lighting",
    summary="Lights surfaces given by their normals: lamps of six kinds, eight models of reflection.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("normal", "which way surfaces face: x, y, z of any length", (3, 3), picture=False),
        Input("position", "where surfaces are: x, y, z", (3, 3), required=False, picture=False),
        Input("albedo", "diffuse colour, or grey", (1, 3), required=False),
        Input("specular", "colour of highlights, or grey", (1, 3), required=False),
        Input("roughness", "of the facets, 0 to 1", (1, 1), required=False, picture=False),
        Input("tangent", "which way the grain goes: x, y, z of any length", (3, 3), required=False, picture=False),
        Input("visibility", "share of each lamp that is seen, 1 where nothing is in the way", (1, None), False, False),
        Input("slide", "what projectors show; of any size", (1, 3), required=False),
        Input("slab", "what leaves slabs: a sheet of pictures, one for each of their cells", (1, 3), required=False),
        listing("the lamp"),
    ),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=_propagate,
    implied=lambda p, facts: (
        "slides and lists of tiles are read where lamps and the picture's corner say, whatever part is taken"
        if "slide" in facts or "tiles" in facts
        else {}
    ),
    check=_check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


RATES = {"opencl": Rate(3e-4, 2e-9), "numpy": Rate(5e-4, 1.2e-7)}


@lighting.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return on_numpy(inputs, p, p.material(), single=False)


def _tabled(p: Parameters, facts: InputFacts) -> str | None:
    if not p.shines or not tables.factored(p.material()):
        return "its highlights are no product of factors of one angle each"
    return "a table holds for one roughness" if "roughness" in facts else None


@lighting.method(
    "tables",
    error=_and_left_out(
        lambda p, size, facts: errors.looked_up(_whole(p, facts), p.material(), round(size), _texels(p, facts))
    ),
    work=lambda p, size, facts: _work(p, size, facts) + size,
    rates=RATES,
    knob=Knob("size", (16, 64, 256, 1024), "entries of each table", 4, 4096, order=-2),
    orderly=True,
    unfit=_tabled,
)
class Tables:
    """Reflectance, spread and masking looked up, each in a table of one angle, linear between `size` entries."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, size: float) -> Array:
        return on_opencl(device, inputs, p, p.material(size=round(size)))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, size: float) -> Array:
        return on_numpy(inputs, p, p.material(size=round(size)))


@lighting.method(
    "schlick",
    error=_and_left_out(lambda p, knob, facts: errors.schlick(_whole(p, facts), p.material(), _texels(p, facts))),
    work=_work,
    rates=RATES,
    unfit=lambda p, facts: (
        None
        if p.drawn is Model.TORRANCE_SPARROW and p.index is not None
        else "only a reflectance by Fresnel's formula can be approximated"
    ),
)
class Schlick:
    """Reflectance as f + (1 - f) (1 - c)^5 from that of light that falls straight."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_opencl(device, inputs, p, p.material(Fresnel.SCHLICK))

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_numpy(inputs, p, p.material(Fresnel.SCHLICK))


def _sparse_error(p: Parameters, share: float, facts: InputFacts) -> Error:
    """What an area gives, either way: lamps at its discs may be anywhere in a highlight."""
    rounding = _by_formulas(p, facts).value
    if share >= 1 or _without_areas(p, facts):
        return Error(rounding, "estimate", rounding)
    apart = max(_from_all_areas(p, facts), _from_areas(p.sparse(share), facts))
    return Error(errors.finite(rounding + apart), "estimate", rounding)


def _from_areas(p: Parameters, facts: InputFacts) -> float:
    """The most that they give."""
    areas = p.model_copy(update={"lights": tuple(lamp for lamp in p.lights if lamp.kind in WIDE)})
    return errors.extent(_reflected(areas, facts), p.material(), 0).high


_from_all_areas = latest(_from_areas)


def _sparse_least(p: Parameters, share: float, facts: InputFacts) -> float:
    """As much as all of them give."""
    return 0.0 if share >= 1 or _without_areas(p, facts) else _from_all_areas(p, facts)


def _without_areas(p: Parameters, facts: InputFacts) -> str | None:
    wide = any(lamp.kind in WIDE and math.prod(lamp.grid) > 1 for lamp in p.lights)
    return None if wide else "no lamp is made up of several discs"


@lighting.method(
    "sparse",
    error=_and_left_out(_sparse_error),
    least=_sparse_least,
    work=lambda p, share, facts: _work(p.sparse(share), share, facts),
    rates=RATES,
    knob=Knob("share", (1 / 64, 1 / 16, 1 / 4, 1.0), "of the discs that make up areas", 1 / 1024, 1.0),
    unfit=_without_areas,
)
class Sparse:
    """The formulas in float32, with a `share` of the discs of each area in place of all: larger ones, on a coarser
    grid; of slabs a share of the cells."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, share: float) -> Array:
        return on_opencl(device, inputs, p.sparse(share), p.material())

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, share: float) -> Array:
        return on_numpy(inputs, p.sparse(share), p.material())


def _coarse_error(p: Parameters, step: float, facts: InputFacts) -> Error:
    """Means of light differ from it by its range at most: that from 0 where no colour is negative."""
    rounding = _by_formulas(p, facts).value
    if coarse.power(step) == 1:
        return Error(rounding, "estimate", rounding)
    most = _brightest(p, facts)
    signed = any(facts[name].extent.low < 0 for name in ("albedo", "specular", "visibility") if name in facts)
    return Error(errors.finite(rounding + most * (1 + signed)), "estimate", rounding, _usual(most, step))


def _coarse_least(p: Parameters, step: float, facts: InputFacts) -> float:
    """As it is off as a rule, or by all of the light."""
    if coarse.power(step) == 1:
        return 0.0
    most = _brightest(p, facts)
    return max(min(_usual(most, step), most) - _by_formulas(p, facts).value, 0.0)


@latest
def _brightest(p: Parameters, facts: InputFacts) -> float:
    return errors.extent(_whole(p, facts), p.material(), 0).high


def _usual(most: float, step: float) -> float:
    """Of the largest light, by which coarse light is off as a rule."""
    return errors.finite(most * 2e-4 * step * step)


@lighting.method(
    "coarse",
    error=_coarse_error,
    least=_coarse_least,
    work=lambda p, step, facts: (
        _work(p, step, facts) * ((1 + p.shines) / coarse.power(step) ** 2 + 0.05) + 4 * facts["normal"].pixels
        if coarse.power(step) > 1
        else _work(p, step, facts)
    ),
    rates=RATES,
    knob=Knob("step", (8, 4, 2, 1), "px between those that are lit: the nearest power of 2", 1, 64, rising=False),
    unfit=coarse.unfit,
)
class Coarse:
    """One pixel in step^2 is lit by the formulas; those between take the light of what is like them around (coarse.py),
    and those that nothing is like are lit by themselves."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, step: float) -> Array:
        apart = coarse.power(step)
        if apart == 1:
            return on_opencl(device, inputs, p, p.material())
        return coarse.opencl_body(device, inputs, p, apart)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, step: float) -> Array:
        apart = coarse.power(step)
        return on_numpy(inputs, p, p.material()) if apart == 1 else coarse.numpy_body(inputs, p, apart)


@lighting.method("exact", error=_and_left_out(lambda p, knob, facts: _by_formulas(p, facts)), work=_work, rates=RATES)
class Exact:
    """The formulas in float32, sixteen pixels at a time, lamp by lamp."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_opencl(device, inputs, p, p.material())

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return on_numpy(inputs, p, p.material())
