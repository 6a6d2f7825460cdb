"""What stands in a scene: spheres, planes, boxes, blobs and terrain, each with what it is made of.

Every object is one kind and its measures. Blobs are unions of balls whose distances are joined smoothly over
`smooth`: the polynomial smooth minimum min(a, b) - h^2 k / 4, h = max(k - |a - b|, 0) / k, which no distance grows
faster than, so that marching by it never passes the surface (I. Quilez, Smooth minimum, 2013). Terrain is a square grid
of heights over x and z, each cell of two triangles.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from lichen.operation import Degrees, OperationParameters
from lichen.operations.scene.camera import Place, Vector

Share = Annotated[float, Field(ge=0, le=1)]
Light = Annotated[float, Field(ge=0, le=1e6)]
Colour = tuple[Light, Light, Light]
Length = Annotated[float, Field(gt=0, le=1e6)]
Ball = tuple[
    Annotated[float, Field(ge=-1e6, le=1e6)], Annotated[float, Field(ge=-1e6, le=1e6)],
    Annotated[float, Field(ge=-1e6, le=1e6)], Length,
]  # fmt: skip


class Material(OperationParameters):
    """What an object is made of."""

    albedo: Colour = (0.8, 0.8, 0.8)
    """what it reflects of light, linear"""
    checker: Colour | None = None
    """the other colour of a checkerboard in space"""
    check: Length = 1.0
    """the side of its fields"""
    roughness: Share = 0.5
    """of its surface: 0 a mirror, 1 dull"""
    id: int = Field(1, ge=0, le=65535)
    """what the mask shows of it; 0 is nothing"""
    emissive: Share = 0.0
    """how much of it shines through fog"""
    velocity: Vector = (0.0, 0.0, 0.0)
    """how far it moves from the frame before to this one"""


class Sphere(Material):
    """All points at a distance from a centre."""

    shape: Literal["sphere"] = "sphere"
    """what it is"""
    centre: Vector = (0.0, 0.0, 0.0)
    """its middle"""
    radius: Length = 1.0
    """its size"""


class Plane(Material):
    """A plane without an end."""

    shape: Literal["plane"] = "plane"
    """what it is"""
    point: Vector = (0.0, 0.0, 0.0)
    """a point of it"""
    normal: Vector = (0.0, 1.0, 0.0)
    """the direction across it; any length but 0"""


class Box(Material):
    """A box, turned about the vertical axis."""

    shape: Literal["box"] = "box"
    """what it is"""
    centre: Vector = (0.0, 0.0, 0.0)
    """its middle"""
    size: tuple[Length, Length, Length] = (1.0, 1.0, 1.0)
    """its sides"""
    turn: Degrees = Field(0.0, ge=-360, le=360)
    """to the left, seen from above"""


class Blob(Material):
    """A smooth union of balls."""

    shape: Literal["blob"] = "blob"
    """what it is"""
    balls: Annotated[tuple[Ball, ...], Field(min_length=1, max_length=64)] = ((0.0, 0.0, 0.0, 1.0),)
    """x, y, z and radius of each"""
    smooth: Length = 0.5
    """over what difference of distances they are joined"""


Row = Annotated[tuple[Place, ...], Field(min_length=2, max_length=64)]


class Terrain(Material):
    """Heights over a rectangle of x and z; between them triangles, two in each cell."""

    shape: Literal["terrain"] = "terrain"
    """what it is"""
    corner: Vector = (-1.0, 0.0, -1.0)
    """the corner with the smallest x and z; heights are added to its y"""
    size: tuple[Length, Length] = (2.0, 2.0)
    """along x and z"""
    heights: Annotated[tuple[Row, ...], Field(min_length=2, max_length=64)] = ((0.0, 0.0), (0.0, 0.0))
    """rows along x, from the smallest z on, all of one length"""

    @field_validator("heights")
    @classmethod
    def _even(cls, rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if len({len(each) for each in rows}) > 1:
            raise ValueError("rows must be of one length")
        return rows


Object = Annotated[Sphere | Plane | Box | Blob | Terrain, Field(discriminator="shape")]
