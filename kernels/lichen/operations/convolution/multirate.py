"""A Gaussian blur of which most is done on a few of the rows.

A Gaussian is one of 1 / sqrt(2) of its deviation after another. What the first has made is smooth, so that every s-th
row of it says enough: the second is summed over those alone, by other weights for each of s neighbouring rows, and the
pass along rows comes in between, where they are fewest. For deviation d of both together, the weight of a sample i rows
away is the Gaussian's times 1 + a(i), up to a factor that makes them sum to 1, where by Poisson's formula

    |a| <= e = 2 sum over m >= 1 of exp(-(pi d m / s)^2 / 2),

the spectrum of what leaving rows out folds back. So the pass is wrong by at most e / (1 - e) of the input's spread, and
by the weight that is cut off both kernels, which are normalised for each of the s rows by themselves.

Source: Crochiere and Rabiner, Interpolation and decimation of digital signals, Proceedings of the IEEE 69 (1981).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from lichen.image import Image, StoredImage
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.convolution.gaussian_weights import fir_radius, fir_weights
from lichen.operations.convolution.passes import Vector, both_axes, rows_laid_out, separable_numpy
from lichen.operations.convolution.stencil import NEAR, STAGE, Stencil, banded, correlate
from lichen.stage import Tail

SOURCE = "convolution/multirate.cl"
ROWS = 3
"""Rows that are summed together, as in multirate.cl."""
TILES = 256, 128, 64
"""Floats of a tile; the widest of which private memory holds all taps is taken."""
WIDEST = 56.0
"""px; more taps than those of a wider filter fit no tile."""
HELD = 1 << 23
"""Floats of both pictures of a few rows, about: what stays in a large cache until the next step reads it."""
MOST = 64
"""Rows of which one is kept at most."""


@dataclass(frozen=True)
class Rates:
    """How rows are left out and put back, in numbers alone: planning asks for those of many tails."""

    step: int
    """rows of which one is kept"""
    radius: int
    """of the first filter, in rows"""
    before: int
    after: int
    """kept rows before and after its own that a row of the result is summed from"""
    distance: float
    """from the Gaussian: half the sum of the magnitudes of all differences, at most"""

    @property
    def taps(self) -> int:
        """Of the second filter."""
        return self.before + 1 + self.after

    @property
    def rows(self) -> int:
        """That a kept row is summed from."""
        return 2 * self.radius + 1


@dataclass(frozen=True, eq=False)
class Filters:
    """The two filters down an image."""

    rates: Rates
    analysis: Vector
    """odd, centred"""
    synthesis: npt.NDArray[np.float64]
    """(step, taps): row step q + p of the result is the sum over k of [p, k] times kept row q - before + k"""


def step_of(sigma: float, tail: float) -> int:
    """Rows of which one is kept."""
    return min(max(int(math.pi * sigma / math.sqrt(2 * math.log(4.1 / tail))), 1), MOST)


@lru_cache(maxsize=1024)
def rates(sigma: float, tail: float) -> Rates:
    """Filters whose distance is about `tail`, where `sigma` is so wide that rows can be left out."""
    step = step_of(sigma, tail)
    part = sigma / math.sqrt(2)
    radius, cut = fir_radius(part, tail / 4)
    before, after = radius // step, (radius + step - 1) // step
    # What the second filter lacks falls off with the distance on either side: of all phases the first or the last most.
    lacking = max(
        [
            _beyond((before + 1) * step + phase, part, step) + _beyond((after + 1) * step - phase, part, step)
            for phase in {0, step - 1}
        ]
    )
    folded = _folded(sigma, step)
    return Rates(step, radius, before, after, folded / (1 - folded) + cut + lacking / (1 - _folded(2 * part, step)))


def _folded(sigma: float, step: int) -> float:
    """e of the module's text."""
    first = -0.5 * (math.pi * sigma / step) ** 2
    return 2 * (math.exp(first) + math.exp(4 * first) + math.exp(9 * first))


def _beyond(first: int, sigma: float, step: int) -> float:
    """The weight of a Gaussian's samples at `first` > 0 and every `step` further, relative to the integral over all of
    them, at most: that of the first three, and an integral in place of the rest."""
    a, b, c = first / sigma, (first + step) / sigma, (first + 2 * step) / sigma
    summed = (math.exp(-0.5 * a * a) + math.exp(-0.5 * b * b) + math.exp(-0.5 * c * c)) / math.sqrt(2 * math.pi)
    return summed * step / sigma + 0.5 * math.erfc(c / math.sqrt(2))


@lru_cache(maxsize=64)
def filters(sigma: float, tail: float) -> Filters:
    """The weights that `rates` speaks of."""
    found, part = rates(sigma, tail), sigma / math.sqrt(2)
    kept = np.arange(-found.before, found.after + 1) * found.step - np.arange(found.step)[:, np.newaxis]
    weights = np.exp(-0.5 * np.square(kept / part))
    return Filters(found, fir_weights(part, tail / 4), weights / weights.sum(axis=1, keepdims=True))


