"""Where the pixels of a warp's result come from: maps from output to source coordinates, and their footprints.

Coordinates are in pixels, y down, the centre of pixel (column, row) at (column + 0.5, row + 0.5), and float64 on every
road: at 16384 pixels a float32 coordinate would be a thousandth of a pixel off. NaN is the mark of background: places
that no part of the source is seen from.

The footprint of an output pixel is the parallelogram that the map's derivative makes of it. A map that knows its
derivative gives it; of any other, it is taken from side to side of the pixel: what the source position changes by
between the middles of opposite sides. Where a side is background, the half that is not counts double.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lichen.memory import Array
from lichen.part import Place

Doubles = Array
"""Of float64."""


class Places(NamedTuple):
    """Source coordinates, and what they change by along one pixel of the output: (dx/du, dy/du), (dx/dv, dy/dv).

    All of one shape, float64."""

    x: Doubles
    y: Doubles
    xu: Doubles
    yu: Doubles
    xv: Doubles
    yv: Doubles

    def take(self, which: Array) -> Places:
        return Places(*(each[which] for each in self))


@dataclass(frozen=True, eq=False)
class Recipe:
    """How a device finds the places of a map: the kernel `places` of a source (see look.clh)."""

    source: str
    numbers: Sequence[float] | Doubles
    """what the kernel's `p` holds behind the periods"""
    given: Array | None = field(default=None)
    """a picture that it reads, float32"""
    plain: bool = False
    """whether the filters that take no footprint read that picture themselves, as given.clh says"""


class Rays(NamedTuple):
    """Places on rays from a middle: x = middle + radius * cosine, y = middle + radius * sine."""

    middle: tuple[float, float]
    cosine: Doubles
    """by column"""
    sine: Doubles
    radius: Doubles
    """by row"""


class Map:
    """From output coordinates to source coordinates."""

    periods: tuple[float, float] = (math.inf, math.inf)
    """of the source coordinates x and y: how far two numbers of one and the same place lie apart"""

    def recipe(self) -> Recipe | None:
        """How a device finds its places, or None where the host does."""
        return None

    def rays(self, u: Doubles, v: Doubles) -> Rays | None:
        """The places of columns `u` and rows `v` where columns are rays and rows are circles, else None."""
        return None

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        """x and y for output coordinates that broadcast against one another; NaN for background."""
        raise NotImplementedError

    def places(self, u: Doubles, v: Doubles) -> Places:
        """x, y and the footprint of the pixels centred at columns `u` and rows `v`, both one-dimensional, spaced 1."""
        u, v = u[np.newaxis, :], v[:, np.newaxis]
        shape = (v.shape[0], u.shape[1])
        x, y = (np.broadcast_to(each, shape) for each in self.at(u, v))
        sides = np.concatenate([u - 0.5, u[:, -1:] + 0.5], axis=1)
        across = [np.broadcast_to(each, (shape[0], shape[1] + 1)) for each in self.at(sides, v)]
        ends = np.concatenate([v - 0.5, v[-1:] + 0.5], axis=0)
        down = [np.broadcast_to(each, (shape[0] + 1, shape[1])) for each in self.at(u, ends)]
        px, py = self.periods
        xu, yu = _change(across[0], x, 1, px), _change(across[1], y, 1, py)
        xv, yv = _change(down[0], x, 0, px), _change(down[1], y, 0, py)
        return Places(np.array(x, np.float64), np.array(y, np.float64), xu, yu, xv, yv)


def _change(sides: Doubles, middle: Doubles, axis: int, period: float) -> Doubles:
    """From side to side; twice the half that there is, or nothing where both sides are background."""
    first, second = (sides[:, :-1], sides[:, 1:]) if axis else (sides[:-1], sides[1:])
    with np.errstate(invalid="ignore"):
        whole = folded_difference(second - first, period)
        before = 2 * folded_difference(middle - first, period)
        after = 2 * folded_difference(second - middle, period)
    made = np.where(np.isnan(whole), np.where(np.isnan(before), after, before), whole)
    return np.where(np.isnan(made), 0.0, made)


