"""What parameters of all operations have in common."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Pixels = Annotated[float, Field(json_schema_extra={"unit": "px"})]
Degrees = Annotated[float, Field(json_schema_extra={"unit": "deg"})]


class Border(StrEnum):
    """How an image continues beyond its edge, for the row a b c d."""

    REFLECT = "reflect"
    """c b a | a b c d | d c b (half-sample symmetric)"""
    REFLECT101 = "reflect101"
    """d c b | a b c d | c b a (whole-sample symmetric)"""
    CLAMP = "clamp"
    """a a a | a b c d | d d d"""
    WRAP = "wrap"
    """b c d | a b c d | a b c"""
    CONSTANT = "constant"
    """v v v | a b c d | v v v"""


class OperationParameters(BaseModel):
    """Base of every operation's parameters: frozen, no unknown fields, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)
