"""Scenes through the routes: one JSON in, a picture out; what does not run, and every flaw where it was written."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

import lichen
from lichen.files import decode, encode
from lichen_service.http.message import Response

from .conftest import Caller, form, pointers, problem_of, read_json

PATH = "/v1/scenes"
SCENE: dict[str, Any] = {
    "camera": {"eye": [0, 1.5, 4], "target": [0, 0.6, 0], "width": 48, "height": 36},
    "objects": [
        {"shape": "plane", "albedo": [0.6, 0.6, 0.6]},
        {"shape": "sphere", "centre": [0, 0.8, 0], "radius": 0.8, "albedo": [0.8, 0.2, 0.1]},
    ],
    "lights": [{"kind": "point", "position": [3, 5, 2], "intensity": 30, "shadow": {"size": 64}}],
    "fog": {"density": 0.03, "colour": [0.6, 0.7, 0.8]},
}
JSON = {"content-type": "application/json"}


def posted(call: Caller, scene: Any, query: str = "", method: str = "POST") -> Response:
    return call(method, PATH + query, json.dumps(scene).encode(), JSON)


def test_one_json_is_a_picture(call: Caller) -> None:
    for method in ("POST", "QUERY"):
        response = posted(call, SCENE, "?device=numpy", method)
        assert response.status == 200, bytes(response.body)
        assert response.headers["Content-Type"] == "image/png"
        expected = lichen.render(SCENE, device="numpy", storage="uint8", space="srgb")
        assert bytes(response.body) == bytes(encode(expected.image, "png", storage=lichen.Storage.UINT8).data)
    picture = decode(bytes(response.body))
    assert (picture.height, picture.width, picture.channels) == (36, 48, 3)
    assert picture.pixels.std() > 0.05
    assert "fog=exact" in response.headers["Lichen-Method"]


def test_explain_tells_which_effects_run_and_why_the_others_do_not(call: Caller) -> None:
    still = {**SCENE, "fog": {"density": 0}, "lights": [*SCENE["lights"], {"intensity": 0}]}
    plan = read_json(posted(call, still, "?explain=true"))
    nodes = {each["name"] for each in plan["nodes"]}
    assert "light_0_shadow" in nodes
    assert "fog" not in nodes
    said = {each["node"]: each["reason"] for each in plan["decisions"] if each["pass"] == "scene"}
    assert said["fog"] == "its density is 0"
    assert said["light_1"] == "it gives no light"
    whole = read_json(posted(call, still, "?explain=true&prune=false"))
    assert "fog" in {each["name"] for each in whole["nodes"]}


def test_conventions_are_of_buffers_that_are_given(call: Caller) -> None:
    response = posted(call, {**SCENE, "conventions": {"left_handed": ["position", "depth"], "encoding": "bits"}})
    problem = problem_of(response, 422, "invalid-request")
    assert pointers(problem) == {"/conventions/left_handed/1", "/conventions/encoding"}
    response = posted(call, {**SCENE, "conventions": {"left_handed": ["position"]}})
    assert pointers(problem_of(response, 422, "invalid-request")) == {"/conventions/left_handed"}


def test_a_map_tells_which_lights_are_looked_at_where(call: Caller) -> None:
    """A spot on the sphere's left, and a lamp below the ground."""
    lamps = [
        {"kind": "spot", "position": [-3, 1, 0], "direction": [1, 0, 0], "inner": 3, "outer": 9, "shadow": {}},
        {"kind": "point", "position": [0, -4, 0]},
        {"intensity": 0},
    ]
    scene = {**SCENE, "lights": lamps, "camera": {**SCENE["camera"], "width": 90, "height": 70}}
    answer = posted(call, scene, "?explain=map")
    assert answer.headers["Content-Type"] == "image/png"
    picture = decode(bytes(answer.body))
    assert (picture.height, picture.width) == (70, 90)
    assert "faces away from the lamp" in answer.headers["Lichen-Skipped"]
    sent = json.dumps(scene).encode()
    told = read_json(call("POST", PATH + "?explain=map", sent, {**JSON, "accept": "application/json"}))
    assert told["effects"] == ["light_1", "light_0"]
    why = np.array(told["why"])
    assert why.shape == (3, 3, 2)
    reasons = [told["reasons"][each] for each in np.unique(why)]
    assert reasons[0] == "it is computed"
    assert {"it lies outside the lamp's cone", "it faces away from the lamp"} <= set(reasons)
    assert any(each["node"] == "light_2" for each in told["decisions"])
    both = call("POST", PATH + "?explain=map", sent, {**JSON, "accept": "multipart/mixed"})
    assert both.headers["Content-Type"].startswith("multipart/mixed")
    assert bytes(answer.body) in bytes(both.body)
    dark = posted(call, {**SCENE, "lights": []}, "?explain=map")
    assert pointers(problem_of(dark, 422, "invalid-request")) == {"/lights"}


