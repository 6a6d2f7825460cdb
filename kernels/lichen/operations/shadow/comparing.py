"""Which share of a light reaches a point: the definition of shadow, in doubles, and its NumPy body.

shadow.cl does the same operations in the same order, so that both give the same bits and no pixel falls on the other
side of a shadow's edge.

A texel of the map compares its own depth with that of the receiver. Where the receiver's normal is known, that is the
depth at which the ray through the texel's middle meets the receiver's tangent plane, or the receiver's own, whichever
is nearer to the light: a slope then needs no bias at all, however wide the filter. For the plane n (x - P) = 0 and the
ray O + t D that depth is n (P - O) / (n D), and n D < 0 where the plane faces the light, so t <= m is n (P - O) >= m n
D: no division. Without normals, the receiver is as much nearer as `slope` allows within the distance of the texel's
middle.

A hollow lies before its tangent plane, and a crease at once: half a texel is given for each texel away, so shadows
begin that much late, which is less than the map resolves.

What is left is the depths' quantum: positions and maps are float32, whose coordinates are off by 2^-24 of themselves
and whose sums by as much again; 2^-21 of the coordinates' magnitudes is allowed for. A map stored in few bits adds its
step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operation import Inputs
from lichen.operations.scene.view import planar, pointed, rays
from lichen.operations.shadow.parameters import Kind, MapKind, Outside, Parameters
from lichen.operations.shadow.storing import WHOLE, Stored

QUANTUM = 2.0**-21
BEND = 1 / 2
"""Texels by which a hollow may lie before a tangent plane, for each texel away."""
MARGIN = 64.0
"""Texels beyond the map's edge from which on no filter reaches it."""


@dataclass(frozen=True, slots=True, eq=False)
class Receivers:
    """Points as the light sees them; arrays of one shape, float64."""

    u: Array
    v: Array
    z: Array
    quantum: Array
    bend: Array
    """by how much a surface may be nearer to the light than its tangent plane, a texel away"""
    plane: tuple[Array, Array, Array, Array] | None
    """n (P - E), n times minus back, and the changes of it for a texel to the right and down"""
    reaches: Array
    """whether the map can say anything of the point"""
    missing: Array
    """what is known of it otherwise: NaN, or a share"""


def points(inputs: Inputs, p: Parameters, rows: slice) -> tuple[Array, Array, Array]:
    """x, y and z of the receivers of some rows."""
    depth = inputs["depth"]
    if pointed(depth):
        x, y, z = (depth.pixels[rows, :, k].astype(np.float64) for k in range(3))
        return x, y, z
    across, up = rays(p, depth.height, depth.width)
    up = up[rows]
    z = planar(depth.pixels[rows, :, 0].astype(np.float64), p, across, up)
    return across * z, up * z, -z


