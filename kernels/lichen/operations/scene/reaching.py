"""What a lamp can give in a tile at most, from a box around the tile's points and one around its normals.

Of each lamp and tile, in this order, nothing arrives where

    1  nothing is there: every position is infinite
    2  all of the box lies outside the lamp's cone, or behind it
    3  every normal faces away from it: with a normal n of one box and a way l to the lamp of the other, each component
       of the sum <n, l> is at most the largest of four products

and otherwise no more than

    t  strength  reflected,    strength = brightness / (a + b s + c s^2),    s^2 = distance^2 + radius^2

with the box's least distance from the lamp, the largest share of light that surfaces send on, and the most that comes
through the fog before the box: that of the nearest distance through the thinnest layer between the heights of eye and
box. Lamps of which that is little are left out, the faintest first, as long as all of them together give no more than
`faint`: because of the fog (4) where they would have given more without it, else for their distance (5).

An environment gives as much everywhere, and is left out where nothing is and for the fog, as one more lamp would be.

Everything is counted in doubles from float32 boxes. Margins cover the roundings of the float32 arithmetic that is left
out: 1e-5 of a sum's terms, a thousandth of a radian, and 1e-5 of what comes through.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operations.fog.parameters import Kind as FogKind
from lichen.operations.fog.parameters import Parameters as Fog
from lichen.operations.lighting.lamps import TURNED, WIDE, Kind, Lamp, unit_vector

REASONS = (
    "it is computed",
    "nothing is there",
    "it lies outside the lamp's cone",
    "it faces away from the lamp",
    "fog hides it",
    "the lamp is too far away",
)
NOTHING, BESIDE, AWAY, FOGGED, FAR = range(1, 6)
WIDEST = 85.0
"""Degrees; wider cones are not looked at."""
UNDERFLOW = 1e-38
"""Less comes through as nothing."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Around the finite points of every tile, and around their normals; each float64 (tiles, 3)."""

    low: Array
    high: Array
    least: Array
    most: Array
    spoilt: Array
    """whether something is not a number, so that nothing may be left out"""

    @classmethod
    def of(cls, found: Array) -> Boxes:
        """From rows of twelve bounds and a count of what is spoilt."""
        wide = found.astype(np.float64)
        return cls(wide[:, 0:3], wide[:, 3:6], wide[:, 6:9], wide[:, 9:12], wide[:, 12] > 0)

    @property
    def empty(self) -> Array:
        return np.asarray((self.low > self.high).any(axis=1))

    def some(self, which: Array) -> Boxes:
        return Boxes(self.low[which], self.high[which], self.least[which], self.most[which], self.spoilt[which])

    def distance(self, place: Array) -> Array:
        """The least from a place, (tiles,)."""
        off = np.maximum(np.maximum(self.low - place, place - self.high), 0)
        return np.asarray(np.sqrt(np.sum(off * off, axis=1)))

    def ahead(self, axis: Array, place: Array) -> Array:
        """The largest distance along each axis (k, 3), counted from its place: (tiles, k)."""
        made = np.zeros((len(self.low), len(axis)))
        for c in range(3):
            low, high = (end[:, c, None] - place[:, c] for end in (self.low, self.high))
            made += np.maximum(low * axis[:, c], high * axis[:, c])
        return made

    @property
    def size(self) -> Array:
        """The largest coordinate."""
        return np.asarray(np.maximum(np.abs(self.low), np.abs(self.high)).max(axis=1))


