"""Maps that are given by numbers, one for each pixel of the result."""

from __future__ import annotations

import numpy as np

from lichen.operations.warp.maps import Doubles, Map, Places


class Sampled(Map):
    """Source coordinates for the pixels themselves, float64 (height, width) each; NaN for background."""

    def __init__(self, x: Doubles, y: Doubles) -> None:
        finite = np.isfinite(x) & np.isfinite(y)
        self.x, self.y = np.where(finite, x, np.nan), np.where(finite, y, np.nan)

    def at(self, u: Doubles, v: Doubles) -> tuple[Doubles, Doubles]:
        """At centres of pixels, of which it tells the one they lie in."""
        columns, rows = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        return self.x[rows, columns], self.y[rows, columns]

    def places(self, u: Doubles, v: Doubles) -> Places:
        x, y = self.at(u[np.newaxis, :], v[:, np.newaxis])
        first, end = int(v[0]), int(v[-1]) + 1
        low, high = max(first - 1, 0), min(end + 1, self.x.shape[0])
        steps = []
        for axis in (1, 0):
            for whole in (self.x, self.y):
                change = _slopes(whole[low:high], axis)
                steps.append(change[first - low : end - low])
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
