"""A camera, or a light that sees: where it stands, how it looks, and what it does to points.

Right-handed, the camera looking along its own -z, x to the right, y up. A pixel of column i and row j of W x H looks
through (x, y), x = (2 (i + 1/2) / W - 1) s W / H, y = (1 - 2 (j + 1/2) / H) s. In perspective s = tan(fov / 2) and the
ray from the eye runs along x right + y up - back; without (`extent` given) s = extent / 2 and rays run along -back
from the eye moved by x right + y up. A ray's parameter is in both the planar depth.

Source: M. Pharr, W. Jakob, G. Humphreys, Physically based rendering, 4th edition, 2023, chapter 5.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.memory import Array
from lichen.operation import Degrees, OperationParameters

Place = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Place, Place, Place]


class Camera(OperationParameters):
    """Where a camera is and how it looks."""

    eye: Vector = (0.0, 0.0, 0.0)
    """where it stands"""
    target: Vector = (0.0, 0.0, -1.0)
    """what it looks at; not the eye"""
    up: Vector = (0.0, 1.0, 0.0)
    """what is up in its picture, roughly; not the viewing direction"""
    fov: Degrees = Field(50.0, ge=0.01, le=175)
    """vertical angle of view"""
    extent: float | None = Field(None, ge=1e-6, le=1e6)
    """without perspective: the height of what it sees"""

    def camera_flaws(self, where: str = "/parameters") -> list[Flaw]:
        """What is wrong with its directions."""
        if self.eye == self.target:
            return [Flaw(f"{where}/target", "is the eye")]
        back = np.subtract(self.eye, self.target)
        across = np.cross(self.up, back)
        if float(np.dot(across, across)) <= 1e-18 * float(np.dot(self.up, self.up) * np.dot(back, back)):
            return [Flaw(f"{where}/up", "is the viewing direction")]
        return []

    def axes(self) -> Array:
        """Rows right, up and back, orthonormal; float64 (3, 3). Takes directions of the world to the camera's axes."""
        return _axes(self.eye, self.target, self.up)

    @property
    def scale(self) -> float:
        """s of the module's text."""
        return math.tan(math.radians(self.fov) / 2) if self.extent is None else self.extent / 2

    def sights(self, height: int, width: int) -> tuple[Array, Array]:
        """x of every column and y of every row; float64 (width,), (height,)."""
        x = (2 * (np.arange(width) + 0.5) / width - 1) * (self.scale * width / height)
        return x, (1 - 2 * (np.arange(height) + 0.5) / height) * self.scale

    def to_pixels(self, height: int, width: int) -> Array:
        """The matrix (4, 4) that takes (point, 1) of the world to (u w, v w, z w, w): u and v in pixels from the upper
        left corner, z the planar depth times w, and w the depth in perspective, else 1."""
        axes = self.axes()
        moved = np.concatenate([axes, -(axes @ np.array(self.eye))[:, None]], axis=1)
        depth, one = -moved[2], np.array([0.0, 0.0, 0.0, 1.0])
        w = one if self.extent is not None else depth
        per = height / (2 * self.scale)
        u = width / 2 * w + per * moved[0]
        v = height / 2 * w - per * moved[1]
        return np.stack([u, v, depth, w])


@lru_cache(maxsize=256)
def _axes(eye: Vector, target: Vector, up: Vector) -> Array:
    back = _unit(np.subtract(eye, target))
    right = _unit(np.cross(_unit(np.array(up, np.float64)), back))
    made = np.stack([right, np.cross(back, right), back])
    made.flags.writeable = False
    return made


def _unit(vector: Array) -> Array:
    """Of length 1; scaled first, so that nothing overflows."""
    made = np.asarray(vector, np.float64) / float(np.abs(vector).max())
    return np.asarray(made / math.sqrt(float(np.sum(made * made))))
