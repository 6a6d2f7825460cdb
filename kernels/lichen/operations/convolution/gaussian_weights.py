"""The numbers behind a Gaussian blur: taps and how many are needed, modes and how many are needed.

The kernel is exp(-k^2 / 2 sigma^2) at integers k, normalised to sum to 1 over all of them. Over `size` reflecting
samples a pass with it has the cosine modes cos(pi m (x + 1/2) / size) as eigenvectors, and as eigenvalues the kernel's
spectrum at pi m / size: by Poisson's formula again Gaussians.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from functools import lru_cache
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from lichen.memory import Array, aligned

Vector = npt.NDArray[np.float64]
Modes = npt.NDArray[np.int_]
BARELY = 1e-17
"""Weight below which a tap changes nothing even in float64."""
NOTHING = 1e-150
"""px; of a narrower kernel all weight is in the middle, as it is of this one."""
WHOLLY = 1.5
"""px; of wider kernels the sum over all integers is the integral in every digit of float64, by Poisson's formula."""
SMOOTH = 8.0
"""px; in wider kernels weights change so little from one to the next that sums are nearly integrals."""
MOST_TAIL = 0.5
"""The largest that may be asked for."""
NORMAL = NormalDist()


def reach_of(sigma: float) -> int:
    """The first k whose weight no longer matters in float64."""
    return math.ceil(sigma * math.sqrt(-2 * math.log(BARELY))) + 1


@lru_cache(maxsize=64)
def half_kernel(sigma: float) -> Vector:
    """Weights of k = 0, 1, 2 ... until they no longer matter in float64, of the kernel that sums to 1."""
    weights = np.exp(-0.5 * np.square(np.arange(reach_of(sigma) + 1) / max(sigma, NOTHING)))
    total = 1 / middle(sigma) if sigma > WHOLLY else weights[0] + 2 * math.fsum(weights[1:])
    return np.asarray(weights / total)


def middle(sigma: float) -> float:
    """The weight of k = 0."""
    return 1 / (sigma * math.sqrt(2 * math.pi)) if sigma > WHOLLY else float(half_kernel(sigma)[0])


@lru_cache(maxsize=64)
def _outside(sigma: float) -> memoryview:
    """The weight at distances >= r, for r = n - 1, n - 2 ... 0, from as far as it matters; it rises. Not of an array,
    since planning looks for a number in it by the dozen."""
    return (2 * np.cumsum(half_kernel(sigma)[::-1])).data


@lru_cache(maxsize=1024)
def fir_radius(sigma: float, tail: float) -> tuple[int, float]:
    """The smallest radius that leaves at most `tail` of the weight outside, and the weight it leaves; of wide kernels
    by the integral from half a pixel further on, which is a little more where the Gaussian is convex, as it is beyond
    sigma."""
    if sigma > SMOOTH and tail < 0.25:
        radius = math.ceil(-NORMAL.inv_cdf(tail / 2) * sigma - 0.5)
        return radius, math.erfc((radius + 0.5) / (sigma * math.sqrt(2)))
    outside = _outside(sigma)
    last = len(outside) - 1
    radius = min(last - bisect_right(outside, tail, 0, last), last - 1)
    return radius, outside[last - radius - 1]


def fir_weights(sigma: float, tail: float) -> Vector:
    """2r + 1 weights that sum to 1."""
    radius, _ = fir_radius(sigma, tail)
    half = half_kernel(sigma)[: radius + 1]
    half = half / (half[0] + 2 * math.fsum(half[1:]))
    return np.concatenate([half[:0:-1], half])


def eigenvalues(sigma: float, size: int, modes: Modes) -> Vector:
    """Of the pass over `size` reflecting samples: each in (0, 1]."""
    angles = np.pi * modes / size
    if sigma < 0.75:
        half = half_kernel(sigma)
        direct: Vector = half[0] + 2 * np.cos(np.outer(angles, np.arange(1, len(half)))) @ half[1:]
        return direct
    spectrum: Vector = np.exp(-0.5 * np.square(sigma * angles))
    if sigma < 2:  # beyond, the aliases of Poisson's sum lie below 1e-8, where they meet modes as small as they
        aliases = np.array([-4, -2, 2, 4]) * np.pi
        spectrum += np.exp(-0.5 * np.square(sigma * (angles[:, np.newaxis] + aliases))).sum(axis=1)
        spectrum /= 1 + np.exp(-0.5 * np.square(sigma * aliases)).sum()
    return spectrum


@lru_cache(maxsize=64)
def _dropped(sigma: float, size: int, most: float) -> tuple[int, Vector]:
    """How many modes matter, and what the eigenvalues of the last n of them sum to, for n = 0, 1, 2 ... until it is
    more than `most`: a narrow Gaussian passes nearly all modes, and the others need not be looked at."""
    count = min(size, math.ceil(size / (math.pi * max(sigma, 0.1)) * math.sqrt(-2 * math.log(BARELY))) + 2)
    sums, more = np.zeros(1), 64
    while len(sums) <= count and sums[-1] <= most:
        last = count - len(sums)  # of those that are left
        found = eigenvalues(sigma, size, np.arange(last, max(last - more, -1), -1))
        sums = np.concatenate([sums, np.cumsum(np.append(sums[-1], found))[1:]])
        more *= 4
    return count, sums


@lru_cache(maxsize=1024)
def dct_modes(sigma: float, size: int, tail: float) -> tuple[int, float]:
    """How many modes are kept so that the eigenvalues of the others sum to at most `tail`, and that sum."""
    count, sums = _dropped(sigma, size, 1e-2 if tail <= 1e-2 else MOST_TAIL)
    dropped = min(int(sums.searchsorted(tail, "right")), count) - 1
    return count - dropped, float(sums[dropped])


def modes_about(sigma: float, size: int, tail: float) -> int:
    """About as many as `dct_modes` says, by the integral of a Gaussian instead of the sum of its eigenvalues: enough to
    tell how long they take."""
    width = size / (math.pi * max(sigma, 0.1))
    beyond = -NORMAL.inv_cdf(min(tail / (width * math.sqrt(2 * math.pi)), 0.5))
    return min(size, math.ceil(width * beyond) + 1)


@lru_cache(maxsize=16)
def dct_bases(sigma: float, size: int, tail: float) -> tuple[Array, Array]:
    """The forward (K, size) and the weighted inverse (size, K) matrix, float32; their product is the pass."""
    kept, _ = dct_modes(sigma, size, tail)
    modes = np.arange(kept)
    waves = np.cos(np.pi / size * np.outer(modes, np.arange(size) + 0.5))
    weights = eigenvalues(sigma, size, modes) * np.where(modes == 0, 1.0, 2.0)
    return aligned(waves / size, np.float32), aligned((waves * weights[:, None]).T, np.float32)
