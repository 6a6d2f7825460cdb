"""Pixels lit by lamps, in NumPy: the definition in doubles, and the same in float32 as the method's twin.

Vectors are arrays of shape (3, pixels). Every lamp is a row of `lamps.Row`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lichen.memory import Array, aligned_empty
from lichen.operations.lighting import tables
from lichen.operations.lighting.lamps import POSITIONAL, Doubles, Row
from lichen.operations.lighting.reflection import SMOOTHEST, STEEP, Material, Model, cross, dot, highlight, unit

PICTURES = ("slide", "slab")
Pictures = tuple[Array | None, ...]
BLOCK = 1 << 13
"""Pixels that are lit at once, so that the steps stay in cache."""


@dataclass(frozen=True, eq=False)
class Lit:
    """What is the same for all pixels."""

    rows: Doubles
    material: Material
    eye: tuple[float, float, float] | None
    """where the viewer is; None: at infinity, along `view`"""
    view: tuple[float, float, float]
    albedo: tuple[float, float, float]
    specular: tuple[float, float, float]
    roughness: float
    tangent: tuple[float, float, float]
    single: bool
    """whether all numbers are rounded to float32"""

    @property
    def slope(self) -> float:
        return min(max(self.roughness, SMOOTHEST), 1.0) ** 2

    @property
    def kind(self) -> type[np.floating[Any]]:
        return np.float32 if self.single else np.float64


def lit(images: Mapping[str, Array], task: Lit) -> Array:
    """Radiance of shape (height, width, 3) in the task's precision; `images` are pixels of the inputs by name,
    and `out` which lamps are left out, a channel for each."""
    height, width, _ = images["normal"].shape
    flat = {name: each.reshape(-1, each.shape[-1]) for name, each in images.items() if name not in PICTURES}
    out = aligned_empty((height * width, 3), task.kind)
    pictures = tuple(images.get(name) for name in PICTURES)
    with np.errstate(all="ignore"):
        for start in range(0, len(out), BLOCK):
            some = {
                name: np.ascontiguousarray(each[start : start + BLOCK].T.astype(task.kind))
                for name, each in flat.items()
            }
            out[start : start + BLOCK] = _block(some, task, pictures).T
    return out.reshape(height, width, 3)


def _constant(vector: tuple[float, float, float], task: Lit) -> Array:
    return np.array(vector, task.kind).reshape(3, 1)


def _towards(place: Doubles, position: Array, task: Lit) -> Array:
    """place - position, the place in as many digits as the position has and as many again."""
    near = place.astype(np.float32).astype(np.float64)
    made: Array = (near.astype(task.kind).reshape(3, 1) - position) + (place - near).astype(task.kind).reshape(3, 1)
    return made


def _viewed(some: Mapping[str, Array], task: Lit) -> Array:
    """Unit vectors to the viewer."""
    if task.eye is not None:
        return unit(_towards(np.array(task.eye), some["position"], task))
    shape = (3, some["normal"].shape[1])
    return np.broadcast_to(unit(_constant(task.view, task)), shape)


def _grain(some: Mapping[str, Array], task: Lit, n: Array) -> Array:
    given = some["tangent"] if "tangent" in some else np.broadcast_to(_constant(task.tangent, task), n.shape)
    along = unit(given)
    if task.material.model is Model.BANKS:
        return along
    across = along - dot(along, n) * n
    return np.asarray(np.where(dot(across, across) < STEEP**2, across - across, unit(across)))


def _block(some: Mapping[str, Array], task: Lit, pictures: Pictures) -> Array:
    n, v = unit(some["normal"]), _viewed(some, task)
    albedo = _constant(task.albedo, task) * some["albedo"] if "albedo" in some else _constant(task.albedo, task)
    specular = (
        _constant(task.specular, task) * some["specular"] if "specular" in some else _constant(task.specular, task)
    )
    rough = some["roughness"][0] if "roughness" in some else np.full(n.shape[1], task.roughness, task.kind)
    m = np.clip(rough, SMOOTHEST, 1) ** 2
    t = _grain(some, task, n)
    shines = task.material.model is not Model.LAMBERT and any(task.specular)
    total = np.zeros((3, n.shape[1]), task.kind)
    for row in task.rows:
        l, light = _arriving(row, some, task, pictures)  # noqa: E741
        u = dot(n, l)
        diffuse = np.where(u > 0, u, u - u)
        if task.material.model is Model.BANKS:
            across = cross(l, t)
            diffuse = np.where(dot(t, t) > 0, diffuse * np.sqrt(dot(across, across)), diffuse)
        sent = albedo * diffuse
        if shines:
            shiny = (
                tables.highlight(task.material, task.slope, n, l, v)
                if task.material.size
                else highlight(task.material, m, n, l, v, t)
            )
            sent = sent + specular * shiny
        if "visibility" in some:
            seen = some["visibility"]
            light = light * seen[0 if len(seen) == 1 else int(row[Row.LAMP])]
        if "out" in some:
            light = np.where(some["out"][int(row[Row.LAMP])] > 0, light.dtype.type(0), light)
        total = total + light * sent
    return _there(total, some, v)


def _there(total: Array, some: Mapping[str, Array], v: Array) -> Array:
    """Nothing where a position is infinite; not a number where the viewer's direction is none for another reason."""
    total = total + (v[0] - v[0])
    if "position" not in some:
        return total
    return np.asarray(np.where(np.isinf(some["position"]).any(axis=0), total.dtype.type(0), total))


