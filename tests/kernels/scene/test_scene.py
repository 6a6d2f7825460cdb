"""Scenes: what they are lowered to, what is left out, and that leaving it out changes nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import lichen
from lichen.errors import InvalidRequest
from lichen.opencl.session import Session
from lichen.scene.description import read
from lichen.scene.predicates import clearance

STILL: dict[str, Any] = {
    "camera": {"eye": [0.6, 1.6, 4.5], "target": [0, 0.6, 0], "fov": 42, "width": 72, "height": 54},
    "objects": [
        {"shape": "plane", "albedo": [0.75, 0.75, 0.72], "checker": [0.25, 0.28, 0.33], "check": 0.8},
        {"shape": "sphere", "centre": [-0.9, 0.7, 0], "radius": 0.7, "albedo": [0.8, 0.15, 0.08]},
        {"shape": "box", "centre": [0.9, 0.45, 0.6], "size": [0.8, 0.9, 0.8], "turn": 25, "albedo": [0.2, 0.4, 0.75]},
    ],
    "lights": [
        {"kind": "point", "position": [3, 4, 3], "intensity": 18, "shadow": {"filter": 3, "size": 128}},
        {"kind": "directional", "direction": [0.6, -1, -0.3], "intensity": 0.25},
    ],
    "ambient": [0.05, 0.06, 0.08],
    "background": [0.55, 0.65, 0.8],
    "fog": {"kind": "height", "density": 0.12, "falloff": 1.5, "colour": [0.6, 0.68, 0.8]},
}
SPOT = {
    "kind": "spot",
    "position": [0, 5, 0],
    "direction": [0, 1, 0],
    "intensity": 9,
    "outer": 40,
    "shadow": {"size": 64},
}
DARK = {"kind": "point", "position": [1, 1, 1], "intensity": 0, "shadow": {"size": 64}}
ALONE = {"objects": STILL["objects"][1:2], "lights": [{**STILL["lights"][0], "shadow": {"size": 64}}]}
SCENES: dict[str, dict[str, Any]] = {
    "all of it": STILL,
    "no fog, black background": {**STILL, "fog": {"density": 0}, "background": [0, 0, 0]},
    "lights that light nothing": {**STILL, "lights": [*STILL["lights"], SPOT, DARK]},
    "one convex object": {**STILL, **ALONE},
    "a point that pretends": {**STILL, "lights": [{**STILL["lights"][0], "shadow": {"kind": "pcss", "size": 64}}]},
    "from a side, in layers": {
        **STILL,
        "camera": {**STILL["camera"], "extent": 4.0},
        "fog": {"kind": "layered", "heights": [0, 0.5, 2], "densities": [0.4, 0.0, 0.1], "density": 0.5},
        "surface": {"model": "blinn_phong", "highlight": [0.5, 0.5, 0.5]},
    },
    "by a still lens with a shutter": {**STILL, "lens": {"blur": 0}, "shutter": {}},
    "a background that fog hides": {
        **STILL,
        "lights": STILL["lights"][:1],
        "ambient": [0, 0, 0],
        "fog": {"kind": "linear", "start": 3, "end": 9, "colour": [0.6, 0.68, 0.8]},
    },
    "in no light at all": {**STILL, "lights": [DARK], "ambient": [0, 0, 0]},
}


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kernels that are launched, by their sources."""
    found: list[str] = []
    launch = Session.launch

    def counting(self: Session, source: str, kernel: str, *arguments: Any, **further: Any) -> None:
        found.append(source)
        launch(self, source, kernel, *arguments, **further)

    monkeypatch.setattr(Session, "launch", counting)
    return found


@pytest.mark.parametrize("name", list(SCENES))
def test_what_is_left_out_changes_nothing(name: str) -> None:
    pruned = lichen.render(SCENES[name])
    whole = lichen.render(SCENES[name], prune=False)
    apart = np.abs(pruned.image.pixels - whole.image.pixels).max()
    assert apart <= pruned.error.value + whole.error.value
    assert apart < 1e-5
    assert not [each for each in whole.decisions if each.pass_ == "scene" and each.action == "not lowered"]
    assert np.isfinite(pruned.image.pixels).all()


