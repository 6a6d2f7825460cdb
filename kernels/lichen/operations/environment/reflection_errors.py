"""What reflection is off by, and between which numbers it lies."""

from __future__ import annotations

from lichen.operation import ROUNDING, Error, Facts, InputFacts
from lichen.operations.compositing.layers import FLOAT_MAX
from lichen.operations.environment import fresnel
from lichen.operations.environment.reflection_parameters import Fresnel, Mode, Parameters
from lichen.operations.warp.charts import LAYOUT, Chart

MOVED = 2e-7
"""Of a chart's side: what is seen moves by so much where mirrors are found in float32."""


def under(facts: InputFacts) -> tuple[float, float]:
    """Range of what lies under the mirror."""
    ends = [facts[name].extent for name in ("base", "irradiance") if name in facts]
    if not ends:
        return 0.0, 0.0
    products = [ends[0].low, ends[0].high]
    if len(ends) == 2:
        products = [a * b for a in products for b in (ends[1].low, ends[1].high)] + products
    return min(*products, 0.0), max(*products, 0.0)


def range_of(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    seen = facts.get("environment", facts["normal"]).extent
    low, high = under(facts)
    return low + min(seen.low, 0.0), high + max(seen.high, 0.0)


def moved(p: Parameters, facts: Facts) -> float:
    """Texels by which a place may be off. Longitudes and latitudes are float32 angles: 4.5e-7 of a radian at most."""
    if p.chart is Chart.LATLONG:
        return 4.5e-7 * (facts.width / 6.28 + facts.height / 3.14) + 2 * ROUNDING
    return 4 * ROUNDING


def rounded(p: Parameters, facts: InputFacts) -> float:
    """Of places, of weights, and of the sums: two dozen roundings of what is added, seams among them, and of a
    reflectance ten more."""
    environment = facts.get("environment", facts["normal"])
    scale = facts["base"].extent.magnitude if "base" in facts and "irradiance" in facts else 1.0
    value = moved(p, environment) * environment.extent.spread
    if "irradiance" in facts:
        value += moved(p, facts["irradiance"]) * facts["irradiance"].extent.spread * scale
    magnitude = environment.extent.magnitude + max(map(abs, under(facts)))
    return min(value + (34 if p.fresnel is Fresnel.DIELECTRIC else 24) * ROUNDING * magnitude, FLOAT_MAX)


def faint(p: Parameters, facts: InputFacts) -> float:
    return p.faint if "tiles" in facts else 0.0


def exact_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    value = rounded(p, facts)
    return Error(value + faint(p, facts), "bound", value)


def nearest_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """A texel differs from any mean of texels by the environment's spread at most."""
    rounding = rounded(p, facts)
    scale = facts["base"].extent.magnitude if "base" in facts and "irradiance" in facts else 1.0
    value = facts.get("environment", facts["normal"]).extent.spread
    if "irradiance" in facts:
        value += scale * facts["irradiance"].extent.spread
    return Error(min(value + rounding + faint(p, facts), FLOAT_MAX), "bound", rounding)


def single_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Places in float32: by so much of a chart's side they are off at most, in both directions."""
    rounding, value = rounded(p, facts), 0.0
    scale = facts["base"].extent.magnitude if "base" in facts and "irradiance" in facts else 1.0
    for name, by in (("environment", 1.0), ("irradiance", scale)):
        if name in facts:
            across, down = LAYOUT[p.chart]
            side = facts[name].width / across + facts[name].height / down
            value += MOVED * side * facts[name].extent.spread * by
    seen = facts.get("environment", facts["normal"]).extent.magnitude
    value += 16 * ROUNDING * (seen + (max(map(abs, under(facts))) if p.coated else 0.0))
    return Error(min(value + rounding + faint(p, facts), FLOAT_MAX), "estimate", rounding)


def no_single(p: Parameters, facts: InputFacts) -> str | None:
    if p.mode is not Mode.MIRROR:
        return "what is seen through a surface bends too steeply for float32"
    if p.chart is Chart.LATLONG or p.chart is Chart.MIRROR_BALL:
        return f"a {p.chart} picture is too steep at its ends for float32"
    if facts["normal"].channels == 2:
        return "normals of two channels lose their third in float32"
    if p.fresnel is Fresnel.DIELECTRIC and p.index < 1:
        return "below an index of 1 the reflectance is too steep for float32"
    return None


def _weighed(p: Parameters, facts: InputFacts) -> float:
    """How far apart what a reflectance weighs can be."""
    seen = facts.get("environment", facts["normal"]).extent
    below = max(map(abs, under(facts))) if p.coated else 0.0
    return max(seen.high, 0.0) - min(seen.low, 0.0) + below


def schlick_least(p: Parameters, knob: float, facts: InputFacts) -> float:
    return min(fresnel.schlick_least(p.index) * _weighed(p, facts), FLOAT_MAX)


def schlick_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    rounding, value = rounded(p, facts), fresnel.schlick_error(p.index) * _weighed(p, facts)
    return Error(min(value + rounding + faint(p, facts), FLOAT_MAX), "estimate", rounding)
