"""Parts of pictures: which rectangle of what is read gives which rectangle of a result.

Most operations tell by their footprint alone: wider rectangles of the inputs, with the same parameters, give the
rectangle of the result. Others depend on where a pixel lies. They do a part by parameters that say which part it is:
`placed` makes them from those of the whole, with a `Place` beside, which tells what there is of the first input and
what is to be made of the result, and the sizes of both in whole. Whoever computes by such parameters takes places in
the whole pictures and subtracts corners at the end, so that the bits are those of the whole.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias, TypeVar

from pydantic import create_model

from lichen.parameters import OperationParameters

Rectangle: TypeAlias = tuple[int, int, int, int]
"""Left, top, width and height, px."""
Size: TypeAlias = tuple[int, int]
"""Width and height, px."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """The output pixel (x, y) depends on inputs within `rows` above and below and `columns` left and right.

    None means the whole extent in that direction. Where the image `wraps`, distances are taken around its edges.
    """

    rows: int | None
    columns: int | None
    wraps: bool = False

    @property
    def sides(self) -> tuple[int | None, int | None]:
        return self.rows, self.columns


POINTWISE = Footprint(0, 0)
WHOLE = Footprint(None, None)


def halo(radius: int) -> Footprint:
    return Footprint(radius, radius)


@dataclass(frozen=True, slots=True)
class Part:
    """How a rectangle of a result is made: from which rectangles of the inputs, by which parameters."""

    parameters: OperationParameters
    inputs: Mapping[str, Rectangle]
    covers: Rectangle
    """of the result: what is made, which may be more than was wanted"""


class Place(OperationParameters):
    """Where a part lies in what it is of."""

    source: Rectangle
    """of the first input: what there is of it"""
    result: Rectangle
    """of the result: what is to be made of it"""
    source_size: Size
    """of the whole first input"""
    result_size: Size
    """of the whole result"""


P = TypeVar("P", bound=OperationParameters)


def placed(parameters: P, place: Place) -> P:
    """The same parameters, with the part that is to be done."""
    said: dict[str, Any] = {name: getattr(parameters, name) for name in type(parameters).model_fields}
    made: P = _placed(type(parameters)).model_construct(**{**said, "place": place})
    return made


def place_of(parameters: OperationParameters) -> Place | None:
    """The part that parameters ask for, None for the whole."""
    found: Place | None = parameters.__dict__.get("place")  # a model takes microseconds to say that it has none
    return found


@cache
def _placed(model: type[P]) -> type[P]:
    return create_model(f"Placed{model.__name__}", __base__=model, place=(Place, ...))


def widened(rectangle: Rectangle, by: Size, size: Size, cells: int = 1) -> Rectangle:
    """A rectangle and what lies within `by` of it, inside a picture of `size`: never nothing. Its edges are the
    picture's, or multiples of `cells`."""
    left, width = _span(rectangle[0], rectangle[2], by[0], size[0], cells)
    top, height = _span(rectangle[1], rectangle[3], by[1], size[1], cells)
    return left, top, width, height


def _span(start: int, length: int, by: int, size: int, cells: int) -> tuple[int, int]:
    low, high = min(max(start - by, 0), size - 1), max(min(start + length + by, size), 1)
    low -= low % cells
    high = min(max(-(-high // cells), low // cells + 1) * cells, size)
    return low, high - low


def united(a: Rectangle, b: Rectangle) -> Rectangle:
    """The smallest rectangle that holds both."""
    left, top = min(a[0], b[0]), min(a[1], b[1])
    right, bottom = max(a[0] + a[2], b[0] + b[2]), max(a[1] + a[3], b[1] + b[3])
    return left, top, right - left, bottom - top