@pytest.mark.parametrize(
    ("changes", "source"),
    [
        ({"fog": None}, "fog/"),
        ({"fog": {"density": 0}}, "fog/"),
        ({"lights": STILL["lights"][1:]}, "shadow/"),
        ({"objects": STILL["objects"][1:2]}, "shadow/"),
        ({"background": [0, 0, 0]}, "scene/background"),
        ({"ambient": [0, 0, 0], "lights": STILL["lights"][:1], "fog": {"density": 0.1}}, "scene/background"),
        ({"ambient": [0, 0, 0]}, "arithmetic/expression"),
        ({"lights": [SPOT, DARK]}, "shadow/"),
        ({"lights": [SPOT, DARK]}, "lighting/"),
        ({"output": "light"}, "fog/"),
        ({"lens": {"focus": 4.5, "blur": 0}}, "lens/"),
        ({"objects": STILL["objects"], "shutter": {}}, "motion/"),
        ({"environment": {"image": "sky", "reflectance": 0}}, "environment/"),
    ],
)
def test_effects_that_are_off_launch_no_kernel(changes: dict[str, Any], source: str, launched: list[str]) -> None:
    sky = {"sky": lichen.Image(np.full((8, 16, 3), 0.5, np.float32), lichen.Space.LINEAR)}
    moving = [STILL["objects"][0], {**STILL["objects"][1], "velocity": [0.2, 0, 0]}, STILL["objects"][2]]
    on = {"lens": {"focus": 4.5, "blur": 3}, "shutter": {}, "objects": moving, "environment": {"image": "sky"}}
    lichen.render({**STILL, **on}, images=sky, device="opencl")
    assert any(each.startswith(source) for each in launched), "the effect is on, and counted"
    launched.clear()
    lichen.render({**STILL, **changes}, images=sky if "environment" in changes else None, device="opencl")
    assert launched
    assert not [each for each in launched if each.startswith(source)]


def test_every_decision_of_the_scene_has_its_reason() -> None:
    plan = lichen.explain_scene(SCENES["lights that light nothing"])
    said = {each.node: each.reason for each in plan.decisions if each.pass_ == "scene"}
    assert said["light_2"] == "nothing lies in its cone"
    assert said["light_3"] == "it gives no light"
    assert all(each.reason for each in plan.decisions)
    single = lichen.explain_scene({**STILL, **ALONE})
    assert any("convex" in each.reason for each in single.decisions)


def test_an_error_counts_with_lights_where_they_are() -> None:
    """Boxes that are turned, balls from within: no surface is nearer than was said, and light is what it was."""
    rng = np.random.default_rng(5)
    lights = [{"kind": "point", "position": rng.uniform([-2, 0.2, -2], [2, 2, 2]).tolist()} for _ in range(24)]
    scene = read({**STILL, "lights": [*lights, {"kind": "point", "position": [-0.8, 0.7, 0.1]}]})
    position = lichen.render({**STILL, "output": "position"}).image.pixels.reshape(-1, 3).astype(float)
    position = position[np.isfinite(position).all(axis=1)]
    for light in scene.lights:
        near = np.linalg.norm(position - light.position, axis=1).min()
        assert clearance(light, scene.objects) <= near * (1 + 1e-6)
    made, bare = lichen.render(STILL), {**STILL["lights"][0], "nearest": 1e-9}
    plain = lichen.render({**STILL, "lights": [bare, *STILL["lights"][1:]]})
    assert np.array_equal(made.image.pixels, plain.image.pixels)
    assert made.error.value < 1e-4 < plain.error.value / 100


def test_shadow_darkens_and_fog_brightens_where_they_should() -> None:
    bare = {**STILL, "fog": None, "ambient": [0, 0, 0], "lights": STILL["lights"][:1]}
    unshadowed = {**bare, "lights": [{**STILL["lights"][0], "shadow": None}]}
    with_shadow, without = (lichen.render(each).image.pixels for each in (bare, unshadowed))
    assert (with_shadow <= without + 1e-5).all()
    assert np.count_nonzero(with_shadow.sum(-1) < 0.1 * without.sum(-1)) > 100
    foggy = lichen.render(STILL).image.pixels
    clear = lichen.render({**STILL, "fog": None}).image.pixels
    sky = np.isinf(lichen.render({**STILL, "output": "depth"}).image.pixels[..., 0])
    assert sky.any()
    assert np.abs(foggy[~sky] - clear[~sky]).max() > 0.02


