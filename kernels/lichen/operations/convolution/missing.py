"""Filters in which some pixels take no part: what they share for masks and undefined samples.

Means give the others their weight.

With w >= 0 the weights of a filter that sum to 1, and m those of the pixels,

    out = sum of w m f / sum of w m

so what is left makes up for what is left out. m is 0 where the input `mask` is, and under `missing` = skip where a
sample is NaN or infinite; inside leaves out all that lies beyond the edges, too, whatever the border. Where nothing
takes part there is nothing to give, and the result is NaN. A transparent pixel of a picture weighs nothing without any
of this: colour is associated with coverage before it is filtered, and is divided by it afterwards.

Both sums are of one sign where f is, and are rounded alike: however little is left, a result is right to twice the
roundings of the plain filter. That takes weights that are not negative, and one and the same kernel in truth and in
method, since a pixel is defined or not by whether the kernel's end reaches a sample. Methods that only come near to
their kernel are therefore out of the question here.

Filters that choose among samples, or fit something to them, have no weights to hand on. They receive NaN for what takes
no part and pass it by (`chosen`); a mask says of them whether a pixel takes part, not how much of it.

Sources: Knutsson and Westin, Normalized and differential convolution, CVPR 1993.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum, StrEnum

import numpy as np

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import ROUNDING, Border, Error, Facts, Input, InputFacts, Inputs

LEAST = 2.0**-20
"""A mask's values below this count as 0."""
MASK = Input(
    "mask", "weights of the pixels in [0, 1], one channel; 0 takes no part", (1, 1), required=False, picture=False
)
WHICH = Input(
    "mask", "which pixels take part, one channel: those where it is not 0", (1, 1), required=False, picture=False
)
SEGMENT = 64


class Missing(StrEnum):
    """What becomes of samples that are undefined."""

    SPREAD = "spread"
    """they count as they are, and NaN fills the kernel around it"""
    SKIP = "skip"
    """they take no part; the weights of the others make up for theirs"""
    INSIDE = "inside"
    """nor does anything beyond the edges"""


Mean = Callable[[Array, Border, float], Array]
"""A filter with weights that are not negative and sum to 1, given an array, a border and the constant beyond it."""


def leaves_out(missing: Missing, inputs: Mapping[str, object]) -> bool:
    """Whether a mean is renormalised."""
    return missing is not Missing.SPREAD or "mask" in inputs


def chooses(missing: Missing, inputs: InputFacts | Inputs) -> bool:
    """Whether a filter that chooses among samples has any to pass by."""
    skipped = missing is Missing.SKIP and inputs["image"].extent.nonfinite > 0
    return skipped or missing is Missing.INSIDE or "mask" in inputs


def check_mask(facts: InputFacts, name: str = "mask") -> list[Flaw]:
    if name not in facts:
        return []
    image, mask = facts["image"], facts[name]
    flaws = []
    if (mask.height, mask.width) != (image.height, image.width):
        sizes = f"is {mask.width} x {mask.height}, the image {image.width} x {image.height}"
        flaws.append(Flaw(f"/inputs/{name}", sizes))
    if mask.extent.nonfinite or mask.extent.low < 0 or mask.extent.high > 1:
        flaws.append(Flaw(f"/inputs/{name}", "has values outside [0, 1]"))
    return flaws


def extent_without(facts: InputFacts, extent: Extent) -> Extent:
    """What a mean within `extent` becomes: undefined where nothing took part."""
    if "mask" in facts and facts["mask"].extent.low < LEAST:
        return Extent(extent.low, extent.high, max(extent.nonfinite, 1))
    return extent


def extent_chosen(missing: Missing, facts: InputFacts, extent: Extent) -> Extent:
    """What `extent` becomes where samples are passed by: nothing, where none is left."""
    left = max(extent.nonfinite, 1) if chooses(missing, facts) else extent.nonfinite
    return Extent(extent.low, extent.high, left)


def renormalised_error(plain: float, magnitude: float) -> Error:
    """From the rounding of the plain filter: numerator and denominator, products with the mask, and the quotient."""
    rounding = 2 * plain + 8 * ROUNDING * magnitude
    return Error(rounding, "bound", rounding)


def _borders(missing: Missing, border: Border, value: float) -> tuple[Border, float, float]:
    """The border, and the constants of numerator and denominator."""
    return (Border.CONSTANT, 0.0, 0.0) if missing is Missing.INSIDE else (border, value, 1.0)


