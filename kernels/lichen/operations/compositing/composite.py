"""Composite: one picture over another, by every operator of Porter and Duff and every blend mode of W3C.

Truth, for associated colour cs of coverage a in `image`, cb of coverage b in `base`, and a weight m = opacity x mask:

    s = m a                                               coverage that the image has left
    c = m cs                                              blend = normal
    c = (1 - b) m cs + m a b B(cb / b, cs / a)            any other, free of divisions by coverage (blending.py)
    colour   = c Fs + cb Fb
    coverage = s Fs + b Fb                                plus: at most 1

    operator            Fs                    Fb          operator            Fs        Fb
    clear               0                     0           in                  b         0
    copy                1                     0           destination_in      0         s
    destination         0                     1           out                 1 - b     0
    over                1                     1 - s       destination_out     0         1 - s
    destination_over    1 - b                 1           atop                b         1 - s
    plus                1                     1           destination_atop    1 - b     s
    saturate            min(s, 1 - b) / s     1           xor                 1 - b     1 - s

A picture without coverage covers wholly. The result has coverage unless it is 1 everywhere by definition. Nothing is
clamped but the mask, to [0, 1]: light above 1 and coverage outside [0, 1] go through the formulas. Factors of zero take
nothing, not even NaN.

Porter and Duff's operators are sums of light and are computed in scene-linear light. So are the blend modes, unless
`light` is stored: then all is computed on the numbers as they are, which is what style sheets and most picture editors
do, and what the curves of these modes were drawn for. Lightness in hue, saturation, color and luminosity is the
luminance of BT.709 in linear light and W3C's 0.3, 0.59, 0.11 as stored.

Sources: see blending.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    POINTWISE,
    ROUNDING,
    Error,
    Facts,
    Footprint,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.compositing.blending import (
    Blend,
    Operator,
    base_factor,
    composited,
    image_factor,
    linear_factors,
)
from lichen.operations.compositing.composite_cases import CASES
from lichen.operations.compositing.layers import FLOAT_MAX, colours, placed, row_blocks, same_size, split
from lichen.stage import Stage

if TYPE_CHECKING:
    from lichen.opencl.device import Device

SOURCE = "compositing/composite.cl"
LUMINANCE = (0.2126, 0.7152, 0.0722)
LUMA = (0.3, 0.59, 0.11)


class Parameters(OperationParameters):
    operator: Operator = Operator.OVER
    """what of either picture remains"""
    blend: Blend = Blend.NORMAL
    """what colour the image gets where both cover"""
    opacity: float = Field(1.0, ge=0, le=1)
    """what the image is multiplied by, colour and coverage"""
    light: Light = Light.LINEAR
    """linear: sums of light; stored: the numbers as they are, as style sheets do"""
    x: int = Field(0, ge=-65536, le=65536, json_schema_extra={"unit": "px"})
    """column of the base at which the image begins; what hangs over is cut off"""
    y: int = Field(0, ge=-65536, le=65536, json_schema_extra={"unit": "px"})
    """row of the base at which the image begins"""

    @property
    def weights(self) -> tuple[float, float, float]:
        return LUMINANCE if self.light is Light.LINEAR else LUMA


# -------------------------------------------------------------------------------------------------------- prediction


def _aside(p: Parameters, facts: InputFacts) -> bool:
    """Whether the image does not lie on the base pixel by pixel."""
    image, base = facts["image"], facts.get("base", facts["image"])
    return bool(p.x or p.y) or (image.height, image.width) != (base.height, base.width)


def _transparent(p: Parameters, facts: InputFacts) -> tuple[bool, bool]:
    """Whether image and base may cover less than wholly."""
    image, base = facts["image"], facts.get("base", facts["image"])
    image_may = image.alpha is not Alpha.NONE or p.opacity < 1 or "mask" in facts or _aside(p, facts)
    return image_may, base.alpha is not Alpha.NONE


def _covered(p: Parameters, facts: InputFacts) -> bool:
    """Whether the result has coverage: it is bilinear in both coverages, so their ends tell whether it is always 1."""
    image_may, base_may = _transparent(p, facts)
    for a, b in product((0.0, 1.0) if image_may else (1.0,), (0.0, 1.0) if base_may else (1.0,)):
        s, ground = np.array([a]), np.array([b])
        total = s * image_factor(p.operator, s, ground) + ground * base_factor(p.operator, s)
        if min(float(total[0]), 1.0) != 1:
            return True
    return False


@dataclass(frozen=True, slots=True)
class Sizes:
    """Largest magnitudes: of colours and coverages, of both factors, and of what a blend mode computes on its way."""

    cs: float
    a: float
    cb: float
    b: float
    from_image: float
    from_base: float
    blended: float

    @property
    def largest(self) -> float:
        """Of the result and of the terms it is summed from."""
        image = max(self.cs, self.a) + (self.cs * (1 + self.b) + self.blended if self.blended else 0.0)
        return min(image * self.from_image + max(self.cb, self.b) * self.from_base, FLOAT_MAX)


def _sizes(p: Parameters, facts: InputFacts) -> Sizes:
    # Facts are asked for before the inputs are checked, so the base may not be there yet.
    image, base = facts["image"], facts.get("base", facts["image"])
    image_may, base_may = _transparent(p, facts)
    cs, cb = image.extent.magnitude * p.opacity, base.extent.magnitude
    low, high = (min(image.extent.low, 0.0) * p.opacity, max(image.extent.high, 0.0) * p.opacity)
    if image.alpha is Alpha.NONE:
        low, high = (0.0, p.opacity) if image_may else (1.0, 1.0)
    bottom, top = (base.extent.low, base.extent.high) if base_may else (1.0, 1.0)
    a, b = max(abs(low), abs(high)), max(abs(bottom), abs(top))
    rest_image, rest_base = max(abs(1 - bottom), abs(1 - top)), max(abs(1 - low), abs(1 - high))
    from_image = {1.0: 1.0, 0.0: 0.0}.get(_probe(p, 0.5, image=True), b)
    from_base = {1.0: 1.0, 0.0: 0.0}.get(_probe(p, 0.5, image=False), a)
    if p.operator in (Operator.DESTINATION_OVER, Operator.OUT, Operator.DESTINATION_ATOP, Operator.XOR):
        from_image = rest_image
    if p.operator in (Operator.OVER, Operator.DESTINATION_OUT, Operator.ATOP, Operator.XOR):
        from_base = rest_base
    if p.operator is Operator.SATURATE:
        from_image = 1.0
    blended = 0.0 if p.blend is Blend.NORMAL else 4 * (cs + a) * (cb + b)
    return Sizes(cs, a, cb, b, from_image, from_base, blended)


def _probe(p: Parameters, at: float, *, image: bool) -> float:
    """A factor where both coverages are `at`: 0 or 1 if it is that always."""
    half = np.array([at])
    factor = image_factor(p.operator, half, half) if image else base_factor(p.operator, half)
    return float(factor[0])


ROUNDINGS = {True: 24.0, False: 200.0}
"""Of a blend mode, relative to what it computes on its way: of separable modes, and of those that keep lightness, which
divide by distances from it that may be a fourteenth of the colours'."""


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    sizes = _sizes(p, facts)
    each = 12.0 if p.blend is Blend.NORMAL else ROUNDINGS[p.blend.separable]
    value = min(each * ROUNDING * sizes.largest, FLOAT_MAX)
    return Error(value, "bound", value)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    image_may, _ = _transparent(p, facts)
    image = facts["image"]
    if p.blend is not Blend.NORMAL or _aside(p, facts) or _covered(p, facts) != (image.alpha is not Alpha.NONE):
        return None
    if p.operator is Operator.COPY and p.opacity == 1 and "mask" not in facts:
        return "the image is copied whole"
    return "the image covers the base wholly" if p.operator is Operator.OVER and not image_may else None


