"""Hue rotation that keeps luminance.

Truth: linear RGB is turned so that grey lies along z, sheared so that planes of equal luminance are planes of equal z,
turned about z by the angle, and brought back. Grey and luminance stay exactly as they are: with w the luminance
weights, w H = w and H 1 = 1. The shear adds (w'_x x + w'_y y) / w'_z to z, where w' are the weights turned like the
colours: that makes z proportional to luminance, which the shear printed in the course does not.

Hues move as positions on a circle in RGB, so 120 degrees take red towards green, but not onto it: green of red's
luminance would be darker than it is bright. Colours may leave the gamut; nothing is clamped.

Source: P. Haeberli, Matrix operations for image processing, 1993 (the construction, with the shear corrected).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import Field

from lichen.memory import Array
from lichen.operation import (
    POINTWISE,
    Degrees,
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
from lichen.operations.colour.primaries import luminance


class Parameters(OperationParameters):
    angle: Degrees = Field(90, ge=-36000, le=36000)
    """from red towards green"""

    @property
    def affine(self) -> Affine:
        return _affine(self.angle)


def rotation(angle: float) -> Array:
    """The matrix of the module's docstring, (3, 3); `angle` in degrees."""
    upright = np.array([[1, -0.5, -0.5], [0, math.sqrt(0.75), -math.sqrt(0.75)], [1, 1, 1]])
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)  # orthogonal; its last row is grey
    weights = upright @ luminance()
    shear = np.eye(3)
    shear[2, :2] = weights[:2] / weights[2]
    turn = math.radians(math.fmod(angle, 360))
    about = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    levelled = shear @ upright
    matrix: Array = np.linalg.solve(levelled, about @ levelled)
    return matrix


@lru_cache(maxsize=64)
def _affine(angle: float) -> Affine:
    return Affine.of(rotation(angle))


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    return affine.error(p.affine, facts["image"])


def _greys() -> dict[str, Any]:
    values = np.array([0, 1e-40, 1e-7, 0.18, 0.5, 1, -0.25, 1e4, 1e30], np.float32)
    return {"image": np.repeat(values, 3).reshape(1, -1, 3)}


def _still_grey(inputs: Any, pixels: Array) -> str | None:
    if np.allclose(pixels, inputs["image"], rtol=1e-6, atol=1e-44):
        return None
    return f"grey became {pixels.tolist()}"


def _colours() -> dict[str, Any]:
    return {"image": np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1], [4, -0.5, 0.25], [1e-6, 0, 0]]], np.float32)}


def _same_luminance(inputs: Any, pixels: Array) -> str | None:
    before, after = (np.asarray(each, np.float64) @ luminance() for each in (inputs["image"], pixels))
    return None if np.allclose(before, after, rtol=2e-6, atol=1e-13) else f"luminance {before} became {after}"


hue_rotate = Operation(
    name="hue_rotate",
    family="colour",
    summary="Turns all hues by an angle; luminance and grey stay as they are.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "the picture; channels after the third pass unchanged", channels=(3, None)),),
    light=Light.LINEAR,
    footprint=lambda p, facts: POINTWISE,
    identity=lambda p, facts: "whole turns" if p.angle % 360 == 0 else None,
    result=lambda p, facts: affine.result(p.affine, facts["image"]) if p.angle % 360 else facts["image"],
    propagate=lambda p, facts, by: affine.propagate(p.affine, facts["image"], by),
    departure=lambda p, facts: affine.departure(p.affine, facts["image"]),
    link=lambda p, facts: affine.Mixing.of(p.affine, facts["image"]),
    inverse=lambda p: Parameters(angle=-p.angle),
    examples=({"angle": 90}, {"angle": -30}, {"angle": 180}, {"angle": 120}),
    hard_cases=(
        HardCase(
            name="grey keeps its colour",
            why="with the printed shear grey turns into (1.84, 1.44, -0.28)",
            inputs=_greys,
            parameters={"angle": 90},
            holds=_still_grey,
        ),
        HardCase(
            name="luminance stays",
            why="a plain rotation about grey makes blue brighter than it can be",
            inputs=_colours,
            parameters={"angle": 137},
            holds=_same_luminance,
        ),
    ),
)


@hue_rotate.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    """The matrix in float64."""
    result = inputs["image"].pixels.copy()
    if p.angle % 360:
        result[..., :3] = result[..., :3] @ rotation(p.angle).T
    return result


@hue_rotate.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].samples,
    rates=affine.RATES,
    stage=lambda p, facts: affine.stage(p.affine, facts["image"]),
)
class Exact(affine.Applied):
    """One matrix for each angle, applied by fused multiply-adds in float32."""