def _scale(image: Facts) -> float:
    """A power of two that brings the image to magnitude 1, so that no small weight makes a product vanish."""
    return 2.0 ** -min(max(math.frexp(image.extent.magnitude)[1], -120), 120)


def renormalised(inputs: Inputs, missing: Missing, border: Border, value: float, mean: Mean) -> Array:
    """The mean of what takes part, in the precision of the image; `mean` is computed of the array it is given."""
    image = inputs["image"]
    pixels, kind = image.pixels, image.pixels.dtype.type
    scale = _scale(Facts.of(image))
    weights = np.ones((*pixels.shape[:2], 1), pixels.dtype)
    if "mask" in inputs:
        mask = inputs["mask"].pixels
        weights = np.where(mask < LEAST, 0, mask).astype(pixels.dtype)
    if missing is not Missing.SPREAD and image.extent.nonfinite:
        weights = weights * np.isfinite(pixels)
    with np.errstate(invalid="ignore"):
        values = np.where(weights > 0, pixels * kind(scale) * weights, 0).astype(pixels.dtype)
    around, beyond, counted = _borders(missing, border, value)
    sums, shares = mean(values, around, beyond * scale), mean(weights, around, counted)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        means = np.where(shares > 0, sums / shares, np.nan).astype(pixels.dtype)
        return np.asarray(means * kind(1 / scale))


def renormalised_opencl(
    device: Device, inputs: Inputs, missing: Missing, border: Border, value: float, mean: Mean
) -> Array:
    """The same on a device; `mean` launches what it needs itself."""
    image = inputs["image"]
    pixels, mask = image.pixels, inputs["mask"].pixels if "mask" in inputs else None
    height, width, channels = pixels.shape
    skip = missing is not Missing.SPREAD and image.extent.nonfinite > 0
    scale, grid = _scale(Facts.of(image)), (-(-height * width // SEGMENT),)
    values, weights = aligned_empty(pixels.shape), aligned_empty((height, width, channels if skip else 1))
    each = np.int32(weights.shape[2])
    with device.session() as session:
        session.launch(
            "convolution/missing.cl", "weigh", grid,
            pixels, mask, session.write(values), session.write(weights), np.int32(height * width), np.int32(channels),
            each, np.int32(skip), np.float32(LEAST), np.float32(scale),
        )  # fmt: skip
    around, beyond, counted = _borders(missing, border, value)
    sums, shares = mean(values, around, beyond * scale), mean(weights, around, counted)
    with device.session() as session:
        session.launch(
            "convolution/missing.cl", "divide", grid,
            session.readwrite(sums), shares, np.int32(height * width), np.int32(channels), each, np.float32(1 / scale),
        )  # fmt: skip
    return sums


class Undefined(IntEnum):
    """What a filter that chooses among samples makes of NaN."""

    NONE = 0
    """there is none"""
    SPREAD = 1
    """a window that holds one gives NaN"""
    SKIP = 2
    """it takes no part; a window of nothing else gives NaN"""


Choice = Callable[[Array, Border, float, Undefined], Array]
"""A filter, given an array, a border, the constant beyond it, and what it makes of NaN."""
Reach = Callable[[Array], Array]
"""Given an array that is 1 somewhere and else 0: one of its shape, above 0 where the filter reaches a 1."""


def chosen(
    inputs: Inputs,
    missing: Missing,
    border: Border,
    value: float,
    choose: Choice,
    reach: Reach,
    made: Array | None = None,
) -> Array:
    """What a filter chooses among the samples that take part, of the image or of what was `made` of it before."""
    image = inputs["image"]
    pixels = image.pixels if made is None else made
    if not chooses(missing, inputs):
        return choose(pixels, border, value, Undefined(image.extent.nonfinite > 0))
    kept = np.ones((*pixels.shape[:2], 1), bool)
    if "mask" in inputs:
        kept = inputs["mask"].pixels >= LEAST
    if missing is not Missing.SPREAD:
        kept = kept & np.isfinite(image.pixels)
    around = (Border.CONSTANT, math.nan) if missing is Missing.INSIDE else (border, value)
    left = np.where(kept, pixels, pixels.dtype.type(math.nan))
    out = choose(aligned(left, pixels.dtype), *around, Undefined.SKIP)
    spreading = np.isnan(pixels) & kept
    if spreading.any():  # undefined, and not left out
        out[reach(aligned(spreading, pixels.dtype)) > 0] = math.nan
    return out
