"""From parameters and images to lit pixels, on either backend."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import Inputs
from lichen.operations.lighting import tables
from lichen.operations.lighting.lamps import Row, unit_vector
from lichen.operations.lighting.parameters import Parameters
from lichen.operations.lighting.reflection import SMOOTHEST, STEEP, Distribution, Fresnel, Masking, Material, Model
from lichen.operations.lighting.shading import Lit, lit
from lichen.operations.scene.lists import by_pixel, left_out

if TYPE_CHECKING:
    from lichen.opencl.device import Device

NAMES = ("position", "albedo", "specular", "roughness", "tangent", "visibility", "slide", "slab")


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


def _defines(material: Material) -> dict[str, int | float | str]:
    """What the kernel is built for: each model has its own, and of facets each of their terms."""
    facets = material.model is Model.TORRANCE_SPARROW
    return {
        "MODEL": list(Model).index(material.model),
        "DISTRIBUTION": list(Distribution).index(material.distribution) if facets else 0,
        "MASKING": list(Masking).index(material.masking) if facets else 0,
        "FRESNEL": list(Fresnel).index(material.fresnel) if facets else 0,
    }


def active(out: Array | None, rows: Array) -> Array | None:
    """For each tile how many discs are to be looked at, and their rows in order: int32 (tiles, 1 + rows)."""
    if out is None:
        return None
    off = out[..., rows[:, Row.LAMP].astype(np.int64)].reshape(-1, len(rows))
    counts = np.count_nonzero(~off, axis=1)
    return aligned(np.column_stack([counts, np.argsort(off, axis=1, kind="stable")]), np.int32)


@lru_cache(maxsize=64)
def scattered(count: int) -> int:
    """A step that meets all of so many rows, neighbours far apart: coprime to the count, near its golden section."""
    return next((step for step in range(round(count * 0.618), count) if math.gcd(step, count) == 1), 1)


def on_opencl(device: Device, inputs: Inputs, p: Parameters, material: Material) -> Array:
    normal, task = inputs["normal"], task_of(p, inputs, material, single=True)
    out = aligned_empty((normal.height, normal.width, 3))
    pixels = normal.height * normal.width
    channels = [inputs[name].channels if name in inputs else 0 for name in NAMES]
    slide: Any = inputs.get("slide", normal)
    slab: Any = inputs.get("slab", normal)
    out_of_tiles = left_out(inputs, p.effect, len(p.lights), normal.height, normal.width)
    width = normal.width if out_of_tiles is not None else pixels
    looked = aligned(tables.entries(material, p.slope, material.size)) if material.size else None
    with device.session() as session:
        session.sweep(
            "lighting/lighting.cl", "lighting", -(-width // 16) * (pixels // width),
            aligned(normal.pixels), *(aligned(inputs[name].pixels) if name in inputs else None for name in NAMES),
            aligned(np.array(channels), np.int32), np.int32(slide.width), np.int32(slide.height),
            np.int32(slab.width), np.int32(slab.height),
            aligned(task.rows), np.int32(len(task.rows)), active(out_of_tiles, task.rows), aligned(_numbers(p, task)),
            looked, np.int32(material.size), session.write(out), np.uint32(width), np.uint32(pixels // width),
            np.uint32(scattered(pixels // width)),
            defines=_defines(material),
        )  # fmt: skip
    return out


def on_numpy(inputs: Inputs, p: Parameters, material: Material, *, single: bool = True) -> Array:
    images = {name: image.pixels for name, image in inputs.items() if name != "tiles"}
    height, width, _ = images["normal"].shape
    out = left_out(inputs, p.effect, len(p.lights), height, width)
    if out is not None:
        images["out"] = by_pixel(out, height, width)
    return lit(images, task_of(p, inputs, material, single=single))