def receivers(inputs: Inputs, p: Parameters, rows: slice) -> Receivers:
    """Points in the map's texels, with what their comparison needs."""
    x, y, z = points(inputs, p, rows)
    depths = inputs["map"]
    light, (height, width) = p.light, (depths.height, depths.width)
    matrix = light.to_pixels(height, width)
    a, b, deep, w = (((m[0] * x + m[1] * y) + m[2] * z) + m[3] for m in matrix)
    per = 1 / w
    u, v = a * per, b * per
    quantum = QUANTUM * (((np.abs(x) + np.abs(y)) + np.abs(z)) + sum(map(abs, p.light_eye)))
    bend = np.full_like(deep, BEND * (2 * light.scale / height))
    bend = bend * deep if light.extent is None else bend
    dark = np.zeros(x.shape, bool)
    plane = None
    missing = np.full(x.shape, 1.0 if p.outside is Outside.LIT else 0.0)
    nan = np.isnan(x) | np.isnan(y) | np.isnan(z)
    if "normal" in inputs:
        n = [inputs["normal"].pixels[rows, :, k].astype(np.float64) for k in range(3)]
        right, up, back = light.axes()
        along = (n[0] * (x - p.light_eye[0]) + n[1] * (y - p.light_eye[1])) + n[2] * (z - p.light_eye[2])
        facing = -((n[0] * back[0] + n[1] * back[1]) + n[2] * back[2])
        texel = 2 * light.scale / height
        plane = (
            along,
            facing,
            ((n[0] * right[0] + n[1] * right[1]) + n[2] * right[2]) * texel,
            -((n[0] * up[0] + n[1] * up[1]) + n[2] * up[2]) * texel,
        )
        dark = (facing if light.extent is not None else along) > 0
        nan |= np.isnan(n[0]) | np.isnan(n[1]) | np.isnan(n[2])
    seen = (w > 0) & (u > -MARGIN) & (u < width + MARGIN) & (v > -MARGIN) & (v < height + MARGIN) & ~dark
    missing = np.where(dark, 0.0, missing)
    missing = np.where(np.isinf(x) | np.isinf(y) | np.isinf(z), 1.0, missing)
    missing = np.where(nan, np.nan, missing)
    reaches = seen & np.isfinite(x) & np.isfinite(y) & np.isfinite(z) & ~nan
    u, v = np.where(reaches, u, 0.0), np.where(reaches, v, 0.0)
    return Receivers(u, v, deep, quantum, bend, plane, reaches, missing)


class Map:
    """The light's depths, and what of them a texel says."""

    def __init__(self, inputs: Inputs, p: Parameters, stored: Stored = WHOLE) -> None:
        self._pixels = inputs["map"].pixels[..., 0]
        self._p, self._stored = p, stored
        self.height, self.width = self._pixels.shape

    def depths(self, i: Array, j: Array) -> tuple[Array, Array]:
        """Planar depths of texels, and the step of what they are stored in; -inf beyond the edge where that is dark."""
        inside = (i >= 0) & (i < self.width) & (j >= 0) & (j < self.height)
        m = self._pixels[np.where(inside, j, 0).astype(np.int64), np.where(inside, i, 0).astype(np.int64)]
        m = m.astype(np.float64)
        if self._p.map_kind is not MapKind.PLANAR:
            s, a, b = self._p.terms
            below = a + b * m
            m = np.where(below <= 0, np.inf, s / below)
        m, step = self._stored.of(m, self._p)
        beyond = np.inf if self._p.outside is Outside.LIT else -np.inf
        return np.where(inside, m, beyond), step

    def lit(self, r: Receivers, i: Array, j: Array) -> Array:
        """1 where a texel lets light through to the receiver, 0 where not, NaN where its depth is none."""
        m, step = self.depths(i, j)
        reach = m + (r.quantum + step)
        du, dv = i + 0.5, j + 0.5
        if r.plane is None:
            light = self._p.light
            wide = self._p.slope * (2 * light.scale / self.height)
            wide = wide * r.z if light.extent is None else wide
            yes = r.z - wide * (np.abs(du - r.u) + np.abs(dv - r.v)) <= reach
        else:
            along, facing, right, down = r.plane
            x, y = du - r.u, dv - r.v
            reach = reach + r.bend * (np.abs(x) + np.abs(y))
            across, low = du - self.width / 2, dv - self.height / 2
            if self._p.light.extent is None:
                below = (facing + right * across) + down * low
                yes = (r.z <= reach) | ((below < 0) & (along >= reach * below))
            else:
                above = (along - right * across) - down * low
                yes = (r.z <= reach) | ((facing < 0) & (above >= reach * facing))
        return np.where(np.isnan(m), np.nan, np.where(yes, 1.0, 0.0))


def shares(low: Array, high: Array, k: int) -> tuple[Array, Array]:
    """The k-th texel that a span touches, and how much of it."""
    i = np.floor(low) + k
    first, last = np.where(i > low, i, low), np.where(i + 1 < high, i + 1, high)
    return i, np.where(last > first, last - first, 0.0)


