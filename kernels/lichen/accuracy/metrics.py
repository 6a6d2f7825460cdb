"""How far a result lies from truth, in numbers that cannot hide anything.

Differences are taken over all samples, borders included. Where either side is NaN or infinite there is no difference
to take: such samples are counted apart, as mismatches unless both sides hold the same. Colour of straight images
counts as it shows, multiplied by its coverage; under none it has no visible value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.image import Alpha
from lichen.memory import Array


@dataclass(frozen=True, slots=True)
class Difference:
    """Absolute differences in output units."""

    largest: float
    p999: float
    """exceeded by one sample in a thousand"""
    rms: float
    mismatched: int
    """samples that are non-finite on one side, or differently so on both"""


def difference(pixels: Array, truth: Array, alpha: Alpha = Alpha.NONE) -> Difference:
    """Compare two arrays of one shape (height, width, channels). `alpha` says what their last channel is.

    >>> import numpy as np
    >>> difference(np.ones((2, 2, 1)), np.zeros((2, 2, 1))).largest
    1.0
    """
    if pixels.shape != truth.shape:
        raise ValueError(f"shapes differ: {pixels.shape} and {truth.shape}")
    with np.errstate(all="ignore"):
        apart = np.abs(pixels.astype(np.float64) - truth)
        if alpha is Alpha.STRAIGHT:
            apart[..., :-1] *= np.abs(truth[..., -1:])
    finite = np.isfinite(pixels) & np.isfinite(truth)
    same = (pixels == truth) | (np.isnan(pixels) & np.isnan(truth))
    mismatched = int(np.count_nonzero(~finite & ~same))
    taken = apart[finite]
    if not taken.size:
        return Difference(0.0, 0.0, 0.0, mismatched)
    return Difference(
        float(taken.max()), float(np.quantile(taken, 0.999)), float(np.sqrt(np.mean(np.square(taken)))), mismatched
    )