@dataclass(frozen=True, eq=False)
class Lamps:
    """All lamps as arrays, (lamps,) or (lamps, 3): kinds, middles, axes, and how far each reaches from its middle."""

    kind: Array
    place: Array
    axis: Array
    half: Array
    outer: Array
    brightest: Array
    square: Array
    falloff: Array

    @classmethod
    def of(cls, lamps: tuple[Lamp, ...]) -> Lamps:
        direction = np.array([lamp.direction for lamp in lamps], np.float64)
        direction = direction / np.abs(direction).max(axis=1, keepdims=True)
        return cls(
            np.array([lamp.kind for lamp in lamps]),
            np.array([lamp.position for lamp in lamps]),
            direction / np.sqrt(np.sum(direction * direction, axis=1, keepdims=True)),
            np.array([math.hypot(*lamp.size) / 2 if lamp.kind in WIDE else 0.0 for lamp in lamps]),
            np.array([lamp.outer for lamp in lamps]),
            np.array([max(lamp.colour) * lamp.intensity for lamp in lamps]),
            np.array([lamp.reach**2 for lamp in lamps]),
            np.array([lamp.falloff for lamp in lamps]).T,
        )

    @property
    def far(self) -> Array:
        """Which of them shine the same everywhere."""
        return np.asarray(self.kind == Kind.DIRECTIONAL)

    def some(self, which: Array) -> Lamps:
        return Lamps(
            self.kind[which], self.place[which], self.axis[which], self.half[which], self.outer[which],
            self.brightest[which], self.square[which], self.falloff[:, which],
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sky:
    """An environment: the largest light it adds to a pixel, and whether it is seen where there is no surface."""

    brightest: float
    behind: bool


def reached(
    boxes: Boxes, lamps: Lamps, fog: Fog | None, reflected: float | None, faint: float, sky: Sky | None = None
) -> Array:
    """Reasons and bounds, float64 (tiles, 2 effects): why each lamp is left out, and the sky after them, or 0, and by
    how much that is wrong."""
    lit = len(lamps.kind)
    count = lit + (sky is not None)
    made = np.zeros((len(boxes.low), 2 * count))
    made[boxes.empty & ~boxes.spoilt, : lit if sky is None or sky.behind else count] = NOTHING
    seen = np.flatnonzero(~boxes.empty & ~boxes.spoilt)
    if not seen.size:
        return made
    some = boxes.some(seen)
    why = np.zeros((len(seen), lit), np.int64)
    for kinds, beside in (((Kind.SPOT,), _outside_cones), (TURNED, _behind)):
        which = np.flatnonzero(np.isin(lamps.kind, kinds))
        if which.size:
            why[:, which] = np.where(beside(lamps.some(which), some), BESIDE, why[:, which])
    left = np.nonzero(why == 0)
    pairs = left if 4 * left[0].size < why.size else np.ix_(*map(np.arange, why.shape))
    why[pairs] = np.where(_faces_away(lamps, some, *pairs) & (why[pairs] == 0), AWAY, why[pairs])
    through = np.ones((len(seen), 1)) if fog is None else comes_through(fog, some)[:, None]
    plain = _strongest(lamps, some) * reflected if reflected is not None and faint else _unknown(lamps, some)
    if sky is not None:
        why = np.column_stack([why, np.zeros(len(seen), np.int64)])
        plain = np.column_stack([plain, np.full(len(seen), sky.brightest)])
    with np.errstate(invalid="ignore"):
        most = np.where((why > 0) | (through == 0), 0.0, plain * through)
    new = _little(most, faint) & (why == 0)
    why[new] = np.where(plain > faint / count, FOGGED, FAR)[new]
    made[seen, :count], made[seen, count:] = why, np.where(new, most, 0.0)
    return made


def _unknown(lamps: Lamps, boxes: Boxes) -> Array:
    """What each lamp gives where nothing is known but that black ones give nothing."""
    return np.broadcast_to(np.where(lamps.brightest > 0, math.inf, 0.0), (len(boxes.low), len(lamps.kind)))


def _little(most: Array, faint: float) -> Array:
    """Which lamps, the faintest first, amount to no more than `faint` in a tile."""
    made: Array = most == 0
    rows = np.flatnonzero(((most > 0) & (most <= faint)).any(axis=1))
    if rows.size:
        order = np.argsort(most[rows], axis=1, kind="stable")
        together = np.cumsum(np.take_along_axis(most[rows], order, axis=1), axis=1)
        little = np.zeros(order.shape, bool)
        np.put_along_axis(little, order, together <= faint, axis=1)
        made[rows] |= little
    return made


def _faces_away(lamps: Lamps, boxes: Boxes, tile: Array, lamp: Array) -> Array:
    """Whether no normal of a tile faces a lamp, for these indices of both."""
    far = lamps.far
    near, half = np.where(far, 0.0, 1.0)[lamp], lamps.half[lamp]
    largest, normals = 0.0, np.zeros(len(boxes.low))
    for c in range(3):
        direct = np.where(far, -lamps.axis[:, c], lamps.place[:, c])[lamp]
        least, most = boxes.least[:, c], boxes.most[:, c]
        low, high = direct - half - boxes.high[tile, c] * near, direct + half - boxes.low[tile, c] * near
        at_least, at_most = (np.maximum(normal[tile] * low, normal[tile] * high) for normal in (least, most))
        largest = largest + np.maximum(at_least, at_most)
        normals += np.maximum(np.abs(least), np.abs(most))
    slack = normals[tile] * (1 + near * (boxes.size[tile] + np.abs(lamps.place).max(axis=1)[lamp]))
    return np.asarray(largest < -1e-5 * slack)


def _behind(lamps: Lamps, boxes: Boxes) -> Array:
    """Which lamps of those that shine to one side have all of a tile behind them."""
    ahead = boxes.ahead(lamps.axis, lamps.place)
    return np.asarray(ahead < -1e-5 * (boxes.size[:, None] + np.abs(lamps.place).max(axis=1)))


def _outside_cones(lamps: Lamps, boxes: Boxes) -> Array:
    """Which spots leave the ball around a tile in the dark."""
    outer = np.radians(lamps.outer) + 1e-3
    middle, radius = (boxes.low + boxes.high) / 2, np.linalg.norm(boxes.high - boxes.low, axis=1) / 2
    square, ahead = np.zeros((2, len(middle), len(outer)))
    for c in range(3):
        to = middle[:, c, None] - lamps.place[:, c]
        square += to * to
        ahead += to * lamps.axis[:, c]
    side = np.sqrt(np.maximum(square - ahead * ahead, 0))
    outside = np.cos(outer) * side - np.sin(outer) * ahead > radius[:, None] * 1.00001
    return np.asarray(outside & (lamps.outer <= WIDEST))


def _strongest(lamps: Lamps, boxes: Boxes) -> Array:
    """The largest radiance that each lamp gives a white diffuse surface in each tile."""
    off = np.zeros((len(boxes.low), len(lamps.kind)))
    for c in range(3):
        place = lamps.place[:, c]
        off += np.maximum(np.maximum(boxes.low[:, c, None] - place, place - boxes.high[:, c, None]), 0) ** 2
    slack = lamps.half + 1e-6 * (boxes.size[:, None] + np.abs(lamps.place).max(axis=1))
    square = np.maximum(np.sqrt(off) - slack, 0) ** 2 + lamps.square
    a, b, c_ = lamps.falloff
    falls = np.where(lamps.far, 1.0, a + b * np.sqrt(square) + c_ * square)
    return np.asarray(1.00001 * lamps.brightest / falls)


def comes_through(fog: Fog, boxes: Boxes) -> Array:
    """The largest share of light that fog lets through before each box."""
    eye, size = np.array(fog.eye), boxes.size + np.abs(fog.eye).max()
    if fog.distance == "planar":
        axis = unit_vector(fog.forward)
        way = -boxes.ahead(-axis[None], eye[None])[:, 0]
    else:
        way = boxes.distance(eye)
    way = np.maximum(way - 1e-5 * size, 0)
    if fog.kind is FogKind.LINEAR:
        share = np.clip((fog.end - way) / (fog.end - fog.start) + 1e-5, 0, 1)
        return np.asarray(np.where(way > fog.end * 1.00001, 0.0, share))
    deep = fog.density * way
    deep *= deep if fog.kind is FogKind.SQUARED else _thinnest(fog, boxes, eye)
    share = np.minimum(np.exp(-0.99999 * deep) * 1.00001, 1.0)
    return np.asarray(np.where(share < UNDERFLOW, 0.0, share))


def _thinnest(fog: Fog, boxes: Boxes, eye: Array) -> Array:
    """The least density, relative to that of the fog, between the heights of eye and box."""
    up = unit_vector(fog.up)
    here = float(up @ eye)
    margin = 1e-5 * (boxes.size + np.abs(eye).max())
    low = np.minimum(here, here - boxes.ahead(-up[None], eye[None])[:, 0]) - margin
    high = np.maximum(here, here + boxes.ahead(up[None], eye[None])[:, 0]) + margin
    if fog.kind is FogKind.HEIGHT:
        return np.asarray(np.exp(np.minimum(-(high - fog.base) / fog.falloff, 700.0)))
    if fog.kind is not FogKind.LAYERED:
        return np.ones(len(low))
    at, of = np.array(fog.heights), np.array(fog.densities)
    ends = np.minimum(np.interp(low, at, of), np.interp(high, at, of))
    inside = (at >= low[:, None]) & (at <= high[:, None])
    return np.asarray(np.minimum(ends, np.where(inside, of, np.inf).min(axis=1)))
