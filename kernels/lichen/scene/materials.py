"""Buffers from a picture of material numbers and a list of materials, and what a mask leaves of buffers.

Every pixel of `material` holds the place of its material in the scene's list, from 0 on, in pictures of whole numbers
as those; what is not a whole number in it is refused, and NaN gives NaN in its pixel. Of each material come albedo,
specular and roughness, as far as no buffer of its own gives them. Where `mask` is 0 there is nothing: depths and
positions are infinite there, whatever they were; a mask that is not a number makes them none, too.

What is made is kept as long as the pictures that it was made of: frames of other lights ask for the same.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lichen.errors import Flaw, InvalidRequest
from lichen.image import Image, Space
from lichen.memory import Array, aligned
from lichen.scene.description import Buffers, Material, Scene
from lichen.scene.keeping import made_once

COLOURS = ("albedo", "specular")
PLACES = ("depth", "position")


def applied(scene: Scene, images: Mapping[str, Image]) -> tuple[Scene, dict[str, Image]]:
    """The scene with buffers in place of numbers and masks, and all its pictures. Raises `InvalidRequest`."""
    given, sent = dict(scene.buffers.given), dict(images)
    mask, numbers = (given.pop(name, None) for name in ("mask", "material"))
    if mask is None and numbers is None:
        return scene, sent
    flaws = [
        Flaw(f"/inputs/{name}", f"is required: the {what} of the scene's buffers")
        for what, name in (("mask", mask), ("material", numbers))
        if name is not None and name not in images
    ]
    if flaws:
        raise InvalidRequest("The scene lacks pictures.", flaws)
    if numbers is not None:
        for buffer in (*COLOURS, "roughness"):
            if buffer not in given:
                given[buffer] = f"{numbers}-{buffer}"
                sent[given[buffer]] = made_once(images[numbers], (buffer, scene.materials), _filled)
        sent.pop(numbers, None)
    if mask is not None:
        for buffer in PLACES:
            if given.get(buffer) in images:
                where = images[given[buffer]]
                given[buffer] = f"{given[buffer]}-masked"
                sent[given[buffer]] = made_once(where, (images[mask],), _masked)
        sent.pop(mask, None)
    left = set(given.values())
    kept = {name: image for name, image in sent.items() if name in left or name not in scene.buffers.given.values()}
    return scene.model_copy(update={"buffers": Buffers(**given)}), kept


def _filled(image: Image, buffer: str, materials: tuple[Material, ...]) -> Image:
    numbers = image.pixels[..., 0]
    if image.storage.integer:
        numbers = np.rint(numbers * image.storage.levels)
    known = ~np.isnan(numbers)
    wrong = known & ((numbers != np.rint(numbers)) | (numbers < 0) | (numbers >= len(materials)))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        said = f"holds {numbers[row, column]:g} at row {row}, column {column}; there are {len(materials)} materials"
        raise InvalidRequest("The scene's materials are not known.", [Flaw("/buffers/material", said)])
    values = [getattr(each, buffer) for each in materials]
    table = np.array(values, np.float32).reshape(len(values), -1)
    pixels = table[np.where(known, numbers, 0).astype(np.int64)]
    pixels[~known] = np.nan
    return Image(aligned(pixels), Space.LINEAR if buffer in COLOURS else Space.DATA)


def _masked(where: Image, mask: Image) -> Image:
    seen: Array = mask.pixels[..., :1]
    if seen.shape[:2] != where.pixels.shape[:2]:
        size = f"is {mask.width} x {mask.height} px; what it masks is {where.width} x {where.height} px"
        raise InvalidRequest("The scene's mask has another size.", [Flaw("/buffers/mask", size)])
    pixels = np.where(seen == 0, np.float32(np.inf), where.pixels)
    return where.replace(pixels=aligned(np.where(np.isnan(seen), np.float32(np.nan), pixels)))
