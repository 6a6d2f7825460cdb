"""Lighting: what lamps make of surfaces that are given as images of their normals.

Truth, for every pixel, summed over `lamps` i with the light E_i that arrives from them (lamps.py):

    radiance = sum of E_i (diffuse u_i + highlight H_i)

where u_i is the cosine at the surface, 0 or more, and H_i what the `model` says (reflection.py). Nothing is clamped:
highlights are as bright as they are.

Inputs beside the normals, which need not be of unit length: `position`, wanted where a lamp is at a place or a viewer
near; `albedo` and `specular`, colours or grey, which multiply `diffuse` and `highlight`; `roughness` and `tangent`, in
place of `facet_roughness` and `grain`; `visibility`, how much is seen of a lamp, in one channel for all or one for
each; `slide`, what projectors show.

The frame is right-handed, x to the right, y up, and the viewer looks along -z: from `eye` where there are positions and
`local_viewer` is set, from infinity along `view` otherwise.

A normal of no length is not lit; nor is a pixel whose position is infinite, where there is nothing. A NaN stays in its
pixel. A lamp that is left by half of a surface takes the highlight of `phong` with it at once, so there rounding
decides about all of it, and the error stated is the highlight.

Methods: `exact` evaluates the formulas in float32, `schlick` with C. Schlick's approximation of the reflectance.

Sources: see lamps.py and reflection.py.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
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
from lichen.operations.lighting import errors
from lichen.operations.lighting.cases import CASES, EXAMPLES
from lichen.operations.lighting.lamps import Colour, Doubles, Kind, Lamp, Vector, unit_vector
from lichen.operations.lighting.reflection import SMOOTHEST, STEEP, Distribution, Fresnel, Masking, Material, Model
from lichen.operations.lighting.shading import Lit, lit

if TYPE_CHECKING:
    from lichen.opencl.device import Device

MOST_ROWS = 4096
"""Discs of all lamps together."""


class Parameters(OperationParameters):
    lights: Annotated[tuple[Lamp, ...], Field(min_length=1, max_length=256)] = (
        Lamp.model_validate({"direction": (-1.0, -1.0, -2.0)}),
    )
    """the lamps, each by its kind (directional, point, spot, area, projector), colour, intensity and place"""
    model: Model = Model.TORRANCE_SPARROW
    """how the surface reflects besides diffusely"""
    diffuse: Colour = (0.8, 0.8, 0.8)
    """share of light that is reflected diffusely, linear; times the input albedo"""
    highlight: Colour = (1.0, 1.0, 1.0)
    """factor on highlights, linear; times the input specular; 0 leaves them out"""
    facet_roughness: float = Field(0.4, ge=0, le=1)
    """where there is no input roughness; its square is the slope of facets; less than 0.05 is taken as that"""
    exponent: float | None = Field(None, ge=1, le=1e5)
    """of the models that are powers of a cosine, in place of the one from the roughness"""
    index: float | None = Field(1.5, ge=1, le=1000)
    """of refraction, for torrance_sparrow; null: all is reflected"""
    distribution: Distribution = Distribution.GGX
    """of the facets of torrance_sparrow"""
    masking: Masking = Masking.SMITH
    """how facets of torrance_sparrow hide one another"""
    grain: Vector = (1.0, 0.0, 0.0)
    """its direction for ward, lafortune and banks, where there is no input tangent"""
    stretch: float = Field(1.0, ge=0.1, le=10)
    """for ward: how much rougher the surface is along the grain than on the mean, and smoother across it"""
    lobe: Annotated[
        tuple[
            Annotated[float, Field(ge=-1, le=1)],
            Annotated[float, Field(ge=-1, le=1)],
            Annotated[float, Field(ge=-1, le=1)],
        ],
        Field(),
    ] = (-1.0, -1.0, 1.0)
    """for lafortune: factors along the grain, across it and along the normal; -1, -1, 1 mirrors"""
    eye: Vector = (0.0, 0.0, 0.0)
    """where the viewer is"""
    view: Vector = (0.0, 0.0, 1.0)
    """the direction towards a viewer at infinity"""
    local_viewer: bool = True
    """whether the viewer is at `eye`, given positions, or at infinity"""

    @property
    def fresnel(self) -> Fresnel:
        return Fresnel.NONE if self.index is None else Fresnel.EXACT

    @property
    def grained(self) -> bool:
        """Whether the model looks at the grain."""
        plain = self.lobe[0] == self.lobe[1] if self.model is Model.LAFORTUNE else self.stretch == 1
        return self.model is Model.BANKS or (self.model in (Model.LAFORTUNE, Model.WARD) and not plain)

    @property
    def shines(self) -> bool:
        dull = self.model is Model.TORRANCE_SPARROW and self.index == 1
        return self.model is not Model.LAMBERT and any(self.highlight) and not dull

    @property
    def drawn(self) -> Model:
        """The model whose code is needed."""
        return self.model if self.shines or self.model is Model.BANKS else Model.LAMBERT

    def material(self, fresnel: Fresnel | None = None) -> Material:
        contrast = 0.0 if self.index is None else (self.index - 1) * (self.index + 1)
        return Material(
            self.drawn, self.distribution, self.masking, fresnel or self.fresnel, contrast, self.exponent,
            self.stretch, self.lobe,
        )  # fmt: skip

    def rows(self) -> Doubles:
        return np.concatenate([lamp.rows(number) for number, lamp in enumerate(self.lights)])


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    normal = facts["normal"]
    flaws = [
        Flaw(f"/inputs/{name}", f"is {each.width}x{each.height}; normal is {normal.width}x{normal.height}")
        for name, each in facts.items()
        if name != "slide" and (each.height, each.width) != (normal.height, normal.width)
    ]
    for name in ("albedo", "specular", "slide"):
        if name in facts and (facts[name].channels == 2 or facts[name].alpha is not Alpha.NONE):
            flaws.append(Flaw(f"/inputs/{name}", "must be grey or a colour, without coverage"))
    seen = facts["visibility"].channels if "visibility" in facts else 1
    if seen not in (1, len(p.lights)):
        flaws.append(Flaw("/inputs/visibility", f"has {seen} channels for {len(p.lights)} lamps; one, or one for each"))
    for number, lamp in enumerate(p.lights):
        if lamp.kind is not Kind.DIRECTIONAL and "position" not in facts:
            flaws.append(Flaw(f"/parameters/lights/{number}/kind", f"{lamp.kind} needs the input position"))
    if sum(math.prod(lamp.grid) for lamp in p.lights) > MOST_ROWS:
        flaws.append(Flaw("/parameters/lights", f"have more than {MOST_ROWS} samples together"))
    if not any(p.view):
        flaws.append(Flaw("/parameters/view", "has no length"))
    return flaws


def _reflected(p: Parameters, facts: InputFacts) -> errors.Reflected:
    def size(name: str, factor: tuple[float, ...]) -> float:
        return max(factor) * (facts[name].extent.magnitude if name in facts else 1.0)

    least = facts["roughness"].extent.low if "roughness" in facts else p.facet_roughness
    through = {name: facts[name].extent.magnitude if name in facts else 1.0 for name in ("visibility", "slide")}
    arriving = sum(lamp.brightest * (through["slide"] if lamp.kind is Kind.PROJECTOR else 1.0) for lamp in p.lights)
    arriving *= through["visibility"]
    slope = min(max(least, SMOOTHEST), 1.0) ** 2
    return errors.Reflected(
        arriving, size("albedo", p.diffuse), size("specular", p.highlight) if p.shines else 0.0, slope, len(p.rows())
    )


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return errors.exact(_reflected(p, facts), p.material(), _texels(p, facts))


def _schlick_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return errors.schlick(_reflected(p, facts), p.material(), _texels(p, facts))


def _texels(p: Parameters, facts: InputFacts) -> int:
    """The longer side of what projectors show."""
    shown = any(lamp.kind is Kind.PROJECTOR for lamp in p.lights) and "slide" in facts
    return max(facts["slide"].width, facts["slide"].height) if shown else 0


def _result(p: Parameters, facts: InputFacts) -> Facts:
    normal = facts["normal"]
    space = facts["albedo"].space if "albedo" in facts else Space.LINEAR
    spoilt = any(each.extent.nonfinite for each in facts.values())
    extent = errors.extent(_reflected(p, facts), p.material(), normal.pixels * 3 if spoilt else 0)
    return Facts(normal.height, normal.width, 3, space, Alpha.NONE, extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Colours and slides are pictures; a highlight times a change of its colour has no bound but its own."""
    reflected = _reflected(p, facts)
    most = errors.gain(reflected, p.material(), shiny="specular" in facts)
    slides = errors.extent(reflected, p.material(), 0).high if "slide" in facts else 0.0
    return errors.finite(error * (most + slides))


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    each = {Model.LAMBERT: 1.0, Model.PHONG: 2.5, Model.COSINE_LOBE: 2.5}.get(p.drawn, 3.0)
    placed = 1.0 if "position" in facts else 0.3
    return facts["normal"].pixels * (1.0 + len(p.rows()) * (each + placed))


