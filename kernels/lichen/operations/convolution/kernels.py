"""Kernels by name, and how a kernel is taken apart into sums of separable ones.

The fixed masks are those of McReynolds and Blythe, Advanced Graphics Programming Techniques Using OpenGL (1998),
section 12.3.5, with the sums they need: what smooths sums to 1, what finds edges to 0, what sharpens to 1 (the printed
5 x 5 high-pass sums to -7; its centre here makes up for that). They are written as correlation masks: element (i, j)
weighs the pixel i rows down and j columns to the right of the mask's corner.

A disc weighs each pixel by the area of it that the disc covers, exactly: the aperture of a lens out of focus. A line
is the path of a moving camera, 64 points to a pixel, each shared bilinearly by the four pixels around it.
"""

from __future__ import annotations

import math
from enum import StrEnum
from functools import lru_cache

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]


class Named(StrEnum):
    """A kernel by name."""

    BOX = "box"
    """equal weights, `size` x `size`"""
    SMOOTH = "smooth"
    """binomial weights, `size` x `size`; 3 gives 1 2 1"""
    HIGHPASS = "highpass"
    """3 x 3, centre 9, the others -1"""
    HIGHPASS5 = "highpass5"
    """5 x 5 with rings of both signs"""
    SHARPEN = "sharpen"
    """the image minus its four-neighbour Laplacian"""
    LAPLACIAN = "laplacian"
    """3 x 3, four neighbours, centre 4"""
    LAPLACIAN5 = "laplacian5"
    """5 x 5, centre 24, the others -1"""
    SOBEL_X = "sobel_x"
    SOBEL_Y = "sobel_y"
    COMPASS_N = "compass_n"
    """the gradient mask of a direction; the others turn its rim by an eighth at a time"""
    COMPASS_NE = "compass_ne"
    COMPASS_E = "compass_e"
    COMPASS_SE = "compass_se"
    COMPASS_S = "compass_s"
    COMPASS_SW = "compass_sw"
    COMPASS_W = "compass_w"
    COMPASS_NW = "compass_nw"
    LINES_HORIZONTAL = "lines_horizontal"
    LINES_VERTICAL = "lines_vertical"
    LINES_FALLING = "lines_falling"
    LINES_RISING = "lines_rising"
    EMBOSS = "emboss"
    """light from the upper left over the image itself; sums to 1"""
    DISC = "disc"
    """a disc of `radius`"""
    LINE = "line"
    """a segment of `length` at `angle`"""


_RIM = ((0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0))
"""Places of a 3 x 3 mask around its middle, clockwise from the upper left."""


def turned(mask: Matrix, eighths: int) -> Matrix:
    """A 3 x 3 mask with its rim turned clockwise, so many eighths."""
    made = mask.copy()
    for place, target in enumerate(_RIM):
        made[target] = mask[_RIM[(place - eighths) % 8]]
    return made


_FIXED = {
    Named.HIGHPASS: [[-1, -1, -1], [-1, 9, -1], [-1, -1, -1]],
    Named.HIGHPASS5: [
        [0, -1, -1, -1, 0],
        [-1, 2, -4, 2, -1],
        [-1, -4, 21, -4, -1],
        [-1, 2, -4, 2, -1],
        [0, -1, -1, -1, 0],
    ],
    Named.SHARPEN: [[0, -1, 0], [-1, 5, -1], [0, -1, 0]],
    Named.LAPLACIAN: [[0, -1, 0], [-1, 4, -1], [0, -1, 0]],
    Named.LAPLACIAN5: [[24 if i == j == 2 else -1 for j in range(5)] for i in range(5)],
    Named.SOBEL_X: [[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]],
    Named.SOBEL_Y: [[-1, -2, -1], [0, 0, 0], [1, 2, 1]],
    Named.LINES_HORIZONTAL: [[-1, -1, -1], [2, 2, 2], [-1, -1, -1]],
    Named.LINES_VERTICAL: [[-1, 2, -1], [-1, 2, -1], [-1, 2, -1]],
    Named.LINES_FALLING: [[2, -1, -1], [-1, 2, -1], [-1, -1, 2]],
    Named.LINES_RISING: [[-1, -1, 2], [-1, 2, -1], [2, -1, -1]],
    Named.EMBOSS: [[-2, -1, 0], [-1, 1, 1], [0, 1, 2]],
}


_COMPASS = tuple(each for each in Named if each.startswith("compass_"))


def named(name: Named, size: int, radius: float, length: float, angle: float) -> Matrix:
    """The mask of that name, as correlation reads it."""
    if name in _FIXED:
        return np.array(_FIXED[name], np.float64)
    if name in _COMPASS:
        return turned(np.array(_FIXED[Named.SOBEL_Y], np.float64), _COMPASS.index(name))
    if name is Named.BOX:
        return np.full((size, size), 1 / size**2)
    if name is Named.SMOOTH:
        line = np.array([math.comb(size - 1, k) for k in range(size)], np.float64) / 2.0 ** (size - 1)
        return np.outer(line, line)
    return disc(radius) if name is Named.DISC else line_segment(length, angle)


