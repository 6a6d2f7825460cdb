"""What parameters of all operations have in common."""

from __future__ import annotations

import ast
import contextlib
import inspect
import json
import textwrap
from collections.abc import Mapping
from enum import StrEnum
from functools import cache, cached_property
from typing import Annotated, Any, Literal, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

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


class Documented(BaseModel):
    """A model whose fields are described by the strings that stand below them.

    pydantic can look for these itself, when a class is made, by going through its source: for all operations that takes
    0.5 s at every start. Here they are looked for when a schema is asked for.
    """

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        made = handler(core)
        properties = handler.resolve_ref_schema(made).get("properties", {})
        for name, text in _described(cls).items():
            if name in properties:
                properties[name].setdefault("description", text)
        return made


class OperationParameters(Documented):
    """Base of every operation's parameters: frozen, no unknown fields, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @cached_property
    def written(self) -> str:
        """All of them, as JSON: numbers that are equal and not the same (0 and -0) are two."""
        return self.model_dump_json()

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        made = super().model_copy(update=update, deep=deep)
        made.__dict__.pop("written", None)  # what the original was
        return made


@cache
def _described(model: type) -> dict[str, str]:
    """The strings below the fields of a class and of those that it inherits from."""
    found: dict[str, str] = {}
    for each in reversed([each for each in model.__mro__ if issubclass(each, BaseModel) and each is not BaseModel]):
        try:
            (body,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
        except OSError:  # made in passing, or installed without its source
            continue
        assert isinstance(body, ast.ClassDef)
        for field, after in zip(body.body, [*body.body[1:], ast.Pass()], strict=True):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                found.pop(field.target.id, None)
                if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                    found[field.target.id] = inspect.cleandoc(str(after.value.value))
    return found


def from_text(value: Any, field: Any) -> Any:
    """Text of a JSON array or object is parsed, and a number of a literal type found; the rest is left to the model."""
    if isinstance(value, str) and value[:1] in ("[", "{"):
        with contextlib.suppress(ValueError):
            return json.loads(value)
    known = get_args(field.annotation) if field and get_origin(field.annotation) is Literal else ()
    return next((each for each in known if str(each) == value), value)
