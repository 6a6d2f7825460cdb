"""How a camera's pixels become rays, and stored depths become distances: what the operations on depth share.

Camera space is right-handed: the eye at the origin, x to the right, y up, looking along -z. A pixel in column i and row
j of a picture of W x H px looks along (x, y, -1), with

    x = (2 (i + 1/2) / W - 1) t W / H,    y = (1 - 2 (j + 1/2) / H) t,    t = tan(fov / 2)

so a point of planar depth z lies at z (x, y, -1), and its distance from the eye is z sqrt(1 + x^2 + y^2). Depths are

    planar      z itself, +inf where there is nothing
    euclidean   the distance from the eye
    window      0 at `near`, 1 at `far`: z = near far / (far - d (far - near)), or near / (1 - d) without a far end
    reversed    1 at `near`, 0 at `far`: z = near far / (near + d (far - near)), or near / d

Where three channels are given in place of one, they are points, in any axes. What a window's depth places at infinity
or beyond, where the divisor is not positive, is infinitely far. A negative z lies behind the eye. NaN stays.

Source: E. Lengyel, Mathematics for 3D game programming and computer graphics, 2011, section 5.5.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Image
from lichen.memory import Array
from lichen.operation import Degrees, Facts, OperationParameters

FLOAT_MAX = float(np.finfo(np.float32).max)


class DepthKind(StrEnum):
    """What a depth buffer holds."""

    PLANAR = "planar"
    EUCLIDEAN = "euclidean"
    WINDOW = "window"
    REVERSED = "reversed"


class View(OperationParameters):
    """Parameters of operations that read depth."""

    fov: Degrees = Field(50.0, ge=0.01, le=175)
    """the camera's vertical angle of view"""
    depth_kind: DepthKind = DepthKind.PLANAR
    """planar: along the viewing direction; euclidean: from the eye; window: 0 at near, 1 at far; reversed: 1 to 0"""
    near: float = Field(0.1, gt=0, le=1e9)
    """of a window's depth"""
    far: float | None = Field(None, gt=0, le=1e12)
    """of a window's depth; none: infinitely far"""

    def depth_flaws(self) -> list[Flaw]:
        """What is wrong with the depth's ends."""
        if self.far is None or self.far > self.near:
            return []
        return [Flaw("/parameters/far", f"must lie beyond near, {self.near:g} (got {self.far:g})")]


def pointed(given: Image | Facts) -> bool:
    """Whether what is given as depth is points: of three channels. Of fewer, the first is depth."""
    return given.channels == 3


def tangents(p: View, height: int, width: int) -> tuple[float, float]:
    """x and y of the ray through the middle of the right and of the upper edge."""
    t = math.tan(math.radians(p.fov) / 2)
    return t * width / height, t


def rays(p: View, height: int, width: int) -> tuple[Array, Array]:
    """x of every column, shape (1, width), and y of every row, shape (height, 1); float64."""
    across, up = tangents(p, height, width)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * across
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * up
    return x[None, :], y[:, None]


def planar(depth: Array, p: View, x: Array, y: Array) -> Array:
    """Planar depths of stored ones, float64 of one shape with x and y; infinite where float32 holds no such number."""
    if p.depth_kind is DepthKind.PLANAR:
        return depth
    with np.errstate(all="ignore"):
        if p.depth_kind is DepthKind.EUCLIDEAN:
            made: Array = depth / np.sqrt(1 + x * x + y * y)
            return made
        scale, divisor = window_terms(p)
        below = divisor[0] + divisor[1] * depth
        made = scale / below
        return np.where((below <= 0) | (made > FLOAT_MAX), np.inf, made)


def window_terms(p: View) -> tuple[float, tuple[float, float]]:
    """s and (a, b) with z = s / (a + b d), of a window's depth."""
    if p.far is None:
        return p.near, ((1.0, -1.0) if p.depth_kind is DepthKind.WINDOW else (0.0, 1.0))
    apart = p.far - p.near
    return p.near * p.far, ((p.far, -apart) if p.depth_kind is DepthKind.WINDOW else (p.near, apart))


def farthest(p: View, low: float, high: float, height: int, width: int) -> float:
    """The largest finite distance from the eye that depths in [low, high] may stand for; infinite where it has none."""
    across, up = tangents(p, height, width)
    corner = math.sqrt(1 + across * across + up * up)
    if p.depth_kind is DepthKind.PLANAR:
        return max(high, 0.0) * corner
    if p.depth_kind is DepthKind.EUCLIDEAN:
        return max(high, 0.0)
    scale, (a, b) = window_terms(p)
    least = min(a + b * low, a + b * high)
    return scale / least * corner if least > 0 else math.inf