def test_shadow_is_the_same_for_an_eye_within_it() -> None:
    """Under a ball, where counts of shadow volumes that are crossed begin with 1: by the ray from floor to lamp."""
    eye, lamp, centre, radius = [0.1, 0.7, 0.3], np.array([0.0, 6, 0]), np.array([0.0, 2, 0]), 0.8
    objects = [{"shape": "plane"}, {"shape": "sphere", "centre": centre.tolist(), "radius": radius}]
    camera = {"eye": eye, "target": [0.5, 0, -0.3], "fov": 90, "width": 60, "height": 60}
    shadow = {"size": 512, "filter": 0}
    light = {"kind": "point", "position": lamp.tolist(), "intensity": 20, "shadow": shadow}
    scene = {"camera": camera, "objects": objects, "lights": [light], "output": "light"}
    found = lichen.render(scene).image.pixels[..., 0]
    points = lichen.run("gbuffer", objects=objects, buffer="position", frame="world", **camera).image.pixels
    floor = np.isfinite(points).all(axis=-1) & (np.abs(points[..., 1]) < 1e-4)
    ray = lamp - np.where(floor[..., None], points, 0)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    past = np.linalg.norm(np.cross(ray, lamp - centre), axis=-1)
    hidden, lit = floor & (past < radius - 0.03), floor & (past > radius + 0.03)
    assert min(np.count_nonzero(hidden), np.count_nonzero(lit)) > 200
    assert found[hidden].max() == 0
    assert found[lit].min() > 0


def test_projectors_and_slabs_show_pictures_sent_along() -> None:
    """As the operation does by itself, each its own, with shadows and without."""
    rng = np.random.default_rng(3)
    images = {"film": rng.random((6, 8, 3), np.float32), "sheet": 2 * rng.random((8, 12, 1), np.float32)}
    placed = {"position": [0.5, 3, 2], "direction": [-0.5, -3, -2], "intensity": 6}
    lamps = [
        {"kind": "projector", "slide": "film", **placed},
        {"kind": "slab", "slide": "sheet", "cells": [3, 2], "size": [0.3, 0.2], "fov": 60, **placed},
    ]
    scene: dict[str, Any] = {
        "camera": {**STILL["camera"], "width": 40, "height": 30}, "objects": [{"shape": "plane"}, STILL["objects"][1]],
    }  # fmt: skip
    for shadow in (None, {"size": 64}):
        both = [{**lamp, "shadow": shadow} for lamp in lamps]
        made = lichen.render({**scene, "lights": [*both, STILL["lights"][1]]}, images=images).image.pixels
        alone = [
            lichen.render(
                {**scene, "lights": [each]}, images={k: v for k, v in images.items() if k == each.get("slide")}
            )
            for each in (*both, STILL["lights"][1])
        ]
        np.testing.assert_allclose(made, sum(each.image.pixels for each in alone), atol=2e-6)
    seen = {name: lichen.render({**scene, "output": name}).image.pixels for name in ("position", "normal", "albedo")}
    slab = {key: value for key, value in lamps[1].items() if key != "slide"}
    wish: dict[str, Any] = {"lights": [slab], "model": "lambert", "diffuse": [1, 1, 1]}
    by_hand = lichen.run("lighting", **seen, slab=images["sheet"], **wish).image.pixels
    assert by_hand.max() > 0.1
    rendered = lichen.render({**scene, "lights": lamps[1:]}, images={"sheet": images["sheet"]}).image.pixels
    np.testing.assert_allclose(rendered, by_hand, atol=1e-5)


def test_points_of_a_light_each_cast_a_shadow() -> None:
    """With and without shadows, in parts of what four points give: all of them are there, and none between."""
    lamp = {"kind": "area", "position": [1, 3, 1], "direction": [-1, -3, -1], "size": [0.8, 0.8], "samples": 1}
    balls = [{"shape": "plane"}, {"shape": "sphere", "centre": [0, 0.7, 0], "radius": 0.4}]
    scene: dict[str, Any] = {
        "camera": {"eye": [0, 2.5, 3], "target": [0, 0, 0], "width": 64, "height": 48}, "objects": balls,
    }  # fmt: skip
    shadow = {"filter": 0, "points": 4, "size": 256}
    lit, whole = (
        lichen.render({**scene, "lights": [light]}).image.pixels[..., 0] for light in ({**lamp, "shadow": shadow}, lamp)
    )
    shares = np.divide(lit, whole, where=whole > 1e-4, out=np.ones_like(lit))
    assert np.allclose(shares * 4, np.rint(shares * 4), atol=1e-4)
    assert set(np.unique(np.rint(shares * 4))) == {0, 1, 2, 3, 4}
    single = lichen.explain_scene({**scene, "lights": [{**lamp, "kind": "point", "shadow": shadow}]})
    assert any(each.reason == "the light is one point" for each in single.decisions)


