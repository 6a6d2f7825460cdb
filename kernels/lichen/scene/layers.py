"""Buffers from one picture of many layers, as renderers write them: EXR channels by their names.

A channel is called LAYER.PASS.COMPONENT, as in `ViewLayer.Normal.X`; layers may be missing, and of several the first
that has a pass gives it. Which passes are which buffers:

    position    Position
    depth       Depth, Z
    normal      Normal
    albedo      DiffCol, Diffuse Color, Denoising Albedo, Albedo
    specular    GlossCol, Glossy Color, Specular
    roughness   Roughness
    emissive    Emissive
    height      Height, Displacement, where there are normals and places, too
    motion      Vector, where the scene has a shutter
    material    IndexMA, Material Index, where the scene lists materials
    mask        Mask, Alpha, and of Combined the component A, where any of it is 0 and there are depths or positions

What the compositor made, the layer Composite, says nothing of the surfaces and is not read. Nor are numbers of objects,
a mask in Blender's compositor: 0 is what all objects have there as long as nobody numbers them.

Where there is nothing, Blender writes a depth of 1e10, in half floats of 65504, and a position of 0 0 0; both become
infinite by the depth. Its normals and positions are in the world's axes, whose z is up, so where both are there the
scene is in those axes, and `up` of the camera says so. Depth alone is the camera's, and so must normals be then. Of a
Vector X and Y lead to where the point was in the frame before, y up.

Source: Blender manual, Rendering, Passes, and the files that Blender 4.2 writes; of vectors what Cycles subtracts, in
`primitive_motion_vector`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lichen.errors import Flaw, InvalidRequest
from lichen.image import Image, Space
from lichen.memory import Array, aligned
from lichen.scene.description import Buffers, Scene

PASSES: Mapping[str, tuple[str, ...]] = {
    "position": ("Position",),
    "depth": ("Depth", "Z"),
    "normal": ("Normal",),
    "albedo": ("DiffCol", "Diffuse Color", "Denoising Albedo", "Albedo"),
    "specular": ("GlossCol", "Glossy Color", "Specular"),
    "roughness": ("Roughness",),
    "emissive": ("Emissive",),
    "height": ("Height", "Displacement"),
    "motion": ("Vector",),
    "material": ("IndexMA", "Material Index"),
    "mask": ("Mask", "Alpha", "Combined.A"),
}
"""Passes of each buffer; of some a component that is not the first."""
COMPOSITE = "Composite"
COMPONENTS: Mapping[str, tuple[str, ...]] = {
    "position": ("X", "Y", "Z"), "normal": ("X", "Y", "Z"), "albedo": ("R", "G", "B"), "specular": ("R", "G", "B"),
    "motion": ("X", "Y"),
}  # fmt: skip
BACK = np.array([-1, 1], np.float32)
"""From the way back with y up to that which the point has come, with y down."""
NOWHERE = 1e9
"""A depth from which on there is nothing; half floats end at 65504."""
HALF_MAX = 65504.0


def spread(scene: Scene, images: Mapping[str, Image]) -> tuple[Scene, dict[str, Image]]:
    """The scene with buffers of their own in place of layers, and all its pictures. Raises `InvalidRequest`."""
    name = scene.buffers.layers
    if name is None or name not in images:
        return scene, dict(images)
    found = buffers(images[name])
    given = scene.buffers.given
    there = found.keys() | given.keys()
    raised = "normal" in there and not there.isdisjoint(("depth", "position"))
    hidden = "mask" in found and not there.isdisjoint(("depth", "position")) and not (found["mask"].pixels > 0).all()
    wanted = {
        "material": bool(scene.materials), "height": raised, "motion": scene.shutter is not None, "mask": hidden,
    }  # fmt: skip
    made = {key: f"{name}-{key}" for key in found if key not in given and wanted.get(key, True)}
    if "position" in made or "position" in given:
        made.pop("depth", None)
    if not made:
        flaw = Flaw("/buffers/layers", f"{name} has none of the passes {', '.join(PASSES)}")
        raise InvalidRequest("The picture has no layers that are read.", [flaw])
    others = {key: image for key, image in images.items() if key != name}
    changed = scene.model_copy(update={"buffers": Buffers(**given, **made)})
    return changed, others | {made[key]: found[key] for key in made}


def buffers(image: Image) -> dict[str, Image]:
    """The buffers among a picture's channels."""
    names = [str(each) for each in image.metadata.get("channel_names", ())]
    found = {}
    for buffer, passes in PASSES.items():
        channels = next((at for each in passes if (at := _channels(names, each, buffer))), None)
        if channels is not None:
            pixels = aligned(np.ascontiguousarray(image.pixels[..., channels]))
            pixels = aligned(pixels * BACK, pixels.dtype) if buffer == "motion" else pixels
            space = Space.LINEAR if buffer in ("albedo", "specular") else Space.DATA
            found[buffer] = Image(pixels, space, storage=image.storage)
    if "depth" in found:
        nothing = _nothing(found["depth"].pixels)
        for buffer in ("depth", "position"):
            if buffer in found:
                found[buffer] = found[buffer].replace(pixels=aligned(np.where(nothing, np.inf, found[buffer].pixels)))
    return found


def _nothing(depth: Array) -> Array:
    return np.asarray((depth >= NOWHERE) | (depth == HALF_MAX))


def _channels(names: list[str], wanted: str, buffer: str) -> list[int] | None:
    """Places of a pass's components; None where it is not there."""
    wanted, _, one = wanted.partition(".")
    order = (one,) if one else COMPONENTS.get(buffer)
    of_pass: dict[str, dict[str, int]] = {}
    for at, name in enumerate(names):
        layer, _, component = name.rpartition(".")
        layer, _, own = layer.rpartition(".")
        if own == wanted and layer != COMPOSITE:
            of_pass.setdefault(layer, {}).setdefault(component, at)
    for components in of_pass.values():
        if order is None:
            return [next(iter(components.values()))]
        if all(each in components for each in order):
            return [components[each] for each in order]
    return None
