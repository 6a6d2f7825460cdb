"""Sparse convolution: impulses strewn over cells, each with a kernel around it, summed.

Every cell holds `impulses` of them at places that its hash gives, 16 bits along each axis, anywhere in the cell. With d
the way from an impulse, in cells, u and v along and across the direction `angle`, and r^2 = u^2 + (stretch v)^2 + z^2 +
w^2, its window is (1 - r^2)^3 where r < 1. That ends by itself, with two continuous derivatives, where the usual
Gaussian is cut; and it ends within a cell, so the 3^d cells around a place hold all that reach it: the sum is exact.

Kernels are zero-mean and independent, so the variance is impulses x the integral of the squared window, over `stretch`,
and half of that for waves: the integral is pi^(d/2) / Gamma(d/2) B(d/2, 7) in d dimensions. n is the sum over four
standard deviations, kept within [-1, 1]: of a normal distribution that is 6 in 100 000 places."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from pydantic import Field

from lichen.hashing import Words, keyed, pcg
from lichen.memory import Array
from lichen.operations.noise.basis import Basis, Place, Slice, Values, corners, padded
from lichen.operations.noise.coordinates import Axis
from lichen.operations.noise.octaves import Key, Lattice
from lichen.operations.noise.parameters import Fractal, LatticeParameters

GOLDEN = 0x9E3779B9
"""2^32 over the golden ratio: apart, impulse by impulse."""


NORMAL_MAGNITUDE = math.sqrt(2 / math.pi) / 4
"""The mean of |n| of a normal distribution whose standard deviation is 1/4."""


class ImpulseParameters(LatticeParameters):
    fractal: Fractal = Field(Fractal.NONE, description="how octaves are summed")
    impulses: int = Field(4, ge=1, le=32, description="of a cell; with few, single ones show")
    angle: float = Field(
        0.0, ge=-360, le=360, description="direction, from x towards y", json_schema_extra={"unit": "deg"}
    )


@dataclass(frozen=True, slots=True)
class Kernel:
    """What is around every impulse."""

    impulses: int
    scale: float
    stretch: float
    angle: float
    """deg"""
    waves: float = 0.0
    """cycles per cell; 0: a spot, up or down"""
    spread: float = 0.0
    """half turns that the direction of a wave strays from `angle` at most"""

    @property
    def numbers(self) -> tuple[float, ...]:
        """In the order in which impulses.clh takes them."""
        turn = math.radians(self.angle)
        return (float(self.impulses), self.scale, self.stretch, math.cos(turn), math.sin(turn), self.waves, self.spread)


def scale(p: ImpulseParameters, stretch: float, *, waves: bool) -> float:
    """One over four standard deviations of the sum."""
    half = p.dimensions / 2
    window = math.pi**half / math.gamma(half) * math.gamma(half) * math.gamma(7) / math.gamma(half + 7)
    return 1 / (4 * math.sqrt(p.impulses * window / stretch * (0.5 if waves else 1.0)))


def slices(p: ImpulseParameters, key: Key, axes: tuple[Axis, ...]) -> tuple[Slice, ...]:
    return tuple(Slice(own, **padded(away)) for own, away in corners(key, axes, (-1, 0, 1)))


def evaluate(kernel: Kernel, place: Place, dimensions: int, derivatives: bool) -> Values:
    kind = place.x.dtype.type
    size = np.broadcast_shapes(place.x.shape, place.y.shape)
    sums = [np.zeros(size, kind) for _ in range(3 if derivatives else 1)]
    for part in place.slices:
        for j, i in product((-1, 0, 1), repeat=2):
            h = keyed(place.column(i), *place.row(part, j))
            for m in range(kernel.impulses):
                g = pcg(h + np.uint32(m * GOLDEN & 0xFFFFFFFF))
                more = pcg(g)
                x, y = place.x - i - _low(g, kind), place.y - j - _high(g, kind)
                last = pcg(more) if dimensions > 2 else more
                away = [kind(part.z) - _low(last, kind), kind(part.w) - _high(last, kind)][: dimensions - 2]
                for total, term in zip(sums, _terms(kernel, x, y, away, more, derivatives), strict=True):
                    total += term
    total = sums[0] * kind(kernel.scale)
    inside = np.abs(total) < 1
    slopes = [np.where(inside, each * kind(kernel.scale), 0) for each in sums[1:]]
    value = np.clip(total, -1, 1)
    return (value, slopes[0], slopes[1]) if derivatives else (value, None, None)


def _low(h: Words, kind: Any) -> Array:
    """The lower half of a hash as a fraction of one."""
    return np.asarray(((h & np.uint32(0xFFFF)).astype(kind) + kind(0.5)) * kind(2.0**-16))


def _high(h: Words, kind: Any) -> Array:
    return np.asarray(((h >> np.uint32(16)).astype(kind) + kind(0.5)) * kind(2.0**-16))


def _terms(kernel: Kernel, x: Array, y: Array, away: list[Array], more: Words, derivatives: bool) -> list[Array]:
    """What one impulse adds to the sum, and to its derivatives along x and y."""
    kind = x.dtype.type
    _, _, stretch, cosine, sine, waves, spread = (kind(number) for number in kernel.numbers)
    u, v = x * cosine + y * sine, (y * cosine - x * sine) * stretch
    squared = u * u + v * v
    for each in away:
        squared = squared + each * each
    rest = np.maximum(1 - squared, 0)
    spot = rest * rest * rest
    found = [spot]
    if derivatives:
        fall = -6 * rest * rest
        found += [fall * (u * cosine - v * (stretch * sine)), fall * (u * sine + v * (stretch * cosine))]
    if not waves:
        return [np.where(more & np.uint32(1), -each, each) for each in found]
    turn = (2 * _high(more, kind) - 1) * spread * kind(np.pi)
    way_x, way_y = np.cos(turn) * cosine - np.sin(turn) * sine, np.sin(turn) * cosine + np.cos(turn) * sine
    phase = kind(np.pi) * np.remainder(2 * waves * (way_x * x + way_y * y) + 2 * _low(more, kind), 2)
    wave = np.cos(phase)
    if not derivatives:
        return [spot * wave]
    steep = spot * np.sin(phase) * (kind(-2 * np.pi) * waves)
    return [spot * wave, found[1] * wave + steep * way_x, found[2] * wave + steep * way_y]


def basis(kernel: Any, *, gabor: bool, band: Any) -> Basis[Any]:
    """The basis of the kernel that `kernel` makes of parameters."""

    def reached(p: Any) -> float:
        """Impulses that may lie around one place, over four standard deviations."""
        made: Kernel = kernel(p)
        return float(made.impulses * 3.0**p.dimensions * made.scale)

    def slope(p: Any) -> float:
        made: Kernel = kernel(p)
        return reached(p) * (1.72 * made.stretch + 2 * math.pi * made.waves)

    def rounding(p: Any) -> float:
        """Ways carry three roundings of up to 2, r^2 that and its own, stretched, and the window thrice that; a wave's
        phase that of the way, and four of the phase's size."""
        made: Kernel = kernel(p)
        return reached(p) * (60 * made.stretch + 60 * made.waves + 20 * (made.waves > 0)) + 4

    return Basis(
        lattice=lambda p: Lattice(band(p)),
        slices=slices,
        evaluate=lambda place, p, derivatives: evaluate(kernel(p), place, p.dimensions, derivatives),
        mean=lambda p: (0.0, NORMAL_MAGNITUDE),
        slope=slope,
        rounding=rounding,
        slope_rounding=lambda p: None,
        work=lambda p: p.impulses * 3.0**p.dimensions * (2.0 if gabor else 0.8),
        defines=lambda p: {"BASIS": 3, "GABOR": int(gabor)},
        numbers=lambda p: kernel(p).numbers,
    )
