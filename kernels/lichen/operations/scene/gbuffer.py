"""G-buffer: what a camera sees of a small scene, as buffers for effects: depth, normals, albedo and the rest.

Truth: along the ray of every pixel's middle (see `lichen.operations.scene.camera`) the nearest surface of `objects`
(see `lichen.operations.scene.objects`) up to `far`, and of it

    depth      the planar depth; +inf where there is nothing
    distance   the distance from the eye; +inf
    position   x, y and z in the `frame`'s axes, those of the camera or of the world; +inf
    normal     its unit normal on the side that is seen; 0 0 0
    albedo     what it reflects, linear light; 0
    roughness  0 to 1; 1
    mask       the number of its material; 0
    height     y in the world; 0
    motion     how far its point has moved in the picture since the frame before, px, x right, y down; 0
    emissive   how much of it shines through fog; 0

What a light sees is the same with the light as the camera, `extent` making it one without perspective: a shadow map.

Everything is computed in doubles, in one order of operations, by the definition as by the method, and rounded to
float32 once. That rounding is part of the definition, so the result is exact and effects that read it inherit no error;
at a silhouette, where any error is as large as the step, nothing less would do. Pixels are not antialiased.

Sources: see `lichen.operations.scene.casting`; T. Saito and T. Takahashi, Comprehensible rendering of 3-D shapes, 1990.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from lichen.errors import Flaw
from lichen.image import Extent, Space
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import (
    EXACT,
    POINTWISE,
    Facts,
    InputFacts,
    Inputs,
    Light,
    Operation,
    Rate,
)
from lichen.operations.compositing.layers import row_blocks
from lichen.operations.scene.camera import Camera
from lichen.operations.scene.casting import Hits, Triple, cast, encoded, materials, ray_of
from lichen.operations.scene.gbuffer_cases import CASES, EXAMPLES
from lichen.operations.scene.objects import Blob, Object, Plane, Terrain

if TYPE_CHECKING:
    from lichen.opencl.device import Device

SEGMENT = 64
FLOAT_MAX = float(np.finfo(np.float32).max)


class Buffer(StrEnum):
    """What is wanted of the surfaces."""

    DEPTH = "depth"
    DISTANCE = "distance"
    POSITION = "position"
    NORMAL = "normal"
    ALBEDO = "albedo"
    ROUGHNESS = "roughness"
    MASK = "mask"
    HEIGHT = "height"
    MOTION = "motion"
    EMISSIVE = "emissive"

    @property
    def channels(self) -> int:
        return {Buffer.POSITION: 3, Buffer.NORMAL: 3, Buffer.ALBEDO: 3, Buffer.MOTION: 2}.get(self, 1)


class Frame(StrEnum):
    """In whose axes positions and normals are told."""

    CAMERA = "camera"
    WORLD = "world"


class Parameters(Camera):
    width: int = Field(256, ge=1, le=16384)
    """px"""
    height: int = Field(256, ge=1, le=16384)
    """px"""
    buffer: Buffer = Buffer.DEPTH
    """depth, distance, position, normal, albedo, roughness, mask, height, motion or emissive"""
    frame: Frame = Frame.CAMERA
    """whose axes positions and normals are told in"""
    far: float = Field(1e4, gt=0, le=1e6)
    """depth beyond which nothing is seen"""
    objects: Annotated[tuple[Object, ...], Field(max_length=64)] = ()
    """spheres, planes, boxes, blobs and terrains"""


def _check(p: Parameters, facts: InputFacts) -> list[Flaw]:
    return p.camera_flaws() + [
        Flaw(f"/parameters/objects/{at}/normal", "is no direction")
        for at, each in enumerate(p.objects)
        if isinstance(each, Plane) and not any(each.normal)
    ]


def _result(p: Parameters, facts: InputFacts) -> Facts:
    corner = math.hypot(1, p.scale, p.scale * p.width / p.height)
    apart = (max(map(abs, p.eye)) + p.far * corner + (p.extent or 0.0) * corner) * (1 + 1e-6)
    low, high = {
        Buffer.DEPTH: (0.0, p.far * (1 + 1e-6)),
        Buffer.DISTANCE: (0.0, p.far * corner * (1 + 1e-6)),
        Buffer.NORMAL: (-1.0, 1.0),
        Buffer.ALBEDO: (
            0.0,
            max((max(*each.albedo, *(each.checker or ())) for each in p.objects), default=0.0) * (1 + 1e-6),
        ),
        Buffer.MASK: (0.0, float(max((each.id for each in p.objects), default=0))),
        Buffer.ROUGHNESS: (min((each.roughness for each in p.objects), default=1.0) * (1 - 1e-6), 1.0),
        Buffer.EMISSIVE: (0.0, 1.0),
        Buffer.MOTION: (-FLOAT_MAX, FLOAT_MAX),
    }.get(p.buffer, (-apart, apart))
    endless = p.buffer in (Buffer.DEPTH, Buffer.DISTANCE, Buffer.POSITION)
    extent = Extent(low, high, p.width * p.height * p.buffer.channels if endless else 0)
    space = Space.LINEAR if p.buffer is Buffer.ALBEDO else Space.DATA
    return Facts(p.height, p.width, p.buffer.channels, space, extent=extent)


gbuffer = Operation(
    name="gbuffer",
    family="scene",
    summary="Casts rays at spheres, planes, boxes, blobs and terrains, and tells depth, normals, albedo and the rest.",
    description=__doc__ or "",
    parameters=Parameters,
    inputs=(),
    light=Light.STORED,
    footprint=lambda p, facts: POINTWISE,
    result=_result,
    implied=lambda p, facts: "a pixel's ray depends on where the pixel lies",
    check=_check,
    examples=EXAMPLES,
    hard_cases=CASES,
)


# ----------------------------------------------------------------------------------------------------------- buffers


def _world(t: Array, origin: Triple, direction: Triple) -> Triple:
    a, b, c = (o + t * d for o, d in zip(origin, direction, strict=True))
    return a, b, c


def _of_materials(rows: Array, hits: Hits, what: int) -> Array:
    return np.where(hits.index >= 0, rows[np.maximum(hits.index, 0), what], 0.0)


def _albedo(rows: Array, hits: Hits, p: Triple) -> list[Array]:
    side = _of_materials(rows, hits, 6)
    field = (np.floor(p[0] / side) + np.floor(p[1] / side + 0.5)) + np.floor(p[2] / side)
    odd = (hits.index >= 0) & (side > 0) & (field - 2.0 * np.floor(field * 0.5) == 1.0)
    return [np.where(odd, _of_materials(rows, hits, 3 + c), _of_materials(rows, hits, c)) for c in range(3)]


def _motion(p: Parameters, rows: Array, hits: Hits, point: Triple) -> list[Array]:
    matrix = p.to_pixels(p.height, p.width)
    before = [point[c] - _of_materials(rows, hits, 10 + c) for c in range(3)]

    def row(at: int, v: list[Array] | Triple) -> Array:
        m = matrix[at]
        return np.asarray(((m[0] * v[0] + m[1] * v[1]) + m[2] * v[2]) + m[3])

    w, earlier = row(3, point), row(3, before)
    seen = (hits.index >= 0) & (earlier > 0)
    return [np.where(seen, row(at, point) / w - row(at, before) / earlier, 0.0) for at in range(2)]


def _position(p: Parameters, hits: Hits, point: Triple, x: Array, y: Array) -> list[Array]:
    if p.frame is Frame.WORLD:
        told: list[Array] = list(point)
    else:
        across, up = (x, y) if p.extent is not None else (x * hits.t, y * hits.t)
        told = [across, up, -hits.t]
    return [np.where(hits.index >= 0, each, hits.t) for each in told]


def _normal(p: Parameters, hits: Hits) -> list[Array]:
    n = hits.normal
    if p.frame is Frame.WORLD:
        return list(n)
    return [(n[0] * axis[0] + n[1] * axis[1]) + n[2] * axis[2] for axis in p.axes()]


def _seen(p: Parameters, rows: slice) -> Array:
    """Some rows of the buffer, float32."""
    columns, lines = p.sights(p.height, p.width)
    x, y = np.broadcast_arrays(columns[None, :], lines[rows, None])
    origin, direction = ray_of(p, x, y)
    hits = cast(p.objects, origin, direction, p.far)
    made_of = materials(p.objects)
    with np.errstate(all="ignore"):
        point = _world(hits.t, origin, direction)
        match p.buffer:
            case Buffer.DEPTH:
                made = [hits.t]
            case Buffer.DISTANCE:
                a, b, c = direction
                made = [hits.t * np.sqrt((a * a + b * b) + c * c)]
            case Buffer.POSITION:
                made = _position(p, hits, point, x, y)
            case Buffer.NORMAL:
                made = _normal(p, hits)
            case Buffer.ALBEDO:
                made = _albedo(made_of, hits, point)
            case Buffer.HEIGHT:
                made = [np.where(hits.index >= 0, point[1], 0.0)]
            case Buffer.ROUGHNESS:
                made = [np.where(hits.index >= 0, _of_materials(made_of, hits, 7), 1.0)]
            case Buffer.MOTION:
                made = _motion(p, made_of, hits, point)
            case _:
                at = {Buffer.MASK: 8, Buffer.EMISSIVE: 9}[p.buffer]
                made = [_of_materials(made_of, hits, at)]
        return np.stack(made, axis=-1).astype(np.float32)


@gbuffer.truth
def truth(inputs: Inputs, p: Parameters) -> Array:
    return _seen(p, slice(0, p.height)).astype(np.float64)


def _work(p: Parameters, knob: float, facts: InputFacts) -> float:
    """Rays times objects, a blob counting as ten of its balls, a terrain as the cells on a way across it."""
    each = 1.0
    for o in p.objects:
        match o:
            case Blob():
                each += 10.0 * len(o.balls)
            case Terrain():
                each += 2.0 * (len(o.heights) + len(o.heights[0]))
            case _:
                each += 1.0
    return p.width * p.height * each


def _any(p: Parameters, kind: type) -> bool:
    return any(isinstance(each, kind) for each in p.objects)


@gbuffer.method(
    "exact",
    error=lambda p, knob, facts: EXACT,
    work=_work,
    rates={"opencl": Rate(2e-4, 3e-9), "numpy": Rate(1.2e-2, 2e-8)},
)
class Exact:
    """Rays in doubles, the result rounded once; on a device without doubles, on the host."""

    @staticmethod
    def opencl(device: Device, inputs: Inputs, p: Parameters, knob: float) -> Array:
        if not device.has_fp64:
            return Exact.numpy(inputs, p, knob)
        out = aligned_empty((p.height, p.width, p.buffer.channels))
        objects, balls = encoded(p.objects)
        x, y = p.sights(p.height, p.width)
        choices = (float(p.extent is not None), p.far, float(p.frame is Frame.WORLD))
        eyes = np.array([*p.eye, *p.axes().ravel(), *choices, *p.to_pixels(p.height, p.width).ravel()])
        doubles = (eyes, objects, balls, materials(p.objects), np.append(x, np.full(7, x[-1])), y)
        with device.session() as session:
            session.launch(
                "scene/gbuffer.cl", "gbuffer", (p.height * -(-p.width // SEGMENT),),
                session.write(out), *(aligned(each, np.float64) for each in doubles),
                *(np.int32(each) for each in (list(Buffer).index(p.buffer), p.buffer.channels, len(p.objects))),
                np.int32(p.width), np.int32(p.height),
                defines={"BLOBS": int(_any(p, Blob)), "TERRAINS": int(_any(p, Terrain))},
            )  # fmt: skip
        return out

    @staticmethod
    def numpy(inputs: Inputs, p: Parameters, knob: float) -> Array:
        out = aligned_empty((p.height, p.width, p.buffer.channels))
        for rows in row_blocks(p.height, p.width):
            out[rows] = _seen(p, rows)
        return out
