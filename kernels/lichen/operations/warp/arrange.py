"""Arrange: crop, pad, transpose, flip and tile, without touching a value.

Truth, in this order: `left`, `top`, `right` and `bottom` pixels are added on each side, continued by `border`, or cut
off where negative; rows and columns change places with `transpose`; the image is flipped; and it is repeated `tile`
times across and down. All of it is one look-up of rows and columns, so every sample of the result is a sample of the
image bit for bit, or the border's value. A quarter turn to the left is a transpose and a vertical flip.

There is nothing to trade accuracy for: the only method is exact.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.opencl.device import Device
from lichen.operation import (
    EXACT,
    WHOLE,
    Border,
    Error,
    Facts,
    HardCase,
    Input,
    InputFacts,
    Inputs,
    Light,
    Operation,
    OperationParameters,
    Rate,
)
from lichen.operations.convolution.borders import continued
from lichen.operations.warp import cases
from lichen.operations.warp.launch import built_for
from lichen.operations.warp.prediction import LARGEST, Size, check_size
from lichen.part import Part, Place, Rectangle, place_of, placed

STRIP = 64
Side = Annotated[int, Field(ge=-LARGEST, le=LARGEST, json_schema_extra={"unit": "px"})]
Times = Annotated[int, Field(ge=1, le=LARGEST)]
Index = npt.NDArray[np.int32]


class Flip(StrEnum):
    """Which way the image is mirrored."""

    NONE = "none"
    HORIZONTAL = "horizontal"
    """left and right change places"""
    VERTICAL = "vertical"
    """top and bottom change places"""
    BOTH = "both"


class Parameters(OperationParameters):
    left: Side = Field(0, description="columns added on the left; cut off where negative")
    top: Side = Field(0, description="rows added at the top; cut off where negative")
    right: Side = Field(0, description="columns added on the right; cut off where negative")
    bottom: Side = Field(0, description="rows added at the bottom; cut off where negative")
    transpose: bool = Field(False, description="whether rows and columns change places")
    flip: Flip = Field(Flip.NONE, description="which way the image is mirrored, after that")
    tile: tuple[Times, Times] = Field((1, 1), description="how often it is repeated, across and down")
    border: Border = Field(Border.CONSTANT, description="how the image continues where pixels are added")
    value: float = Field(0.0, description="what a constant border adds, in every channel")


def _kept(p: Parameters, facts: InputFacts) -> Size:
    """Columns and rows once sides are added and cut."""
    image = facts["image"]
    return image.width + p.left + p.right, image.height + p.top + p.bottom


def size_of(p: Parameters, facts: InputFacts) -> Size:
    """Columns and rows of what is made."""
    place = place_of(p)
    return place.result[2:] if place else _whole(p, (facts["image"].width, facts["image"].height))


def _whole(p: Parameters, source: Size) -> Size:
    width, height = source[0] + p.left + p.right, source[1] + p.top + p.bottom
    if p.transpose:
        width, height = height, width
    return width * p.tile[0], height * p.tile[1]


def indices(p: Parameters, facts: InputFacts) -> tuple[Index, Index]:
    """What each column and each row of the result reads: columns and rows of the source, or rows and columns where
    they change places; negative for the border's value. Of a part, and told from the corner of what there is of the
    source, where the parameters say so."""
    place = place_of(p)
    if place is None:
        return _indices(p, (facts["image"].width, facts["image"].height))
    columns, rows = (some[start : start + length] for some, start, length in _spans(p, place.source_size, place.result))
    left, top = place.source[1::-1] if p.transpose else place.source[:2]
    return np.where(columns < 0, columns, columns - left), np.where(rows < 0, rows, rows - top)


def _spans(p: Parameters, source: Size, part: Rectangle) -> tuple[tuple[Index, int, int], tuple[Index, int, int]]:
    columns, rows = _indices(p, source)
    return (columns, part[0], part[2]), (rows, part[1], part[3])


def _indices(p: Parameters, source: Size) -> tuple[Index, Index]:
    """Of the whole."""
    across = continued(np.arange(source[0] + p.left + p.right) - p.left, source[0], p.border)
    down = continued(np.arange(source[1] + p.top + p.bottom) - p.top, source[1], p.border)
    if p.transpose:
        across, down = down, across
    if p.flip in (Flip.HORIZONTAL, Flip.BOTH):
        across = across[::-1]
    if p.flip in (Flip.VERTICAL, Flip.BOTH):
        down = down[::-1]
    return np.tile(across, p.tile[0]).astype(np.int32), np.tile(down, p.tile[1]).astype(np.int32)


def _part(p: Parameters, facts: InputFacts, wanted: Rectangle) -> Part:
    """What rows and columns are looked up, and nothing beside."""
    image = facts["image"]
    source = image.width, image.height
    read = [some[start : start + length] for some, start, length in _spans(p, source, wanted)]
    spans = [_range(some) for some in (read[::-1] if p.transpose else read)]
    shown = spans[0][0], spans[1][0], spans[0][1], spans[1][1]
    place = Place(source=shown, result=wanted, source_size=source, result_size=_whole(p, source))
    return Part(placed(p, place), {"image": shown}, wanted)


def _range(read: Index) -> tuple[int, int]:
    """The first of what is read, and how many there are up to the last; at least one."""
    inside = read[read >= 0]
    return (int(inside.min()), int(inside.max() - inside.min()) + 1) if inside.size else (0, 1)


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    flaws = []
    width, height = _kept(p, facts)
    if width < 1:
        flaws.append(Flaw("/parameters/right", f"leaves {width} columns"))
    if height < 1:
        flaws.append(Flaw("/parameters/bottom", f"leaves {height} rows"))
    if flaws:
        return flaws
    size = size_of(p, facts)
    if max(size) > LARGEST:
        return [Flaw("/parameters/tile", f"makes {size[0]} x {size[1]} pixels; a side has {LARGEST} at most")]
    return check_size(facts["image"], size)


def _identity(p: Parameters, facts: InputFacts) -> str | None:
    moved = p.left or p.top or p.right or p.bottom or p.transpose or p.flip is not Flip.NONE or p.tile != (1, 1)
    return None if moved else "nothing is moved, added or left out"


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image, (width, height) = facts["image"], size_of(p, facts)
    low, high = image.extent.low, image.extent.high
    if p.border is Border.CONSTANT:
        low, high = min(low, p.value), max(high, p.value)
    return Facts(height, width, image.channels, image.space, image.alpha, Extent(low, high, image.extent.nonfinite))


def _inverse(p: Parameters) -> Parameters | None:
    """A flip undoes itself, a transpose too; both together are a turn, which the other flip undoes."""
    if p.left or p.top or p.right or p.bottom or p.tile != (1, 1):
        return None
    other = {Flip.HORIZONTAL: Flip.VERTICAL, Flip.VERTICAL: Flip.HORIZONTAL}
    return p.model_copy(update={"flip": other.get(p.flip, p.flip) if p.transpose else p.flip})


def _rotated(inputs: cases.Given, pixels: Array) -> str | None:
    same = np.array_equal(pixels, np.rot90(inputs["image"]), equal_nan=True)
    return None if same else "a quarter turn is not exact"


arrange = Operation(
    name="arrange",
    family="warp",
    summary="Crops, pads, transposes, flips and tiles an image; every sample stays as it is.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(Input("image", "a picture or data, any number of channels"),),
    light=Light.STORED,
    footprint=lambda p, facts: WHOLE,
    identity=_identity,
    inverse=_inverse,
    result=_result,
    implied=lambda p, facts: "which part of the image a tile shows is known by its place alone",
    part=_part,
    check=_check,
    examples=(
        {"left": 3, "top": -2, "right": 5, "bottom": 1, "border": "reflect101"},
        {"transpose": True, "flip": "vertical"},
        {"flip": "both", "tile": [2, 3], "left": 1, "value": 0.5},
    ),
    hard_cases=(
        HardCase(
            name="quarter turn with NaN",
            why="what moves samples must not compute with them",
            inputs=cases.noise_with_nan,
            parameters={"transpose": True, "flip": "vertical"},
            holds=_rotated,
        ),
        HardCase(
            name="padded by more than there is",
            why="reflections of reflections: the border must be followed around as often as it takes",
            inputs=cases.constant,
            parameters={"left": 500, "top": 211, "border": "reflect101"},
            holds=cases.stays_constant,
        ),
    ),
)


@arrange.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _taken(inputs, p)


def _taken(inputs: Inputs, p: Parameters) -> Array:
    pixels = inputs["image"].pixels
    columns, rows = indices(p, {"image": Facts.sized(inputs["image"])})
    if p.transpose:
        pixels = pixels.swapaxes(0, 1)
    made = pixels[np.maximum(rows, 0)][:, np.maximum(columns, 0)]
    made[rows < 0] = p.value
    made[:, columns < 0] = p.value
    return made


def _no_error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """None; but the border's value is held in float32, as every sample is."""
    stored = float(np.float32(p.value))
    return (
        EXACT
        if stored == p.value or p.border is not Border.CONSTANT
        else Error(abs(stored - p.value), "bound", abs(stored - p.value))
    )


@arrange.method(
    "exact",
    error=_no_error,
    work=lambda p, knob, facts: float(size_of(p, facts)[0] * size_of(p, facts)[1] * facts["image"].channels),
    rates={"opencl": Rate(2e-4, 5e-10), "numpy": Rate(1e-4, 2e-9)},
)
class Exact:
    """Rows and columns by number."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        columns, rows = indices(p, {"image": Facts.sized(image)})
        out = aligned_empty((len(rows), len(columns), image.channels))
        with device.session() as session:
            session.launch(
                "warp/arrange.cl", "arrange", (-(-len(columns) // STRIP), len(rows)), aligned(image.pixels),
                session.write(out), aligned(columns, np.int32), aligned(rows, np.int32), np.int32(len(columns)),
                np.int32(len(rows)), np.int32(image.width), np.int32(image.channels), np.int32(p.transpose),
                np.float32(p.value), local=(1, 16), defines=built_for(image.channels),
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        return aligned(_taken(inputs, p))
