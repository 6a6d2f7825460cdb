"""The parameters that noises share."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent
from lichen.operation import Facts, InputFacts, OperationParameters

Cell = Annotated[float, Field(ge=1e-6, le=1e6)]
Place = Annotated[float, Field(ge=-1e12, le=1e12)]
Level = Annotated[float, Field(ge=-1e6, le=1e6)]


class Fractal(StrEnum):
    """How octaves n_k, each in [-1, 1], become one; a_k = gain^k over the sum of all of them."""

    NONE = "none"
    """n_0 alone"""
    FBM = "fbm"
    """sum a_k n_k"""
    TURBULENCE = "turbulence"
    """sum a_k |n_k|, in [0, 1]"""
    BILLOW = "billow"
    """sum a_k (2 |n_k| - 1)"""
    RIDGED = "ridged"
    """2 sum a_k s_k - 1 with s_k = w_k (1 - |n_k|)^2, w_0 = 1 and w_k+1 = min(2 s_k, 1)"""


class Output(StrEnum):
    """What the picture holds."""

    VALUE = "value"
    """the noise, one channel"""
    DERIVATIVES = "derivatives"
    """three channels: the noise and its derivatives along x and y, per px"""


class Generated(OperationParameters):
    """Of every picture that comes out of nothing."""

    width: int = Field(512, ge=1, le=16384, description="of the picture", json_schema_extra={"unit": "px"})
    height: int = Field(512, ge=1, le=16384, description="of the picture", json_schema_extra={"unit": "px"})
    seed: int = Field(0, ge=0, le=2**32 - 1, description="which of the noises")
    low: Level = Field(0.0, description="what noise of -1 becomes")
    high: Level = Field(1.0, description="what noise of +1 becomes")

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2

    @property
    def half(self) -> float:
        """What noise of 1 adds to the middle."""
        return (self.high - self.low) / 2

    def facts(self, reach: float = 1.0, slack: float = 0.0, channels: int = 1) -> Facts:
        """Of a picture whose noise lies in [-reach, reach], give or take `slack` of the output."""
        far = abs(self.half) * reach + slack
        return Facts(self.height, self.width, channels, extent=Extent(self.middle - far, self.middle + far, 0))


class Placed(Generated):
    """Of noises that lie in a plane of cells."""

    cell: Cell | tuple[Cell, Cell] = Field(
        64.0, description="side of a cell, or its sides along x and y", json_schema_extra={"unit": "px"}
    )
    x: Place = Field(0.0, description="of the picture's left edge", json_schema_extra={"unit": "px"})
    y: Place = Field(0.0, description="of the picture's upper edge", json_schema_extra={"unit": "px"})
    tile: bool = Field(
        False, description="whether the picture repeats without a seam; a whole number of cells is fitted into it"
    )

    @property
    def cells(self) -> tuple[float, float]:
        """Sides of a cell along x and y, px."""
        return self.cell if isinstance(self.cell, tuple) else (self.cell, self.cell)


class LatticeParameters(Placed):
    """Of noises that sum octaves of a lattice."""

    fractal: Fractal = Field(Fractal.FBM, description="how octaves are summed")
    octaves: int = Field(6, ge=0, le=30, description="octaves at most; 0 gives the middle")
    lacunarity: float = Field(2.0, ge=1, le=16, description="from one octave's frequency to the next one's")
    gain: float = Field(0.5, ge=0, le=8, description="from one octave's amplitude to the next one's; lacunarity^-H")
    antialias: bool = Field(
        True, description="whether octaves that pixels cannot show are replaced by their mean, the last one fading"
    )
    warp: float = Field(
        0.0,
        ge=0,
        le=16384,
        description="how far places are moved by two more such noises",
        json_schema_extra={"unit": "px"},
    )
    dimensions: int = Field(2, ge=2, le=4, description="of the noise; beyond two, the picture is a slice at z and w")
    z: float = Field(0.0, ge=-1e9, le=1e9, description="third coordinate, in cells: time, or depth")
    w: float = Field(0.0, ge=-1e9, le=1e9, description="fourth coordinate, in cells")
    loop: int = Field(0, ge=0, le=65536, description="cells of z after which the noise comes again; 0: never")
    output: Output = Field(Output.VALUE, description="the noise alone, or its derivatives with it")

    @property
    def channels(self) -> int:
        return 3 if self.output is Output.DERIVATIVES else 1

    @property
    def asked(self) -> int:
        """Octaves that the definition has."""
        return min(self.octaves, 1) if self.fractal is Fractal.NONE else self.octaves

    @property
    def folds(self) -> bool:
        """Whether octaves go in by their magnitude, which has a crease where they are 0."""
        return self.fractal in (Fractal.TURBULENCE, Fractal.BILLOW, Fractal.RIDGED)


def no_inputs(p: OperationParameters, facts: InputFacts) -> str:
    """Why there are no tiles of pictures that have no source."""
    return "the picture comes from its parameters alone"


def unused(p: LatticeParameters) -> list[Flaw]:
    """Coordinates that the noise does not have."""
    given = (("z", p.z, 3), ("loop", p.loop, 3), ("w", p.w, 4))
    return [
        Flaw(f"/parameters/{name}", f"needs {needed} dimensions (there are {p.dimensions})")
        for name, value, needed in given
        if value and p.dimensions < needed
    ]
