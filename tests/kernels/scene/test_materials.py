"""Materials by their numbers, and masks, against the buffers that they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, Space, Storage

HEIGHT, WIDTH = 24, 40
MATERIALS = [
    {"albedo": [0.7, 0.2, 0.1], "roughness": 0.3},
    {"albedo": [0.1, 0.6, 0.2], "specular": [0.2, 0.4, 0.8], "roughness": 0.9},
    {"albedo": [0.25, 0.5, 1.0], "specular": [0, 0, 0]},
]
SCENE: dict[str, Any] = {
    "buffers": {"position": "p", "normal": "n"},
    "lights": [{"kind": "point", "position": [0, 1, 2], "intensity": 9}],
    "surface": {"model": "torrance_sparrow"},
    "ambient": [0.1, 0.1, 0.1],
    "fog": {"density": 0.1},
    "background": [0.2, 0.3, 0.4],
}
RNG = np.random.default_rng(7)
NUMBERS = RNG.integers(0, 3, (HEIGHT, WIDTH, 1)).astype(np.float32)


def sent() -> dict[str, Any]:
    normal = RNG.standard_normal((HEIGHT, WIDTH, 3)).astype(np.float32) + np.float32([0, 0, 3])
    position = RNG.uniform(-1, 1, (HEIGHT, WIDTH, 3)).astype(np.float32) - np.float32([0, 0, 4])
    return {"p": position, "n": normal}


def render(images: dict[str, Any], **buffers: str) -> np.ndarray:
    scene = {**SCENE, "buffers": {**SCENE["buffers"], **buffers}}
    if "material" in buffers:
        scene["materials"] = MATERIALS
    return lichen.render(scene, images=images).image.pixels


@pytest.mark.parametrize("stored", [Storage.FLOAT32, Storage.UINT8])
def test_numbers_stand_for_buffers(stored: Storage) -> None:
    images = sent()
    of = NUMBERS[..., 0].astype(int)
    given = {
        name: np.array([each.get(name, usual) for each in MATERIALS], np.float32)[of].reshape(HEIGHT, WIDTH, -1)
        for name, usual in (("albedo", [0.5] * 3), ("specular", [1.0] * 3), ("roughness", 0.5))
    }
    colours = {name: Image(given[name], Space.LINEAR) for name in ("albedo", "specular")}
    plain = render(
        {**images, **colours, "r": Image(given["roughness"], Space.DATA)},
        albedo="albedo", specular="specular", roughness="r",
    )  # fmt: skip
    numbers = Image(NUMBERS / (255 if stored is Storage.UINT8 else 1), Space.DATA, storage=stored)
    np.testing.assert_array_equal(render({**images, "m": numbers}, material="m"), plain)


def test_layers_hold_numbers_as_blender_names_them() -> None:
    images = sent()
    names = ["Position.X", "Position.Y", "Position.Z", "Normal.X", "Normal.Y", "Normal.Z", "IndexMA.X"]
    pixels = np.concatenate([images["p"], images["n"], NUMBERS], axis=2)
    layers = Image(pixels, Space.DATA, metadata={"channel_names": [f"ViewLayer.{each}" for each in names]})
    scene = {**SCENE, "buffers": {"layers": "l"}, "materials": MATERIALS}
    found = lichen.render(scene, images={"l": layers}).image.pixels
    np.testing.assert_array_equal(found, render({**images, "m": NUMBERS}, material="m"))


def test_one_number_that_is_none_stays_in_its_pixel() -> None:
    images, numbers = sent(), NUMBERS.copy()
    plain = render({**images, "m": numbers}, material="m")
    numbers[3, 5] = np.nan
    found = render({**images, "m": numbers}, material="m")
    assert np.isnan(found[3, 5]).all()
    found[3, 5] = plain[3, 5]
    np.testing.assert_array_equal(found, plain)


def test_where_a_mask_is_0_there_is_nothing() -> None:
    images = sent()
    mask = np.ones((HEIGHT, WIDTH), np.float32)
    mask[4:9, 10:30] = 0
    position = np.where(mask[..., None] == 0, np.float32(np.inf), images["p"])
    plain = render({**images, "p": position, "m": NUMBERS}, material="m")
    np.testing.assert_array_equal(render({**images, "m": NUMBERS, "k": mask}, material="m", mask="k"), plain)
    empty = render({**images, "m": NUMBERS, "k": np.zeros_like(mask)}, material="m", mask="k")
    np.testing.assert_array_equal(empty, np.broadcast_to(empty[0, 0], empty.shape))


@pytest.mark.parametrize(
    ("buffers", "changes", "pointer"),
    [
        ({"material": "m"}, {"m": NUMBERS + 1}, "/buffers/material"),
        ({"material": "m"}, {"m": NUMBERS + 0.25}, "/buffers/material"),
        ({"material": "m"}, {}, "/inputs/m"),
        ({"mask": "k"}, {"k": np.ones((2, 2), np.float32)}, "/buffers/mask"),
    ],
)
def test_flaws_are_named(buffers: dict[str, str], changes: dict[str, Any], pointer: str) -> None:
    with pytest.raises(InvalidRequest) as refused:
        render({**sent(), **changes}, **buffers)
    assert pointer in [flaw.pointer for flaw in refused.value.flaws]
    with pytest.raises(InvalidRequest, match="materials"):
        lichen.render({**SCENE, "materials": MATERIALS}, images=sent())
