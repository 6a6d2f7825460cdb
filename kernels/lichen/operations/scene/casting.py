"""Rays and what they meet, in doubles: the definition of gbuffer, and its NumPy body.

gbuffer.cl does the same operations in the same order. Sums, products, quotients and roots of doubles are rounded as
IEEE 754 says everywhere, and nothing else is used, so both give the same bits and no pixel of a silhouette falls on
another object on one backend than on the other.

Spheres: the discriminant is taken from the distance of the centre from the ray, not as b^2 - a c, which cancels for
small and far ones; of both roots the one is c over the other (E. Haines et al., Precision improvements for ray/sphere
intersection, Ray Tracing Gems, 2019). Boxes: slabs, a direction along a slab being inside it or not (A. Williams et
al., 2005). Blobs: marching by their distance (J. Hart, Sphere tracing, 1996) from the ball around them, until less than
2^-30 of the way is left, 256 steps at most: a ray that has not arrived by then only grazes, and passes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lichen.memory import Array
from lichen.operations.scene import terrain
from lichen.operations.scene.camera import Camera, _unit
from lichen.operations.scene.objects import Blob, Box, Object, Plane, Sphere, Terrain

STEPS = 256
CLOSE = 2.0**-30
WIDTH = 16
"""Doubles of an object, and of a material."""
KINDS = (Sphere, Plane, Box, Blob, Terrain)

Triple = tuple[Array, Array, Array]


def encoded(objects: Sequence[Object]) -> tuple[Array, Array]:
    """Objects as doubles (count, `WIDTH`); the balls of all blobs, four doubles each, with all heights behind them."""
    made, balls = np.zeros((max(len(objects), 1), WIDTH)), [(0.0, 0.0, 0.0, 1.0)]
    for row, each in zip(made, objects, strict=False):
        row[0] = KINDS.index(type(each))
        match each:
            case Sphere():
                row[1:5] = *each.centre, each.radius
            case Plane():
                normal = _unit(np.array(each.normal))
                row[1:5] = *normal, normal[0] * each.point[0] + normal[1] * each.point[1] + normal[2] * each.point[2]
            case Box():
                turn = math.radians(each.turn)
                row[1:9] = *each.centre, *(side / 2 for side in each.size), math.cos(turn), math.sin(turn)
            case Blob():
                row[1:5] = ball_around(each)
                row[5:8] = each.smooth, len(balls), len(each.balls)
                balls += each.balls
    extras = [np.array(balls).ravel()]
    for row, each in zip(made, objects, strict=False):
        if isinstance(each, Terrain):
            numbers, heights = terrain.encoded(each, sum(map(len, extras)))
            row[1 : 1 + len(numbers)] = numbers
            extras.append(heights)
    return made, np.concatenate(extras)


def ball_around(blob: Blob) -> tuple[float, float, float, float]:
    """A ball that holds the blob: every join swells it by a quarter of `smooth` at most."""
    places = np.array(blob.balls)
    centre = places[:, :3].mean(axis=0)
    apart = np.sqrt(np.sum((places[:, :3] - centre) ** 2, axis=1)) + places[:, 3]
    x, y, z = map(float, centre)
    return x, y, z, float(apart.max()) + blob.smooth * (len(blob.balls) - 1) / 4 + 1e-9 * float(apart.max())


def materials(objects: Sequence[Object]) -> Array:
    """What objects are made of, as doubles (count, `WIDTH`): two colours, the side of a check (0: none), roughness, id,
    share that shines, velocity."""
    made = np.zeros((max(len(objects), 1), WIDTH))
    for row, each in zip(made, objects, strict=False):
        row[0:3], row[3:6] = each.albedo, each.checker or each.albedo
        row[6:10] = each.check if each.checker else 0.0, each.roughness, each.id, each.emissive
        row[10:13] = each.velocity
    return made


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Of every ray: how far along it the nearest surface lies (infinite: none), of which object, and its normal."""

    t: Array
    index: Array
    normal: Triple


def ray_of(p: Camera, x: Array, y: Array) -> tuple[Triple, Triple]:
    """Origins and directions of the rays through (x, y), arrays of one shape."""
    right, up, back = p.axes()
    if p.extent is None:
        a, b, c = ((x * right[k] + y * up[k]) - back[k] for k in range(3))
        return (np.full_like(x, p.eye[0]), np.full_like(x, p.eye[1]), np.full_like(x, p.eye[2])), (a, b, c)
    a, b, c = ((p.eye[k] + x * right[k]) + y * up[k] for k in range(3))
    return (a, b, c), (np.full_like(x, -back[0]), np.full_like(x, -back[1]), np.full_like(x, -back[2]))


def cast(objects: Sequence[Object], origin: Triple, direction: Triple, far: float) -> Hits:
    """The nearest surfaces up to `far`."""
    rows, balls = encoded(objects)
    shape = origin[0].shape
    best, index = np.full(shape, np.inf), np.full(shape, -1)
    normal = (np.zeros(shape), np.zeros(shape), np.zeros(shape))
    with np.errstate(all="ignore"):
        for number in range(len(objects)):
            row = rows[number]
            t, n = (_sphere, _plane, _box, _blob, terrain.meet)[int(row[0])](row, balls, origin, direction)
            nearer = (t > 0) & (t <= far) & (t < best)
            best, index = np.where(nearer, t, best), np.where(nearer, number, index)
            a, b, c = (np.where(nearer, mine, old) for mine, old in zip(n, normal, strict=True))
            normal = (a, b, c)
        away = _dot(normal, direction) > 0
        a, b, c = (np.where(away, -each, each) for each in normal)
    return Hits(best, index, (a, b, c))


