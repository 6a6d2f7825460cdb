"""What can be said of a line integral convolution before it is computed: sizes, ranges, footprint, errors, flaws."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Space
from lichen.memory import Array
from lichen.once import latest
from lichen.operation import EXACT, ROUNDING, WHOLE, Error, Facts, Footprint, InputFacts, Knob
from lichen.operations.streamlines.maps import Map
from lichen.operations.streamlines.parameters import OVERSHOOT, Edge, Kernel, Parameters, Sampling, Speed
from lichen.operations.streamlines.task import noise, noise_size


@latest
def texture_facts(p: Parameters, facts: InputFacts) -> Facts:
    field = facts["field"]
    rows, columns = noise_size(field.height, field.width, p)
    return facts.get("texture", Facts(rows, columns, 1, extent=Extent(0.0, 1.0, 0)))


# ------------------------------------------------------------------------------------------------------------ results


@latest
def smeared(p: Parameters, facts: InputFacts) -> Extent:
    """Of the values before contrast and colour, in exact arithmetic."""
    extent = _sampled(p, texture_facts(p, facts).extent)
    if p.enhance:
        more = p.enhance * 8 / 9 * extent.spread
        extent = _sampled(p, Extent(extent.low - more, extent.high + more, extent.nonfinite))
    return extent


def _sampled(p: Parameters, extent: Extent) -> Extent:
    more = OVERSHOOT * extent.spread if p.sampling is Sampling.CUBIC else 0.0
    return Extent(extent.low - more, extent.high + more, extent.nonfinite)


def result_facts(p: Parameters, facts: InputFacts) -> Facts:
    field, texture = facts["field"], texture_facts(p, facts)
    extent = smeared(p, facts)
    slack = 1e-5 * (extent.magnitude + extent.spread)  # of rounding
    low, high = (0.0, 1.0) if p.contrast else (extent.low - slack, extent.high + slack)
    channels, space = texture.channels, texture.space
    if p.colour is not Map.NONE:
        channels, space, low, high = 3, Space.SRGB, min(low, 0.0), max(high, 0.0)
    made = Facts(field.height * p.frames, field.width, channels, space, texture.alpha, pages=p.frames)
    return dataclasses.replace(made, extent=Extent(low, high, extent.nonfinite))


def reach(p: Parameters, facts: InputFacts) -> float:
    """How far a line can go, px."""
    if p.speed is Speed.ARC:
        return p.length
    extents = [facts[name].extent for name in ("field", "later") if name in facts]
    farthest = max(max(abs(extent.low - p.bias), abs(extent.high - p.bias)) for extent in extents)
    stretch = 1.6 if p.field_sampling is Sampling.CUBIC else 1.0
    return p.length * math.sqrt(2) * abs(p.scale) * farthest * stretch


def footprint(p: Parameters, facts: InputFacts) -> Footprint:
    field, texture = facts["field"], texture_facts(p, facts)
    cubic = Sampling.CUBIC in (p.sampling, p.field_sampling)
    far = p.passes * (reach(p, facts) + (2 if cubic else 1)) + p.passes - 1
    apart = (texture.height, texture.width) != (field.height, field.width)
    if apart or global_parts(p) or far > max(field.height, field.width):
        return WHOLE
    return Footprint(math.ceil(far), math.ceil(far), wraps=p.border is Edge.WRAP)


def global_parts(p: Parameters) -> str | None:
    """What depends on the whole image, or None."""
    if p.contrast:
        return "the contrast follows from the whole result"
    if p.colour is not Map.NONE and not p.fastest:
        return "colours are relative to the longest vector of the whole field"
    return None


def implied(p: Parameters, facts: InputFacts) -> Mapping[str, Array] | str:
    """The noise that stands in for a texture. By time, truth follows the fastest vector of the field in its steps."""
    if p.speed is Speed.FIELD:
        return "the steps of truth depend on the fastest vector of the whole field"
    if p.frames > 1:
        return "frames lie one below the other"
    reason = global_parts(p)
    if reason is not None:
        return reason
    if "texture" in facts:
        return {}
    field = facts["field"]
    return "grains are no pixels" if p.grain != 1 else {"texture": noise(field.height, field.width, p)}


def propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Means do not enlarge an error; cubics and sharpening do."""
    gain = (1 + 2 * OVERSHOOT) if p.sampling is Sampling.CUBIC else 1.0
    if p.enhance:
        gain *= gain * (1 + p.enhance * 16 / 9)
    return min(gain * error, 1.0) if p.contrast else gain * error


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    return list(_flaws(p, facts))