lighting = Operation(
    name="lighting",
    family="lighting",
    summary="Lights surfaces given by their normals: lamps of five kinds, eight models of reflection.",
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
    ),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


def _task(p: Parameters, inputs: Inputs, fresnel: Fresnel | None, *, single: bool) -> Lit:
    local = p.local_viewer and "position" in inputs
    return Lit(
        p.rows(), p.material(fresnel), p.eye if local else None, p.view, p.diffuse, p.highlight, p.facet_roughness,
        p.grain, single,
    )  # fmt: skip


@lighting.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return lit({name: image.pixels for name, image in inputs.items()}, _task(p, inputs, None, single=False))


NAMES = ("position", "albedo", "specular", "roughness", "tangent", "visibility", "slide")


def _numbers(p: Parameters, task: Lit) -> Array:
    """What the kernel reads of the parameters, in its order."""
    eye = np.array(p.eye)
    near = eye.astype(np.float32)
    material = task.material
    straight = 0.0 if p.index is None else ((p.index - 1) / (p.index + 1)) ** 2
    return np.concatenate(
        [
            near, eye - near, unit_vector(p.view), [float(task.eye is not None)], p.diffuse, p.highlight,
            [p.facet_roughness, SMOOTHEST, p.exponent or 0.0, material.contrast, straight, p.stretch], p.lobe,
            unit_vector(p.grain), [STEEP**2],
        ]
    )  # fmt: skip


