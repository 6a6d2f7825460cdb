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

Methods: `exact`; `schlick` takes his approximation of F; `nearest` takes the texel a direction falls in.

Sources: W. Heidrich and H.-P. Seidel, View-independent environment maps, Graphics Hardware 1998; W. Heidrich et al.,
Applications of pixel textures in visualization and realistic image synthesis, I3D 1999, section 6; the reflectance
stands in `lichen.operations.environment.fresnel`.
"""

from __future__ import annotations

import dataclasses
import math
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    WHOLE,
    Degrees,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import FLOAT_MAX, same_size
from lichen.operations.environment import framed
from lichen.operations.environment.fresnel import algebraic, reflectance, schlick, schlick_error
from lichen.operations.environment.reflection_cases import CASES, EXAMPLES
from lichen.operations.environment.surfaces import Convention, Encoding, Seen, mirrored, refracted, surface
from lichen.operations.scene.lists import left_out, listing, passed
from lichen.operations.warp.charts import FACES, NOTHING, Chart

if TYPE_CHECKING:
    from collections.abc import Callable

    from lichen.opencl.device import Device

    Lookup = Callable[[Array, framed.Found], Array]
    Weight = Callable[[Array, Array], Array]


class Mode(StrEnum):
    """What is seen of the environment."""

    MIRROR = "mirror"
    REFRACTION = "refraction"
    GLASS = "glass"


class Fresnel(StrEnum):
    """How much is reflected."""

    NONE = "none"
    """a constant"""
    DIELECTRIC = "dielectric"
    """by Fresnel's equations"""


class Background(StrEnum):
    """What shows where there is no surface."""

    NONE = "none"
    """the base, or 0"""
    ENVIRONMENT = "environment"


class Parameters(Seen):
    chart: Chart = Field(Chart.LATLONG, description="how the environment, and the irradiance, hold all directions")
    mode: Mode = Field(Mode.MIRROR, description="what is reflected, what is seen through the surface, or both")
    fresnel: Fresnel = Field(Fresnel.NONE, description="a constant reflectance, or that of a dielectric")
    reflectance: float = Field(1.0, ge=0, le=1, description="where fresnel is none; of refraction, what passes")
    index: float = Field(1.5, ge=0.1, le=1000, description="of refraction: the body's over that around it")
    coated: bool = Field(False, description="whether the base loses what is reflected above it")
    background: Background = Field(Background.NONE, description="what shows where there is no surface")
    yaw: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far the environment's middle is turned to the right")
    pitch: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far up")
    roll: Degrees = Field(0.0, ge=-1e5, le=1e5, description="how far it is tilted clockwise")
    effect: int = Field(0, ge=0, le=4095, description="the channel of `tiles` that is about the environment")
    faint: float = Field(0.0, ge=0, le=1e6, description="what `tiles` leave out of a pixel's light at most")

    @property
    def turn(self) -> Array:
        return framed.turn(self.yaw, self.pitch, self.roll)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    environment = facts["environment"]
    flaws = same_size(facts, "normal", "position", "base")
    if p.chart is Chart.FISHEYE:
        flaws.append(Flaw("/parameters/chart", "a fisheye does not hold all directions; convert it by panorama"))
        return flaws
    for name in ("environment", "irradiance"):
        if name in facts:
            flaws += framed.flaws_of(name, p.chart, facts[name])
    for name in ("base", "irradiance"):
        if name in facts and facts[name].channels != environment.channels:
            text = f"has {facts[name].channels} channel(s); the environment has {environment.channels}"
            flaws.append(Flaw(f"/inputs/{name}", text))
    if p.coated and not {"base", "irradiance"} & facts.keys():
        flaws.append(Flaw("/parameters/coated", "there is neither a base nor an irradiance to be coated"))
    return flaws


def _under(facts: InputFacts) -> tuple[float, float]:
    """Range of what lies under the mirror."""
    ends = [facts[name].extent for name in ("base", "irradiance") if name in facts]
    if not ends:
        return 0.0, 0.0
    products = [ends[0].low, ends[0].high]
    if len(ends) == 2:
        products = [a * b for a in products for b in (ends[1].low, ends[1].high)] + products
    return min(*products, 0.0), max(*products, 0.0)


