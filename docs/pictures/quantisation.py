"""What frame buffers of 8 and 12 bits made of shadows and fog, beside float32: docs/pictures/quantisation.png.

Columns are 8 bits, 12 bits and float32. Rows, from above:

* a shadow map whose depths are stored in so many bits, linear between its ends: edges move and light leaks;
* exponential fog, its share and the picture kept in so many bits, contrast times 12: bands;
* a floor in fog where two viewing directions meet, fog counted along each as hardware did: a seam, which no number of
  bits mends. In the last column it is counted from the eye.

Run: python docs/pictures/quantisation.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import lichen
from lichen.files import encode
from lichen.image import Image, Space, Storage
from lichen.memory import Array, aligned

WIDTH, HEIGHT = 320, 240
TARGET = Path(__file__).parent / "quantisation.png"
OBJECTS: list[dict[str, Any]] = [
    {"shape": "plane", "albedo": [0.8, 0.8, 0.8]},
    {"shape": "sphere", "centre": [-0.6, 0.8, 0], "radius": 0.7, "albedo": [0.8, 0.8, 0.8]},
    {"shape": "box", "centre": [1.1, 0.5, -0.3], "size": [0.8, 1, 0.8], "turn": 30, "albedo": [0.8, 0.8, 0.8]},
]
COLUMNS = ("fixed8", "fixed12", "float32")
BITS = {"fixed8": 8, "fixed12": 12}


def shadows(column: str) -> Array:
    """Grey: what reaches each point of a lamp far away, by a map whose ends are far apart."""
    camera = {"eye": [2.2, 2.6, 4.2], "target": [0, 0.4, 0], "fov": 40, "width": WIDTH, "height": HEIGHT}
    lamp = {"eye": [14.0, 18.0, 9.0], "target": [0, 0, 0], "fov": 9}
    seen = {
        name: lichen.run("gbuffer", objects=OBJECTS, buffer=name, frame="world", **camera).image
        for name in ("position", "normal")
    }
    depths = lichen.run("gbuffer", objects=OBJECTS, buffer="depth", **lamp, width=512, height=512).image
    light = {f"light_{name}": value for name, value in lamp.items()} | {"light_near": 1, "light_far": 300}
    stored = {"method": "linear", "bits": BITS[column]} if column in BITS else {"method": "exact"}
    made = lichen.run("shadow", depths, depth=seen["position"], normal=seen["normal"], filter=2, **light, **stored)
    direction = np.array(lamp["eye"]) / np.linalg.norm(lamp["eye"])
    cosine = np.maximum(seen["normal"].pixels @ direction, 0)[..., None]
    return np.asarray((0.12 + 0.88 * made.image.pixels * cosine).repeat(3, axis=-1))


def stored(values: Array, column: str) -> Array:
    """As a frame buffer of so many bits holds it."""
    return (
        lichen.run("quantise", values, levels=2 ** BITS[column], dither="none").image.pixels
        if column in BITS
        else values
    )


def fogged(scene: dict[str, Any], column: str) -> Array:
    """The fog's share and the picture, each through the frame buffer."""
    light = {"camera": scene["camera"], "objects": scene["objects"], "ambient": [1, 1, 1]}
    bare = stored(lichen.render(light).image.pixels, column)
    share = {"fog": {**scene["fog"], "colour": [1, 1, 1]}, "ambient": [0, 0, 0]}
    hidden = stored(lichen.render({**light, **share}).image.pixels, column)
    return stored(bare * (1 - hidden) + hidden * np.float32(scene["fog"]["colour"]), column)


def bands(column: str) -> Array:
    """A floor that fades into thin fog, its small differences made large."""
    camera = {"eye": [0, 1.2, 0], "target": [0, 0.6, -4], "fov": 50, "width": WIDTH, "height": HEIGHT}
    floor = [{"shape": "plane", "albedo": [0.3, 0.3, 0.3]}]
    fog = {"density": 0.06, "colour": [0.36, 0.36, 0.36]}
    return np.asarray((fogged({"camera": camera, "objects": floor, "fog": fog}, column) - 0.33) * 12 + 0.45)


def seam(column: str) -> Array:
    """A floor around the eye, its left half fogged for a view whose right edge is in the middle, its right half for one
    that looks there."""
    angle, rise = np.radians(np.linspace(-50, 50, WIDTH)), np.linspace(0.3, -0.7, HEIGHT)[:, None]
    with np.errstate(divide="ignore"):
        far = np.where(rise < 0, -1.2 / rise, np.inf)
    points = np.stack(np.broadcast_arrays(np.sin(angle) * far, rise * far, -np.cos(angle) * far), axis=-1)
    points = np.where(np.isfinite(far)[..., None], points, np.inf).astype(np.float32)
    bare = stored(np.full((HEIGHT, WIDTH, 3), [0.12, 0.16, 0.1], np.float32), column)
    halves = []
    for half, turn in ((slice(0, WIDTH // 2), -25), (slice(WIDTH // 2, WIDTH), 0)):
        ahead = [float(np.sin(np.radians(turn))), 0.0, -float(np.cos(np.radians(turn)))]
        fog = {"density": 0.3, "colour": 1.0, "distance": "euclidean" if column == "float32" else "planar"}
        black = np.zeros((HEIGHT, WIDTH // 2, 3), np.float32)
        hidden = stored(lichen.run("fog", black, depth=points[:, half], forward=ahead, **fog).image.pixels, column)
        halves.append(stored(bare[:, half] * (1 - hidden) + hidden * np.float32([0.75, 0.78, 0.82]), column))
    return np.concatenate(halves, axis=1)


def main() -> None:
    rows = [np.concatenate([make(column) for column in COLUMNS], axis=1) for make in (shadows, bands, seam)]
    light = Image(aligned(np.concatenate(rows), np.float32), Space.LINEAR)
    shown = lichen.run("transfer", light, curve="srgb", direction="encode").image
    TARGET.write_bytes(encode(shown, "png", storage=Storage.UINT8).data)


if __name__ == "__main__":
    main()
