"""Porter and Duff's operators and W3C's blend modes for associated colour, without a division by coverage.

An image of colour cs and coverage a meets a ground of colour cb and coverage b. Straight colours would be cs / a and
cb / b, which do not exist under no coverage. A blend mode B(cb / b, cs / a) is therefore evaluated as T = a b B, whose
fractions cancel: multiply is cs cb, screen cs b + cb a - cs cb, darken the lesser of cs b and cb a. So light without
coverage, and coverage outside [0, 1] as filters with negative lobes leave it, meet no pole.

Where a mode is not defined by its source, because a colour lies outside [0, 1], it goes on continuously: soft light's
parabola Cb (1 - Cb) counts as 0 outside [0, 1] and its D(Cb) is 4 Cb below 0; dodge over a ground of 0 or less is 0;
hue, saturation, color and luminosity pull a colour to its grey where the lightness itself lies outside.

A factor of zero takes nothing, not even NaN: an opaque pixel hides whatever lies behind it.

All functions take and return arrays of one float type; coverage has one channel and broadcasts.

Sources: T. Porter and T. Duff, Compositing Digital Images, SIGGRAPH 1984; W3C, Compositing and Blending Level 1, 2024;
W3C, SVG Compositing Specification, 2011 (associated forms of the separable modes); for saturate, McReynolds et al.,
Programming with OpenGL: advanced rendering, SIGGRAPH course 1997, section 7.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum

import numpy as np

from lichen.memory import Array


class Operator(StrEnum):
    """What of either picture remains."""

    CLEAR = "clear"
    COPY = "copy"
    DESTINATION = "destination"
    OVER = "over"
    DESTINATION_OVER = "destination_over"
    IN = "in"
    DESTINATION_IN = "destination_in"
    OUT = "out"
    DESTINATION_OUT = "destination_out"
    ATOP = "atop"
    DESTINATION_ATOP = "destination_atop"
    XOR = "xor"
    PLUS = "plus"
    SATURATE = "saturate"


class Blend(StrEnum):
    """What colour the image gets where both pictures cover."""

    NORMAL = "normal"
    MULTIPLY = "multiply"
    SCREEN = "screen"
    OVERLAY = "overlay"
    DARKEN = "darken"
    LIGHTEN = "lighten"
    COLOR_DODGE = "color_dodge"
    COLOR_BURN = "color_burn"
    HARD_LIGHT = "hard_light"
    SOFT_LIGHT = "soft_light"
    DIFFERENCE = "difference"
    EXCLUSION = "exclusion"
    HUE = "hue"
    SATURATION = "saturation"
    COLOR = "color"
    LUMINOSITY = "luminosity"

    @property
    def separable(self) -> bool:
        return self not in (Blend.HUE, Blend.SATURATION, Blend.COLOR, Blend.LUMINOSITY)


def part(value: Array, factor: Array | float) -> Array:
    """Their product; 0 where the factor is 0, whatever the value is."""
    factor = np.asarray(factor, value.dtype)
    product: Array = np.where(factor == 0, value.dtype.type(0), value * factor)
    return product


def image_factor(operator: Operator, s: Array, b: Array) -> Array:
    """What the image, of coverage s, is multiplied by over a ground of coverage b."""
    one = s.dtype.type(1)
    if operator in (Operator.COPY, Operator.OVER, Operator.PLUS):
        return np.ones_like(s)
    if operator in (Operator.IN, Operator.ATOP):
        return b
    if operator in (Operator.DESTINATION_OVER, Operator.OUT, Operator.DESTINATION_ATOP, Operator.XOR):
        rest: Array = one - b
        return rest
    if operator is Operator.SATURATE:
        room = np.maximum(one - b, 0)
        whole = np.where(np.isnan(b), b, one)
        return np.where(s > room, room / np.where(s == 0, one, s), whole)
    return np.zeros_like(s)


def base_factor(operator: Operator, s: Array) -> Array:
    """What the ground is multiplied by under an image of coverage s."""
    if operator in (Operator.DESTINATION, Operator.DESTINATION_OVER, Operator.PLUS, Operator.SATURATE):
        return np.ones_like(s)
    if operator in (Operator.DESTINATION_IN, Operator.DESTINATION_ATOP):
        return s
    if operator in (Operator.OVER, Operator.DESTINATION_OUT, Operator.ATOP, Operator.XOR):
        rest: Array = s.dtype.type(1) - s
        return rest
    return np.zeros_like(s)


def linear_factors(operator: Operator) -> tuple[float, float, float, float]:
    """p, q, r, t: the image is multiplied by p + q b and the ground by r + t s; but for saturate's image."""
    zero, one = np.zeros(1), np.ones(1)
    at_zero, at_one = image_factor(operator, zero, zero), image_factor(operator, zero, one)
    base_zero, base_one = base_factor(operator, zero), base_factor(operator, one)
    return float(at_zero[0]), float((at_one - at_zero)[0]), float(base_zero[0]), float((base_one - base_zero)[0])


# ------------------------------------------------------------------------------------------------------- blend modes


def _hard(cs: Array, a: Array, cb: Array, b: Array) -> Array:
    return np.where(2 * cs <= a, 2 * cs * cb, a * b - 2 * (a - cs) * (b - cb))