def _range(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    seen = facts.get("environment", facts["normal"]).extent
    low, high = _under(facts)
    return low + min(seen.low, 0.0), high + max(seen.high, 0.0)


def _moved(p: Parameters, facts: Facts) -> float:
    """Texels by which a place may be off. Longitudes and latitudes are float32 angles: 4.5e-7 of a radian at most."""
    if p.chart is Chart.LATLONG:
        return 4.5e-7 * (facts.width / 6.28 + facts.height / 3.14) + 2 * ROUNDING
    return 4 * ROUNDING


def _rounded(p: Parameters, facts: InputFacts) -> float:
    """Of places, of weights, and of the sums: two dozen roundings of what is added, seams among them, and of a
    reflectance ten more."""
    environment = facts.get("environment", facts["normal"])
    scale = facts["base"].extent.magnitude if "base" in facts and "irradiance" in facts else 1.0
    value = _moved(p, environment) * environment.extent.spread
    if "irradiance" in facts:
        value += _moved(p, facts["irradiance"]) * facts["irradiance"].extent.spread * scale
    magnitude = environment.extent.magnitude + max(map(abs, _under(facts)))
    return min(value + (34 if p.fresnel is Fresnel.DIELECTRIC else 24) * ROUNDING * magnitude, FLOAT_MAX)


def _faint(p: Parameters, facts: InputFacts) -> float:
    return p.faint if "tiles" in facts else 0.0


def _exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = _rounded(p, facts)
    return Error(value + _faint(p, facts), "bound", value)


def _nearest_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A texel differs from any mean of texels by the environment's spread at most."""
    rounding = _rounded(p, facts)
    scale = facts["base"].extent.magnitude if "base" in facts and "irradiance" in facts else 1.0
    value = facts.get("environment", facts["normal"]).extent.spread
    if "irradiance" in facts:
        value += scale * facts["irradiance"].extent.spread
    return Error(min(value + rounding + _faint(p, facts), FLOAT_MAX), "bound", rounding)


def _schlick_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    rounding = _rounded(p, facts)
    weighed = facts.get("environment", facts["normal"]).extent
    low, high = min(weighed.low, 0.0), max(weighed.high, 0.0)
    under = max(map(abs, _under(facts))) if p.coated else 0.0
    value = schlick_error(p.index) * (high - low + under)
    return Error(min(value + rounding + _faint(p, facts), FLOAT_MAX), "estimate", rounding)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    normal, environment = facts["normal"], facts.get("environment", facts["normal"])
    low, high = _range(p, facts)
    slack = _rounded(p, facts)
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
    check=_check,
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


def _cells(chart: Chart) -> Array:
    """Where a cube's image shows each of its faces."""
    faces = FACES.get(chart, FACES[Chart.CUBE])
    return aligned(np.array([faces.index(each) for each in range(NOTHING)]), np.int32)


def _launched(
    device: Device, inputs: Inputs, p: Parameters, *, nearest: bool = False, approximate: bool = False
) -> Array:
    normal = inputs["normal"]
    channels = inputs["environment"].channels
    maps = {name: framed.kept(inputs[name], p.chart) for name in ("environment", "irradiance") if name in inputs}
    short = nearest and p.fresnel is Fresnel.NONE
    charts = {Chart.LATLONG: 0, Chart.PARABOLOID: 2, Chart.MIRROR_BALL: 3}
    scale = math.tan(math.radians(p.fov or 0.0) / 2) / (0.5 * normal.height)
    numbers = np.array([*p.turn.reshape(-1), *p.eye, scale, p.index, 1 / p.index, p.reflectance])
    fresnel = 0 if p.fresnel is Fresnel.NONE else (2 if approximate else 1)
    defines: dict[str, int | float | str] = {
        "NORMALS": normal.channels, "UNIT": int(p.encoding is Encoding.UNIT),
        "DOWN": int(p.convention is Convention.DIRECTX), "CHART": charts.get(p.chart, 1),
        "VIEW": 2 if "position" in inputs else int(p.fov is not None), "MODE": list(Mode).index(p.mode),
        "FRESNEL": fresnel, "COLOURS": channels, "BASE": int("base" in inputs),
        "WEIGHT": "float" if 0.5 <= p.index <= 2 else "double", "IRRADIANCE": int("irradiance" in inputs),
        "COATED": int(p.coated), "REAL": "float" if short else "double", "SHORT": int(short),
        "BEHIND": int(p.background is Background.ENVIRONMENT), "NEAREST": int(nearest),
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
    with device.session() as session:
        session.launch(
            "environment/reflection.cl", "reflection", (-(-pixels // 64),),
            aligned(normal.pixels), given["position"], given["base"], *memories,
            session.write(out), aligned(numbers, np.float64), _cells(p.chart), np.int32(normal.width),
            np.int32(normal.height), *sizes,
            None if skipped is None else aligned(skipped, np.uint8), np.uint64(pixels),
            local=(1,), defines=defines,
        )  # fmt: skip
    return out


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Lookups, and the texels that are framed first."""
    looks = 1.0 + (p.mode is Mode.GLASS) + ("irradiance" in facts)
    return facts["normal"].pixels * looks + 0.2 * facts.get("environment", facts["normal"]).pixels


@reflection.method(
    "exact", error=_exact_error, work=_work, rates={"opencl": Rate(8e-4, 8e-9), "numpy": Rate(2e-3, 9e-7)}
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
    "schlick",
    error=_schlick_error,
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
    "nearest", error=_nearest_error, work=_work, rates={"opencl": Rate(8e-4, 7e-9), "numpy": Rate(2e-3, 6e-7)}
)
class Nearest:
    """The texel that a direction falls in, found in float32 where no reflectance depends on it."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        return _launched(device, inputs, p, nearest=True) if device.has_fp64 else Nearest.numpy(inputs, p, knob)

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_evaluated(inputs, p, framed.nearest, algebraic, np.float32))