def test_surroundings_lens_and_shutter_do_what_their_operations_do() -> None:
    sky = lichen.Image(np.random.default_rng(2).random((16, 32, 3), np.float32), lichen.Space.LINEAR)
    moving = [STILL["objects"][0], {**STILL["objects"][1], "velocity": [0.2, 0, 0]}]
    still = {**STILL, "objects": moving, "fog": None}
    effects = {
        "environment": {"image": "sky", "reflectance": 0.4},
        "lens": {"focus": 4.0, "blur": 4.0},
        "shutter": {"shutter": 0.8},
    }
    plain = lichen.render({**still, "background": [0, 0, 0]}).image
    made = lichen.render({**still, **effects, "background": [0, 0, 0]}, images={"sky": sky}).image.pixels
    seen = {name: lichen.render({**still, "output": name}).image.pixels for name in ("depth", "normal", "position")}
    camera = {key: still["camera"][key] for key in ("eye", "target", "fov", "width", "height")}
    motion = lichen.run("gbuffer", objects=moving, buffer="motion", **camera).image.pixels
    eye = still["camera"]["eye"]
    expected = lichen.run(
        "reflection", seen["normal"], environment=sky, position=seen["position"], base=plain, eye=eye, reflectance=0.4
    ).image
    expected = lichen.run("depth_of_field", expected, depth=seen["depth"], focus=4.0, blur=4.0).image
    expected = lichen.run("motion_blur", expected, motion=motion, shutter=0.8).image
    np.testing.assert_allclose(made, expected.pixels, atol=2e-3)
    assert np.abs(made - plain.pixels).max() > 0.1


def buffers() -> dict[str, np.ndarray]:
    """What a renderer would send: the same scene, seen from the camera."""
    camera = {key: STILL["camera"][key] for key in ("eye", "target", "fov", "width", "height")}
    made = {
        name: lichen.run("gbuffer", objects=STILL["objects"], buffer=name, **camera).image
        for name in ("depth", "normal", "albedo")
    }
    return {name: image.pixels if name != "albedo" else image for name, image in made.items()}


def test_buffers_sent_along_are_lit_like_objects() -> None:
    """The lamp goes with the camera, so that both axes agree on it."""
    lamp = {"kind": "point", "position": [0.6, 1.6, 4.5], "intensity": 12}
    objects = {**STILL, "lights": [lamp], "fog": {"density": 0.1, "colour": [0.6, 0.7, 0.8]}}
    sent = {
        "camera": {"fov": 42},
        "buffers": {"depth": "z", "normal": "n", "albedo": "a"},
        "lights": [{**lamp, "position": [0, 0, 0]}],
        **{key: objects[key] for key in ("ambient", "background", "fog")},
    }
    given = buffers()
    made = lichen.render(sent, images={"z": given["depth"], "n": given["normal"], "a": given["albedo"]})
    np.testing.assert_allclose(made.image.pixels, lichen.render(objects).image.pixels, atol=2e-5)


MANY = [
    {
        "kind": "spot", "position": [x, 2.5, z], "direction": [0, -1, 0], "inner": 12, "outer": 24, "intensity": 6,
        **({"shadow": {"size": 32, "filter": 2}} if z > 0 else {}),
    }
    for x in (-3.0, -1.5, 0.0, 1.5, 3.0) for z in (-3.0, -1.0, 1.0)
]  # fmt: skip


def test_lamps_are_left_out_of_tiles_and_nothing_changes() -> None:
    camera = {**STILL["camera"], "width": 150, "height": 110}
    scene = {**STILL, "camera": camera, "lights": [*MANY, *STILL["lights"]], "surface": {"model": "blinn_phong"}}
    pruned, whole = lichen.render(scene), lichen.render(scene, prune=False)
    np.testing.assert_allclose(pruned.image.pixels, whole.image.pixels, atol=1e-6)
    said = [each for each in pruned.decisions if each.pass_ == "tiles"]
    assert {each.reason.split(":")[0] for each in said} >= {"it lies outside the lamp's cone"}
    assert all(each.action == "skipped" and each.bound == 0 for each in said)
    assert not [each for each in whole.decisions if each.pass_ == "tiles"]