def _dodge(cs: Array, a: Array, cb: Array, b: Array) -> Array:
    full = a * b
    made = np.where(cs >= a, full, np.minimum(full, cb * (a / (a - cs)) * a))
    return np.where(cb <= 0, np.zeros_like(made), made)


def _burn(cs: Array, a: Array, cb: Array, b: Array) -> Array:
    full = a * b
    made = full - np.minimum(full, (b - cb) * (a / cs) * a)
    return np.where(cb >= b, full, np.where(cs <= 0, np.zeros_like(made), made))


def _soft(cs: Array, a: Array, cb: Array, b: Array) -> Array:
    x = cb / b
    lit = np.where(4 * cb <= b, ((16 * x - 12) * x + 4) * cb, np.sqrt(cb) * np.sqrt(np.maximum(b, 0)))
    lit = np.where(cb <= 0, 4 * cb, lit)
    bend = np.where((cb > 0) & (cb < b), cb * (1 - x), np.zeros_like(x))
    made: Array = cb * a + (2 * cs - a) * np.where(2 * cs <= a, bend, lit - cb)
    return made


SEPARABLE: Mapping[Blend, Callable[[Array, Array, Array, Array], Array]] = {
    Blend.MULTIPLY: lambda cs, a, cb, b: cs * cb,
    Blend.SCREEN: lambda cs, a, cb, b: cs * b + cb * a - cs * cb,
    Blend.OVERLAY: lambda cs, a, cb, b: _hard(cb, b, cs, a),
    Blend.DARKEN: lambda cs, a, cb, b: np.minimum(cs * b, cb * a),
    Blend.LIGHTEN: lambda cs, a, cb, b: np.maximum(cs * b, cb * a),
    Blend.COLOR_DODGE: _dodge,
    Blend.COLOR_BURN: _burn,
    Blend.HARD_LIGHT: _hard,
    Blend.SOFT_LIGHT: _soft,
    Blend.DIFFERENCE: lambda cs, a, cb, b: np.abs(cs * b - cb * a),
    Blend.EXCLUSION: lambda cs, a, cb, b: cs * b + cb * a - 2 * cs * cb,
}
"""T = a b B(cb / b, cs / a) of the modes that know nothing of the other colours."""


def _lightness(c: Array, weights: Sequence[float]) -> Array:
    w = [c.dtype.type(each) for each in weights]
    light: Array = c[..., 0:1] * w[0] + c[..., 1:2] * w[1] + c[..., 2:3] * w[2]
    return light


def _relit(c: Array, l: Array, full: Array, weights: Sequence[float]) -> Array:  # noqa: E741
    """The colours c moved to lightness l and drawn together until they lie between 0 and `full`."""
    c = c + (l - _lightness(c, weights))
    least, most = c.min(axis=-1, keepdims=True), c.max(axis=-1, keepdims=True)
    under, over, one = np.maximum(l, 0), np.maximum(full - l, 0), np.ones_like(l)
    scale = np.where(least < 0, part(1 / (l - least), under), one)
    scale = scale * np.where(most > full, part(1 / (most - l), over), one)
    made: Array = l + (c - l) * scale
    return made


def _of_three(mode: Blend, cs: Array, a: Array, cb: Array, b: Array, weights: Sequence[float]) -> Array:
    of_image = mode in (Blend.HUE, Blend.COLOR)
    colour = cs * b if of_image else cb * a
    if mode in (Blend.HUE, Blend.SATURATION):
        hue, vivid, covers = (cs, cb, a) if of_image else (cb, cs, b)
        least = hue.min(axis=-1, keepdims=True)
        span = hue.max(axis=-1, keepdims=True) - least
        wanted = (vivid.max(axis=-1, keepdims=True) - vivid.min(axis=-1, keepdims=True)) * covers
        colour = np.where(span > 0, (hue - least) / span * wanted, span * 0)
    light = _lightness(cs, weights) * b if mode is Blend.LUMINOSITY else _lightness(cb, weights) * a
    return _relit(colour, light, a * b, weights)


def composited(
    operator: Operator,
    mode: Blend,
    image: tuple[Array, Array],
    base: tuple[Array, Array],
    m: Array,
    weights: Sequence[float],
) -> tuple[Array, Array]:
    """Colour and coverage of the result, from colour and coverage of both pictures and what the image is weighted by.

    `weights` are those of lightness, which the modes of three colours keep.
    """
    (cs, a), (cb, b) = image, base
    with np.errstate(all="ignore"):
        s = part(a, m)
        from_image, from_base = image_factor(operator, s, b), base_factor(operator, s)
        colour = part(cs, m)
        if mode is not Blend.NORMAL:
            three = _of_three(mode, cs, a, cb, b, weights) if not mode.separable else SEPARABLE[mode](cs, a, cb, b)
            colour = part(colour, b.dtype.type(1) - b) + part(three, m)
        colour = part(colour, from_image) + part(cb, from_base)
        covered = part(s, from_image) + part(b, from_base)
        if operator is Operator.PLUS:
            covered = np.minimum(covered, 1)
    return colour, covered
