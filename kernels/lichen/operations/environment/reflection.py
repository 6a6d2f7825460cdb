"""Reflection: the environment seen in a surface and through it, from a picture of its normals.

Truth. What a pixel shows of a surface, the normal n turned to the viewer and the direction v to the viewer, is said in
`lichen.operations.environment.surfaces`. With c = n . v, `index` the index of the body over that of what is around it
(inverted where the viewer is inside, behind the normal), and L(d) the environment in direction d, bilinear between its
texels (`lichen.operations.environment.framed`),

    r = 2 c n - v                                     the mirror's direction
    t = (c / i - sqrt(1 - (1 - c^2) / i^2)) n - v / i the refracted one; r where the root has none: total reflection
    F = Fresnel's reflectance at c                    or the constant `reflectance` where `fresnel` is none
    under = base, base x irradiance(n) or irradiance(n), whichever inputs there are; times 1 - F where `coated`

    mirror      F L(r) + under
    refraction  (1 - F) L(t) + under                  reflectance x L(t) where `fresnel` is none
    glass       F L(r) + (1 - F) L(t) + under

So one request gives a mirror, a varnished picture (a base, coated), the classic sum of a mirror by Fresnel's weight and
an irradiance map, or thin glass: a body without thickness, through which one refraction is seen. Frosted glass and
glossy mirrors are the same with an environment that was blurred. Normals are the pixels' own, so that normal maps need
no more than a picture of them. The environment is turned by yaw, pitch and roll as a camera is.

Where no surface is (a normal of 0, a position at infinity) the base passes, or the environment is seen straight ahead
where `background` is environment.

Where `tiles` leave the environment out (see the operation tiles) the base passes, too, and nothing is looked up; what
that changes, `faint`, is part of every error.

Methods: `exact`; `single` finds mirrors in float32, which moves what is seen by a part of a texel, and again in doubles
where a rounding could decide in which chart it lies; `schlick` takes Schlick's approximation of F; `nearest` takes the
texel a direction falls in.

Sources: W. Heidrich and H.-P. Seidel, View-independent environment maps, Graphics Hardware 1998; W. Heidrich et al.,
Applications of pixel textures in visualization and realistic image synthesis, I3D 1999, section 6; the reflectance
stands in `lichen.operations.environment.fresnel`.
"""

from __future__ import annotations

import dataclasses
import math
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    WHOLE,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX
from lichen.operations.environment import framed
from lichen.operations.environment.fresnel import algebraic, reflectance, schlick
from lichen.operations.environment.reflection_cases import CASES, EXAMPLES
from lichen.operations.environment.reflection_errors import (
    exact_error,
    nearest_error,
    no_single,
    range_of,
    rounded,
    schlick_error,
    schlick_least,
    single_error,
)
from lichen.operations.environment.reflection_parameters import Background, Fresnel, Mode, Parameters, check
from lichen.operations.environment.surfaces import Convention, Encoding, mirrored, refracted, surface
from lichen.operations.scene.lists import left_out, listing, passed
from lichen.operations.warp.charts import FACES, NOTHING, Chart

if TYPE_CHECKING:
    from collections.abc import Callable

    from lichen.opencl.device import Device
    from lichen.opencl.session import Held

    Lookup = Callable[[Array, framed.Found], Array]
    Weight = Callable[[Array, Array], Array]


SEGMENT, RUN = 64, 64
"""Pixels, and segments that are looked at for those in doubt, of a work-item of the kernel."""


def _result(p: Parameters, facts: InputFacts) -> Facts:
    normal, environment = facts["normal"], facts.get("environment", facts["normal"])
    low, high = range_of(p, facts)
    slack = rounded(p, facts)
    bad = any(each.extent.nonfinite for each in facts.values()) or max(abs(low), abs(high)) + slack >= FLOAT_MAX
    extent = Extent(
        max(low - slack, -FLOAT_MAX), min(high + slack, FLOAT_MAX), normal.pixels * environment.channels if bad else 0
    )
    return dataclasses.replace(environment, height=normal.height, width=normal.width, extent=extent)


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    base, light = (facts[n].extent.magnitude if n in facts else 1.0 for n in ("base", "irradiance"))
    return error * (2 + base + light + error)


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    """Of a pixel of the surface; any texel of an environment may be read."""
    spoilt = any(facts[name].extent.nonfinite for name in ("environment", "irradiance") if name in facts)
    return WHOLE if spoilt else POINTWISE


