"""Pictures moved by their disparities: the NumPy bodies of stereo_view."""

from __future__ import annotations

import numpy as np

from lichen.memory import Array

GONE = -np.inf
"""The disparity of what nothing covers."""


def _between(a: Array, b: Array, t: Array) -> Array:
    """(1 - t) a + t b; at both ends, the one alone."""
    with np.errstate(invalid="ignore", over="ignore"):
        made: Array = np.where(t == 0, a, np.where(t == 1, b, (1 - t) * a + t * b))
    return made


def searched(pixels: Array, shift: Array, near: Array, reach: int, tear: float) -> tuple[Array, Array]:
    """The definition: the picture before its holes are filled, of the pixels' precision, and the disparities shown."""
    height, width, _ = pixels.shape
    rows, x = np.arange(height)[:, np.newaxis], np.arange(width)[np.newaxis, :]
    most, share = np.full((height, width), GONE), np.zeros((height, width))
    first, second = np.zeros((height, width), np.int64), np.zeros((height, width), np.int64)
    with np.errstate(invalid="ignore", divide="ignore"):
        for step in range(-reach, reach + 1):
            q = x + step
            left, right = np.clip(q, 0, width - 1), np.clip(q + 1, 0, width - 1)
            move, other = shift[rows, left], shift[rows, right]
            a, b = q + move, q + 1 + other
            here, there = near[rows, left], near[rows, right]
            one, two = (a <= x) & (x < a + 0.5), (b - 0.5 <= x) & (x < b)
            torn = np.abs(other - move) > tear
            covers = np.where(torn, one | two, (a <= x) & (x < b))
            t = np.where(torn, np.where(one & ~(two & (there > here)), 0.0, 1.0), (x - a) / (b - a))
            value = _between(here, there, t)
            better = covers & (value > most)
            most, share = np.where(better, value, most), np.where(better, t, share)
            first, second = np.where(better, left, first), np.where(better, right, second)
    t = share.astype(pixels.dtype)[..., np.newaxis]
    return _between(pixels[rows, first], pixels[rows, second], t), most


def filled(pixels: Array, near: Array, made: Array, seen: Array) -> Array:
    """Holes show the farther of what lies to their left and to their right; beyond a row's ends go on its first and its
    last pixel. Where neither has a disparity, NaN."""
    hole = seen == GONE
    height, width = seen.shape
    x = np.broadcast_to(np.arange(width), seen.shape)
    before = np.maximum.accumulate(np.where(hole, -1, x), axis=1)
    after = np.minimum.accumulate(np.where(hole, width, x)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height)[:, np.newaxis]
    inner_left, inner_right = np.maximum(before, 0), np.minimum(after, width - 1)
    left = np.where(before >= 0, seen[rows, inner_left], near[:, :1])
    right = np.where(after < width, seen[rows, inner_right], near[:, -1:])
    of_left = (left <= right) | np.isnan(right)
    inside = np.where(of_left, before >= 0, after < width)[..., np.newaxis]
    source = np.where(of_left, inner_left, inner_right)
    shown = np.where(inside, made[rows, source], pixels[rows, source])
    lost = (np.isnan(left) & np.isnan(right))[..., np.newaxis]
    return np.where(hole[..., np.newaxis], np.where(lost, made.dtype.type(np.nan), shown), made)


def iterated(pixels: Array, shift: Array, steps: int) -> Array:
    """Every pixel followed back, x <- column - shift(x), as often as there are steps; of the pixels' precision."""
    height, width, _ = pixels.shape
    rows = np.arange(height)[:, np.newaxis]
    columns = np.broadcast_to(np.arange(width, dtype=np.float64), (height, width))
    x = columns
    for step in range(steps + 1):
        at = np.clip(np.where(np.isnan(x), 0, x), 0, width - 1)
        left = at.astype(np.int64)
        right, t = np.minimum(left + 1, width - 1), at - left
        moved = _between(shift[rows, left], shift[rows, right], t)
        if step < steps:
            x = columns - moved
    made = _between(pixels[rows, left], pixels[rows, right], t.astype(pixels.dtype)[..., np.newaxis])
    return np.where(np.isnan(x)[..., np.newaxis], made.dtype.type(np.nan), made)
