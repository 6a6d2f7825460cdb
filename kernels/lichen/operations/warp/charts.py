"""Charts of the sphere: where an image of all directions holds each of them, and which direction each place is.

Directions have x to the right, y down and z ahead; lengths do not matter where a direction is read, and are 1 where one
is given. An image is one or more charts, each a square or a strip of it; `face` says which. A chart is defined a little
beyond its own edge, so that footprints and filters at the edge know what lies across it: `widened` gives an image
whose charts have a margin, filled with what the others show there.

* latlong: longitude across, 0 in the middle and to the right positive; latitude down, from straight up to straight
  down.
* cube: three faces in two rows: left, ahead, right; up, behind, down, with the upper and lower edges of the face ahead
  meeting the lower edge of up and the upper edge of down. cube_cross: the same faces where they meet: left, ahead,
  right and behind in the second of three rows, up above ahead, down below it; the other six cells show nothing.
  cube_pages: the same faces one below the other: right, left, up, down, ahead, behind.
* mirror_ball: a ball seen from far away along z. Its middle shows what is behind the viewer's back, its rim, all
  around, what is straight behind the ball.
* paraboloid: two discs: the half ahead, and the half behind as it is seen once one has turned around.
* fisheye: angle from z even in the radius, `view` degrees across the whole disc; beyond it, nothing.

No formula divides by what can be 0: a half is chosen before its paraboloid is, and 1 - z is taken from x and y where it
would cancel.

Sources: Debevec, Rendering synthetic objects into real scenes, SIGGRAPH 1998, for the ball; Heidrich and Seidel,
View-independent environment maps, Graphics Hardware 1998, for paraboloids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lichen.operations.warp.maps import Doubles


class Chart(StrEnum):
    """How an image holds all directions."""

    LATLONG = "latlong"
    CUBE = "cube"
    CUBE_CROSS = "cube_cross"
    CUBE_PAGES = "cube_pages"
    MIRROR_BALL = "mirror_ball"
    PARABOLOID = "paraboloid"
    FISHEYE = "fisheye"


Vectors = tuple[Doubles, Doubles, Doubles]
LAYOUT: dict[Chart, tuple[int, int]] = {
    Chart.LATLONG: (1, 1),
    Chart.CUBE: (3, 2),
    Chart.CUBE_CROSS: (4, 3),
    Chart.CUBE_PAGES: (1, 6),
    Chart.MIRROR_BALL: (1, 1),
    Chart.PARABOLOID: (2, 1),
    Chart.FISHEYE: (1, 1),
}
"""Charts across and down."""
SHAPE: dict[Chart, tuple[int, int]] = {**LAYOUT, Chart.LATLONG: (2, 1)}
"""Proportions of the whole image."""
LEFT, AHEAD, RIGHT, UP, BEHIND, DOWN, NOTHING = range(7)
FACES: dict[Chart, tuple[int, ...]] = {
    Chart.CUBE: (LEFT, AHEAD, RIGHT, UP, BEHIND, DOWN),
    Chart.CUBE_CROSS: (
        NOTHING, UP, NOTHING, NOTHING, LEFT, AHEAD, RIGHT, BEHIND, NOTHING, DOWN, NOTHING, NOTHING,
    ),
    Chart.CUBE_PAGES: (RIGHT, LEFT, UP, DOWN, AHEAD, BEHIND),
}  # fmt: skip
"""Of the cells of a cube's image, row by row."""


