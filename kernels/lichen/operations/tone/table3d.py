"""Table3d: colour through a three-dimensional table, or a colour transform file.

Truth: each colour is brought into the domain, [domain_min, domain_max] per channel, and its place in the table of n^3
colours is interpolated between the corners of its cell:

* tetrahedral: among the four corners of the tetrahedron it lies in, from the one nearest black along the axes in the
  order of the place's parts. Neutral colours meet neutral corners only, so a table that keeps grey keeps it between its
  nodes.
* trilinear: among all eight.

Both are continuous and neither leaves the range of the table. The table is the text of a .cube file, or an input image
of n^2 rows and n columns, red along a row and green faster than blue down the rows. A .cube may also hold a
one-dimensional table, alone or as a shaper before the other. Channels beyond the third pass untouched; a pixel with NaN
in any colour becomes NaN in all three.

Or `clf` is the text of a Common LUT Format file: its nodes (matrices, tables of one and three dimensions, ranges,
exponents, logarithms, ASC CDL) are applied in order, each as the format defines it, in one pass over the picture. A
table in it says itself how it is interpolated (trilinear unless it does).

Source: J. Kasson et al., Performing color space conversions with three-dimensional linear interpolation, J. Electronic
Imaging 4(3), 1995; McReynolds and Blythe, Advanced Graphics Programming Using OpenGL, 2005, section 12.2.3; AMPAS
S-2014-006 (CLF).
"""

from __future__ import annotations

import dataclasses
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, field_validator

