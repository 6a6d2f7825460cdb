"""From measured times to a rate: seconds = start + step x work.

Times span five decades, and what a caller notices is a factor, not a difference: so logarithms of prediction over
measurement are made small. Times on a shared machine have a long tail upwards, which squares would follow: so
their absolute values are, by least squares whose weights are renewed until they have settled. Neither number becomes
negative.

Runs of little work, or all of the same, do not tell what a step takes. There the rate as it is declared helps, which is
of some other machine: scaled by what the runs took, it counts as one more sample, of far more work than any of them.
Where the runs do tell, a single sample changes little.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lichen.operation import Rate

ROUNDS = 30
FAR = 16.0
"""Times the most work of a sample, at which a declared rate is heard."""
INFINITELY_FAST = 1e-16
"""Seconds per step, less than any machine takes; a rate of 0 would make every amount of work equally dear."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Steps of work and the seconds they took."""

    work: float
    seconds: float


def fit(samples: Sequence[Sample], declared: Rate | None = None) -> Rate:
    """The rate that predicts the samples best. At least one is needed.

    >>> rate = fit([Sample(n, 1e-4 + 2e-9 * n) for n in (1e3, 1e5, 1e7)])
    >>> f"{rate.start:.2g} {rate.step:.2g}"
    '0.0001 2e-09'
    >>> rate = fit([Sample(1e3, 4e-3), Sample(1e3, 4e-3)], Rate(1e-3, 1e-6))
    >>> f"{rate.start:.2g} {rate.step:.2g}"
    '0.002 2e-06'
    """
    if declared is not None:
        samples = [*samples, _far(samples, declared)]
    work, seconds = np.array([(sample.work, sample.seconds) for sample in samples], dtype=np.float64).T
    seconds = np.maximum(seconds, 1e-9)
    weights = 1 / seconds
    start, step = 0.0, 0.0
    for _ in range(ROUNDS):
        start, step = _squares(work, seconds, weights)
        predicted = np.maximum(start + step * work, 1e-12)
        apart = np.abs(np.log(predicted / seconds))
        # Least squares of differences, weighted so that near the solution they are those of logarithms.
        weights = 1 / np.sqrt(seconds * predicted) / np.sqrt(np.maximum(apart, 0.03))
    return Rate(start, max(step, INFINITELY_FAST))


def _far(samples: Sequence[Sample], declared: Rate) -> Sample:
    """What the declared rate says of far more work, on a machine that is as much quicker as the longer runs were."""
    longest = sorted(samples, key=lambda sample: sample.work)[len(samples) // 2 :]
    scale = float(np.median([each.seconds / (declared.start + declared.step * each.work) for each in longest]))
    work = FAR * max(longest[-1].work, 1.0)
    return Sample(work, scale * (declared.start + declared.step * work))


def apart(rate: Rate, samples: Sequence[Sample]) -> float:
    """The factor by which a sample lies from the prediction, in the median."""
    logs = [math.log((rate.start + rate.step * sample.work) / sample.seconds) for sample in samples]
    return math.exp(statistics.median(map(abs, logs)))


def misses(rate: Rate, samples: Sequence[Sample], factor: float = 1.5) -> int:
    """How many samples lie further than `factor` from the prediction."""
    ratios = [(rate.start + rate.step * sample.work) / sample.seconds for sample in samples]
    return sum(not 1 / factor <= ratio <= factor for ratio in ratios)


def _squares(work: np.ndarray, seconds: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """The weighted least squares solution with neither number below 0: of the normal equations, in which weights have
    made all samples about 1."""
    scale = max(float(work.max()), 1.0)
    ones, steps, wanted = weights, weights * work / scale, weights * seconds
    a, b, c = float(ones @ ones), float(ones @ steps), float(steps @ steps)
    p, q = float(ones @ wanted), float(steps @ wanted)
    apart = a * c - b * b
    if apart > 1e-12 * a * c:
        start, step = (c * p - b * q) / apart, (a * q - b * p) / apart
        if start >= 0 and step >= 0:
            return start, step / scale
    alone = max(p / a, 0.0), max(q / max(c, 1e-300), 0.0)
    left = [float(np.square(wanted - each * x).sum()) for each, x in zip((ones, steps), alone, strict=True)]
    return (alone[0], 0.0) if left[0] <= left[1] else (0.0, alone[1] / scale)