def _launch(device: Device, inputs: Inputs, p: Parameters, fresnel: Fresnel | None) -> Array:
    normal, task = inputs["normal"], _task(p, inputs, fresnel, single=True)
    out = aligned_empty((normal.height, normal.width, 3))
    pixels = normal.height * normal.width
    channels = [inputs[name].channels if name in inputs else 0 for name in NAMES]
    slide: Any = inputs.get("slide", normal)
    material = task.material
    with device.session() as session:
        session.launch(
            "lighting/lighting.cl", "lighting", (-(-pixels // 16),),
            aligned(normal.pixels), *(aligned(inputs[name].pixels) if name in inputs else None for name in NAMES),
            aligned(np.array(channels), np.int32), np.int32(slide.width), np.int32(slide.height),
            aligned(task.rows), np.int32(len(task.rows)), aligned(_numbers(p, task)),
            np.int32(list(Distribution).index(material.distribution)),
            np.int32(list(Masking).index(material.masking)), np.int32(list(Fresnel).index(material.fresnel)),
            session.write(out), np.uint64(pixels),
            defines={"MODEL": list(Model).index(material.model)},
        )  # fmt: skip
    return out


def _single(inputs: Inputs, p: Parameters, fresnel: Fresnel | None) -> Array:
    pixels = {name: image.pixels for name, image in inputs.items()}
    return lit(pixels, _task(p, inputs, fresnel, single=True))


@lighting.method("exact", error=_exact_error, work=_work, rates={"opencl": Rate(3e-4, 1e-9), "numpy": Rate(3e-4, 2e-8)})
class Exact:
    """The formulas in float32, sixteen pixels at a time, lamp by lamp."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launch(device, inputs, p, None)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _single(inputs, p, None)


@lighting.method(
    "schlick",
    error=_schlick_error,
    work=_work,
    rates={"opencl": Rate(3e-4, 1e-9), "numpy": Rate(3e-4, 2e-8)},
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
        return _launch(device, inputs, p, Fresnel.SCHLICK)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _single(inputs, p, Fresnel.SCHLICK)