def _hides(p: Parameters, facts: InputFacts) -> str | None:
    """Of `over`, a factor of zero takes nothing of the base; a blend mode mixes with it all the same."""
    alone = p.operator is Operator.OVER and p.blend is Blend.NORMAL and p.opacity == 1 and "mask" not in facts
    return "image" if alone and not _aside(p, facts) else None


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, base = facts["image"], facts.get("base", facts["image"])
    if _identity(p, facts):
        return image
    covered, sizes = _covered(p, facts), _sizes(p, facts)
    slack = _error(p, 0.0, facts).value
    most = min(max(sizes.largest, 1.0 if covered else 0.0) + slack, FLOAT_MAX)
    plain = p.blend is Blend.NORMAL and min(image.extent.low, base.extent.low) >= 0
    within = all(each.alpha is Alpha.NONE or each.extent.high <= 1 for each in (image, base))
    low = -slack if plain and within else -most
    count = colours(base) + covered
    spoilt = most >= FLOAT_MAX or any(each.extent.nonfinite for each in facts.values())
    extent = Extent(low, most, base.height * base.width * count if spoilt else 0)
    alpha = Alpha.ASSOCIATED if covered else Alpha.NONE
    return Facts(base.height, base.width, count, image.space, alpha, extent)


ROUGH = (Blend.COLOR_DODGE, Blend.COLOR_BURN, Blend.SOFT_LIGHT)
"""Separable modes that a small change of colour may change by anything."""


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    """Products of both pictures change by either's change times the other, and by the product of both."""
    s, e = _sizes(p, facts), error
    if not p.blend.separable or p.blend in ROUGH:
        return max(2 * _result(p, facts).extent.magnitude, e)
    depends = 0.0 if s.from_image in (0.0, 1.0) else max(s.cs, s.a) + e
    depends += 0.0 if s.from_base in (0.0, 1.0) else max(s.cb, s.b) + e
    if p.operator is Operator.SATURATE:  # s Fs = min(s, 1 - b), and colour by as much as it exceeds coverage
        return max(2 * _result(p, facts).extent.magnitude, e)
    blend = 0.0
    if p.blend is not Blend.NORMAL:
        blend = s.b + s.cs + e + 4 * (s.a + s.cs + s.b + s.cb) + 8 * e
    return float(e * (s.from_image * (1 + blend) + s.from_base + depends * (1 + blend)))


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, base = facts["image"], facts["base"]
    flaws = []
    if colours(image) != colours(base):
        flaws.append(Flaw("/inputs/base", f"has {colours(base)} colour channel(s); the image has {colours(image)}"))
    if not p.blend.separable and colours(image) != 3:
        flaws.append(Flaw("/parameters/blend", f"{p.blend} needs 3 colour channels; the image has {colours(image)}"))
    return flaws + same_size(facts, "image", "mask")


