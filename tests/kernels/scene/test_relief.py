"""A relief on surfaces: what lights and environment see of it, and that a flat one costs nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.image import Image, Space
from lichen.opencl.session import Session

CAMERA: dict[str, Any] = {"eye": [0.6, 1.6, 4.5], "target": [0, 0.6, 0], "fov": 42, "width": 72, "height": 54}
OBJECTS = [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.7}]
EFFECTS: dict[str, Any] = {
    "lights": [
        {"kind": "point", "position": [2, 3, 1], "intensity": 9},
        {"kind": "directional", "direction": [-1, -1, -1], "intensity": 0.4},
    ],
    "surface": {"model": "blinn_phong", "diffuse": [0.5, 0.5, 0.5], "highlight": [0.4, 0.4, 0.4]},
    "environment": {"image": "sky", "reflectance": 0.3, "fresnel": "none"},
    "fog": {"density": 0.05},
    "background": [0.2, 0.3, 0.4],
}
SCALE = 0.03


def seen() -> dict[str, Image]:
    """What a renderer would send: in the camera's axes, or positions in those of the world."""
    size = {key: CAMERA[key] for key in ("fov", "width", "height", "eye", "target")}
    made = {
        name: lichen.run("gbuffer", objects=OBJECTS, buffer=name, frame="camera", **size).image
        for name in ("depth", "normal", "position")
    }
    y, x = np.mgrid[0:54, 0:72]
    made["height"] = Image((np.sin(x / 2) * np.cos(y / 3))[..., None].astype(np.float32))
    made["sky"] = Image(np.random.default_rng(3).random((8, 16, 3), dtype=np.float32), Space.LINEAR)
    return made


def rendered(images: dict[str, Image], *buffers: str, prune: bool = True, **changes: Any) -> Any:
    scene = {"camera": {"fov": 42}, "buffers": {name: name for name in buffers}, **EFFECTS, **changes}
    return lichen.render(scene, images={name: images[name] for name in (*buffers, "sky")}, prune=prune)


@pytest.mark.parametrize("place", ["depth", "position"])
def test_lights_and_environment_see_bent_normals(place: str) -> None:
    images = seen()
    found = rendered(images, place, "normal", "height", relief={"scale": SCALE})
    points = {"position": images["position"], "height": images["height"]}
    bent = lichen.run("bump", images["normal"], **points, scale=SCALE).image
    expected = rendered({**images, "normal": bent}, place, "normal").image.pixels
    np.testing.assert_allclose(found.image.pixels, expected, rtol=1e-5, atol=1e-6)
    whole = rendered(images, place, "normal", "height", prune=False, relief={"scale": SCALE})
    np.testing.assert_allclose(whole.image.pixels, expected, atol=1e-5)
    normals = rendered(images, place, "normal", "height", relief={"scale": SCALE}, output="normal")
    np.testing.assert_allclose(normals.image.pixels, bent.pixels, atol=1e-4)
    plain = rendered(images, place, "normal").image.pixels
    assert np.abs(plain - expected).max() > 0.05, "the relief is seen"


def test_a_flat_relief_launches_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    launched: list[str] = []
    launch = Session.launch

    def counting(self: Session, source: str, kernel: str, *arguments: Any, **further: Any) -> None:
        launched.append(source)
        launch(self, source, kernel, *arguments, **further)

    monkeypatch.setattr(Session, "launch", counting)
    images = seen()
    plain = rendered(images, "depth", "normal").image.pixels
    flat = {**images, "height": Image(np.full((54, 72, 1), 0.7, np.float32))}
    for sent, values in ((flat, {}), (images, {"relief": {"scale": 0}})):
        launched.clear()
        found = rendered(sent, "depth", "normal", "height", **values)
        assert launched
        assert "relief/bump.cl" not in launched
        assert [each for each in found.decisions if each.node == "relief" and each.pass_ == "identity"]
        np.testing.assert_array_equal(found.image.pixels, plain)
        whole = rendered(sent, "depth", "normal", "height", prune=False, **values)
        assert "relief/bump.cl" in launched
        np.testing.assert_allclose(whole.image.pixels, plain, atol=1e-6)


@pytest.mark.parametrize("named", ["Height", "Displacement"])
def test_layers_hold_a_relief(named: str) -> None:
    images = seen()
    names = [f"ViewLayer.Position.{each}" for each in "XYZ"] + [f"ViewLayer.Normal.{each}" for each in "XYZ"]
    parts = [images[name].pixels for name in ("position", "normal", "height")]
    layers = Image(np.concatenate(parts, axis=2), metadata={"channel_names": [*names, f"ViewLayer.{named}.X"]})
    scene = {"camera": {"fov": 42}, "buffers": {"layers": "l"}, **EFFECTS, "relief": {"scale": SCALE}}
    found = lichen.render(scene, images={"l": layers, "sky": images["sky"]}).image.pixels
    expected = rendered(images, "position", "normal", "height", relief={"scale": SCALE}).image.pixels
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("buffers", "changes", "pointers"),
    [
        ({"height": "h"}, {}, {"/buffers/normal", "/buffers/depth"}),
        ({"depth": "d", "normal": "n"}, {"relief": {}}, {"/buffers/height"}),
        ({"depth": "d", "normal": "n", "height": "h"}, {"relief": {"scale": "steep"}}, {"/relief/scale"}),
        ({"depth": "d", "normal": "n", "height": "h"}, {"h": np.zeros((2, 3), np.float32)}, {"/buffers/height"}),
    ],
)
def test_flaws_are_named(buffers: dict[str, str], changes: dict[str, Any], pointers: set[str]) -> None:
    images = {"d": np.ones((4, 4), np.float32), "n": np.ones((4, 4, 3), np.float32), "h": np.eye(4, dtype=np.float32)}
    scene = {"buffers": buffers, "lights": [{"kind": "directional"}]}
    for name, value in changes.items():
        (images if name in images else scene)[name] = value
    with pytest.raises(InvalidRequest) as refused:
        lichen.render(scene, images={name: images[name] for name in buffers.values()})
    assert {flaw.pointer for flaw in refused.value.flaws} == pointers