@lru_cache(maxsize=64)
def disc(radius: float) -> Matrix:
    """Weights of a disc centred on the middle pixel: covered areas, normalised to sum to 1."""
    reach = max(math.ceil(radius - 0.5), 0)
    if reach == 0:  # all of it in one pixel, whose area may be too small for a number
        return np.ones((1, 1))
    edges: Matrix = np.arange(-reach, reach + 2, dtype=np.float64) - 0.5
    corner = _covered(edges[None, :], edges[:, None], radius)
    areas = np.maximum(np.diff(np.diff(corner, axis=0), axis=1), 0.0)
    areas[areas < 1e-12 * areas.max()] = 0.0  # what cancellation leaves where nothing is covered
    weights: Matrix = areas / areas.sum()
    return weights


def _covered(x: Matrix, y: Matrix, radius: float) -> Matrix:
    """Area of the disc around the origin that lies left of x and above y.

    It is the integral over u <= x of the chord's length below min(y, s), with s(u) the half chord.
    """
    x, height = np.clip(x, -radius, radius), np.clip(y, -radius, radius)

    def half(u: Matrix) -> Matrix:
        """Integral of s from 0 to u."""
        inside = np.sqrt(np.maximum(radius**2 - u * u, 0.0))
        area: Matrix = (u * inside + radius**2 * np.arcsin(np.clip(u / radius, -1, 1))) / 2
        return area

    h = np.abs(height)
    flat = np.sqrt(np.maximum(radius**2 - h * h, 0.0))  # |u| below this: the chord reaches beyond h
    middle = np.clip(x, -flat, flat)
    start = np.full_like(x, -radius)
    capped = half(np.minimum(x, -flat)) - half(start) + h * (middle + flat) + half(np.maximum(x, flat)) - half(flat)
    area: Matrix = half(x) - half(start) + np.sign(height) * capped
    return area


@lru_cache(maxsize=64)
def line_segment(length: float, angle: float) -> Matrix:
    """Weights of a segment centred on the middle pixel, `angle` degrees from +x towards +y, summing to 1."""
    count = max(math.ceil(64 * length), 1)
    along = ((np.arange(count) + 0.5) / count - 0.5) * length
    x, y = along * math.cos(math.radians(angle)), along * math.sin(math.radians(angle))
    reach = math.ceil(max(np.abs(x).max(), np.abs(y).max())) + 1
    weights = np.zeros((2 * reach + 1, 2 * reach + 1))
    left, top = np.floor(x), np.floor(y)
    for i in (0, 1):
        for j in (0, 1):
            share = (1 - np.abs(x - left - j)) * (1 - np.abs(y - top - i))
            np.add.at(weights, ((top + i + reach).astype(int), (left + j + reach).astype(int)), share / count)
    weights[weights < 1e-12 * weights.max()] = 0.0
    rows, columns = np.flatnonzero(weights.any(1)), np.flatnonzero(weights.any(0))
    tall, wide = (max(reach - at[0], at[-1] - reach) for at in (rows, columns))
    kept = weights[reach - tall : reach + tall + 1, reach - wide : reach + wide + 1]
    normalised: Matrix = kept / kept.sum()
    return normalised


def separated(taps: Matrix, tolerance: float) -> tuple[list[tuple[Matrix, Matrix]], Matrix]:
    """The fewest products of a column and a row that sum to `taps` but for `tolerance` of its l1 norm; what is left.

    The singular value decomposition is best in the l2 norm; what it leaves is measured in the l1 norm all the same.
    Asked for twice before anything is computed, for the error and for the work, answers are kept: none may be changed.
    """
    return _separated(taps.tobytes(), taps.shape, tolerance)


@lru_cache(64)
def _separated(taps: bytes, shape: tuple[int, int], tolerance: float) -> tuple[list[tuple[Matrix, Matrix]], Matrix]:
    columns, rows, without = _unfolded(taps, shape)
    whole: Matrix = np.frombuffer(taps).reshape(shape)
    allowed = tolerance * float(np.abs(whole).sum())
    # What is left measures no less in the l1 norm than in the l2 norm, which is known of every number of products.
    count = len(without) - int(without[::-1].searchsorted(allowed * (1 + 1e-9), "right"))
    left: Matrix = whole - columns[:count].T @ rows[:count]
    while count < len(columns) and np.abs(left).sum() > allowed:
        left, count = whole - columns[: count + 1].T @ rows[: count + 1], count + 1
    return [(column[:, None], row[None, :]) for column, row in zip(columns[:count], rows[:count], strict=True)], left


@lru_cache(16)
def _unfolded(taps: bytes, shape: tuple[int, int]) -> tuple[Matrix, Matrix, npt.NDArray[np.float64]]:
    """The columns and rows of all products, and the l2 norm of what the first 0, 1, 2 ... leave."""
    down, values, across = np.linalg.svd(np.frombuffer(taps).reshape(shape), full_matrices=False)
    values = values[: int(np.count_nonzero(values > 1e-14 * values[0]))]
    count, scales = len(values), np.sqrt(values)[:, None]
    without = np.sqrt(np.cumsum(np.append(0.0, np.square(values[::-1]))))[::-1]
    return _cleaned(down[:, :count].T * scales), _cleaned(across[:count] * scales), without


def _cleaned(vectors: Matrix) -> Matrix:
    """Each row without what the decomposition leaves where there is a zero."""
    sizes = np.abs(vectors)
    cleaned: Matrix = np.where(sizes < 1e-14 * sizes.max(axis=1, keepdims=True), 0.0, vectors)
    return cleaned
