"""From parameters and images to lit pixels, on either backend."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Inputs
from lichen.operations.lighting import tables
from lichen.operations.lighting.lamps import Kind, Row, unit_vector
from lichen.operations.lighting.parameters import Parameters
from lichen.operations.lighting.reflection import SMOOTHEST, STEEP, Distribution, Fresnel, Masking, Material, Model
from lichen.operations.lighting.shading import Lit, lit

if TYPE_CHECKING:
    from lichen.opencl.device import Device

WIDEST = 85.0
"""Degrees; a wider cone misses too little to be looked for."""
NAMES = ("position", "albedo", "specular", "roughness", "tangent", "visibility", "slide")


def task_of(p: Parameters, inputs: Inputs, material: Material, *, single: bool) -> Lit:
    local = p.local_viewer and "position" in inputs
    return Lit(
        p.rows(), material, p.eye if local else None, p.view, p.diffuse, p.highlight, p.facet_roughness,
        p.grain, single,
    )  # fmt: skip


def _numbers(p: Parameters, task: Lit) -> Array:
    """What the kernel reads of the parameters, in its order."""
    eye = np.array(p.eye)
    near = eye.astype(np.float32)
    material = task.material
    straight = 0.0 if p.index is None else ((p.index - 1) / (p.index + 1)) ** 2
    return np.concatenate(
        [
            near, eye - near, unit_vector(p.view), [float(task.eye is not None)], p.diffuse, p.highlight,
            [p.facet_roughness, SMOOTHEST, p.exponent or 0.0, material.contrast, straight, p.stretch], p.lobe,
            unit_vector(p.grain), [STEEP**2, tables.width(material, p.slope)],
        ]
    )  # fmt: skip


def cones_of(p: Parameters, rows: Array) -> Array | None:
    """The cones of lamps as the kernel's columns: apex, axis, cosine and sine, all 0 of lamps without one; None where
    no lamp has one. A thousandth of a radian is added, so that rounding shuts nobody out."""
    narrow = [lamp.kind is Kind.SPOT and lamp.outer < WIDEST for lamp in p.lights]
    if not any(narrow):
        return None
    made = np.zeros((8, -(-len(rows) // 16) * 16), np.float32)
    for at, row in enumerate(rows):
        lamp = p.lights[int(row[Row.LAMP])]
        if narrow[int(row[Row.LAMP])]:
            outer = math.radians(lamp.outer) + 1e-3
            made[:3, at], made[3:6, at] = row[Row.PLACE : Row.PLACE + 3], row[Row.AXIS : Row.AXIS + 3]
            made[6:, at] = math.cos(outer), math.sin(outer)
    return aligned(made)


def on_opencl(device: Device, inputs: Inputs, p: Parameters, material: Material) -> Array:
    normal, task = inputs["normal"], task_of(p, inputs, material, single=True)
    out = aligned_empty((normal.height, normal.width, 3))
    pixels = normal.height * normal.width
    channels = [inputs[name].channels if name in inputs else 0 for name in NAMES]
    slide: Any = inputs.get("slide", normal)
    looked = aligned(tables.entries(material, p.slope, material.size)) if material.size else None
    with device.session() as session:
        session.launch(
            "lighting/lighting.cl", "lighting", (-(-pixels // 16),),
            aligned(normal.pixels), *(aligned(inputs[name].pixels) if name in inputs else None for name in NAMES),
            aligned(np.array(channels), np.int32), np.int32(slide.width), np.int32(slide.height),
            aligned(task.rows), np.int32(len(task.rows)), cones_of(p, task.rows), aligned(_numbers(p, task)),
            np.int32(list(Model).index(material.model)), np.int32(list(Distribution).index(material.distribution)),
            np.int32(list(Masking).index(material.masking)), np.int32(list(Fresnel).index(material.fresnel)),
            looked, np.int32(material.size), session.write(out), np.uint64(pixels),
            defines={"SHINY": int(material.model is not Model.LAMBERT)},
        )  # fmt: skip
    return out


def on_numpy(inputs: Inputs, p: Parameters, material: Material, *, single: bool = True) -> Array:
    return lit({name: image.pixels for name, image in inputs.items()}, task_of(p, inputs, material, single=single))