def _footprint(p: Parameters, facts: InputFacts) -> Footprint:
    return Footprint(abs(p.y), abs(p.x)) if _aside(p, facts) else POINTWISE


composite = Operation(
    name="composite",
    family="compositing",
    summary="Composites a picture with another: all operators of Porter and Duff, all blend modes of W3C.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "the picture on top"),
        Input("base", "the picture below it, of as many colours; the result has its size"),
        Input("mask", "weights of the image's pixels, its last channel; of the image's size", (1, 4), False, False),
    ),
    light=Light.LINEAR,
    as_stored=lambda p: p.light is Light.STORED,
    wants_alpha=Alpha.ASSOCIATED,
    footprint=_footprint,
    hides=_hides,
    identity=_identity,
    result=_result,
    propagate=_propagate,
    check=_check,
    examples=(
        {"opacity": 0.6},
        {"blend": "multiply", "opacity": 0.8},
        {"operator": "xor", "blend": "soft_light", "opacity": 0.5, "light": "stored"},
        {"operator": "atop", "blend": "luminosity", "opacity": 0.7},
    ),
    hard_cases=CASES,
)


# ------------------------------------------------------------------------------------------- truth and method


def _laid(inputs: Inputs, p: Parameters) -> tuple[Image, Image, Array | None]:
    """The image on a canvas of the base's size, the base, and the image's weights where there are any."""
    image, base = inputs["image"], inputs["base"]
    weights = inputs["mask"].pixels[..., -1:] if "mask" in inputs else None
    aside = p.x or p.y or image.pixels.shape[:2] != base.pixels.shape[:2]
    if aside:
        if weights is None:
            weights = np.ones((*image.pixels.shape[:2], 1), image.pixels.dtype)
        weights = placed(weights, base.height, base.width, p.x, p.y)
        image = image.replace(pixels=placed(image.pixels, base.height, base.width, p.x, p.y))
    return image, base, weights


