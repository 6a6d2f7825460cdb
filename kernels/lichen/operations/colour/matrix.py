"""Matrix: every pixel's channels mixed by a matrix.

Truth: with x the first channels of a pixel, y = M x + b. A 3x3 or 3x4 matrix acts on the first three channels, a 4x4 or
4x5 matrix on the first four, coverage being one of them like the others; the last column of 3x4 and 4x5 is b. What
follows these channels passes unchanged.

Colours mix in scene-linear light. Where colour is associated with coverage a and the matrix leaves coverage alone, b is
multiplied by a: that is the same map of the straight colour, and nothing shows where nothing covers. Nothing is
clamped. A factor of zero takes no part: a NaN in green does not reach a red that has no green in it.

Source: T. McReynolds et al., Programming with OpenGL: advanced rendering, SIGGRAPH course, the colour matrix.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field, field_validator

from lichen.errors import Flaw
from lichen.image import Alpha, Image
from lichen.memory import Array
from lichen.operation import (
    POINTWISE,
    Error,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
)
from lichen.operations.colour import affine
from lichen.operations.colour.affine import Affine

SHAPES = ((3, 3), (3, 4), (4, 4), (4, 5))


class Parameters(OperationParameters):
    matrix: tuple[tuple[float, ...], ...] = Field(((1, 0, 0), (0, 1, 0), (0, 0, 1)), min_length=3, max_length=4)
    """rows of factors, 3x3 or 4x4; or 3x4 or 4x5, whose last column is added"""

    @field_validator("matrix")
    @classmethod
    def _shaped(cls, rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if any((len(rows), len(row)) not in SHAPES for row in rows) or len({len(row) for row in rows}) > 1:
            raise ValueError("must be 3x3, 3x4, 4x4 or 4x5")
        if any(abs(value) > affine.LARGEST for row in rows for value in row):
            raise ValueError(f"holds a factor beyond {affine.LARGEST:g}")
        return rows

    @property
    def affine(self) -> Affine:
        return _affine(self.matrix)


@lru_cache(maxsize=1024)
def _affine(rows: tuple[tuple[float, ...], ...]) -> Affine:
    size = len(rows)
    return Affine.of([row[:size] for row in rows], [row[size] if len(row) > size else 0.0 for row in rows])


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, size = facts["image"], len(p.matrix)
    colours = image.channels - (image.alpha is not Alpha.NONE and size == 3)
    if colours >= size:
        return []
    return [Flaw("/parameters/matrix", f"has {size} rows and the image only {colours} channel(s) for them")]


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return affine.error(p.affine, facts["image"])


def _spoilt() -> dict[str, Any]:
    pixels = np.full((1, 20, 3), 0.5, np.float32)
    pixels[0, 3] = np.nan, 0.25, 0.5
    pixels[0, 17] = 0.25, np.inf, 0.5
    return {"image": pixels}


def _kept_apart(inputs: Any, pixels: Array) -> str | None:
    bad = np.argwhere(~np.isfinite(pixels)).tolist()
    return None if bad == [[0, 3, 2], [0, 17, 0]] else f"not finite at {bad}"


def _covered() -> dict[str, Any]:
    pixels = np.array([[[0.5, 0.25, 0, 0.5], [0, 0, 0, 0], [1, 1, 1, 1]]], np.float32)
    return {"image": Image(pixels, alpha=Alpha.ASSOCIATED)}


def _negated(inputs: Any, pixels: Array) -> str | None:
    expected = np.array([[[0, 0.25, 0.5, 0.5], [0, 0, 0, 0], [0, 0, 0, 1]]])
    return None if np.allclose(pixels, expected, atol=1e-6) else f"got {pixels.tolist()}"


SWAP = ((0, 0.5, 0.5), (0, 0, 1), (1, 0, 0))
NEGATIVE = ((-1, 0, 0, 1), (0, -1, 0, 1), (0, 0, -1, 1))
SEPIA = ((0.393, 0.769, 0.189), (0.349, 0.686, 0.168), (0.272, 0.534, 0.131))

matrix = Operation(
    name="matrix",
    family="colour",
    summary="Mixes the channels of every pixel by a matrix, with an addition if wanted.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after the matrix's pass unchanged", channels=(3, None)),),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "the matrix is the identity" if p.affine.trivial else None,
    result=lambda p, facts: affine.result(p.affine, facts["image"]),
    propagate=lambda p, facts, by: affine.propagate(p.affine, facts["image"], by),
    departure=lambda p, facts: affine.departure(p.affine, facts["image"]),
    link=lambda p, facts: affine.Mixing.of(p.affine, facts["image"]),
    check=_check,
    examples=(
        {"matrix": SEPIA},
        {"matrix": NEGATIVE},
        {"matrix": SWAP},
        {"matrix": ((1, 0, 0, 0.2), (0, 0.5, 0.5, 0), (0, -1, 2, 0), (0.3, 0.3, 0.3, 0))},
        {"matrix": ((1.5, -0.5, 0, 0), (0, 1.5, -0.5, 0), (-0.5, 0, 1.5, 0.125))},
        {"matrix": ((2, 0, 0, 0, -0.5), (0, 2, 0, 0, -0.5), (0, 0, 2, 0, -0.5), (0, 0, 0, 1, 0))},
    ),
    hard_cases=(
        HardCase(
            name="a zero factor and a NaN",
            why="0 x NaN is NaN, and would spoil channels that do not depend on it",
            inputs=_spoilt,
            parameters={"matrix": SWAP},
            holds=_kept_apart,
        ),
        HardCase(
            name="addition under partial coverage",
            why="adding 1 to associated colour shows light where nothing covers",
            inputs=_covered,
            parameters={"matrix": NEGATIVE},
            holds=_negated,
        ),
    ),
)


@matrix.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """Row by row, over the factors that are not zero."""
    image = inputs["image"]
    result, size = image.pixels.copy(), len(p.matrix)
    associated = image.alpha is Alpha.ASSOCIATED and image.channels > size
    for row, factors in enumerate(p.matrix):
        added = factors[size] if len(factors) > size else 0.0
        total = np.full(image.pixels.shape[:2], added)
        if associated and added:
            total *= image.pixels[..., -1]
        for channel in range(size):
            if factors[channel]:
                total += factors[channel] * image.pixels[..., channel]
        result[..., row] = total
    return result


@matrix.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates=affine.RATES,
    stage=lambda p, facts: affine.stage(p.affine, facts["image"]),
)
class Exact(affine.Applied):
    """Fused multiply-adds in float32, sixteen pixels at a time."""
