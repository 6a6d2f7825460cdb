"""Means of a picture along straight paths, one for every pixel: the NumPy bodies of motion_blur.

A path is x(t) = u - a t, y(t) = v - b t for t from `first` to `last`, (u, v) the pixel's centre. Between pixels the
picture is bilinear, so along a path it is a quadratic between two crossings of the lines through pixel centres, and
Simpson's rule has no error there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operation import Border
from lichen.operations.convolution.borders import continued

CHUNK = 1 << 18
"""Crossings that are held at once."""


@dataclass(frozen=True)
class Picture:
    """Pixels with what lies beyond their edges."""

    pixels: Array
    border: Border
    value: float

    def taps(self, row: Array, column: Array) -> Array:
        height, width, _ = self.pixels.shape
        r, c = continued(row, height, self.border), continued(column, width, self.border)
        inside = (r >= 0) & (c >= 0)
        return np.where(inside[..., np.newaxis], self.pixels[r, c], self.pixels.dtype.type(self.value))


def shortened(motion: Array, largest: float) -> Array:
    """Vectors no longer than `largest`, float64; NaN where a component is not finite."""
    given = np.where(np.isfinite(motion).all(axis=-1, keepdims=True), motion.astype(np.float64), np.nan)
    x, y = given[..., 0], given[..., 1]
    length = np.sqrt(x * x + y * y)
    factor = np.where(length > largest, largest / np.where(length > largest, length, 1.0), 1.0)
    return given * factor[..., np.newaxis]


def _bands(height: int, width: int, each: int) -> Iterator[slice]:
    rows = max(1, CHUNK // (width * each))
    for top in range(0, height, rows):
        yield slice(top, min(top + rows, height))


def _add(total: Array, weight: Array, value: Array) -> None:
    """What has no weight takes no part."""
    w = weight[..., np.newaxis]
    total += np.where(w == 0, 0, w * value)


def along(picture: Picture, motion: Array, first: float, last: float) -> Array:
    """The exact means; `motion` as `shortened` gives it. Of the pixels' precision, places in float64."""
    height, width, channels = picture.pixels.shape
    out = np.empty((height, width, channels), picture.pixels.dtype)
    finite = np.where(np.isnan(motion), 0.0, motion)
    crossings = [int(np.ceil(np.abs(finite[..., axis]).max(initial=0.0) * (last - first))) + 1 for axis in (0, 1)]
    columns, rows = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    for band in _bands(height, width, sum(crossings) + 2):
        a, b = finite[band, :, 0], finite[band, :, 1]
        u, v = np.broadcast_arrays(columns[np.newaxis, :], rows[band, np.newaxis])
        t = [np.full((*a.shape, 1), first), np.full((*a.shape, 1), last)]
        for at, step, count in ((u, a, crossings[0]), (v, b, crossings[1])):
            ends = np.stack([at - step * first, at - step * last])
            line = np.ceil(ends.min(axis=0))[..., np.newaxis] + np.arange(count)
            safe = np.where(step == 0, 1.0, step)[..., np.newaxis]
            with np.errstate(over="ignore"):
                when = np.where(step[..., np.newaxis] == 0, last, (at[..., np.newaxis] - line) / safe)
            t.append(np.clip(when, first, last))
        times = np.sort(np.concatenate(t, axis=-1), axis=-1)
        total = np.zeros((*a.shape, channels))
        for number in range(times.shape[-1] - 1):
            start, end = times[..., number], times[..., number + 1]
            if (end > start).any():
                _segment(total, picture, u, v, a, b, start, end, first, last)
        lost = np.isnan(motion[band]).any(axis=-1, keepdims=True)
        out[band] = np.where(lost, np.nan, total)
    return out


def _segment(
    total: Array, picture: Picture, u: Array, v: Array, a: Array, b: Array, start: Array, end: Array, first: float,
    last: float,
) -> None:  # fmt: skip
    """Adds the part between two neighbouring crossings: Simpson's rule on the weights of the four pixels around."""
    middle = (start + end) / 2
    left, top = np.floor(u - a * middle), np.floor(v - b * middle)
    weights = np.zeros((4, *u.shape))
    for when, share in ((start, 1 / 6), (middle, 4 / 6), (end, 1 / 6)):
        x, y = np.clip(u - a * when - left, 0, 1), np.clip(v - b * when - top, 0, 1)
        weights += share * np.stack([(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x])
    weights *= (end - start) / (last - first)
    column, row = left.astype(np.int64), top.astype(np.int64)
    for corner, (dy, dx) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        _add(total, weights[corner], picture.taps(row + dy, column + dx))


def sampled(picture: Picture, motion: Array, first: float, last: float, samples: int) -> Array:
    """The mean of `samples` bilinear values, in the middles of as many equal parts of the path."""
    height, width, channels = picture.pixels.shape
    out = np.empty((height, width, channels), picture.pixels.dtype)
    columns, rows = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    for band in _bands(height, width, 4):
        moved = np.where(np.isnan(motion[band]), 0.0, motion[band])
        total = np.zeros((*moved.shape[:2], channels), picture.pixels.dtype)
        for number in range(samples):
            t = first + (last - first) * (number + 0.5) / samples
            x, y = columns - moved[..., 0] * t, rows[band, np.newaxis] - moved[..., 1] * t
            total += bilinear(picture, x, y)
        total /= picture.pixels.dtype.type(samples)
        out[band] = np.where(np.isnan(motion[band]).any(axis=-1, keepdims=True), np.nan, total)
    return out


def bilinear(picture: Picture, x: Array, y: Array) -> Array:
    """Values at places counted from the first pixel's centre."""
    left, top = np.floor(x), np.floor(y)
    fx, fy = (x - left).astype(picture.pixels.dtype), (y - top).astype(picture.pixels.dtype)
    column, row = left.astype(np.int64), top.astype(np.int64)
    total = np.zeros((*x.shape, picture.pixels.shape[2]), picture.pixels.dtype)
    for dy, dx, weight in ((0, 0, (1 - fy) * (1 - fx)), (0, 1, (1 - fy) * fx), (1, 0, fy * (1 - fx)), (1, 1, fy * fx)):
        _add(total, weight, picture.taps(row + dy, column + dx))
    return total
