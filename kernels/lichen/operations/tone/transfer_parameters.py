"""What `transfer` is asked for, and the curve that follows from it."""

from __future__ import annotations

from enum import StrEnum
from functools import lru_cache
from typing import Annotated

from pydantic import Field, field_validator

from lichen.operation import OperationParameters
from lichen.operations.tone import curves
from lichen.operations.tone.curves import WHOLE, Curve, Direction, Form
from lichen.operations.tone.definitions import LOGC3, Definition, definition
from lichen.operations.tone.piecewise import held
from lichen.operations.tone.shapes import Pieced, Powers, Shape, Whole

Luminance = Annotated[float, Field(json_schema_extra={"unit": "cd/m2"})]
Exponent = Annotated[float, Field(ge=0.1, le=10)]

WHITE = {Curve.PQ: 203.0, Curve.BT1886: 100.0, Curve.ST428: 48.0, Curve.DICOM_GSDF: 100.0}
"""cd/m2 of linear 1 where the caller names none: graphics white of ITU-R BT.2408, the reference display of BT.2035, the
reference projector of SMPTE RP 431-2"""


class Negative(StrEnum):
    """What becomes of negative values."""

    MIRROR = "mirror"
    CLAMP = "clamp"


class Parameters(OperationParameters):
    curve: Curve = Curve.SRGB
    """the transfer function"""
    direction: Direction = Direction.DECODE
    """decode: signal to linear light; encode: linear light to signal"""
    gamma: Exponent | Annotated[tuple[Exponent, ...], Field(min_length=1, max_length=64)] = 2.2
    """decoding exponent, for curve=gamma, or one for each colour channel; encoding takes its reciprocal"""
    exposure_index: int = Field(800, ge=160, le=1600)
    """for curve=arri_logc3: 160, 200, 250, 320, 400, 500, 640, 800, 1000, 1280 or 1600"""
    white: Luminance | None = Field(None, ge=1, le=10000)
    """luminance that linear 1 stands for, for curve=pq (203 unless given), bt1886 (100), st428 (48) and dicom_gsdf
    (100)"""
    black: Luminance = Field(0, ge=0, le=1000)
    """luminance of the display's black, for curve=bt1886; below white"""
    negative: Negative = Negative.MIRROR
    """negative light: mirror keeps it, by odd extension or as the curve's standard says; clamp makes it none"""

    @field_validator("exposure_index")
    @classmethod
    def _printed(cls, index: int) -> int:
        if index not in LOGC3:
            raise ValueError("must be one of " + ", ".join(map(str, LOGC3)))
        return index

    @property
    def nominal_white(self) -> float:
        return WHITE.get(self.curve, 1.0) if self.white is None else self.white

    @property
    def clamped(self) -> bool:
        return self.negative is Negative.CLAMP


@lru_cache(maxsize=64)
def form(p: Parameters) -> Form:
    """The parameters' curve as computed, of those in `WHOLE` with one gamma."""
    gamma = p.gamma if isinstance(p.gamma, float) else p.gamma[0]
    return curves.form(p.curve, p.direction, gamma=gamma, white=p.nominal_white, black=p.black)


def stated(p: Parameters) -> Definition:
    return definition(p.curve, white=p.nominal_white, exposure_index=p.exposure_index)


@lru_cache(maxsize=256)
def shape(p: Parameters) -> Shape:
    """The same of every curve."""
    encode = p.direction is Direction.ENCODE
    if p.curve is Curve.GAMMA and isinstance(p.gamma, tuple):
        return Powers(tuple(1 / g if encode else g for g in p.gamma), p.clamped)
    if p.curve in WHOLE:
        return Whole(form(p), p.clamped)
    curve = stated(p).curve(encode)
    return Pieced(held(curve, encode) if p.clamped else curve)
