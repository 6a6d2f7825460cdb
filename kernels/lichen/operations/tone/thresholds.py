"""Thresholds and weights of dithering.

* `bayer`: the recursive index matrix of Bayer (1973), M(2n) = [[4 M, 4 M + 2], [4 M + 3, 4 M + 1]].
* `blue_noise`: void and cluster (Ulichney 1993) on a 64 x 64 torus with a Gaussian of 1.5 pixels, from a fixed seed:
  a mask whose levels have no low frequencies. Made at first use, and the same everywhere: only sums of a fixed table
  in a fixed order decide it.
* `WEIGHTS`: error diffusion as what a pixel receives, (dx, dy) away: Floyd and Steinberg (1976), Jarvis, Judice and
  Ninke (1976), Stucki (1981), and Atkinson's, which passes on three quarters.

A rank r of n becomes the threshold (r + 1/2) / n, so that the mean over a mask is exactly 1/2.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from lichen.memory import Array

SIDE = 64
SPREAD = 1.5


def bayer(side: int) -> Array:
    """Thresholds of a matrix whose side is a power of two, float64."""
    ranks = np.zeros((1, 1))
    while len(ranks) < side:
        ranks = np.block([[4 * ranks, 4 * ranks + 2], [4 * ranks + 3, 4 * ranks + 1]])
    return np.asarray((ranks + 0.5) / side**2)


@cache
def blue_noise() -> Array:
    """Thresholds of the 64 x 64 mask, float64."""
    away = np.minimum(np.arange(SIDE), SIDE - np.arange(SIDE))
    bell = np.exp(-(away[:, None] ** 2 + away[None, :] ** 2) / (2 * SPREAD**2))
    twice = np.tile(bell, (2, 2))

    def energy(at: int) -> Array:
        y, x = divmod(at, SIDE)
        return twice[SIDE - y : 2 * SIDE - y, SIDE - x : 2 * SIDE - x].reshape(-1)

    start, field = _prototype(energy)
    ranks = np.zeros(SIDE * SIDE, int)
    # Down: take the tightest cluster away, rank by rank.
    pattern, left = start.copy(), field.copy()
    for rank in range(int(start.sum()) - 1, -1, -1):
        at = int(np.argmax(np.where(pattern, left, -np.inf)))
        pattern[at], ranks[at] = False, rank
        left -= energy(at)
    # Up: fill the largest void.
    pattern, left = start, field
    for rank in range(int(start.sum()), SIDE * SIDE):
        at = int(np.argmin(np.where(pattern, np.inf, left)))
        pattern[at], ranks[at] = True, rank
        left += energy(at)
    return (ranks.reshape(SIDE, SIDE) + 0.5) / SIDE**2


def _prototype(energy: Callable[[int], Array]) -> tuple[Array, Array]:
    """A tenth of the points, moved from clusters to voids until nothing moves; with the field of their bells."""
    count = SIDE * SIDE
    pattern = np.zeros(count, bool)
    pattern[np.random.default_rng(20260101).permutation(count)[: count // 10]] = True
    field = np.sum([energy(int(at)) for at in np.flatnonzero(pattern)], axis=0)
    for _ in range(count):
        tight = int(np.argmax(np.where(pattern, field, -np.inf)))
        pattern[tight] = False
        field = field - energy(tight)
        void = int(np.argmin(np.where(pattern, np.inf, field)))
        pattern[void] = True
        field = field + energy(void)
        if void == tight:
            break
    return pattern, field


def _weights(divisor: int, *taps: tuple[int, int, int]) -> Array:
    """Rows (dx, dy, weight) from what a pixel passes on to (dx, dy); negated, they are where it receives from."""
    return np.array([(-dx, -dy, weight / divisor) for dx, dy, weight in taps])


_RING = ((1, 0), (2, 0), (-2, 1), (-1, 1), (0, 1), (1, 1), (2, 1), (-2, 2), (-1, 2), (0, 2), (1, 2), (2, 2))

WEIGHTS = {
    "floyd_steinberg": _weights(16, (1, 0, 7), (-1, 1, 3), (0, 1, 5), (1, 1, 1)),
    "jarvis": _weights(48, *((*at, w) for at, w in zip(_RING, (7, 5, 3, 5, 7, 5, 3, 1, 3, 5, 3, 1), strict=True))),
    "stucki": _weights(42, *((*at, w) for at, w in zip(_RING, (8, 4, 2, 4, 8, 4, 2, 1, 2, 4, 2, 1), strict=True))),
    "atkinson": _weights(8, (1, 0, 1), (2, 0, 1), (-1, 1, 1), (0, 1, 1), (1, 1, 1), (0, 2, 1)),
}
REACH = 2
"""The farthest that any of them goes"""