def test_a_scene_of_nothing_but_its_albedo_is_that_picture() -> None:
    rng = np.random.default_rng(2)
    sent = {
        "a": lichen.Image(rng.random((9, 8, 3), dtype=np.float32), lichen.Space.LINEAR),
        "d": lichen.Image(rng.uniform(1, 2, (9, 8, 1)).astype(np.float32)),
        "m": lichen.Image(np.zeros((9, 8, 2), np.float32)),
        "n": lichen.Image(np.broadcast_to(np.array([0, 0, 1], np.float32), (9, 8, 3)).copy()),
    }
    scene = {
        "buffers": {"albedo": "a", "depth": "d", "motion": "m", "normal": "n"},
        "ambient": [1, 1, 1], "lights": [DARK | {"shadow": None}], "fog": {"density": 0},
        "lens": {"focus": 1.5, "blur": 0}, "shutter": {},
    }  # fmt: skip
    made = lichen.render(scene, images=sent, space="linear")
    assert made.plan.nodes == ()
    np.testing.assert_array_equal(made.image.pixels, sent["a"].pixels)
    whole = lichen.render(scene, images=sent, space="linear", prune=False)
    np.testing.assert_allclose(whole.image.pixels, sent["a"].pixels, atol=1e-6)


@pytest.mark.parametrize("background", ["none", "environment"])
def test_what_fog_hides_mirrors_nothing(background: str) -> None:
    """Nor does what is not there, unless the environment is to be seen behind it."""
    sky = np.random.default_rng(2).random((16, 32, 3), np.float32)
    camera = {**STILL["camera"], "width": 150, "height": 140, "target": [0, 1.8, 0]}
    lamps = [{"kind": "point", "position": [x, 3, 2], "intensity": 3} for x in np.linspace(-2, 2, 8)]
    fog = {"kind": "linear", "start": 1, "end": 4.5, "colour": [0.6, 0.68, 0.8]}
    mirror = {"image": "sky", "fresnel": "dielectric", "background": background}
    scene = {**STILL, "camera": camera, "fog": fog, "lights": lamps, "environment": mirror}
    pruned, whole = (lichen.render(scene, images={"sky": sky}, prune=prune) for prune in (True, False))
    assert np.abs(pruned.image.pixels - whole.image.pixels).max() <= 1e-6
    found = lichen.map_scene(scene, images={"sky": sky})
    assert found.effects[-1] == "environment"
    assert {1, 4} & set(found.why[..., -1].ravel()) == ({4} if background == "environment" else {1, 4})


@pytest.mark.parametrize("kind", ["exponential", "height"])
def test_what_fog_hides_is_not_lit(kind: str) -> None:
    """By as much as no stored code shows, and only where such codes are asked for."""
    fog = {"kind": kind, "density": 2.2, "falloff": 9, "colour": [0.6, 0.68, 0.8]}
    lamps = [{"kind": "point", "position": [x, 3, 2], "intensity": 3} for x in np.linspace(-2, 2, 26)]
    camera = {**STILL["camera"], "width": 150, "height": 110}
    scene = {**STILL, "camera": camera, "fog": fog, "lights": lamps}
    stored, whole = lichen.render(scene, storage="uint8"), lichen.render(scene, prune=False)
    found = {each.reason.split(":")[0]: each.bound for each in stored.decisions if each.pass_ == "tiles"}
    apart = np.abs(stored.image.pixels - whole.image.pixels).max()
    assert found["fog hides it"] > 0
    assert 0 < apart <= sum(found.values()) <= 0.25 / 255 / 32 + 1e-9
    assert stored.error.value >= apart
    assert np.abs(lichen.render(scene).image.pixels - whole.image.pixels).max() < 1e-6


@pytest.mark.parametrize("buffer", ["position", "normal", "albedo", "height"])
def test_what_is_no_number_in_a_buffer_stays_in_its_pixels(buffer: str) -> None:
    """With lamps that are left out of the tile, and a highlight of 1e4 beside it."""
    size = 40, 70
    x, z = np.meshgrid(np.linspace(-4, 4, size[1]), np.linspace(-3, 3, size[0]))
    given = {
        "position": np.stack([x, 0 * x, z], axis=-1).astype(np.float32),
        "normal": np.broadcast_to(np.array([0, 1, 0], np.float32), (*size, 3)).copy(),
        "albedo": np.full((*size, 3), 0.5, np.float32),
        "height": 0.05 * np.sin(9 * x)[..., None].astype(np.float32),
    }
    given["albedo"][20, 40] = 1e4
    given[buffer][20, 41] = np.nan
    scene = {
        "camera": {"eye": [0, 4, 3]}, "buffers": {name: name for name in given},
        "surface": {"model": "lambert"}, "fog": {"density": 0.1}, "ambient": [0.1, 0.1, 0.1],
        "background": [0.2, 0.3, 0.4],
    }  # fmt: skip
    scene["lights"] = [{**each, "shadow": None} for each in (*MANY, *MANY)]
    pruned, whole = (lichen.render(scene, images=given, prune=prune) for prune in (True, False))
    assert [each for each in pruned.decisions if each.pass_ == "tiles"]
    np.testing.assert_allclose(pruned.image.pixels, whole.image.pixels, rtol=1e-6, equal_nan=True)
    spoilt = ~np.isfinite(pruned.image.pixels).all(axis=-1)
    assert spoilt[20, 41]
    assert np.count_nonzero(spoilt) == 1


