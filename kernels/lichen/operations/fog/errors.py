"""What fog may err by, and how much it changes at most.

With e^-t t <= 1/e, a relative error r of the optical depth t changes what comes through by r / e at most. Of a distance
found in float32 that is 5 roundings: the slant of a ray has 3, a depth 1, their product 1; of a point
distance 4, two of the difference and two of its length.

Mean densities of layers err absolutely: x mean'(x) = density(x) - mean(x) is at most the largest density, so relative
errors of x count by that, and so do those of a segment's ends. Times the longest path there is, that is an error of the
optical depth. Between entries w apart, a table of means errs by w / 2 times the largest slope of the mean, which is
half that of the density. Shares of the rise are products with one over it, which is one rounding more than a division.

The exponent of height fog errs by roundings of the height in falloffs. It matters up to where 20 optical depths are
reached, so at (e^u - 1) density falloff e^lift = 20; beyond, nothing comes through on either side, to 2.1e-9.
"""

from __future__ import annotations

import math

from lichen.image import Alpha
from lichen.operation import ROUNDING, Error, InputFacts
from lichen.operations.fog.launch import DEEPEST, reach_of
from lichen.operations.fog.parameters import Kind, Parameters
from lichen.operations.scene.view import farthest, pointed

HIDDEN = 20.0
"""Optical depths after which nothing is left that matters: 2.1e-9."""
FLOAT_MAX = 3.4028234663852886e38


def longest(p: Parameters, facts: InputFacts) -> float:
    """The longest path through fog that is not without end."""
    if "depth" not in facts:
        return math.inf
    depth = facts["depth"]
    if pointed(depth):
        return math.sqrt(3) * (depth.extent.magnitude + max(map(abs, p.eye)))
    return farthest(p, depth.extent.low, depth.extent.high, depth.height, depth.width)


def brightness(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """The largest of the picture's light, and of the fog's."""
    image = facts["image"]
    light = p.colour if isinstance(p.colour, tuple) else (p.colour,)
    cover = max(1.0, image.extent.magnitude) if image.alpha is not Alpha.NONE else 1.0
    return image.extent.magnitude, max(map(abs, light)) * cover


def _stated(p: Parameters, facts: InputFacts, through: float, method: float = 0.0) -> Error:
    """Of the picture, from that of what comes through: `through` from rounding, `method` from a table."""
    image, fog = brightness(p, facts)
    rounding = min((through + 6 * ROUNDING) * (image + fog), FLOAT_MAX)
    return Error(min(rounding + method * (image + fog), FLOAT_MAX), "bound", rounding)


def exact(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of the formulas in float32."""
    return _stated(p, facts, _rounding(p, facts))


def _rounding(p: Parameters, facts: InputFacts) -> float:
    if p.kind is Kind.LINEAR:
        return min(ROUNDING * (10 * p.end / (p.end - p.start) + 3), 1.0)
    if p.kind is not Kind.HEIGHT:
        usual = {Kind.EXPONENTIAL: 5.0, Kind.SQUARED: 8.0, Kind.LAYERED: 5.0}[p.kind] * ROUNDING
        return min(usual + _layers(p, facts, 18 + 2 * len(p.heights)), 1.0)
    if p.clear:
        return 0.0
    power = math.log(HIDDEN) - math.log(p.density * p.falloff) - p.lift
    deep = math.log1p(math.exp(power)) if power < 700 else power
    return min(ROUNDING * (2 + (20 + 2 * abs(p.lift) + 8 * deep) / math.e) + math.exp(-HIDDEN) * 1.1, 1.0)


def _layers(p: Parameters, facts: InputFacts, roundings: float, apart: float = 0.0) -> float:
    """Of what comes through layers whose mean density errs by so many roundings of the largest, and by `apart`."""
    if p.kind is not Kind.LAYERED or p.clear:
        return 0.0
    off = p.density * (roundings * ROUNDING * max(p.densities) + apart)
    return min(off * longest(p, facts), 1.0)


def table(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """Of a table of so many entries, linear between them."""
    cells = max(entries(knob) - 1, 1)
    if p.clear:
        return _stated(p, facts, 0.0)
    if p.kind is Kind.LAYERED:
        apart = reach_of(p) / cells * p.column.steepest / 4
        rounded = _layers(p, facts, 30)
        return _stated(p, facts, 5 * ROUNDING + rounded, min(_layers(p, facts, 30, apart), 1.0) - rounded)
    bend = DEEPEST**2 if p.kind is Kind.EXPONENTIAL else 2 * DEEPEST
    return _stated(p, facts, 16 * ROUNDING, min(bend / cells**2 / 8, 1.0) + math.exp(-DEEPEST))


def entries(knob: float) -> int:
    return round(knob)


def departure(p: Parameters, facts: InputFacts) -> dict[str, float]:
    """No more than the densest fog hides on the longest way."""
    if any(each.extent.nonfinite for each in facts.values()):
        return {}
    far = longest(p, facts)
    if p.kind is Kind.LINEAR:
        hidden = min(max((far - p.start) / (p.end - p.start), 0.0), 1.0)
    elif p.clear:
        hidden = 0.0
    else:
        density = p.density
        if p.kind is Kind.LAYERED:
            density *= max(p.densities)
        if p.kind is Kind.HEIGHT:
            density *= math.exp(min(p.lift + far / p.falloff, 700.0))
        depth = density * far
        hidden = -math.expm1(-(depth * depth if p.kind is Kind.SQUARED else depth))
    image, fog = brightness(p, facts)
    return {"image": hidden * (image + fog) * (1 + 1e-12)}
