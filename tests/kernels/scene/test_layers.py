"""One EXR of many layers as Blender writes it, made with OpenEXR, as a scene's buffers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.files import decode

CAMERA = {"eye": [0.5, 1.5, 4.0], "target": [0, 0.5, 0], "fov": 45, "width": 40, "height": 30}
OBJECTS = [
    {"shape": "plane", "albedo": [0.5, 0.6, 0.7]},
    {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.7, "albedo": [0.8, 0.2, 0.1]},
]
EFFECTS = {
    "lights": [{"kind": "point", "position": [2, 4, 3], "intensity": 12}],
    "ambient": [0.05, 0.05, 0.05],
    "background": [0.3, 0.4, 0.6],
    "fog": {"kind": "height", "density": 0.2, "falloff": 1.0, "colour": [0.6, 0.7, 0.8]},
}


MOVING = [OBJECTS[0], {**OBJECTS[1], "velocity": [0.3, 0.2, 0.1]}]


def seen(buffer: str) -> np.ndarray:
    return lichen.run("gbuffer", objects=MOVING, buffer=buffer, frame="world", **CAMERA).image.pixels


def written(passes: dict[str, tuple[str, np.ndarray]], path: Path) -> bytes:
    """An EXR of passes, by their full names: of each the components and pixels."""
    channels = {
        f"{name}.{component}": np.ascontiguousarray(pixels[..., at])
        for name, (components, pixels) in passes.items()
        for at, component in enumerate(components)
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))
    return path.read_bytes()


@pytest.fixture
def render(tmp_path: Path) -> bytes:
    """What Blender would write of the scene: a depth of 1e10 where there is nothing, and positions of 0 there."""
    depth, position = seen("depth"), seen("position")
    nothing = np.isinf(depth)
    passes = {"Combined": ("RGBA", np.full((30, 40, 4), 0.25, np.float32))}
    passes |= {"Depth": ("Z", np.where(nothing, np.float32(1e10), depth))}
    passes |= {"Position": ("XYZ", np.where(nothing, np.float32(0), position)), "Normal": ("XYZ", seen("normal"))}
    passes |= {"DiffCol": ("RGB", seen("albedo"))}
    back, up = -seen("motion")[..., 0], seen("motion")[..., 1]
    passes["Vector"] = ("XYZW", np.stack([back, up, back * 2, up * 3], axis=-1))
    return written({f"ViewLayer.{name}": each for name, each in passes.items()}, tmp_path / "render.exr")


def test_layers_are_found_by_name_and_lit_like_the_objects(render: bytes) -> None:
    picture = decode(render)
    sent = {"camera": {"eye": CAMERA["eye"], "target": CAMERA["target"]}, "buffers": {"layers": "render"}, **EFFECTS}
    made = lichen.render(sent, images={"render": picture}).image.pixels
    expected = lichen.render({"camera": CAMERA, "objects": OBJECTS, **EFFECTS}).image.pixels
    np.testing.assert_allclose(made, expected, atol=2e-5)


def test_vectors_are_the_motion_of_a_shutter(render: bytes) -> None:
    """As Cycles has them: where a point was less where it is, up and to the right."""
    view = {"camera": {"eye": CAMERA["eye"], "target": CAMERA["target"]}, "buffers": {"layers": "render"}}
    shutter = {"shutter": {"shutter": 0.5, "start": -0.5}}
    made = lichen.render({**view, **EFFECTS, **shutter}, images={"render": decode(render)}).image.pixels
    expected = lichen.render({"camera": CAMERA, "objects": MOVING, **EFFECTS, **shutter}).image.pixels
    np.testing.assert_allclose(made, expected, atol=5e-5)
    still = lichen.render({"camera": CAMERA, "objects": OBJECTS, **EFFECTS}).image.pixels
    assert np.abs(made - still).max() > 0.05


@pytest.mark.parametrize("drawn", [False, True], ids=["alpha", "a mask of its own"])
def test_what_a_render_covers_is_its_mask(drawn: bool, tmp_path: Path) -> None:
    """Without depths, positions of 0 are no places where the render's alpha is 0, or a mask that was drawn besides."""
    nothing = np.isinf(seen("depth"))
    colour, hidden = np.full((30, 40, 4), 0.25, np.float32), nothing.copy()
    colour[nothing[..., 0], 3] = 0
    passes = {
        "Composite.Combined": ("RGBA", np.ones_like(colour)),
        "ViewLayer.Combined": ("RGBA", colour),
        "ViewLayer.IndexOB": ("X", np.zeros((30, 40, 1), np.float32)),
        "ViewLayer.Position": ("XYZ", np.where(nothing, np.float32(0), seen("position"))),
        "ViewLayer.Normal": ("XYZ", seen("normal")),
        "ViewLayer.DiffCol": ("RGB", seen("albedo")),
    }
    if drawn:
        hidden[:, 20:] = True
        passes["ViewLayer.Mask"] = ("X", np.where(hidden, np.float32(0), np.float32(0.5)))
    picture = decode(written(passes, tmp_path / "render.exr"))
    view = {"camera": {"eye": CAMERA["eye"], "target": CAMERA["target"]}, "buffers": {"layers": "render"}}
    made = lichen.render({**view, **EFFECTS}, images={"render": picture}).image.pixels
    expected = lichen.render({"camera": CAMERA, "objects": OBJECTS, **EFFECTS}).image.pixels.copy()
    assert 100 < np.count_nonzero(nothing) < 1100
    np.testing.assert_allclose(made[~hidden[..., 0]], expected[~hidden[..., 0]], atol=2e-5)
    np.testing.assert_allclose(made[nothing[..., 0]], expected[nothing[..., 0]], atol=2e-5)
    if drawn:
        assert np.abs(made - expected)[hidden[..., 0] & ~nothing[..., 0]].max() > 0.1


def test_a_picture_without_such_layers_is_refused() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({"buffers": {"layers": "p"}, "lights": [{}]}, images={"p": np.ones((4, 4, 3))})
    assert {each.pointer for each in caught.value.flaws} == {"/buffers/layers"}
