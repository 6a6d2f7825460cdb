"""Resampling by definition, in float64 NumPy: what every warp's truth is, and the bodies of its methods.

Truth. At a place p of the source, with V and t the shape and the blend of its footprint (see `footprints`):

    result = (1 - t) L(p) + t E(p)

L interpolates by the Lanczos kernel of radius 3 along rows and columns. E is the mean of the samples within the ellipse
q <= 9 around p, weighted by exp(-2 q): a Gaussian whose standard deviation is half an output pixel, cut where 1.5e-8
of its weight is left. t is 0 where the map shrinks nothing: there the result goes through the samples, and a map that
moves none of them changes none. t is 1 where it shrinks to half or less: there nothing aliases that the Gaussian can
hold back (3e-4 of a wave of one cycle per output pixel is left on the half-size grid). Between, it rises smoothly.

An ellipse whose double is wider or taller than four times the source takes the mean of the whole source; beyond a
constant border, that mean by the share of the ellipse which the source fills, and the border's value for the rest.

Sources: Heckbert, Fundamentals of texture mapping and image warping, UC Berkeley 1989; Greene and Heckbert, Creating
raster omnimax images from multiple perspective views using the elliptical weighted average filter, IEEE CG&A 6, 1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.operation import Border
from lichen.operations.convolution.borders import OUTSIDE, continued
from lichen.operations.warp.footprints import Ellipses
from lichen.operations.warp.kernels import BILINEAR, LANCZOS3, Doubles, Kernel
from lichen.operations.warp.maps import Map, Places

REACH = 3.0
"""Radius at which truth cuts its ellipses."""
THIN = 1.5
"""Half an axis, in samples, that bounds how long the other may be."""
BAND = 1 << 16
"""Output pixels worked on at once."""
CHUNK = 1 << 20
"""Weights held at once."""
FAR = 2.0**40
"""Coordinates are kept within this, so that they are integers and fractions still."""

Whole = npt.NDArray[np.int64]


class Closed(StrEnum):
    """How an image of directions continues: its columns go around, and its last row and the first"""

    RING = "ring"
    """are repeated"""
    SPHERE = "sphere"
    """are followed by what lies across the pole: half way around, in reverse order"""


@dataclass(frozen=True)
class Source:
    """Samples with what lies beyond them. `pixels` is (height, width, channels)."""

    pixels: Array
    border: Border | Closed
    value: float

    def extended(self, rows: tuple[int, int], columns: tuple[int, int]) -> Array:
        """With so many rows before and after the samples, and columns left and right; their type."""
        height, width, _ = self.pixels.shape
        if not any((*rows, *columns)):
            return self.pixels
        down, beside = np.arange(-rows[0], height + rows[1]), np.arange(-columns[0], width + columns[1])
        return self.fetch(*np.meshgrid(down, beside, indexing="ij")).astype(self.pixels.dtype)

    def fetch(self, rows: Whole, columns: Whole) -> Array:
        """Samples at any integer places, as float64, in a last axis more."""
        height, width, _ = self.pixels.shape
        if self.border is Closed.SPHERE:
            over = rows % (2 * height) >= height
            beside = continued(columns + np.where(over, width // 2, 0), width, Border.WRAP)
            down = continued(rows, height, Border.REFLECT)
        else:
            down, beside = self.indices(rows, columns)
        found = self.pixels[np.maximum(down, 0), np.maximum(beside, 0)].astype(np.float64)
        found[(down == OUTSIDE) | (beside == OUTSIDE)] = self.value
        return found

    def indices(self, rows: Whole, columns: Whole) -> tuple[Whole, Whole]:
        """Which row and column stands for each; not for a sphere, whose rows change its columns."""
        height, width, _ = self.pixels.shape
        if isinstance(self.border, Closed):
            return continued(rows, height, Border.CLAMP), continued(columns, width, Border.WRAP)
        return continued(rows, height, self.border), continued(columns, width, self.border)

    def mean(self) -> Doubles:
        made: Doubles = self.pixels.mean(axis=(0, 1), dtype=np.float64)
        return made

    def fold(self, x: Doubles, y: Doubles) -> tuple[Doubles, Doubles]:
        """Coordinates of the same content near the source: whole periods of the border are taken off."""
        height, width, _ = self.pixels.shape
        if isinstance(self.border, Closed):
            return x - width * np.floor(x / width), np.clip(y, -FAR, FAR)
        periods = {
            Border.WRAP: (width, height),
            Border.REFLECT: (2 * width, 2 * height),
            Border.REFLECT101: (max(2 * width - 2, 1), max(2 * height - 2, 1)),
        }.get(self.border)
        if periods is None:
            return np.clip(x, -FAR, FAR), np.clip(y, -FAR, FAR)
        return x - periods[0] * np.floor(x / periods[0]), y - periods[1] * np.floor(y / periods[1])


Sampler = Callable[[Source, Places], Doubles]
"""Values at places of shape (n,), as (n, channels)."""


def resample(source: Source, map_: Map, width: int, height: int, sampler: Sampler) -> Doubles:
    """The whole result by one sampler: background where the map gives no place."""
    out = np.full((height, width, source.pixels.shape[2]), source.value, np.float64)
    rows = max(1, BAND // width)
    u = np.arange(width) + 0.5
    for first in range(0, height, rows):
        some = slice(first, min(first + rows, height))
        at = map_.places(u, np.arange(some.start, some.stop) + 0.5)
        seen = np.isfinite(at.x) & np.isfinite(at.y)
        if seen.any():
            out[some][seen] = sampler(source, at.take(seen))
    return out


def interpolate(source: Source, x: Doubles, y: Doubles, kernel: Kernel) -> Doubles:
    """By a kernel along rows and columns. A sample of weight 0 is not used, be it NaN."""
    x, y = source.fold(x, y)
    if kernel.taps == 1:
        return source.fetch(np.floor(y).astype(np.int64), np.floor(x).astype(np.int64))
    column, row = np.floor(x - 0.5), np.floor(y - 0.5)
    across, down = kernel.weights(x - 0.5 - column), kernel.weights(y - 0.5 - row)
    columns, rows = column.astype(np.int64), row.astype(np.int64)
    out = np.zeros((len(x), source.pixels.shape[2]))
    for i, wy in zip(kernel.offsets(), down, strict=True):
        for j, wx in zip(kernel.offsets(), across, strict=True):
            weight = (wy * wx)[:, np.newaxis]
            out += weight * np.where(weight == 0, 0.0, source.fetch(rows + i, columns + j))
    return out


def filtered(source: Source, at: Places, average: Callable[[Places, Ellipses], Doubles]) -> Doubles:
    """The blend of interpolation and average that truth is, with any average; ellipses too large take the mean."""
    height, width, channels = source.pixels.shape
    ellipses = Ellipses.of(at)
    t = ellipses.blend()
    out = np.zeros((len(at.x), channels))
    near = t < 1
    out[near] = interpolate(source, at.x[near], at.y[near], LANCZOS3)
    far = ellipses.beyond(height, width) & (t > 0)
    averaged = np.zeros_like(out)
    averaged[far] = distant(source, at.take(far), ellipses.take(far))
    some = ~far & (t > 0)
    if some.any():
        averaged[some] = average(at.take(some), ellipses.take(some))
    share = t[:, np.newaxis]
    with np.errstate(invalid="ignore"):
        return np.where(share == 0, out, np.where(share == 1, averaged, (1 - share) * out + share * averaged))


def distant(source: Source, at: Places, ellipses: Ellipses) -> Doubles:
    """The mean of the source, by its share of the ellipse where something else lies beyond the border."""
    height, width, _ = source.pixels.shape
    mean = np.broadcast_to(source.mean(), (len(at.x), source.pixels.shape[2]))
    if source.border is not Border.CONSTANT:
        return mean
    with np.errstate(all="ignore"):
        dx, dy = np.clip(width / 2 - at.x, -FAR, FAR), np.clip(height / 2 - at.y, -FAR, FAR)
        xx, xy, yy = ellipses.inverse()
        density = 2 / (np.pi * np.sqrt(ellipses.major) * np.sqrt(ellipses.minor))
        density = density * np.exp(-2 * (xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy))
        share = np.minimum(height * width * density, 1)[:, np.newaxis]
        made: Doubles = np.where(share == 0, source.value, source.value + share * (mean - source.value))
    return made


def ellipse_average(levels: Sequence[Array], source: Source, reach: float, samples: float, most: float) -> Callable[
    [Places, Ellipses], Doubles
]:  # fmt: skip
    """E by samples of a pyramid, of the level that `level_of` says."""

    def average(at: Places, ellipses: Ellipses) -> Doubles:
        x, y = source.fold(at.x, at.y)
        level = level_of(ellipses, samples, most, len(levels))
        out = np.zeros((len(x), source.pixels.shape[2]))
        for one in np.unique(level):
            which = level == one
            image = Source(levels[one], source.border, source.value)
            scale = 2.0 ** -int(one)
            shape = ellipses.take(which).at_level(int(one))
            out[which] = _gathered(image, x[which] * scale, y[which] * scale, shape, reach)
        return out

    return average


def level_of(ellipses: Ellipses, samples: float, most: float, count: int) -> Whole:
    """Of `count` levels of a pyramid, that on which an ellipse's shorter half axis is `samples` to twice as many long;
    or a coarser one, until the product of both, the shorter counted as `THIN` at least, is no more than `most`."""
    along, thin = np.sqrt(ellipses.major), np.sqrt(ellipses.minor)
    least = np.maximum(np.sqrt(along * thin / most), THIN * along / most)
    wanted = np.floor(np.log2(np.maximum(thin / samples, 2 * least)))
    made: Whole = np.clip(wanted, 0, count - 1).astype(np.int64)
    return made


def _gathered(source: Source, x: Doubles, y: Doubles, shape: Ellipses, reach: float) -> Doubles:
    """Sums over boxes around the ellipses; boxes of like size are done together."""
    out = np.zeros((len(x), source.pixels.shape[2]))
    wide, tall = reach * np.sqrt(shape.xx), reach * np.sqrt(shape.yy)
    classes = np.stack([np.ceil(2 * np.log2(wide)), np.ceil(2 * np.log2(tall))], axis=-1).astype(np.int64)
    kinds, member = np.unique(classes, axis=0, return_inverse=True)
    member = member.reshape(-1)
    for number in range(len(kinds)):
        among = np.flatnonzero(member == number)
        half_x, half_y = int(np.ceil(wide[among].max())), int(np.ceil(tall[among].max()))
        each = max(1, CHUNK // ((2 * half_x + 2) * (2 * half_y + 2)))
        for first in range(0, len(among), each):
            some = among[first : first + each]
            out[some] = _boxes(source, x[some], y[some], shape.take(some), reach, half_x, half_y)
    return out


def _boxes(source: Source, x: Doubles, y: Doubles, shape: Ellipses, reach: float, half_x: int, half_y: int) -> Doubles:
    columns = np.floor(x - 0.5).astype(np.int64)[:, np.newaxis, np.newaxis] + np.arange(-half_x, half_x + 2)
    rows = np.floor(y - 0.5).astype(np.int64)[:, np.newaxis, np.newaxis] + np.arange(-half_y, half_y + 2)[:, np.newaxis]
    dx, dy = columns + 0.5 - x[:, np.newaxis, np.newaxis], rows + 0.5 - y[:, np.newaxis, np.newaxis]
    xx, xy, yy = (each[:, np.newaxis, np.newaxis] for each in shape.inverse())
    q = xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy
    # Of a thin ellipse, most of its box is empty: only what lies inside is weighed and fetched.
    pixel, i, j = np.nonzero(q <= reach * reach)
    weights = np.exp(-2 * q[pixel, i, j])[:, np.newaxis]
    found = source.fetch(rows[pixel, i, 0], columns[pixel, 0, j])
    starts = np.searchsorted(pixel, np.arange(len(x)))
    made: Doubles = np.add.reduceat(weights * found, starts) / np.add.reduceat(weights, starts)
    return made


def truth_sampler(source: Source, at: Places) -> Doubles:
    """The definition."""
    return filtered(source, at, ellipse_average([source.pixels], source, REACH, 1.0, np.inf))


def mipmapped(levels: Sequence[Array]) -> Sampler:
    """Bilinear in the two pyramid levels on either side of the longer axis, and between them."""

    def sampler(source: Source, at: Places) -> Doubles:
        detail = np.minimum(np.log2(np.maximum(Ellipses.of(at).rho, 1)), len(levels) - 1)
        lower = np.floor(detail)
        share = (detail - lower)[:, np.newaxis]
        x, y = source.fold(at.x, at.y)
        out = np.zeros((len(x), source.pixels.shape[2]))
        for one in np.unique(lower):
            which = lower == one
            pair = []
            for level in (int(one), min(int(one) + 1, len(levels) - 1)):
                image = Source(levels[level], source.border, source.value)
                pair.append(interpolate(image, x[which] * 2.0**-level, y[which] * 2.0**-level, BILINEAR))
            part = share[which]
            with np.errstate(invalid="ignore"):
                out[which] = np.where(part == 0, pair[0], pair[0] + part * (pair[1] - pair[0]))
        return out

    return sampler


def supersampled(count: int) -> Sampler:
    """A grid of count x count bilinear samples over the ellipse in place of its average."""

    def sampler(source: Source, at: Places) -> Doubles:
        def average(at: Places, ellipses: Ellipses) -> Doubles:
            xx, xy, yy = ellipses.root()
            out = np.zeros((len(at.x), source.pixels.shape[2]))
            for u, v, weight in grid(count):
                x, y = at.x + (xx * u + xy * v), at.y + (xy * u + yy * v)
                out += weight * interpolate(source, x, y, BILINEAR)
            return out

        return filtered(source, at, average)

    return sampler


SPAN = 1.5
"""Radius that supersampling covers."""


def grid(count: int) -> list[tuple[float, float, float]]:
    """Where the samples lie in the pixel's own frame, and their weights, which sum to 1."""
    at = ((np.arange(count) + 0.5) / count * 2 - 1) * SPAN
    weights = np.exp(-2 * at * at)
    weights /= weights.sum()
    return [
        (float(u), float(v), float(a * b))
        for v, b in zip(at, weights, strict=True)
        for u, a in zip(at, weights, strict=True)
    ]