reflection = Operation(
    name="reflection",
    family="environment",
    summary="Shows an environment in a surface and through it: mirror, varnish, thin glass; from a picture of normals.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("normal", "normals of any length, x, y and z, or x and y alone", (2, 3), picture=False),
        Input("environment", "light from all directions, as `chart` says", (1, 4)),
        Input("position", "where the surface is, x, y and z", (3, 3), required=False, picture=False),
        Input("base", "what the surface shows by itself", (1, 4), required=False),
        Input("irradiance", "an environment that is looked up by the normal", (1, 4), required=False),
        listing("the environment"),
    ),
    light=Light.LINEAR,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    result=_result,
    propagate=_propagate,
    implied=lambda p, facts: "any texel may be read, so tiles of the environment are none of the result",
    check=check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


def _evaluated(inputs: Inputs, p: Parameters, look: Lookup, weight: Weight, kind: type[np.floating]) -> Array:
    """The definition; places and weights in doubles, sums in `kind`."""
    seen = surface(inputs, p, p.index)
    images = {
        name: framed.framed(inputs[name].pixels, p.chart) for name in ("environment", "irradiance") if name in inputs
    }
    turn, behind = p.turn, p.background is Background.ENVIRONMENT

    def light(name: str, d: Array) -> Array:
        image = images[name]
        x, y, z = (row[0] * d[0] + row[1] * d[1] + row[2] * d[2] for row in turn)
        return look(image, framed.locate((x, y, z), p.chart, image.shape[1] - 2, image.shape[2] - 2))

    with np.errstate(all="ignore"):
        share = weight(seen.c, seen.ratio) if p.fresnel is Fresnel.DIELECTRIC else np.full_like(seen.c, p.reflectance)
        share = share.astype(kind)[..., np.newaxis]
        base = inputs["base"].pixels if "base" in inputs else None
        made: Array = np.zeros((*seen.c.shape, inputs["environment"].channels), kind)
        kept = 1 - share if p.coated else kind(1)
        if "irradiance" in inputs:
            made = light("irradiance", seen.outward) * (kept if base is None else base * kept)
        elif base is not None:
            made = base * kept
        if p.mode is not Mode.REFRACTION:
            made = made + share * light("environment", mirrored(seen))
        if p.mode is not Mode.MIRROR:
            direction, _ = refracted(seen)
            passes = share if p.mode is Mode.REFRACTION and p.fresnel is Fresnel.NONE else 1 - share
            made = made + passes * light("environment", direction)
        if seen.empty.any():
            plain = base if base is not None and not behind else np.zeros_like(made)
            plain = light("environment", -seen.view) if behind else plain
            made = np.where(seen.empty[..., np.newaxis], plain, made)
    return passed(made, base, inputs, p.effect)


@reflection.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _evaluated(inputs, p, framed.between, reflectance, np.float64)


# ------------------------------------------------------------------------------------------------------- on devices


@cache
def _cells(device: Device, chart: Chart) -> Held:
    """Where a cube's image shows each of its faces."""
    faces = FACES.get(chart, FACES[Chart.CUBE])
    return device.constant(np.array([faces.index(each) for each in range(NOTHING)]), np.int32)


@lru_cache(maxsize=64)
def _numbers(device: Device, p: Parameters, height: int) -> Held:
    """The kernel's doubles, for a picture of this height; kept, since frames of one scene ask for the same."""
    scale = math.tan(math.radians(p.fov or 0.0) / 2) / (0.5 * height)
    made = np.array([*p.turn.reshape(-1), *p.eye, scale, p.index, 1 / p.index, p.reflectance])
    return device.constant(made, np.float64)


