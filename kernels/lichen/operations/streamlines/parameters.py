"""What line integral convolution can be asked for, and the weights that follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from pydantic import Field

from lichen.operation import OperationParameters
from lichen.operations.streamlines.maps import Map


class Kernel(StrEnum):
    """The weight k(s) along the line."""

    BOX = "box"
    """1"""
    HANN = "hann"
    """(1 + cos(pi s / length)) / 2"""
    COSINE = "cosine"
    """cos(pi s / (2 length))"""
    GAUSSIAN = "gaussian"
    """exp(-2 (s / length)^2): a standard deviation of half the length"""
    RIPPLE = "ripple"
    """(1 + cos(pi s / length)) (1 + cos(2 pi (ripples s / (2 length) + phase))) / 4: periodic in `phase`, and what it
    shows moves along the field while the phase grows"""


class Speed(StrEnum):
    """What the line is parametrised by."""

    ARC = "arc"
    """its length: the field gives directions alone"""
    FIELD = "field"
    """time: where the field is strong, the texture is smeared far"""


class Sampling(StrEnum):
    """What lies between pixel centres."""

    NEAREST = "nearest"
    """the pixel that the point lies in"""
    BILINEAR = "bilinear"
    CUBIC = "cubic"
    """Catmull and Rom's spline: smooth, goes beyond the values it connects by up to 28 % of their spread"""


class Edge(StrEnum):
    """Where lines go at the border."""

    END = "end"
    """they end"""
    WRAP = "wrap"
    """they go on at the opposite side: field and texture are periodic"""


OVERSHOOT = 0.28125
"""Of the spread: how far a cubic goes beyond the values it connects. The negative weights at (1/2, 1/2)."""
GAUSSIAN_WAVES = (0.43786981, 0.4806361, 0.07739869, 0.00411912)
"""Weights of cos(0.7 pi n s / length), n from 0, whose sum is the kernel `gaussian` to 2.4e-5 (found by linear
programming as the best there is)."""


@dataclass(frozen=True, slots=True)
class Wave:
    """The part weight * cos(pi * turns * s / length + phase) of a kernel."""

    weight: float
    turns: float
    phase: float = 0.0


class Parameters(OperationParameters):
    length: float = Field(
        20.0, ge=0, le=1000, description="how far to follow the line each way", json_schema_extra={"unit": "px"}
    )
    kernel: Kernel = Field(Kernel.BOX, description="weights along the line")
    ripples: int = Field(2, ge=1, le=64, description="waves of the kernel ripple over the whole line")
    phase: float = Field(0.0, ge=-1, le=1, description="of the kernel ripple, in turns")
    frames: int = Field(
        1, ge=1, le=256, description="pictures of an animation, one below the other: the phase makes one turn over "
        "them, and the time goes from `time` to the second slice"
    )  # fmt: skip
    oriented: bool = Field(False, description="weights grow towards where the line comes from: drops become comets")
    speed: Speed = Field(Speed.ARC, description="line by arc length, or by time (length is then in units of time)")
    scale: float = Field(1.0, ge=-1e6, le=1e6, description="v = (c - bias) * scale; 2 for fields stored in [0, 1]")
    bias: float = Field(
        0.0, ge=-1e6, le=1e6, description="the stored value of a zero component; 0.50196 (128 / 255) or 0.5"
    )
    time: float = Field(0.0, ge=0, le=1, description="between the slices `field` (0) and `later` (1)")
    interval: float = Field(
        0.0, ge=0, le=1e6, description="time from one slice to the other, for speed=field: lines are those of "
        "particles in the changing field; 0: of the field as it stands at `time`"
    )  # fmt: skip
    border: Edge = Field(Edge.END, description="where lines go at the border")
    field_sampling: Sampling = Field(Sampling.BILINEAR, description="what lies between the vectors of pixels")
    sampling: Sampling = Field(Sampling.BILINEAR, description="what lies between the texels")
    enhance: float = Field(
        0.0, ge=0, le=16, description="smears twice, and sharpens between: adds so much of the difference from the "
        "mean of 3 x 3; 9 is customary, 0 smears once"
    )  # fmt: skip
    contrast: float = Field(
        0.0, ge=0, le=1, description="for display only: brings the mean to 1/2 and the standard deviation to this, and "
        "cuts at 0 and 1; 0 leaves values as they are"
    )  # fmt: skip
    colour: Map = Field(Map.NONE, description="colours by the length of the vector; the picture is their brightness")
    fastest: float = Field(0.0, ge=0, le=1e30, description="length at the end of the map; 0: the longest of the field")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the white noise that stands in for a missing texture")
    grain: float = Field(1.0, ge=1, le=64, description="of that noise", json_schema_extra={"unit": "px"})
    density: float = Field(
        1.0, gt=0, le=1, description="of drops: below 1, so many of its grains are 1 and the others are 0"
    )

    def steps(self, step: float) -> int:
        """Equal steps each way, none longer than `step`."""
        return math.ceil(self.length / step)

    def weights(self, count: int, phase: float = 0.0) -> npt.NDArray[np.float64]:
        """k at the ends of `count` equal steps: forwards, and backwards, shape (2, count + 1)."""
        s = np.arange(count + 1) / max(count, 1) * np.array([[1.0], [-1.0]])
        match self.kernel:
            case Kernel.HANN:
                made = 0.5 + 0.5 * np.cos(np.pi * s)
            case Kernel.COSINE:
                made = np.cos(0.5 * np.pi * s)
            case Kernel.GAUSSIAN:
                made = np.exp(-2 * s * s)
            case Kernel.RIPPLE:
                wave = 2 * np.pi * (0.5 * self.ripples * s + self.phase + phase)
                made = (0.5 + 0.5 * np.cos(np.pi * s)) * (0.5 + 0.5 * np.cos(wave))
            case _:
                made = np.ones_like(s)
        weights: npt.NDArray[np.float64] = made * (0.5 - 0.5 * s) if self.oriented else made
        return weights

    def waves(self, phase: float = 0.0) -> tuple[Wave, ...]:
        """The kernel as a sum: the constant, and waves; exactly but for `gaussian`. Not of an oriented one, which grows
        along the line."""
        turn = 2 * math.pi * (self.phase + phase)
        match self.kernel:
            case Kernel.HANN:
                return Wave(0.5, 0), Wave(0.5, 1)
            case Kernel.COSINE:
                return Wave(0.0, 0), Wave(1.0, 0.5)
            case Kernel.GAUSSIAN:
                return tuple(Wave(weight, 0.7 * n) for n, weight in enumerate(GAUSSIAN_WAVES))
            case Kernel.RIPPLE:
                n = self.ripples
                beats = [Wave(0.25, n, turn), Wave(0.125, n + 1, turn), Wave(0.125, n - 1, turn)]
                constant = 0.25 + sum(each.weight * math.cos(turn) for each in beats if each.turns == 0)
                return Wave(constant, 0), Wave(0.25, 1), *(each for each in beats if each.turns)
            case _:
                return (Wave(1.0, 0),)

    @property
    def passes(self) -> int:
        return 2 if self.enhance else 1
