"""The parameters of a Gaussian blur, and what its methods are predicted to cost and to be wrong by."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, NamedTuple

from pydantic import Field

from lichen.errors import Flaw
from lichen.once import latest
from lichen.operation import ROUNDING, Border, Degrees, Error, InputFacts, OperationParameters, Pixels
from lichen.operations.convolution import gaussian_turned
from lichen.operations.convolution.gaussian_turned import Turned
from lichen.operations.convolution.gaussian_weights import NORMAL, dct_modes, fir_radius, modes_about
from lichen.operations.convolution.missing import Missing, check_mask, leaves_out, renormalised_error
from lichen.operations.convolution.multirate import WIDEST, Rates, in_bands, rates, step_of
from lichen.operations.convolution.passes import rows_laid_out
from lichen.operations.convolution.stencil import banded
from lichen.operations.convolution.transform import Layout
from lichen.processors import threads

MOST_MODES = 1536
"""Modes that the dct method keeps at most; a kernel that passes more is narrow enough for fir."""


Width = Annotated[Pixels, Field(ge=0, le=1e5)]
Turn = Annotated[Degrees, Field(ge=-360, le=360)]


class Parameters(OperationParameters):
    sigma: Pixels = Field(ge=0, le=1e5, description="standard deviation")
    sigma_x: Width | None = None
    """along the first axis, x unless it is turned; sigma if left out"""
    sigma_y: Width | None = None
    """along the second axis, y unless it is turned; sigma if left out"""
    angle: Turn = 0.0
    """by which both axes are turned, from x towards y"""
    border: Border = Field(Border.REFLECT, description="how the image continues beyond its edges")
    value: float = Field(0.0, description="what lies beyond a constant border")
    missing: Missing = Missing.SPREAD
    """what becomes of samples that are NaN or infinite"""

    @property
    def turned(self) -> Turned | None:
        """The kernel as one whose axes are turned; None where its axes are those of the image."""
        along, across = self._given
        return None if along == across or self.angle % 90 == 0 else Turned(along, across, self.angle % 180)

    @property
    def _given(self) -> tuple[float, float]:
        along, across = self.sigma_x, self.sigma_y
        return self.sigma if along is None else along, self.sigma if across is None else across

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations along y and along x, of a kernel whose axes are those of the image."""
        along, across = self._given
        return (along, across) if self.angle % 180 == 90 else (across, along)


def check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws, turned = check_mask(facts), p.turned
    if turned is None:
        return flaws
    low, high = gaussian_turned.NARROWEST, gaussian_turned.WIDEST
    for name, given in (("sigma_x", turned.along), ("sigma_y", turned.across)):
        if not low <= given <= high:
            flaws.append(Flaw(f"/parameters/{name}", f"must be within [{low:g}, {high:g}] where the axes are turned"))
    if leaves_out(p.missing, facts):
        flaws.append(Flaw("/parameters/angle", "must be a multiple of 90 where pixels are left out"))
    return flaws


@latest
def spread(p: Parameters, facts: InputFacts) -> tuple[float, float]:
    """Largest difference between input values, and largest magnitude, with the constant beyond the border."""
    extent = facts["image"].extent
    low, high = extent.low, extent.high
    if p.border is Border.CONSTANT:
        low, high = min(low, p.value), max(high, p.value)
    return high - low, max(abs(low), abs(high))


def masked_radius(sigma: float) -> int:
    """Where pixels may be left out, the kernel ends here in every method and in truth."""
    return math.floor(4 * sigma)


# -------------------------------------------------------------------------------------------------------------- fir


class Asked(NamedTuple):
    """What all methods and settings need to know of a request."""

    turned: Turned | None
    renormalised: bool
    sides: tuple[tuple[float, int], tuple[float, int]]
    """standard deviation and samples, along y and along x"""
    working: int
    """threads"""


@latest
def asked(p: Parameters, facts: InputFacts) -> Asked:
    image, (down, across) = facts["image"], p.deviations
    sides = (down, image.height), (across, image.width)
    return Asked(p.turned, leaves_out(p.missing, facts), sides, threads())


def _taps(request: Asked, tail: float) -> list[int]:
    """Multiply-adds for each sample of the FIR passes, down and across."""
    if request.renormalised:
        return [2 * masked_radius(sigma) + 1 for sigma, _ in request.sides]
    return [min(2 * fir_radius(sigma, tail)[0] + 1, size) for sigma, size in request.sides]