def in_bands(height: int, width: int, rates: Rates) -> tuple[int, int]:
    """Bands that an image, `width` floats wide, is blurred in, and of how many steps each of them is."""
    steps = -(-height // rates.step)
    most = max(HELD // (2 * width) - rates.taps, 4 * rates.taps)
    bands = -(-steps // most)
    return bands, -(-steps // bands)


def _sources(kept: int, height: int, rates: Rates, border: Border) -> npt.NDArray[np.int64]:
    """The rows that so many which are kept are summed from, in order; neighbours share most."""
    first = -rates.before * rates.step - rates.radius
    return continued(np.arange((kept - 1) * rates.step + rates.rows) + first, height, border)


def multirate_opencl(
    device: Device, image: Image, down: Filters, across: Vector, border: Border, value: float, tail: Tail | None = None
) -> Array:
    """Blurred down by these filters, along by the weights `across`. A `tail` is for processors."""
    rates = down.rates
    pixels, meant = image.coded if isinstance(image, StoredImage) else (image.pixels, None)
    height, width, channels = pixels.shape
    bands, steps = in_bands(height, width * channels, rates)
    kept, rows = steps + rates.taps - 1, steps * rates.step
    sources = _sources((bands - 1) * steps + kept, height, rates, border)
    out = aligned_empty(pixels.shape, tail.kind if tail else np.float32)
    with device.session() as session:
        few, blurred = (session.scratch((kept, width, channels)) for _ in range(2))
        for top in range(0, height, rows):
            read = sources[top : top + (kept - 1) * rates.step + rates.rows]
            _sum_rows(session, (pixels, meant), read, down.analysis[np.newaxis], rates.step, few, 0, kept, value)
            _along(session, few, blurred, across, border, value)
            some = min(rows, height - top)
            _sum_rows(session, (blurred, None), np.arange(kept), down.synthesis, 1, out, top, some, value, tail)
    return out


def _along(session: Session, source: Array, target: Array, across: Vector, border: Border, value: float) -> None:
    radius = len(across) // 2
    laid = rows_laid_out(1, len(across), source.shape[2])
    if session.in_step or laid is None:
        correlate(session, source, target, Stencil(across[np.newaxis], 0, radius), border, value)
    else:
        both_axes(session, (source, None), target, ((np.ones(1), 0), (across, radius)), laid, border, value)


def _sum_rows(
    session: Session,
    source: tuple[Array, Array | None],
    read: Array,
    weights: Array,
    step: int,
    out: Array,
    top: int,
    rows: int,
    value: float,
    tail: Tail | None = None,
) -> None:
    """Of floats, or of codes and what they mean, into so many rows of `out` from `top` on; a period of `weights`, then
    another `step` further."""
    (period, taps), width, (samples, meant) = weights.shape, out.size // len(out), source
    given = aligned(read, np.int32), session.readwrite(out)
    numbers = np.int32(top), np.int32(rows), np.int32(width), np.int32(taps), np.int32(period), np.int32(step)
    if session.in_step:
        session.launch(SOURCE, "apart", (width, rows), samples, *given, aligned(weights), *numbers, np.float32(value))
        return
    beside = -(-(ROWS - 1) // period) * step  # rows that are summed together begin so far apart at most
    tile = next(tile for tile in TILES if taps + beside <= STAGE // (tile + 16))
    tiles, room = -(-width // tile), STAGE // (tile + 16)
    band = banded(rows, tiles, 2 * taps * period // step)
    capacity = min(room, max(2 * (taps + beside), NEAR // (tile + 16)))
    then = tail or Tail(SOURCE)
    session.launch(
        then.source, "sums", (tiles, -(-rows // band)), samples, meant, *given,
        aligned(np.pad(weights, ((0, 0), (beside, beside)))), *numbers, np.int32(beside), np.int32(band),
        np.int32(tile), np.int32(capacity), np.float32(value), then.numbers, then.counting(session),
        local=(1, 1), defines={"STAGE": STAGE, "CODED": int(meant is not None), **then.defines},
    )  # fmt: skip


def multirate_numpy(pixels: Array, down: Filters, across: Vector, border: Border, value: float) -> Array:
    """The same."""
    rates = down.rates
    height, step = len(pixels), rates.step
    kept = -(-height // step) + rates.taps - 1
    read = _sources(kept, height, rates, border)
    padded = np.take(pixels, np.maximum(read, 0), 0)
    padded[read == OUTSIDE] = value
    few = np.zeros((kept, *pixels.shape[1:]), np.float32)
    for at, weight in enumerate(down.analysis):
        few += np.float32(weight) * padded[at::step][:kept]
    few = separable_numpy(Image(few), np.ones(1), across, border, value)
    out = aligned_empty(pixels.shape)
    for phase, weights in enumerate(down.synthesis):
        some = out[phase::step]
        some[...] = 0
        for at, weight in enumerate(weights):
            some += np.float32(weight) * few[at : at + len(some)]
    return out
