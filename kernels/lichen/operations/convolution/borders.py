"""How images continue beyond their edges, as index arithmetic shared by the family."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lichen.operation import Border

OUTSIDE = -1
"""The index that stands for the constant beyond a constant border."""


def continued(indices: npt.ArrayLike, size: int, border: Border) -> npt.NDArray[np.int64]:
    """Which of `size` samples each index reads, however far outside it lies; OUTSIDE for the constant.

    >>> continued([-2, -1, 0, 3, 4], 4, Border.REFLECT).tolist()
    [1, 0, 0, 3, 3]
    >>> continued([-2, -1, 0, 3, 4], 4, Border.REFLECT101).tolist()
    [2, 1, 0, 3, 2]
    """
    at = np.asarray(indices, dtype=np.int64)
    if border is Border.CONSTANT:
        return np.where((at >= 0) & (at < size), at, OUTSIDE)
    if border is Border.CLAMP:
        return np.clip(at, 0, size - 1)
    if border is Border.WRAP:
        return at % size
    if border is Border.REFLECT:
        at = at % (2 * size)
        return np.where(at < size, at, 2 * size - 1 - at)
    if size == 1:
        return np.zeros_like(at)
    at = at % (2 * size - 2)
    return np.where(at < size, at, 2 * size - 2 - at)