def fir_error(p: Parameters, tail: float, facts: InputFacts) -> Error:
    """Truncation, proved; plus rounding: n taps added in any order lose at most n + 1 roundings of the magnitude."""
    (wide, magnitude), request = spread(p, facts), asked(p, facts)
    if request.turned is not None:
        return gaussian_turned.error(request.turned, tail, wide, magnitude)
    tall, across = _taps(request, tail)
    rounding = 1.01 * (tall + across + 4) * ROUNDING * magnitude
    if request.renormalised:
        return renormalised_error(rounding, magnitude)
    (down, _), (beside, _) = request.sides
    cut = fir_radius(down, tail)[1] + fir_radius(beside, tail)[1]
    return Error(cut * wide + rounding, "bound", rounding)


def fir_work(p: Parameters, tail: float, facts: InputFacts) -> float:
    """Multiply-adds, beside what it takes to move samples; where both passes are one nothing is moved between them.

    Kernels longer than the image are folded onto it, which takes time for each number of that matrix.
    """
    image, request = facts["image"], asked(p, facts)
    if request.turned is not None:
        return gaussian_turned.work(request.turned, tail, image)
    tall, wide = _taps(request, tail)
    if request.renormalised:
        return 2 * image.samples * (MOVED + tall + wide)
    folded = sum(size * size for sigma, size in request.sides if 2 * fir_radius(sigma, tail)[0] >= size)
    return _passed(image.height, image.width, image.channels, tall, wide, request.working) + FOLDED * folded