def _dot(a: Triple, b: Triple) -> Array:
    return np.asarray((a[0] * b[0] + a[1] * b[1]) + a[2] * b[2])


def _from(origin: Triple, centre: Array) -> Triple:
    return origin[0] - centre[0], origin[1] - centre[1], origin[2] - centre[2]


def _along(origin: Triple, t: Array, direction: Triple) -> Triple:
    a, b, c = (o + t * d for o, d in zip(origin, direction, strict=True))
    return a, b, c


def _ball(centre: Array, radius: float, origin: Triple, direction: Triple) -> tuple[Array, Array]:
    """Where rays enter a ball and where they leave it; NaN where they miss it."""
    o = _from(origin, centre)
    a, b = _dot(direction, direction), _dot(o, direction)
    m = b / a
    near = (o[0] - m * direction[0], o[1] - m * direction[1], o[2] - m * direction[2])
    within = a * (radius * radius - _dot(near, near))
    root = np.sqrt(np.where(within >= 0, within, np.nan))
    q = np.where(b >= 0, -(b + root), root - b)
    first, second = (_dot(o, o) - radius * radius) / q, q / a
    return np.where(first < second, first, second), np.where(first < second, second, first)


def _sphere(row: Array, balls: Array, origin: Triple, direction: Triple) -> tuple[Array, Triple]:
    enter, leave = _ball(row[1:4], row[4], origin, direction)
    t = np.where(enter > 0, enter, leave)
    p = _from(_along(origin, t, direction), row[1:4])
    return t, (p[0] / row[4], p[1] / row[4], p[2] / row[4])


def _plane(row: Array, balls: Array, origin: Triple, direction: Triple) -> tuple[Array, Triple]:
    a, b, c, offset = row[1:5]
    across = (a * direction[0] + b * direction[1]) + c * direction[2]
    t = (offset - ((a * origin[0] + b * origin[1]) + c * origin[2])) / across
    return t, (np.full_like(t, a), np.full_like(t, b), np.full_like(t, c))


def _box(row: Array, balls: Array, origin: Triple, direction: Triple) -> tuple[Array, Triple]:
    half, c, s = row[4:7], row[7], row[8]
    o = _turned(_from(origin, row[1:4]), c, s)
    d = _turned(direction, c, s)
    near, far = np.full_like(o[0], -np.inf), np.full_like(o[0], np.inf)
    entered, left = np.zeros(near.shape, int), np.zeros(near.shape, int)
    for axis in range(3):
        along, inside = d[axis] == 0, np.abs(o[axis]) <= half[axis]
        one, other = (-half[axis] - o[axis]) / d[axis], (half[axis] - o[axis]) / d[axis]
        low = np.where(along, np.where(inside, -np.inf, np.inf), np.where(one < other, one, other))
        high = np.where(along, np.where(inside, np.inf, -np.inf), np.where(one < other, other, one))
        entered, near = np.where(low > near, axis, entered), np.where(low > near, low, near)
        left, far = np.where(high < far, axis, left), np.where(high < far, high, far)
    t = np.where(near <= far, np.where(near > 0, near, far), np.nan)
    face = np.where(near > 0, entered, left)
    x, y, z = ((face == k) * np.ones(1) for k in range(3))
    return t, (x * c + z * s, y, z * c - x * s)


def _turned(v: Triple, c: float, s: float) -> Triple:
    """From the world's axes to those of a box."""
    return v[0] * c - v[2] * s, v[1], v[0] * s + v[2] * c


def _blob(row: Array, balls: Array, origin: Triple, direction: Triple) -> tuple[Array, Triple]:
    first, count = 4 * int(row[6]), int(row[7])
    mine, k = balls[first : first + 4 * count].reshape(count, 4), float(row[5])
    enter, leave = _ball(row[1:4], row[4], origin, direction)
    t = np.where(enter > 0, enter, 0.0)
    found = np.full(t.shape, np.nan)
    long = np.sqrt(_dot(direction, direction))
    (at,) = np.nonzero((leave > 0).ravel())
    o, d = _some(origin, at), _some(direction, at)
    length, end, way = long.ravel()[at], leave.ravel()[at], t.ravel()[at]
    live = np.arange(at.size)
    for _ in range(STEPS):
        if not live.size:
            break
        p = _along(_some(o, live), way[live], _some(d, live))
        gap = np.abs(_distance(mine, k, p)[0])
        arrived = gap < CLOSE * (1 + way[live] * length[live])
        found.ravel()[at[live[arrived]]] = way[live[arrived]]
        way[live] = way[live] + gap / length[live]
        live = live[~arrived & (way[live] <= end[live])]
    _, g = _distance(mine, k, _along(origin, found, direction))
    size = np.sqrt(_dot(g, g))
    return found, (g[0] / size, g[1] / size, g[2] / size)


def _some(v: Triple, at: Array) -> Triple:
    a, b, c = (each.ravel()[at] for each in v)
    return a, b, c


def _distance(balls: Array, k: float, p: Triple) -> tuple[Array, Triple]:
    """The blob's distance at points, and its gradient."""
    total: Array | None = None
    for ball in balls:
        v = _from(p, ball[:3])
        length = np.sqrt(_dot(v, v))
        d, g = length - ball[3], (v[0] / length, v[1] / length, v[2] / length)
        if total is None:
            total, slope = d, g
            continue
        h = k - np.abs(total - d)
        h = np.where(h > 0, h / k, 0.0)
        m, first = h * 0.5, total < d
        a, b, c = (
            np.where(first, old + (new - old) * m, new + (old - new) * m) for old, new in zip(slope, g, strict=True)
        )
        slope = (a, b, c)
        total = np.where(first, total, d) - ((h * h) * k) * 0.25
    assert total is not None
    return total, slope
