"""What the pointwise operations on tone share: how they run, and how far an error of the input carries.

Colour channels are computed, coverage passes untouched. Where coverage is straight, colour counts as it shows, times
its coverage a: with |c'a' - ca| and |a' - a| at most e, (c' - c) a' is at most (1 + |c|) e, and
f(c') a' - f(c) a = (f(c') - f(c)) a' + f(c) (a' - a).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.image import Alpha, Extent, Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Facts

if TYPE_CHECKING:
    from lichen.opencl.device import Device

FLOAT_MAX = float(np.finfo(np.float32).max)
BLOCK = 1 << 16
"""Samples that a NumPy body works on at once, so that its steps stay in cache."""


def coverage_channels(image: Image) -> int:
    """The definition COVERAGE of flat.clh."""
    return image.channels if image.alpha is not Alpha.NONE else 0


def launch_flat(
    device: Device, source: str, kernel: str, image: Image, *arguments: Any, defines: Mapping[str, int | float | str]
) -> Array:
    """All samples through a kernel of flat.clh's form: (in, out, `arguments`, count)."""
    pixels = aligned(image.pixels)
    out = aligned_empty(pixels.shape)
    with device.session() as session:
        session.launch(
            source, kernel, (-(-pixels.size // 16),),
            pixels, session.write(out), *arguments, np.uint64(pixels.size),
            defines={"COVERAGE": coverage_channels(image), **defines},
        )  # fmt: skip
    return out


def blockwise(image: Image, function: Callable[[Array], Array]) -> Array:
    """`function` on blocks of rows of float32 colour, shape (rows, width, colours); coverage is copied."""
    pixels, colours = image.pixels, image.colours
    out = aligned_empty(pixels.shape)
    rows = max(1, BLOCK // max(1, image.width * image.channels))
    with np.errstate(all="ignore"):
        for top in range(0, image.height, rows):
            block = pixels[top : top + rows]
            out[top : top + rows, :, :colours] = function(block[..., :colours])
            out[top : top + rows, :, colours:] = block[..., colours:]
    return out


def carried(facts: Facts, magnitude: float, modulus: Callable[[float], float], error: float) -> float:
    """The modulus of continuity of the image, from that of the colour; `magnitude` is the largest result."""
    if facts.alpha is Alpha.NONE:
        return modulus(error)
    if facts.alpha is Alpha.STRAIGHT:
        return max(modulus((1 + facts.extent.magnitude) * error) + magnitude * error, error)
    return max(modulus(error), error)


def within(facts: Facts, low: float, high: float) -> bool:
    """Whether every colour is known to lie in [low, high].

    It is not where there is coverage: colour seen through little of it may be any number, since the range of a picture
    that coverage was divided out of tells how bright it shows.
    """
    extent = facts.extent
    return facts.alpha is Alpha.NONE and low <= extent.low and extent.high <= high and not extent.nonfinite


def spanned(facts: Facts, low: float, high: float, slack: float, *, nonfinite: int | None = None) -> Extent:
    """The extent of a result whose colour lies in [low, high] give or take `slack`, beside coverage."""
    low, high = low - slack, high + slack
    if facts.alpha is not Alpha.NONE:
        low, high = min(low, facts.extent.low), max(high, facts.extent.high)
    bad = facts.extent.nonfinite if nonfinite is None else nonfinite
    if max(abs(low), abs(high)) > FLOAT_MAX:
        bad = facts.samples
    return Extent(max(low, -FLOAT_MAX), min(high, FLOAT_MAX), bad)
