"""Buffers as scenes have them, from those of renderers with other conventions.

Scenes have signed normals, and axes with x to the right, y up and z towards the viewer. Normal maps hold (n + 1) / 2,
in some y runs down, and the camera's axes of Direct3D are left-handed: z runs away from the viewer. Which of these
holds of a buffer is said by the scene's `conventions`, and it is converted before anything looks at it, once.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lichen.image import Image
from lichen.memory import aligned
from lichen.operations.environment.surfaces import Encoding
from lichen.scene.description import Buffers, Conventions, Scene
from lichen.scene.keeping import made_once


def converted(scene: Scene, images: Mapping[str, Image]) -> tuple[Scene, dict[str, Image]]:
    """The scene with buffers in the usual conventions, and all its pictures."""
    said, given, sent = scene.conventions, dict(scene.buffers.given), dict(images)
    if said == Conventions():
        return scene, sent
    for buffer in ("normal", "position"):
        unit = buffer == "normal" and said.encoding is Encoding.UNIT
        signs = (1.0, -1.0 if buffer in said.y_down else 1.0, -1.0 if buffer in said.left_handed else 1.0)
        name = given.get(buffer, "")
        if name in images and images[name].channels == 3 and (unit or min(signs) < 0):
            given[buffer] = f"{name}-converted"
            sent[given[buffer]] = made_once(images[name], (unit, signs), _converted)
    left = set(given.values())
    kept = {name: image for name, image in sent.items() if name in left or name not in scene.buffers.given.values()}
    return scene.model_copy(update={"buffers": Buffers(**given), "conventions": Conventions()}), kept


def _converted(image: Image, unit: bool, signs: tuple[float, float, float]) -> Image:
    pixels = image.pixels * np.float32(2) - np.float32(1) if unit else image.pixels
    return image.replace(pixels=aligned(pixels * np.array(signs, np.float32), image.pixels.dtype))