def _joined(image: Image, base: Image, weights: Array | None, p: Parameters, covered: bool) -> Array:
    """Result in the precision of the pictures."""
    dtype = base.pixels.dtype
    m = np.full((1, 1, 1), p.opacity, dtype)
    if weights is not None:
        m = m * np.clip(weights, 0, 1)
    colour, coverage = composited(p.operator, p.blend, split(image), split(base), m, p.weights)
    if not covered:
        return colour.astype(dtype, copy=False)
    shape = (*colour.shape[:2], 1)
    return np.concatenate([colour, np.broadcast_to(coverage, shape)], axis=-1).astype(dtype, copy=False)


def _facts(inputs: Inputs) -> InputFacts:
    """All that coverage depends on."""
    return {
        name: Facts(each.height, each.width, each.channels, each.space, each.alpha) for name, each in inputs.items()
    }


@composite.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The formulas, in float64."""
    return _joined(*_laid(inputs, p), p, _covered(p, _facts(inputs)))


def _numbers(p: Parameters) -> tuple[float, ...]:
    """The operator's four numbers, and what coverage is at most."""
    return *linear_factors(p.operator), 1.0 if p.operator is Operator.PLUS else math.inf


def _saturating(p: Parameters) -> dict[str, int]:
    return {"SATURATE": int(p.operator is Operator.SATURATE)}


def _stage(p: Parameters, facts: InputFacts) -> Stage | None:
    if p.blend is not Blend.NORMAL or "mask" in facts or _aside(p, facts):
        return None
    return Stage("compositing/composite_stage.clh", _saturating(p), (p.opacity, *_numbers(p)))


@composite.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples * (1.0 if p.blend is Blend.NORMAL else 2.0),
    rates={"opencl": Rate(3e-4, 2e-9), "numpy": Rate(1e-4, 2e-8)},
    stage=_stage,
)
class Exact:
    """The formulas in float32, sixteen pixels at a time."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, base, weights = _laid(inputs, p)
        covered = _covered(p, _facts(inputs))
        pixels = base.height * base.width
        out = aligned_empty((base.height, base.width, base.colours + covered))
        ground = aligned(base.pixels)
        mask = ground if weights is None else aligned(weights)
        defines: dict[str, int | float | str] = {
            "COLOURS": base.colours, "IMAGE": image.channels, "BASE": base.channels, "OUT": out.shape[2],
            "MASK": 0 if weights is None else weights.shape[2],
            "BLEND": 0 if p.blend is Blend.NORMAL else 1 if p.blend.separable else 2,
            **_saturating(p),
        }  # fmt: skip
        factors = [np.float32(each) for each in _numbers(p)]
        given = (aligned(image.pixels), ground)
        flat = (image.channels, base.channels, out.shape[2]) == (4, 4, 4) and base.colours == 3
        with device.session() as session:
            if flat and weights is None and p.blend is Blend.NORMAL:
                session.launch(
                    SOURCE, "composite_flat", (-(-pixels // 16),),
                    *given, session.write(out), np.float32(p.opacity), *factors, np.uint64(pixels),
                    defines=defines,
                )  # fmt: skip
            else:
                session.launch(
                    SOURCE, "composite", (-(-pixels // 16),),
                    *given, mask, session.write(out), *(np.float32(each) for each in (p.opacity, *p.weights)),
                    *factors, np.int32(list(Blend).index(p.blend)), np.uint64(pixels),
                    defines=defines,
                )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        image, base, weights = _laid(inputs, p)
        covered = _covered(p, _facts(inputs))
        out = aligned_empty((base.height, base.width, base.colours + covered))
        for rows in row_blocks(base.height, base.width):
            top, ground = (each.replace(pixels=each.pixels[rows]) for each in (image, base))
            out[rows] = _joined(top, ground, None if weights is None else weights[rows], p, covered)
        return out
