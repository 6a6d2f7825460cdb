"""Matrices of projective maps: their inverse, their condition, and from which one nothing can be seen.

A matrix is judged with both images scaled to [-1, 1]: its condition number is then how much larger the most stretched
direction is than the least, whatever the units. 1e12 leaves four digits of a float64 coordinate; from there on a matrix
is refused as singular. A matrix and its negative are different here: of the plane of the image, they show what lies
before the eye and what lies behind it.
"""

from __future__ import annotations

import math

import numpy as np

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.operation import Facts, Inputs, OperationParameters
from lichen.operations.warp.maps import Doubles
from lichen.part import place_of

SINGULAR = 1e12


def output_to_input(matrix: Array, *, inverse: bool) -> Doubles:
    """The 3 x 3 matrix from output to input coordinates. An affine matrix stays one, bit for bit."""
    forward = np.asarray(matrix, np.float64)
    if inverse:
        return forward
    if forward[2, 0] == 0 and forward[2, 1] == 0:
        # Written out, so that whole shifts and turns have whole inverses.
        (a, b, c), (d, e, f) = forward[0] / forward[2, 2], forward[1] / forward[2, 2]
        determinant = a * e - b * d
        p, q, r, s = e / determinant, -b / determinant, -d / determinant, a / determinant
        inverted = np.array([[p, q, -(p * c + q * f)], [r, s, -(r * c + s * f)], [0, 0, 1.0]])
        return inverted if forward[2, 2] > 0 else -inverted
    return np.linalg.inv(forward)


def condition(matrix: Array, source: tuple[int, int], target: tuple[int, int]) -> float:
    """The condition number between images of these widths and heights; infinite for a singular matrix."""
    (w, h), (W, H) = source, target
    unit_in = np.array([[w / 2, 0, w / 2], [0, h / 2, h / 2], [0, 0, 1.0]])
    unit_out = np.array([[2 / W, 0, -1], [0, 2 / H, -1], [0, 0, 1.0]])
    with np.errstate(all="ignore"):
        scaled = unit_out @ np.asarray(matrix, np.float64) @ unit_in
        largest = np.abs(scaled).max()
        if not 0 < largest < math.inf:
            return math.inf
        values = np.linalg.svd(scaled / largest, compute_uv=False)
    return math.inf if values[-1] == 0 else float(values[0] / values[-1])


def condition_flaws(
    matrix: Array, image: Facts, target: tuple[int, int], inverse: bool, name: str = "matrix"
) -> list[Flaw]:
    source = (image.width, image.height)
    number = condition(matrix, *((target, source) if inverse else (source, target)))
    if number < SINGULAR:
        return []
    return [Flaw(f"/parameters/{name}", f"is singular, or nearly so (condition number {number:.3g})")]


Sizes = tuple[tuple[int, int], tuple[int, int]]


def sizes(p: OperationParameters, inputs: Inputs, pixels: Array) -> Sizes:
    """Width and height of the source and of the result, in whole where only parts of them are there."""
    place, image = place_of(p), inputs["image"]
    if place is not None:
        return place.source_size, place.result_size
    return (image.width, image.height), (pixels.shape[1], pixels.shape[0])


def report(matrix: Array, between: Sizes, inverse: bool) -> dict[str, object]:
    """Findings: the condition number between images of these sizes, and the matrix both ways."""
    backward = output_to_input(matrix, inverse=inverse)
    forward = matrix if not inverse else np.linalg.inv(matrix)
    return {
        "condition": condition(matrix, *(between[::-1] if inverse else between)),
        "input_to_output": np.asarray(forward).tolist(),
        "output_to_input": backward.tolist(),
    }


def unmoved(matrix: Array, size: tuple[int, int], image: Facts) -> str | None:
    """The reason why nothing moves, or None."""
    same = np.array_equal(matrix / matrix[2, 2], np.eye(3)) and matrix[2, 2] > 0 if matrix[2, 2] else False
    return "every pixel stays where it is" if same and size == (image.width, image.height) else None
