"""Light computed for one pixel in many, and given to those between that resemble it.

Every `step`th pixel of every `step`th row is lit, and the last of each; diffuse light and highlights apart and of white
surfaces, so that colours stay as fine as they are. Every other pixel takes the mean of the four around it, each by its
bilinear weight times s^2, where s says how alike the two are:

    s = 1 - 8 ((1 - <n, n'>) + sin^2 a + |roughness - roughness'|),  0 where negative

with a the angle between the way from one to the other and the pixel's tangent plane: 0 along a surface, however steep
it lies, and large across its edge. Where the weights amount to less than 1/8 nothing around a pixel is like it, and it
is lit by itself, as are those with a number missing: edges stay sharp, and NaN stays in its pixel.

Source: P.-P. Sloan, N. Govindaraju, D. Nowrouzezahrai and J. Snyder, Image-based proxy accumulation for real-time soft
global illumination, Pacific Graphics 2007 (upsampling by likeness); W. Heidrich's dissertation (Erlangen 1999), chapter
5, where vertices are what is lit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lichen.image import Image
from lichen.memory import Array, aligned, aligned_empty
from lichen.operation import InputFacts, Inputs
from lichen.operations.lighting.launch import on_numpy, on_opencl
from lichen.operations.lighting.parameters import Parameters
from lichen.operations.lighting.reflection import unit

if TYPE_CHECKING:
    from lichen.opencl.device import Device

LIKE = 8.0
ENOUGH = 1 / 8
SEGMENT = 64
SHAPES = ("normal", "position", "roughness")
"""What light depends on, other than in proportion."""
Shade = Callable[[Inputs, Parameters], Array]


def power(step: float) -> int:
    """The power of 2 that a step stands for."""
    return int(2 ** round(math.log2(step)))


def unfit(p: Parameters, facts: InputFacts) -> str | None:
    if any(name in facts for name in ("slide", "slab", "tangent", "tiles")):
        return "slides, grain and lists of tiles are finer than its pixels"
    if "visibility" in facts and facts["visibility"].channels > 1:
        return "shadows of single lamps are finer than its pixels"
    return None


@dataclass(frozen=True, eq=False)
class Grid:
    """Along one axis the pixels that are lit, and for each pixel the one before it and how far it is to the next."""

    lit: Array
    before: Array
    share: Array

    @classmethod
    def along(cls, size: int, step: int) -> Grid:
        lit = np.unique(np.append(np.arange(0, size, step), size - 1))
        at = np.arange(size)
        before = at // step
        wide = lit[np.minimum(before + 1, len(lit) - 1)] - lit[before]
        return cls(lit, before, ((at - lit[before]) / np.maximum(wide, 1)).astype(np.float32))

    @property
    def after(self) -> Array:
        return np.asarray(np.minimum(self.before + 1, len(self.lit) - 1))


def _lights(inputs: Inputs, p: Parameters, shade: Shade, down: Grid, across: Grid) -> dict[str, Array]:
    """What is known at the pixels that are lit: shapes, normals of unit length (NaN where light is no number),
    diffuse light and highlights."""
    some = {
        name: inputs[name].replace(pixels=aligned(inputs[name].pixels[down.lit][:, across.lit]))
        for name in SHAPES
        if name in inputs
    }
    white, black = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    made = {name: image.pixels for name, image in some.items()}
    made["matt"] = shade(some, p.model_copy(update={"diffuse": white, "highlight": black}))
    if p.shines:
        made["shiny"] = shade(some, p.model_copy(update={"diffuse": black, "highlight": white}))
    with np.errstate(all="ignore"):
        facing = np.moveaxis(unit(np.moveaxis(made["normal"], -1, 0)), 0, -1)
    lost = ~np.logical_and.reduce([np.isfinite(made[name]).all(axis=-1) for name in ("matt", "shiny") if name in made])
    made["normal"] = np.where(lost[..., None], np.nan, facing).astype(np.float32)
    return made


def _alone(inputs: Inputs, p: Parameters, shade: Shade, out: Array, alone: Array) -> Array:
    """With the pixels that nothing around them is like lit by themselves."""
    rows, columns = np.nonzero(alone)
    if rows.size:
        some = {
            name: image.replace(pixels=aligned(image.pixels[rows, columns][None])) for name, image in inputs.items()
        }
        out[rows, columns] = shade(some, p)[0]
    return out


def _colour(p: tuple[float, float, float], image: Image | None) -> Array:
    own = np.array(p, np.float32)
    return np.asarray(own if image is None else own * image.pixels)


def numpy_body(inputs: Inputs, p: Parameters, step: int) -> Array:
    def shade(some: Inputs, q: Parameters) -> Array:
        return on_numpy(some, q, q.material())

    normal = inputs["normal"].pixels
    height, width, _ = normal.shape
    down, across = Grid.along(height, step), Grid.along(width, step)
    low = _lights(inputs, p, shade, down, across)
    lights = np.concatenate([low[name] for name in ("matt", "shiny") if name in low], axis=-1)
    total, weights = np.zeros((height, width, lights.shape[-1]), np.float32), np.zeros((height, width), np.float32)
    with np.errstate(all="ignore"):
        facing = np.moveaxis(unit(np.moveaxis(normal, -1, 0)), 0, -1).astype(np.float32)
        for rows, part_of in ((down.before, 1 - down.share), (down.after, down.share)):
            for columns, share in ((across.before, 1 - across.share), (across.after, across.share)):
                at = np.ix_(rows, columns)
                alike = _alike(inputs, facing, low, at)
                w = part_of[:, None] * share * alike * alike
                w = np.where(w > 0, w, np.float32(0))
                weights += w
                total += np.where(w[..., None] > 0, w[..., None] * lights[at], np.float32(0))
        alone = ~(weights >= ENOUGH) | ~_sound(inputs)
        light = total / weights[..., None]
        made = _colour(p.diffuse, inputs.get("albedo")) * light[..., :3]
        if "shiny" in low:
            made = made + _colour(p.highlight, inputs.get("specular")) * light[..., 3:]
        if "visibility" in inputs:
            made = made * inputs["visibility"].pixels
    return _alone(inputs, p, shade, aligned(np.asarray(made, np.float32)), alone)


def _alike(inputs: Inputs, facing: Array, low: dict[str, Array], at: tuple[Array, ...]) -> Array:
    apart = 1 - np.sum(facing * low["normal"][at], axis=-1)
    if "position" in inputs:
        way = low["position"][at] - inputs["position"].pixels
        off, far = np.sum(facing * way, axis=-1), np.sum(way * way, axis=-1)
        apart = apart + np.where(far == 0, np.float32(0), off * off / far)
    if "roughness" in inputs:
        apart = apart + np.abs(inputs["roughness"].pixels[..., 0] - low["roughness"][at][..., 0])
    made: Array = 1 - np.float32(LIKE) * apart
    return np.asarray(np.where(made > 0, made, made - made))


def _sound(inputs: Inputs) -> Array:
    """Pixels of which all is a number."""
    return np.asarray(np.logical_and.reduce([np.isfinite(image.pixels).all(axis=-1) for image in inputs.values()]))


def opencl_body(device: Device, inputs: Inputs, p: Parameters, step: int) -> Array:
    def shade(some: Inputs, q: Parameters) -> Array:
        return on_opencl(device, some, q, q.material())

    normal = inputs["normal"]
    height, width = normal.height, normal.width
    down, across = Grid.along(height, step), Grid.along(width, step)
    low = _lights(inputs, p, shade, down, across)
    order = ("normal", "position", "roughness", "matt", "shiny")
    planes = np.concatenate([np.moveaxis(low[name], -1, 0) for name in order if name in low])
    names = ("position", "roughness", "albedo", "specular", "visibility")
    defines: dict[str, int | float | str] = {
        name.upper(): inputs[name].channels if name in inputs else 0 for name in names
    }
    out, alone = aligned_empty((height, width, 3)), aligned(np.empty((height, width), np.uint8), np.uint8)
    with device.session() as session:
        session.launch(
            "lighting/coarse.cl", "upsampled", (height * -(-width // SEGMENT),),
            aligned(normal.pixels), *(aligned(inputs[name].pixels) if name in inputs else None for name in names),
            aligned(planes), np.int32(len(down.lit) * len(across.lit)), np.int32(len(across.lit)),
            aligned(np.pad(across.share, (0, SEGMENT), mode="edge")),
            aligned(down.before, np.int32), aligned(down.after, np.int32), aligned(down.share),
            aligned(np.array([*p.diffuse, *p.highlight])), session.write(out), session.write(alone),
            np.int32(width), np.int32(height),
            defines={**defines, "SHINY": int("shiny" in low), "LIKE": LIKE, "ENOUGH": ENOUGH, "STEP": step},
        )  # fmt: skip
    return _alone(inputs, p, shade, out, alone)