FADED: dict[str, Any] = {"kind": "linear", "start": 1, "end": 6, "colour": [0.6, 0.7, 0.8]}


@pytest.mark.parametrize(
    ("changes", "hides"),
    [
        ({}, True),
        ({"fog": {"kind": "squared", "density": 0.2}}, True),
        ({"fog": {**FADED, "background": "keep"}}, False),
        ({"fog": {"kind": "layered", "heights": [0, 1], "densities": [0.5, 0]}}, False),
        ({"ambient": [0.1, 0.1, 0.1]}, False),
        ({"lights": [{"kind": "directional", "direction": [0, -1, 0]}]}, False),
        ({"buffers": {"position": "p", "normal": "n", "albedo": "a", "emissive": "e"}}, False),
    ],
)
def test_a_background_that_fog_hides_is_not_put_in(changes: dict[str, Any], hides: bool) -> None:
    """Even where nothing stands, and normals and albedo are no numbers there."""
    rng = np.random.default_rng(8)
    given = {
        name: rng.uniform(low, 2, (12, 20, channels)).astype(np.float32)
        for name, low, channels in (("p", -2, 3), ("n", -2, 3), ("a", 0, 3), ("e", 0, 1))
    }
    given["p"][3:9, 4:15] = np.inf
    given["n"][4], given["a"][5:7], given["a"][7] = np.nan, np.nan, np.inf
    scene = {
        "camera": {"eye": [0, 1, 4]}, "buffers": {"position": "p", "normal": "n", "albedo": "a"},
        "lights": [{"kind": "point", "position": [0, 3, 0]}], "fog": FADED, "background": [0.2, 0.3, 0.4], **changes,
    }  # fmt: skip
    pruned, whole = (
        lichen.render(scene, images={name: given[name] for name in scene["buffers"].values()}, prune=prune)
        for prune in (True, False)
    )
    np.testing.assert_array_equal(pruned.image.pixels, whole.image.pixels)
    assert hides == ("fog hides whatever is infinitely far" in [each.reason for each in pruned.decisions])


def test_one_pixel_and_nothing_at_all_are_scenes() -> None:
    dot = {**STILL, "camera": {**STILL["camera"], "width": 1, "height": 1}, "lights": [*MANY, *STILL["lights"]]}
    first, second = lichen.render(dot), lichen.render(dot, prune=False)
    assert first.image.pixels.shape == (1, 1, 3)
    np.testing.assert_allclose(first.image.pixels, second.image.pixels, atol=1e-6)
    nothing = lichen.render({**STILL, "objects": [], "lights": [*MANY, *STILL["lights"]], "fog": None}).image.pixels
    np.testing.assert_allclose(nothing, np.broadcast_to(STILL["background"], nothing.shape), atol=1e-6)


def test_flaws_are_told_where_the_author_wrote_them() -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({"camera": {"fov": 0}, "lights": [{"kind": "sun"}], "nonsense": 1})
    assert {"/camera/fov", "/lights/0/kind", "/nonsense"} <= {each.pointer for each in caught.value.flaws}
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({**STILL, "fog": {"density": -1}})
    assert {each.pointer for each in caught.value.flaws} == {"/fog/density"}
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({**STILL, "lens": {"focus": -1}})
    assert {each.pointer for each in caught.value.flaws} == {"/lens/focus"}
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({**STILL, "environment": {}})
    assert {each.pointer for each in caught.value.flaws} == {"/environment/image"}
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({**STILL, "surface": {"model": "chrome"}})
    assert {each.pointer for each in caught.value.flaws} == {"/surface/model"}
    with pytest.raises(InvalidRequest) as caught:
        lichen.render({"buffers": {"depth": "d", "position": "p"}, "objects": [{"shape": "plane"}], "lights": [{}]})
    assert {each.pointer for each in caught.value.flaws} == {"/buffers", "/buffers/position", "/buffers/normal"}