def _arriving(row: Doubles, some: Mapping[str, Array], task: Lit, pictures: Pictures) -> tuple[Array, Array]:
    """Unit vectors to the lamp, and its light: colours over the distance's part, before the cosine at the surface."""
    kind = task.kind
    colour = row[Row.COLOUR : Row.COLOUR + 3].astype(kind).reshape(3, 1)
    if row[Row.TYPE] != POSITIONAL:
        return row[Row.PLACE : Row.PLACE + 3].astype(kind).reshape(3, 1), colour
    place = row[Row.PLACE : Row.PLACE + 3] + row[Row.REST : Row.REST + 3]
    way = _towards(place, some["position"], task)
    square, radius = np.maximum(dot(way, way), kind(row[Row.NEAREST])), kind(row[Row.RADIUS])
    a, b, c = row[Row.FALLOFF : Row.FALLOFF + 3].astype(kind)
    apart = square + radius
    l = unit(way)  # noqa: E741
    falls = np.full_like(apart, a)
    for factor, grown in ((b, np.sqrt(apart)), (c, apart)):
        if factor:  # so far away that a square is infinite, nothing times it is nothing
            falls = falls + factor * grown
    strength = np.where(square > 0, 1 / np.sqrt(1 + radius / square), square) / falls
    axis = row[Row.AXIS : Row.AXIS + 3].astype(kind).reshape(3, 1)
    if row[Row.EMITTER]:
        strength = strength * np.maximum(-dot(axis, l), 0)
    if row[Row.CONE + 1]:
        off = axis + l
        outer, over = row[Row.CONE : Row.CONE + 2].astype(kind)
        share = np.clip((outer - dot(off, off) / 2) * over, 0, 1)
        strength = strength * share * share * (3 - 2 * share)
    light = colour * strength
    slide = pictures[int(row[Row.SLIDE]) - 1] if row[Row.SLIDE] else None
    if slide is not None:
        light = light * _projected(row, way, axis, _cell(row, slide), kind)
    return l, light


def _cell(row: Doubles, sheet: Array) -> Array:
    """The picture of a slab's cell, or the slide."""
    i, j, across, down = (int(each) for each in row[Row.CELL : Row.CELL + 4])
    if not across:
        return sheet
    high, wide = len(sheet) // down, sheet.shape[1] // across
    return sheet[j * high : (j + 1) * high, i * wide : (i + 1) * wide]


def _projected(row: Doubles, way: Array, axis: Array, slide: Array, kind: type[np.floating[Any]]) -> Array:
    """The slide where a point lies in its picture, between texels linearly, black around it and behind the lamp."""
    height, width, channels = slide.shape
    ahead = -dot(axis, way)
    across, down = (row[at : at + 3].astype(kind).reshape(3, 1) for at in (Row.ACROSS, Row.DOWN))
    aside, low = (kind(0.5 + moved) for moved in row[Row.MOVED : Row.MOVED + 2])
    x = kind(width) * (aside - dot(across, way) / ahead) + kind(0.5)
    y = kind(height) * (low - dot(down, way) / ahead) + kind(0.5)
    inside = (ahead > 0) & (x > 0) & (y > 0) & (x < width + 1) & (y < height + 1)
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    framed = np.zeros((height + 2, width + 2, channels), kind)
    framed[1:-1, 1:-1] = slide
    column, row_of = (np.minimum(np.floor(each), most).astype(np.int64) for each, most in ((x, width), (y, height)))
    right, below = x - column, y - row_of
    texel = framed.reshape(-1, channels).T
    corner = row_of * (width + 2) + column
    upper = texel[:, corner] + right * (texel[:, corner + 1] - texel[:, corner])
    lower = texel[:, corner + width + 2] + right * (texel[:, corner + width + 3] - texel[:, corner + width + 2])
    return np.asarray(np.where(inside, upper + below * (lower - upper), kind(0)))