def _flaws(p: Parameters, facts: InputFacts) -> Iterator[Flaw]:
    field, texture = facts["field"], texture_facts(p, facts)
    if max(result_facts(p, facts).samples, texture.samples) >= 2**31:
        yield Flaw("/inputs/texture", "pixels times channels must stay below 2^31")
    for name in ("later", "mask"):
        given = facts.get(name)
        if given is not None and (given.height, given.width) != (field.height, field.width):
            yield Flaw(f"/inputs/{name}", f"is {given.width}x{given.height}, and field {field.width}x{field.height}")
    if "later" not in facts and (p.time or p.interval):
        yield Flaw("/inputs/later", "is needed where time or interval is given")
    if p.interval and p.speed is Speed.ARC:
        yield Flaw("/parameters/interval", "makes particles move in time: it needs speed=field")
    if p.frames > 1 and "later" not in facts and p.kernel is not Kernel.RIPPLE:
        yield Flaw("/parameters/frames", "would all be the same: the kernel must be ripple, or later be given")
    if p.colour is not Map.NONE and texture.channels != 1:
        yield Flaw("/parameters/colour", f"needs a texture of one channel, not of {texture.channels}")
    if p.contrast and texture.alpha is not Alpha.NONE:
        yield Flaw("/parameters/contrast", "needs a texture without coverage")


# ------------------------------------------------------------------------------------------------- errors and effort


@dataclass(frozen=True, slots=True)
class Ladder:
    """What a method costs and leaves at the settings of its knob: `typical` is the RMS error over the spread of the
    texture, on white noise along a field of white noise, at `knob.values`."""

    knob: Knob
    typical: tuple[float, ...]

    def error(self, p: Parameters, setting: float, facts: InputFacts) -> Error:
        """The spread of the texture, the rounding of the sums, and the RMS error that the method typically leaves."""
        most, spread = largest(p, facts), smeared(p, facts).spread
        typical = spread * self.usual(setting)
        if p.contrast:  # noise smeared over 2 length + 1 texels has a deviation of 0.29 / sqrt(2 length + 1)
            gain = p.contrast * math.sqrt(2 * p.length + 1) / (0.29 * spread or 1.0)
            typical = min(gain * typical, 1.0)
        return most if most is EXACT else Error(most.value, most.kind, most.rounding, typical)

    def usual(self, setting: float) -> float:
        if setting in self.knob.values:
            return self.typical[self.knob.values.index(setting)]
        settings, typical = zip(*sorted(zip(self.knob.values, self.typical, strict=True)), strict=True)
        return float(np.interp(setting, settings, typical))


@latest
def largest(p: Parameters, facts: InputFacts) -> Error:
    """Of any method: the spread of what is smeared, and the rounding of the sums."""
    field, texture, extent = facts["field"], texture_facts(p, facts), smeared(p, facts)
    finished = bool(p.contrast or p.enhance or p.colour is not Map.NONE)
    kept = p.length == 0 and (field.height, field.width) == (texture.height, texture.width)
    if not finished and (extent.spread == 0 or kept):
        return EXACT
    rounding = (16 * p.length + 8) * ROUNDING * (extent.spread + extent.magnitude) * p.passes
    if p.contrast:
        return Error(1.0 + 4 * ROUNDING, "bound", 4 * ROUNDING)
    return Error(extent.spread + rounding, "bound", rounding)


def pictures(p: Parameters) -> int:
    """How many textures are smeared."""
    return p.frames * p.passes


def reads(p: Parameters, facts: InputFacts, lookups: float) -> float:
    """Samples taken at a step: `lookups` of the field, and one for each channel of the texture."""
    vectors = lookups * (4 if p.field_sampling is Sampling.CUBIC else 1) * (2 if p.interval else 1)
    return vectors + texture_facts(p, facts).channels * (4 if p.sampling is Sampling.CUBIC else 1)
