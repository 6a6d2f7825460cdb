"""Maps that are given by numbers, one for each pixel of the result."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lichen.memory import Array
from lichen.operations.warp.maps import Doubles, Map, Places, Recipe


@dataclass(frozen=True)
class Coordinate:
    """What a channel's value says of a coordinate: added + (value - bias) x factor + own x that of the pixel."""

    factor: float = 1.0
    added: float = 0.0
    bias: float = 0.0
    own: float = 0.0

    def of(self, given: Doubles, pixel: Doubles) -> Doubles:
        made: Doubles = self.added + (given - self.bias) * self.factor + self.own * pixel
        return made

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.added, self.bias, self.factor, self.own


class Sampled(Map):
    """Source coordinates for the pixels themselves, from the first two channels of a picture of numbers; NaN, for
    background, where one of them is not finite."""

    def __init__(self, given: Array, x: Coordinate, y: Coordinate) -> None:
        self.given, self.told = given, (x, y)

    def recipe(self) -> Recipe:
        x, y = self.told
        height, width, channels = self.given.shape
        return Recipe("warp/grids.cl", (channels, width, height, *x.numbers, *y.numbers), self.given, plain=True)

    @cached_property
    def both(self) -> tuple[Doubles, Doubles]:
        """x and y, float64 (height, width)."""
        given = self.given[..., :2].astype(np.float64)
        height, width, _ = given.shape
        v, u = np.mgrid[0:height, 0:width] + 0.5
        with np.errstate(invalid="ignore", over="ignore"):
            x, y = self.told[0].of(given[..., 0], u), self.told[1].of(given[..., 1], v)
        finite = np.isfinite(x) & np.isfinite(y)
        return np.where(finite, x, np.nan), np.where(finite, y, np.nan)

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        """At centres of pixels, of which it tells the one they lie in."""
        columns, rows = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        x, y = self.both
        return x[rows, columns], y[rows, columns]

    def places(self, u: Doubles, v: Doubles) -> Places:
        """Of neighbours in the whole picture, whatever part of it the pixels are."""
        x, y = self.at(u[np.newaxis, :], v[:, np.newaxis])
        rows, columns = slice(int(v[0]), int(v[-1]) + 1), slice(int(u[0]), int(u[-1]) + 1)
        low, high = max(rows.start - 1, 0), min(rows.stop + 1, self.given.shape[0])
        steps = []
        for axis in (1, 0):
            for whole in self.both:
                change = _slopes(whole[low:high], axis)
                steps.append(change[rows.start - low : rows.stop - low, columns])
        return Places(x, y, *steps)


def _slopes(values: Doubles, axis: int) -> Doubles:
    """Half the way from the neighbour before to the one after; the whole way to the only one there is; else nothing."""
    forward = np.diff(values, axis=axis)
    missing = np.full_like(np.take(values, [0], axis), np.nan)
    after = np.concatenate([forward, missing], axis=axis)
    before = np.concatenate([missing, forward], axis=axis)
    middle = (after + before) / 2
    made = np.where(np.isnan(middle), np.where(np.isnan(after), before, after), middle)
    slopes: Doubles = np.where(np.isnan(made), 0.0, made)
    return slopes