def _launched(
    device: Device,
    inputs: Inputs,
    p: Parameters,
    *,
    nearest: bool = False,
    approximate: bool = False,
    single: bool = False,
) -> Array:
    normal = inputs["normal"]
    channels = inputs["environment"].channels
    maps = {name: framed.kept(inputs[name], p.chart) for name in ("environment", "irradiance") if name in inputs}
    short = single or (nearest and p.fresnel is Fresnel.NONE)
    charts = {Chart.LATLONG: 0, Chart.PARABOLOID: 2, Chart.MIRROR_BALL: 3}
    fresnel = 0 if p.fresnel is Fresnel.NONE else (2 if approximate else 1)
    defines: dict[str, int | float | str] = {
        "NORMALS": normal.channels, "UNIT": int(p.encoding is Encoding.UNIT),
        "DOWN": int(p.convention is Convention.DIRECTX), "CHART": charts.get(p.chart, 1),
        "VIEW": 2 if "position" in inputs else int(p.fov is not None), "MODE": list(Mode).index(p.mode),
        "FRESNEL": fresnel, "COLOURS": channels, "BASE": int("base" in inputs),
        "WEIGHT": "float" if 0.5 <= p.index <= 2 else "double", "IRRADIANCE": int("irradiance" in inputs),
        "COATED": int(p.coated), "REAL": "float" if short else "double", "SHORT": int(short),
        "BEHIND": int(p.background is Background.ENVIRONMENT), "NEAREST": int(nearest), "SINGLE": int(single),
    }  # fmt: skip
    out = aligned_empty((normal.height, normal.width, channels))
    memories = (maps[name][1] if name in maps else None for name in ("environment", "irradiance"))
    given = {name: aligned(inputs[name].pixels) if name in inputs else None for name in ("position", "base")}
    sizes = [
        np.int32(maps[name][0].shape[axis] - 2 if name in maps else 1)
        for name in ("environment", "irradiance")
        for axis in (1, 2)
    ]
    pixels = normal.height * normal.width
    skipped = left_out(inputs, p.effect, 1, normal.height, normal.width)
    segments = -(-pixels // SEGMENT)
    anew = {**defines, "REAL": "double", "SHORT": 0, "SINGLE": 2}
    source = "environment/reflection.cl", "reflection"
    with device.session() as session:
        arguments = (
            aligned(normal.pixels), given["position"], given["base"], *memories, session.write(out),
            _numbers(device, p, normal.height), _cells(device, p.chart), np.int32(normal.width),
            np.int32(normal.height), *sizes,
            None if skipped is None else aligned(skipped, np.uint8), np.uint64(pixels),
            session.write(session.scratch((segments,), np.uint8)) if single else None,
        )  # fmt: skip
        session.launch(*source, (segments,), *arguments, local=(1,), defines=defines)
        if single:
            session.launch(*source, (-(-segments // RUN),), *arguments, local=(1,), defines=anew)
    return out


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Lookups, and the texels that are framed first."""
    looks = 1.0 + (p.mode is Mode.GLASS) + ("irradiance" in facts)
    return facts["normal"].pixels * looks + 0.2 * facts.get("environment", facts["normal"]).pixels


@reflection.method(
    "exact", error=exact_error, work=_work, rates={"opencl": Rate(8e-4, 8e-9), "numpy": Rate(2e-3, 9e-7)}
)
class Exact:
    """Bilinear between texels, Fresnel's equations in their algebraic form."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_evaluated(inputs, p, framed.between, algebraic, np.float32))


@reflection.method(
    "single",
    error=single_error,
    work=_work,
    rates={"opencl": Rate(8e-4, 6e-9), "numpy": Rate(2e-3, 9e-7)},
    unfit=no_single,
)
class Single:
    """Bilinear between texels; mirrors in float32, in doubles where a rounding could matter much."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, single=True) if device.has_fp64 else Exact.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return Exact.numpy(inputs, p, knob)


@reflection.method(
    "schlick",
    error=schlick_error,
    least=schlick_least,
    work=_work,
    rates={"opencl": Rate(8e-4, 8e-9), "numpy": Rate(2e-3, 9e-7)},
    unfit=lambda p, facts: "there is no Fresnel to approximate" if p.fresnel is Fresnel.NONE else None,
)
class Schlick:
    """Bilinear between texels, Schlick's approximation of Fresnel's equations."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, approximate=True) if device.has_fp64 else Schlick.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_evaluated(inputs, p, framed.between, schlick, np.float32))


@reflection.method(
    "nearest", error=nearest_error, work=_work, rates={"opencl": Rate(8e-4, 7e-9), "numpy": Rate(2e-3, 6e-7)}
)
class Nearest:
    """The texel that a direction falls in, found in float32 where no reflectance depends on it."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, nearest=True) if device.has_fp64 else Nearest.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_evaluated(inputs, p, framed.nearest, algebraic, np.float32))