from lichen.errors import Flaw
from lichen.image import Alpha, Extent
from lichen.memory import Array, aligned, aligned_empty
from lichen.once import latest
from lichen.operation import (
    POINTWISE,
    ROUNDING,
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
from lichen.operations.tone import clf
from lichen.operations.tone.chain import Chain, Step, Table1, Table3
from lichen.operations.tone.cube import LARGEST, LONGEST, Triple, parse, written
from lichen.operations.tone.lattice import looked_up
from lichen.operations.tone.pointwise import FLOAT_MAX, blockwise, carried

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from lichen.opencl.device import Device

Edge = Annotated[float, Field(ge=-1e6, le=1e6)]
FAR = 1e30
"""Beyond it a chain of steps may leave float32's range on the way."""


class Interpolation(StrEnum):
    """Between which corners of a cell."""

    TETRAHEDRAL = "tetrahedral"
    TRILINEAR = "trilinear"


class Parameters(OperationParameters):
    cube: str | None = Field(None, max_length=LONGEST)
    """the text of a .cube file, in place of the input table"""
    clf: str | None = Field(None, max_length=LONGEST)
    """the text of a Common LUT Format file, in place of a table"""
    interpolation: Interpolation = Interpolation.TETRAHEDRAL
    """tetrahedral or trilinear: they are different definitions"""
    domain_min: tuple[Edge, Edge, Edge] | None = None
    """the colour at the table's first node; that of the text, or 0, unless given"""
    domain_max: tuple[Edge, Edge, Edge] | None = None
    """the colour at the table's last node; that of the text, or 1, unless given"""

    @field_validator("cube")
    @classmethod
    def _readable(cls, cube: str | None) -> str | None:
        if cube is not None:
            parse(cube)
        return cube

    @field_validator("clf")
    @classmethod
    def _read(cls, text: str | None) -> str | None:
        if text is not None:
            clf.parse(text)
        return text

    @property
    def chain(self) -> Chain | None:
        """The steps of a colour transform file, or of a .cube with a table of one dimension; None for a plain table."""
        if self.clf is not None:
            return clf.parse(self.clf)
        if self.cube is None or parse(self.cube).shaper is None:
            return None
        return _shaped(self.cube, self.interpolation is Interpolation.TETRAHEDRAL)

    @property
    def domain(self) -> tuple[Triple, Triple]:
        held = parse(self.cube) if self.cube is not None else None
        low = self.domain_min or (held.low if held else (0.0, 0.0, 0.0))
        return low, self.domain_max or (held.high if held else (1.0, 1.0, 1.0))


@lru_cache(maxsize=8)
def _shaped(text: str, tetrahedral: bool) -> Chain:
    held = parse(text)
    steps: list[Step] = []
    if held.shaper is not None:
        steps.append(Table1(held.shaper, *held.shaper_ends))
    if held.table is not None:
        steps.append(Table3(held.table, held.low, held.high, tetrahedral))
    return Chain(tuple(steps))


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    image, table = facts["image"], facts.get("table")
    flaws = []
    if sum(each is not None for each in (p.cube, p.clf, table)) != 1:
        flaws.append(Flaw("/inputs/table", "a table is needed: as this input, or as text in cube or clf; only one"))
    if p.chain is not None and (p.domain_min or p.domain_max):
        flaws.append(Flaw("/parameters/domain_min", "applies to a single table: files of several steps say their own"))
    if table is not None:
        size = table.width
        if table.height != size * size or not 2 <= size <= LARGEST:
            flaws.append(Flaw("/inputs/table", f"must have n columns and n^2 rows, n from 2 to {LARGEST}"))
        if table.extent.nonfinite:
            flaws.append(Flaw("/inputs/table", "holds values that are not finite"))
    if image.channels - (image.alpha is not Alpha.NONE) < 3:
        flaws.append(Flaw("/inputs/image", "must have 3 colour channels"))
    low, high = p.domain
    if any(b - a < 1e-5 * max(abs(a), abs(b), 1e-6) for a, b in zip(low, high, strict=True)):
        flaws.append(Flaw("/parameters/domain_max", "must lie above domain_min in every channel"))
    return flaws


def _single(text: str) -> Array:
    """The table of a .cube that holds nothing else."""
    table = parse(text).table
    if table is None:
        raise TypeError("the text holds no table of three dimensions")
    return table


@lru_cache(maxsize=8)
def _steps_of(text: str) -> tuple[float, float, float, int]:
    """Lowest and highest value, the largest differences along the three axes summed, and the size."""
    table = _single(text)
    steps = sum(float(np.abs(np.diff(table, axis=axis)).max()) for axis in range(3))
    return float(table.min()), float(table.max()), steps, len(table)


def _known(p: Parameters, facts: InputFacts) -> tuple[float, float, float, int]:
    """The same, of whichever table there is; of an input only the range is known."""
    if p.cube is not None:
        return _steps_of(p.cube)
    # Facts are asked for before the inputs are checked, so the table may not be there yet.
    table = facts.get("table", facts["image"])
    return table.extent.low, table.extent.high, 3 * table.extent.spread, table.width


@latest
def _walked(p: Parameters, facts: InputFacts) -> tuple[float, float, float]:
    """Of a chain: the results' range and the largest error."""
    assert p.chain is not None
    return p.chain.walk(facts["image"].extent.low, facts["image"].extent.high)


def _error(p: Parameters, knob: float, facts: InputFacts) -> Error:
    """The place carries roundings of the sample, the domain and the scale; the weights sum to 1 but for theirs. Of a
    chain, what its steps make of one another's."""
    if p.chain is not None:
        worst = _walked(p, facts)[2]
        return Error(worst, "estimate", worst)
    low, high, steps, size = _known(p, facts)
    ends = p.domain
    off = max(max(abs(a), abs(b)) / max(b - a, 1e-12) for a, b in zip(*ends, strict=True)) * (size - 1)
    value = ROUNDING * (12 * max(abs(low), abs(high)) + steps * (4 * size + 3 * off))
    return Error(value, "bound", value)


def _result(p: Parameters, facts: InputFacts) -> Facts:
    image = facts["image"]
    chain = p.chain
    low, high = _walked(p, facts)[:2] if chain else _known(p, facts)[:2]
    slack = _error(p, 0.0, facts).value
    low, high = low - slack, high + slack
    if image.channels > 3:
        low, high = min(low, image.extent.low), max(high, image.extent.high)
    if chain and (image.extent.nonfinite or max(-low, high) > FAR):
        # What an infinite value becomes is the chain's affair, and an overflow on the way may be held again.
        return dataclasses.replace(image, extent=Extent(-FLOAT_MAX, FLOAT_MAX, image.samples))
    return dataclasses.replace(image, extent=Extent(low, high, min(3 * image.extent.nonfinite, image.samples)))


def _propagate(p: Parameters, facts: InputFacts, error: float) -> float:
    image, chain = facts["image"], p.chain
    if chain is not None:
        ends = image.extent.low, image.extent.high
        return carried(
            image, _result(p, facts).extent.magnitude,
            lambda change: max(chain.walk(*ends, change)[2], change if image.channels > 3 else 0.0), error,
        )  # fmt: skip
    _, _, steps, size = _known(p, facts)
    narrowest = max(min(b - a for a, b in zip(*p.domain, strict=True)), 1e-12)
    steepest = max(steps * (size - 1) / narrowest, 1.0 if facts["image"].channels > 3 else 0.0)
    return carried(facts["image"], _result(p, facts).extent.magnitude, lambda change: steepest * change, error)


# ------------------------------------------------------------------------------------------------------- hard cases


def _example(size: int, bend: float) -> str:
    """A table that bends and mixes: neutral where its input is."""
    axis = np.linspace(0, 1, size)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    grey = (red + green + blue) / 3
    mixed = [np.round(c + bend * (c - grey) * (1 - grey), 4) ** 1.2 for c in np.clip((red, green, blue), 0, 1)]
    return written(np.nan_to_num(np.stack(mixed, axis=-1)))


SMALL, MIDDLE = _example(2, 0.0), _example(5, -0.4)


GRADE = """<?xml version="1.0" encoding="UTF-8"?>
<ProcessList id="grade" compCLFversion="3">
  <Exponent inBitDepth="32f" outBitDepth="32f" style="monCurveMirrorFwd">
    <ExponentParams exponent="2.4" offset="0.055"/>
  </Exponent>
  <Matrix inBitDepth="32f" outBitDepth="32f">
    <Array dim="3 3">0.82 0.18 0 0.03 0.97 0 0.02 0.07 0.91</Array>
  </Matrix>
  <ASC_CDL inBitDepth="32f" outBitDepth="16f" style="Fwd">
    <SOPNode><Slope>1.1 1 0.9</Slope><Offset>0.01 0 -0.02</Offset><Power>0.9 1 1.1</Power></SOPNode>
    <SatNode><Saturation>1.2</Saturation></SatNode>
  </ASC_CDL>
  <LUT1D inBitDepth="16f" outBitDepth="10i"><Array dim="5 1">0 400 650 850 1023</Array></LUT1D>
</ProcessList>
"""


def _neutral(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    worst = float(np.ptp(pixels, axis=-1).max())
    return None if worst < 1e-6 else f"grey is off by {worst}"


def _ends(inputs: Mapping[str, Any], pixels: Array) -> str | None:
    got = pixels.reshape(-1, 3)
    fine = np.allclose(got[:2], [[0, 0, 0], [1, 1, 1]], atol=1e-6) and np.isnan(got[2]).all()
    return None if fine else f"expected black, white and NaN, got {got.tolist()}"


table3d = Operation(
    name="table3d",
    family="tone",
    summary="Passes colour through a three-dimensional table, as of a .cube file.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(
        Input("image", "a picture of three colours; further channels pass unchanged", channels=(3, None)),
        Input("table", "n^2 rows of n colours, red fastest", channels=(3, 3), required=False, picture=False),
    ),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    propagate=_propagate,
    wants_alpha=Alpha.STRAIGHT,
    check=_check,
    examples=(
        {"cube": MIDDLE},
        {"cube": MIDDLE, "interpolation": "trilinear"},
        {"cube": SMALL, "domain_min": [-0.5, 0, 0], "domain_max": [1, 2, 1.5]},
        {"cube": SMALL, "interpolation": "trilinear", "domain_max": [0.7, 0.8, 0.9]},
        {"clf": GRADE},
    ),
    hard_cases=(
        HardCase(
            name="grey between the nodes",
            why="tetrahedra cut another way leave the neutral axis",
            inputs=lambda: {"image": np.repeat(np.linspace(0, 1, 301, dtype=np.float32), 3).reshape(1, -1, 3)},
            parameters={"cube": MIDDLE},
            holds=_neutral,
        ),
        HardCase(
            name="outside the domain, and NaN",
            why="a place beyond the last node reads past the table; NaN as an integer is any address",
            inputs=lambda: {
                "image": np.array([-np.inf, -1e30, -1, np.inf, 3e38, 1, np.nan, 0.5, 0.5], np.float32).reshape(1, 3, 3)
            },
            parameters={"cube": SMALL},
            holds=_ends,
        ),
    ),
)


def _table(p: Parameters, inputs: Inputs) -> Array:
    """Shape (n, n, n, 3), axes blue, green, red."""
    if p.cube is not None:
        return _single(p.cube)
    pixels = inputs["table"].pixels
    size = pixels.shape[1]
    return pixels.reshape(size, size, size, 3)


@table3d.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    image = inputs["image"]
    if p.chain is not None:
        return p.chain.evaluate(image, np.float64)
    result, tetrahedral = image.pixels.copy(), p.interpolation is Interpolation.TETRAHEDRAL
    result[..., :3] = looked_up(image.pixels[..., :3], _table(p, inputs), p.domain, tetrahedral=tetrahedral)
    return result


@lru_cache(maxsize=8)
def _padded_cube(text: str) -> Array:
    return _padded(_single(text))


def _padded(table: Array) -> Array:
    padded = aligned_empty((table.size // 3, 4))
    padded[:, :3], padded[:, 3] = table.reshape(-1, 3), 0
    return padded


@table3d.method(
    "exact",
    error=_error,
    work=lambda p, knob, facts: facts["image"].pixels * (2.0 * len(p.chain.steps) if p.chain else 1.0),
    rates={"opencl": Rate(3e-4, 5.5e-9), "numpy": Rate(1e-3, 9e-8)},
)
class Exact:
    """The corners of each pixel's cell, weighted in float32; of a file of several steps, all of them in one pass."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        image = inputs["image"]
        if p.chain is not None:
            return p.chain.opencl(device, image)
        pixels = aligned(image.pixels)
        out, count = aligned_empty(pixels.shape), image.height * image.width
        table = _padded_cube(p.cube) if p.cube is not None else _padded(_table(p, inputs))
        size = round(len(table) ** (1 / 3))
        low, high = p.domain
        scale = [(size - 1) / (b - a) for a, b in zip(low, high, strict=True)]
        tetrahedral = int(p.interpolation is Interpolation.TETRAHEDRAL)
        with device.session() as session:
            session.launch(
                "tone/table3d.cl", "lookup", (-(-count // 64),),
                pixels, session.write(out), table, np.int32(size),
                aligned(np.array([*low, *high, *scale], np.float32)), np.uint64(count),
                defines={"CHANNELS": image.channels, "TETRAHEDRAL": tetrahedral},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        if p.chain is not None:
            return p.chain.evaluate(inputs["image"], np.float32)
        table, tetrahedral = _table(p, inputs).astype(np.float32), p.interpolation is Interpolation.TETRAHEDRAL

        def body(x: Array) -> Array:
            y = x.copy()
            y[..., :3] = looked_up(x[..., :3], table, p.domain, tetrahedral=tetrahedral)
            return y

        return blockwise(inputs["image"], body)