def folded_difference(difference: Doubles, period: float) -> Doubles:
    """The shortest way between two places on a circle."""
    return difference if math.isinf(period) else difference - period * np.rint(difference / period)


@dataclass(frozen=True)
class Projective(Map):
    """x = (a u + b v + c) / w, y = (d u + e v + f) / w, w = g u + h v + i. Where w <= 0 lies what is behind the plane
    at infinity: background, never a mirrored image."""

    matrix: tuple[float, ...]
    """the nine numbers a to i, row by row"""

    @classmethod
    def of(cls, matrix: npt.ArrayLike) -> Projective:
        return cls(tuple(float(each) for each in np.asarray(matrix, np.float64).reshape(9)))

    @property
    def array(self) -> Doubles:
        return np.array(self.matrix).reshape(3, 3)

    @property
    def affine(self) -> bool:
        return self.matrix[6] == 0 and self.matrix[7] == 0

    def largest(self) -> float | None:
        """The larger singular value of the footprint where it is one everywhere, else None: as ellipses have it."""
        w = self.matrix[8]
        if not self.affine or not w > 0:
            return None
        xu, xv, yu, yv = (self.matrix[at] / w for at in (0, 1, 3, 4))
        both, half = xu * xu + xv * xv + (yu * yu + yv * yv), ((xu - yu) * (xu + yu) + (xv - yv) * (xv + yv)) / 2
        return math.sqrt(both / 2 + math.hypot(half, xu * yu + xv * yv))

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        a, b, c, d, e, f, g, h, i = self.matrix
        w = self._ahead(g * u + h * v + i)
        return (a * u + b * v + c) / w, (d * u + e * v + f) / w

    @staticmethod
    def _ahead(w: Doubles) -> Doubles:
        return np.where(w > 0, w, np.nan)

    def places(self, u: Doubles, v: Doubles) -> Places:
        a, b, c, d, e, f, g, h, i = self.matrix
        u, v = np.broadcast_arrays(u[np.newaxis, :], v[:, np.newaxis])
        with np.errstate(all="ignore"):
            w = self._ahead(g * u + h * v + i)
            x, y = (a * u + b * v + c) / w, (d * u + e * v + f) / w
            return Places(x, y, (a - x * g) / w, (d - y * g) / w, (b - x * h) / w, (e - y * h) / w)


@dataclass(frozen=True)
class Windowed(Map):
    """Another map's places for a part of the result, told from the corner of a part of the source.

    Whole numbers are added before and subtracted after, so that a place inside the source has the bits that it has in
    the whole, less the corner."""

    of: Map
    result: tuple[int, int]
    """left and top of the part of the result"""
    source: tuple[int, int]
    """left and top of the part of the source"""

    @classmethod
    def by(cls, of: Map, place: Place | None) -> Map:
        return of if place is None else cls(of, place.result[:2], place.source[:2])

    def __post_init__(self) -> None:
        object.__setattr__(self, "periods", self.of.periods)

    def recipe(self) -> Recipe | None:
        """That of the whole, which the device begins at the corner; places are told from the source's first pixel."""
        return None if any(self.source) else self.of.recipe()

    def rays(self, u: Doubles, v: Doubles) -> Rays | None:
        """Those of the whole, told from the source's first pixel."""
        return None if any(self.source) else self.of.rays(u + self.result[0], v + self.result[1])

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        x, y = self.of.at(u + self.result[0], v + self.result[1])
        return x - self.source[0], y - self.source[1]

    def places(self, u: Doubles, v: Doubles) -> Places:
        at = self.of.places(u + self.result[0], v + self.result[1])
        return at._replace(x=at.x - self.source[0], y=at.y - self.source[1])