@dataclass(frozen=True)
class Sphere:
    """A kind of chart with what it needs to be known. In a chart, s and t run from -1 to 1 across and down."""

    chart: Chart
    view: float = 360.0
    """of a fisheye: degrees across"""

    def face(self, d: Vectors) -> Doubles:
        """The chart that holds a direction."""
        x, y, z = d
        if self.chart is Chart.PARABOLOID:
            return np.where(z >= 0, 0, 1)
        if self.chart not in FACES:
            return np.zeros(np.shape(x), np.int64)
        ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
        side = np.where(x >= 0, RIGHT, LEFT)
        upright = np.where(y >= 0, DOWN, UP)
        along = np.where(z >= 0, AHEAD, BEHIND)
        cells = np.array([FACES[self.chart].index(each) for each in range(NOTHING)])
        return cells[np.where((az >= ax) & (az >= ay), along, np.where(ax >= ay, side, upright))]

    def place(self, d: Vectors, face: Doubles) -> tuple[Doubles, Doubles]:
        """s and t of a direction in a chart; NaN where the chart, however far it is widened, does not hold it."""
        x, y, z = d
        match self.chart:
            case Chart.LATLONG:
                return np.arctan2(x, z) / math.pi, np.arctan2(y, np.hypot(x, z)) / (math.pi / 2)
            case Chart.CUBE | Chart.CUBE_CROSS | Chart.CUBE_PAGES:
                return _on_cube(d, self._faces(face))
            case Chart.PARABOLOID:
                length = np.sqrt(x * x + y * y + z * z)
                turned = np.where(face == 0, 1.0, -1.0)
                below = length + turned * z
                good = below > 1e-6 * length
                below = np.where(good, below, np.nan)
                return turned * x / below, y / below
            case Chart.MIRROR_BALL:
                length = np.sqrt(x * x + y * y + z * z)
                flat = x * x + y * y
                less = np.where(z > 0, flat / (length + np.abs(z)), length - z)  # 1 - z, without its difference
                normal = np.sqrt(2 * less * length)
                rim = normal == 0
                safe = np.where(rim, 1.0, normal)
                return np.where(rim, 1.0, x / safe), np.where(rim, 0.0, y / safe)
            case _:
                across = np.hypot(x, y)
                angle = np.arctan2(across, z) / math.radians(self.view / 2)
                middle = across == 0
                safe = np.where(middle, 1.0, across)
                return np.where(middle, angle, angle * x / safe), np.where(middle, 0.0, angle * y / safe)

    def holds(self, s: Doubles, t: Doubles, face: Doubles | None = None) -> Doubles:
        """Whether a place belongs to its chart; where `face` is given, whether that is one at all."""
        if self.chart is Chart.LATLONG or self.chart in FACES:
            square: Doubles = (np.abs(s) <= 1) & (np.abs(t) <= 1)
            return square if face is None or self.chart not in FACES else square & self.shows(face)
        disc: Doubles = s * s + t * t <= 1
        return disc

    def shows(self, face: Doubles) -> Doubles:
        """Whether a cell of the image holds directions."""
        shown: Doubles = self._faces(face) != NOTHING if self.chart in FACES else np.ones(np.shape(face), bool)
        return shown

    def _faces(self, cell: Doubles) -> Doubles:
        """The faces of a cube that cells show."""
        return np.array(FACES[self.chart])[np.asarray(cell, np.int64)]

    def direction(self, s: Doubles, t: Doubles, face: Doubles) -> Vectors:
        """The direction at a place, also beyond the chart's edge; NaN where there is none."""
        match self.chart:
            case Chart.LATLONG:
                longitude, latitude = math.pi * s, math.pi / 2 * t
                c = np.cos(latitude)
                return c * np.sin(longitude), np.sin(latitude) + 0 * longitude, c * np.cos(longitude)
            case Chart.CUBE | Chart.CUBE_CROSS | Chart.CUBE_PAGES:
                return _from_cube(s, t, self._faces(face))
            case Chart.PARABOLOID:
                rr = s * s + t * t
                turned = np.where(face == 0, 1.0, -1.0)
                return turned * 2 * s / (1 + rr), 2 * t / (1 + rr), turned * (1 - rr) / (1 + rr)
            case Chart.MIRROR_BALL:
                rr = s * s + t * t
                depth = np.sqrt(np.where(rr <= 1, 1 - rr, np.nan))
                return 2 * depth * s, 2 * depth * t, 2 * rr - 1 + 0 * depth
            case _:
                r = np.hypot(s, t)
                angle = math.radians(self.view / 2) * np.where(r <= 1, r, np.nan)
                along = np.where(r > 0, np.sin(angle) / np.where(r > 0, r, 1.0), math.radians(self.view / 2))
                return along * s, along * t, np.cos(angle)


def _on_cube(d: Vectors, face: Doubles) -> tuple[Doubles, Doubles]:
    """Central projection onto a face's plane; NaN for what lies behind it."""
    x, y, z = d
    depth = np.select([face == AHEAD, face == BEHIND, face == RIGHT, face == LEFT, face == DOWN], [z, -z, x, -x, y], -y)
    across = np.select([face == BEHIND, face == RIGHT, face == LEFT], [-x, -z, z], x)
    down = np.select([face == UP, face == DOWN], [z, -z], y)
    size = np.abs(x) + np.abs(y) + np.abs(z)
    depth = np.where((depth > 1e-6 * size) & (face != NOTHING), depth, np.nan)
    return across / depth, down / depth


def _from_cube(s: Doubles, t: Doubles, face: Doubles) -> Vectors:
    s, t, face = np.broadcast_arrays(s, t, face)
    one = np.ones_like(s)
    x = np.select([face == AHEAD, face == BEHIND, face == RIGHT, face == LEFT], [s, -s, one, -one], s)
    y = np.select([face == UP, face == DOWN], [-one, one], t)
    z = np.select([face == AHEAD, face == BEHIND, face == RIGHT, face == LEFT, face == UP], [one, -one, -s, s, t], -t)
    length = np.sqrt(x * x + y * y + z * z)
    length = np.where(length > 0, length, np.nan)  # the middle of a cell without a face
    return x / length, y / length, z / length