def share(inputs: Inputs, p: Parameters, rows: slice, stored: Stored = WHOLE) -> Array:
    """The share of light for some rows, float64 (rows, width)."""
    with np.errstate(all="ignore"):
        r = receivers(inputs, p, rows)
        depths = Map(inputs, p, stored)
        if p.filter == 0:
            made = depths.lit(r, np.floor(r.u), np.floor(r.v))
        elif p.kind is Kind.PCF:
            made = averaged(depths, r, np.full_like(r.u, p.filter), p.filter)
        elif p.kind is Kind.PCSS:
            made = averaged(depths, r, penumbra(depths, r, p), p.filter)
        else:
            made = chebyshev(depths, r, p)
        return np.where(r.reaches, made, r.missing)


def _window(r: Receivers, side: Array, widest: float) -> list[tuple[Array, Array, Array]]:
    """Texels under a square, with their shares of its area times side^2, row by row."""
    half = side * 0.5
    count = int(np.ceil(widest)) + 1
    across = [shares(r.u - half, r.u + half, k) for k in range(count)]
    down = [shares(r.v - half, r.v + half, k) for k in range(count)]
    return [(i, j, a * b) for j, b in down for i, a in across]


def averaged(depths: Map, r: Receivers, side: Array, widest: float) -> Array:
    """Comparisons averaged over squares."""
    total = np.zeros_like(r.u)
    for i, j, weight in _window(r, side, widest):
        total = total + np.where(weight > 0, weight * depths.lit(r, i, j), 0.0)
    made: Array = total / (side * side)
    return np.where(made > 1, 1.0, made)


def penumbra(depths: Map, r: Receivers, p: Parameters) -> Array:
    """How wide the penumbra of what lies before a receiver is in the map, texels: at least 1, at most the filter."""
    total, weights = np.zeros_like(r.u), np.zeros_like(r.u)
    light = p.light
    for i, j, weight in _window(r, np.full_like(r.u, p.filter), p.filter):
        m, _ = depths.depths(i, j)
        blocks = (weight > 0) & ~(depths.lit(r, i, j) > 0) & (m > 0)
        # Mean of 1 / depth in perspective, where the penumbra's width is linear in it.
        total = total + np.where(blocks, weight * (1 / m if light.extent is None else m), 0.0)
        weights = weights + np.where(blocks, weight, 0.0)
    mean = total / np.where(weights > 0, weights, 1.0)
    per = p.source * (depths.height / (2 * light.scale))
    wide = per * (mean - 1 / r.z) if light.extent is None else per * (r.z - mean)
    wide = np.where(wide > 1, wide, 1.0)
    return np.where((weights > 0) & (wide > 1), np.where(wide < p.filter, wide, p.filter), 1.0)


def chebyshev(depths: Map, r: Receivers, p: Parameters) -> Array:
    """The largest share of the square's depths that can lie behind the receiver, given their mean and variance.

    Deviations are taken from the receiver itself before they are squared, which is where they are small; the variance
    is then the mean square less the squared mean of numbers of its own size. The receiver's slope is within them.
    """
    total, square, weights = np.zeros_like(r.u), np.zeros_like(r.u), np.zeros_like(r.u)
    spoilt = np.zeros(r.u.shape, bool)
    for i, j, weight in _window(r, np.full_like(r.u, p.filter), p.filter):
        m, step = depths.depths(i, j)
        open_sky = m == np.inf
        # Depths far behind the receiver say no more than that they are: twice the receiver's own is enough.
        behind = np.where(m > 2 * r.z, r.z, m - r.z)
        apart = np.where(open_sky, r.z, behind + (r.quantum + step))
        spoilt |= (weight > 0) & np.isnan(m)
        taken = np.where(weight > 0, weight, 0.0)
        total, weights = total + np.where(weight > 0, taken * apart, 0.0), weights + taken
        square = square + np.where(weight > 0, taken * (apart * apart), 0.0)
    mean = total / weights
    spread = square / weights - mean * mean
    spread = np.where(spread > 0, spread, 0.0)
    made = np.where(mean >= 0, 1.0, spread / (spread + mean * mean))
    return np.where(spoilt, np.nan, made)
