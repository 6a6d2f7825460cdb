"""Makes the pictures of the README from the samples beside them, each by one pipeline as its text form says it.

python docs/pictures/make.py [NAME ...]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import lichen
from lichen.files import decode, encode
from lichen.image import Image, Space, Storage

HERE = Path(__file__).resolve().parent
SAMPLES = HERE.parent / "samples"
PICTURES = {
    "blurred": ("gaussian:sigma=6", ("photo.jpg",)),
    "flow": ("field:kind=gyre,width=640,height=640,time=2|lic:length=28,kernel=hann,contrast=0.25,colour=magma", ()),
    "terrain": (
        "resize:width=806,height=688|gaussian:sigma=2|vector:make=gradient"
        "|lic:length=24,kernel=hann,contrast=0.22,colour=magma|crop:left=120,top=24,width=640,height=640",
        ("terrain.exr",),
    ),
    "cells": ("worley_noise:width=640,height=640,cell=80,tile=true,fractal=none", ()),
    "clouds": ("perlin_noise:width=640,height=640,cell=320,octaves=9,warp=90,tile=true|colour_map:map=magma", ()),
    "tracks": ("field:kind=cylinder,width=640,height=640|streamlines:spacing=14,width=1.6,length=1000", ()),
    "leaning": (
        "homography:matrix=[[1,0.35,0],[0,0.8,40],[0,0.0011,1]],border=wrap,width=640,height=640",
        ("photo.jpg",),
    ),
}


def main() -> None:
    for name in sys.argv[1:] or (*PICTURES, *OTHERS):
        picture = OTHERS[name]() if name in OTHERS else made(*PICTURES[name])
        shown = picture if picture.space is Space.SRGB else picture.replace(space=Space.SRGB)
        encoded = encode(shown, "jpeg", storage=Storage.UINT8, quality=88)
        (HERE / f"{name}.jpg").write_bytes(encoded.data)
        print(f"{name}: {len(encoded.data) // 1024} kB", file=sys.stderr)


def made(pipeline: Any, inputs: Sequence[str]) -> Image:
    images = [decode((SAMPLES / each).read_bytes()) for each in inputs]
    (result,) = lichen.run_pipeline(pipeline, *images).values()
    return result.image


def painted() -> Image:
    """The photo, smeared along its own edges."""
    photo, field = (decode((SAMPLES / each).read_bytes()) for each in ("photo.jpg", "field.exr"))
    return lichen.run("lic", field, texture=photo, length=7, kernel="hann").image


def textures() -> Image:
    """All named textures in a row."""
    each = [made(lichen.texture(name, width=320, height=320), ()).pixels for name in lichen.textures()]
    return Image(np.ascontiguousarray(np.concatenate([np.broadcast_to(one, (320, 320, 3)) for one in each], axis=1)))


def scene() -> Image:
    """The sample scene, rendered at twice its size and reduced."""
    said = json.loads((SAMPLES / "scene.json").read_text())
    width, height = said["camera"]["width"], said["camera"]["height"]
    said["camera"] |= {"width": 2 * width, "height": 2 * height}
    return lichen.run("resize", lichen.render(said).image, width=width, height=height, space="srgb").image


OTHERS = {"painted": painted, "textures": textures, "scene": scene}


if __name__ == "__main__":
    main()
