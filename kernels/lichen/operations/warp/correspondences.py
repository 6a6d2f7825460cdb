"""The projective map that takes points to points.

The direct linear transformation: every pair gives two linear equations for the nine numbers of the matrix, whose
least-squares solution of length 1 is the singular vector of the least singular value. Points are first moved and scaled
to mean 0 and mean distance sqrt(2) on both sides, without which the equations differ by the fourth power of an image's
width. Four pairs, no three on a line, are met exactly; more are met in the least-squares sense of the equations.

The matrix has two signs. The one is taken that puts the points before the eye; where no sign puts them all there, they
are no picture of one plane.

Source: Hartley, In defense of the eight-point algorithm, IEEE PAMI 19, 1997; Hartley and Zisserman, Multiple View
Geometry, 2004, algorithm 4.2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lichen.operations.warp.maps import Doubles


class Fit(NamedTuple):
    """A matrix from input to output points."""

    matrix: Doubles
    determined: float
    """the least but one singular value of the equations over the largest: 0 where the points leave a choice"""
    ahead: bool
    """whether it sees all points on one side"""
    residual: float
    """the largest distance, px, between an output point and where its input point comes to lie"""


def _scaling(points: Doubles) -> Doubles:
    centre = points.mean(axis=0)
    distance = np.hypot(*(points - centre).T).mean()
    scale = np.sqrt(2) / distance if distance > 0 else 1.0
    return np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1.0]])


def fit(sources: npt.ArrayLike, targets: npt.ArrayLike) -> Fit:
    """From (n, 2) input points to as many output points, n >= 4."""
    src, dst = np.asarray(sources, np.float64), np.asarray(targets, np.float64)
    before, after = _scaling(src), _scaling(dst)
    x, y = (src @ before[:2, :2].T + before[:2, 2]).T
    u, v = (dst @ after[:2, :2].T + after[:2, 2]).T
    one, none = np.ones_like(x), np.zeros_like(x)
    rows = [
        np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], axis=-1),
        np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], axis=-1),
    ]
    _, values, vectors = np.linalg.svd(np.concatenate(rows))
    matrix = np.linalg.inv(after) @ vectors[8].reshape(3, 3) @ before
    w = src @ matrix[2, :2] + matrix[2, 2]
    matrix = matrix * (np.sign(w.sum()) or 1.0)
    w = src @ matrix[2, :2] + matrix[2, 2]
    if w.min() > 0:
        matrix = matrix / abs(matrix[2, 2]) if abs(matrix[2, 2]) > 1e-9 * np.abs(matrix).max() else matrix
        w = src @ matrix[2, :2] + matrix[2, 2]
    with np.errstate(all="ignore"):
        there = (src @ matrix[:2, :2].T + matrix[:2, 2]) / w[:, np.newaxis]
        residual = float(np.hypot(*(there - dst).T).max())
    return Fit(matrix, float(values[7] / values[0]), bool(w.min() > 0), residual)