def test_buffers_come_as_parts(call: Caller) -> None:
    camera = {key: SCENE["camera"][key] for key in ("eye", "target", "width", "height")}
    seen = {
        name: lichen.run("gbuffer", objects=SCENE["objects"], buffer=name, **camera).image.pixels
        for name in ("depth", "normal", "albedo")
    }
    scene = {
        "buffers": {"depth": "z", "normal": "n", "albedo": "a"},
        "lights": [{"direction": [0, 0, -1]}],
        "fog": {"density": 0.05},
    }
    parts = {"scene": (json.dumps(scene).encode(), "application/json")}
    for name, buffer in (("z", "depth"), ("n", "normal"), ("a", "albedo")):
        parts[name] = (bytes(encode(lichen.Image(seen[buffer]), "npy").data), "application/x-npy")
    body, headers = form(parts)
    response = call("POST", f"{PATH}?format=npy", body, headers)
    assert response.status == 200, bytes(response.body)
    made = decode(bytes(response.body)).pixels
    images = {"z": seen["depth"], "n": seen["normal"], "a": seen["albedo"]}
    np.testing.assert_allclose(made, lichen.render(scene, images=images).image.pixels, atol=1e-6)


def test_flaws_are_told_at_the_scenes_own_places(call: Caller) -> None:
    wrong = {**SCENE, "camera": {**SCENE["camera"], "fov": 500}, "lights": [{"kind": "sun"}], "mist": 1}
    assert {"/camera/fov", "/lights/0/kind", "/mist"} <= refused(posted(call, wrong))
    layers = {"kind": "layered", "heights": [2, 1], "densities": [1, 1]}
    assert refused(posted(call, {**SCENE, "fog": layers})) == {"/fog/heights"}
    assert refused(call("POST", PATH, b"{not json", JSON)) == {"/scene"}
    unsent = {"buffers": {"depth": "z", "normal": "n"}, "lights": [{}]}
    assert refused(posted(call, unsent)) == {"/inputs/z", "/inputs/n"}


def test_layers_of_one_picture_are_its_buffers(call: Caller) -> None:
    """What is in them is known when they are decoded, and flaws of the scene come then."""
    camera = {key: SCENE["camera"][key] for key in ("eye", "target", "width", "height")}
    seen = {
        name: lichen.run("gbuffer", objects=SCENE["objects"], buffer=name, frame="world", **camera).image.pixels
        for name in ("position", "normal")
    }
    names = [f"L.{each.title()}.{axis}" for each in seen for axis in "XYZ"]
    layers = lichen.Image(np.concatenate(list(seen.values()), axis=2), metadata={"channel_names": names})
    data = bytes(encode(layers, "exr", storage=lichen.Storage.FLOAT32).data)
    scene = {"camera": {"eye": camera["eye"]}, "buffers": {"layers": "all"}, "lights": [{}]}
    parts = {"scene": (json.dumps(scene).encode(), "application/json"), "all": (data, "image/x-exr")}
    body, headers = form(parts)
    response = call("POST", PATH, body, headers)
    assert response.status == 200, bytes(response.body)
    assert response.headers["Content-Type"] == "image/png"
    assert decode(bytes(response.body)).pixels.std() > 0.05
    parts["scene"] = (json.dumps({**scene, "ambient": [1, 1, 1]}).encode(), "application/json")
    body, headers = form(parts)
    assert refused(call("POST", PATH, body, headers)) == {"/buffers/albedo"}


def refused(response: Response) -> set[str]:
    """Pointers to all that the problem document names."""
    return pointers(problem_of(response, 422, "invalid-request"))