@lru_cache(1024)
def _passed(height: int, width: int, channels: int, tall: int, wide: int, working: int) -> float:
    """Of both passes: where they are one, rows above and below a tile are filtered along again, and with few tiles some
    processor has none."""
    together = rows_laid_out(tall, wide, channels)
    if together is None:
        return height * width * channels * (MOVED + tall + wide)
    tile = together[0]
    tiles = -(-width * channels // tile)
    bands = -(-height // banded(height, tiles, 2 * tall))
    items = tiles * bands
    busy = -(-items // working) * working / items * tiles * tile
    return busy * ((1.6 * wide + STAGED) * (height + bands * (tall - 1)) + 0.44 * tall * height)


MOVED, STAGED, FOLDED, KEPT = 122, 10, 700, 34
"""Multiply-adds that take as long as moving a sample through both passes, as reading it into a tile, as folding into
one number of a matrix, or as writing a sample between passes and reading it again."""


# -------------------------------------------------------------------------------------------------------------- fft


@latest
def _layout(p: Parameters, facts: InputFacts) -> Layout:
    turned = asked(p, facts).turned
    return gaussian_turned.spectral_layout(p.deviations if turned is None else turned.deviations, facts["image"])


def spectral_error(p: Parameters, bits: float, facts: InputFacts) -> Error:
    return gaussian_turned.spectral_error(bits, _layout(p, facts), *spread(p, facts))


def spectral_work(p: Parameters, bits: float, facts: InputFacts) -> float:
    return gaussian_turned.spectral_work(bits, _layout(p, facts), facts["image"].channels)


def spectral_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if asked(p, facts).turned is None:
        return "rows and columns can be filtered one after the other, which is quicker"
    return "a transform would spread NaN and infinity over the whole image" if facts["image"].extent.nonfinite else None


# -------------------------------------------------------------------------------------------------------------- dct


def dct_error(p: Parameters, tail: float, facts: InputFacts) -> Error:
    """Dropped modes, proved; rounding as the worst seen over sizes, sigmas and images, with a margin of two.

    It grows with the root of the number of modes, as sums of independent roundings do.
    """
    wide, magnitude = spread(p, facts)
    (rows, below), (columns, beside) = (dct_modes(sigma, size, tail) for sigma, size in asked(p, facts).sides)
    dropped = below + beside
    rounding = (8 + 3 * math.sqrt(rows + columns)) * ROUNDING * magnitude
    return Error(dropped * (1 + dropped) * wide + rounding, "estimate", rounding)


def dct_work(p: Parameters, tail: float, facts: InputFacts) -> float:
    """Multiply-adds of the four products, those of the modes at their own pace, and what it takes to read the image and
    to write it."""
    image = facts["image"]
    rows, columns = (modes_about(sigma, size, tail) for sigma, size in asked(p, facts).sides)
    few = rows * image.width * image.channels
    return image.samples * (2.0 * rows + 40.0) + 3.5 * few * columns


def dct_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if p.border is not Border.REFLECT:
        return f"the border is {p.border}; a cosine transform continues by reflection"
    if reason := not_plain(p, facts):
        return reason
    sides = [(sigma, size) for sigma, size in asked(p, facts).sides if size > MOST_MODES]
    if any(dct_modes(sigma, size, 1e-7)[0] > MOST_MODES for sigma, size in sides):
        return f"more than {MOST_MODES} modes pass so narrow a kernel"
    if facts["image"].extent.nonfinite:
        return "a transform would spread NaN and infinity over the whole image"
    return None


def not_plain(p: Parameters, facts: InputFacts) -> str | None:
    request = asked(p, facts)
    if request.turned is not None:
        return "its axes are turned; rows and columns cannot be filtered one after the other"
    if request.renormalised:
        return "pixels are left out; which ones have a value must not depend on how the kernel is approximated"
    return None


def within(p: Parameters, low: float, high: float) -> tuple[float, float]:
    """The deviations as far as a method takes them: what it is predicted to do where it is unfit is of no use."""
    down, across = (min(max(sigma, low), high) for sigma in p.deviations)
    return down, across


# -------------------------------------------------------------------------------------------------------- multirate


def multirate_filters(p: Parameters, tail: float) -> tuple[Rates, int, float]:
    """Down the image; and the radius along it, with the weight beyond that."""
    down, across = within(p, 1.0, WIDEST)
    return rates(down, tail), *fir_radius(across, tail)


def multirate_error(p: Parameters, tail: float, facts: InputFacts) -> Error:
    """What leaving rows out and cutting off both axes' kernels changes, proved; and rounding, as of `fir`."""
    (wide, magnitude), (down, radius, cut) = spread(p, facts), multirate_filters(p, tail)
    rounding = 1.01 * (down.rows + 2 * radius + down.taps + 7) * ROUNDING * magnitude
    return Error((down.distance + cut) * wide + rounding, "bound", rounding)


NEAR = 250e3
"""Samples that a processor keeps near at hand: of more, what is read again takes 1.8 times as long."""


def multirate_work(p: Parameters, tail: float, facts: InputFacts) -> float:
    """Multiply-adds, of the rows that are left of them; beside what it takes to read the image and to write it, and to
    keep a row from either pass to the next."""
    image, (down, radius, _) = facts["image"], multirate_filters(p, tail)
    bands, steps = in_bands(image.height, image.width * image.channels, down)
    kept = bands * (steps + down.taps - 1) / image.height
    along = 1.6 * (2 * radius + 1)
    far = min(down.rows * image.width * image.channels / NEAR, 1.0)
    return image.samples * (28.0 + kept * ((1 + 0.8 * far) * down.rows + along + KEPT) + 0.3 * down.taps)


def multirate_lightest(p: Parameters, tail: float, facts: InputFacts) -> float:
    """With a tap less at either end than Gaussians that are not sampled would need."""
    down, across = within(p, 1.0, WIDEST)
    step, part = step_of(down, tail), down / math.sqrt(2)
    above, beside = (max(-NORMAL.inv_cdf(beyond) * s - 1, 0.0) for s, beyond in ((part, tail / 8), (across, tail / 2)))
    kept = (2 * above + 1 + 1.6 * (2 * beside + 1) + KEPT) / step
    return facts["image"].samples * (28.0 + kept + 0.3 * max(2 * above / step - 1, 1))


def multirate_unfit(p: Parameters, facts: InputFacts) -> str | None:
    if reason := not_plain(p, facts):
        return reason
    if facts["image"].extent.nonfinite:
        return "two filters in a row would spread NaN and infinity further than the kernel reaches"
    (down, _), (across, _) = asked(p, facts).sides
    if max(down, across) > WIDEST:
        return f"beyond {WIDEST:g} px it takes more rows than are near at hand"
    if down < 1:
        return f"a kernel as narrow as {down:g} px leaves out no rows"
    return None
