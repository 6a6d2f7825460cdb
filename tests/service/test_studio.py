"""The page's files, pictures and cases through the routes. What the page does with them is tested in a browser."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lichen.files import decode
from lichen.image import Alpha, Image, Space
from lichen_service.studio import files as page
from lichen_service.studio.pictures import shown
from lichen_service.studio.samples import curated, samples
from lichen_service.studio.thumbnails import HEIGHT, WIDTH

from .conftest import Caller, problem_of, read_json


def test_every_file_of_the_page_is_served_with_its_policy(call: Caller) -> None:
    assert {path.rpartition(".")[2] for path in page.files()} == {"html", "css", "js", "json", "svg", "jpg"}
    for path, file in page.files().items():
        response = call("GET", f"/studio/{path}")
        assert (response.status, response.body) == (200, file.data)
        assert response.headers["Content-Type"] == file.media_type
        policy = response.headers["Content-Security-Policy"]
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        again = call("GET", f"/studio/{path}", headers={"if-none-match": response.headers["ETag"]})
        assert (again.status, again.body) == (304, b"")


def test_the_portrait_is_the_sample_of_the_documentation() -> None:
    photo = Path(__file__).resolve().parents[2] / "docs" / "samples" / "photo.jpg"
    assert page.files()["content/portrait.jpg"].data == photo.read_bytes()


def test_the_page_holds_no_script_of_its_own_and_names_no_other_host() -> None:
    for path, file in page.files().items():
        if path.endswith(("html", "css", "js")):
            text = file.data.decode()
            hosts = set(re.findall(r"https?://([\w.-]+)", text)) - {"www.w3.org", "numpy.org"}
            assert not hosts, path
            assert not re.search(r"<script(?![^>]*\ssrc=)|<style|\son\w+=\"|\sstyle=\"|innerHTML|eval\(", text), path


def test_every_module_is_there_before_it_is_asked_for() -> None:
    index = page.files()[page.INDEX].data.decode()
    modules = [path for path in page.files() if path.endswith(".js")]
    assert all(f'rel="modulepreload" href="/studio/{path}"' in index for path in modules)
    for path in modules:
        for wanted in re.findall(r'from "(\.[^"]+)"', page.files()[path].data.decode()):
            assert posixpath.normpath(posixpath.join(posixpath.dirname(path), wanted)) in modules


@pytest.mark.parametrize(
    "path", ["nothing.js", "..%2Ffiles.py", "lib/../index.html", "lib/", "lib/nothing.js", "a/b/c"]
)
def test_nothing_else_is_served(call: Caller, path: str) -> None:
    problem_of(call("GET", f"/studio/{path}"), 404, "not-found")


def test_modules_of_the_page_are_short_too() -> None:
    lengths = {path: each.data.count(b"\n") for path, each in page.files().items() if path.endswith((".js", ".css"))}
    assert lengths
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_what_operations_are_first_shown_with_fits_their_declaration(
    call: Caller, operations: Mapping[str, Any]
) -> None:
    told = read_json(call("GET", "/studio/showcase.json"))
    assert set(told["operations"]) == set(operations)
    assert curated().keys() <= operations.keys()
    for name, said in told["operations"].items():
        operations[name].validate(said["parameters"])
        declared = {each.name: each for each in operations[name].inputs}
        assert {key for key, each in declared.items() if each.required} <= said["inputs"].keys() <= declared.keys()
        assert curated().get(name, {}).get("inputs", {}).keys() <= declared.keys()
        assert set(said["inputs"].values()) <= samples().keys()
    for each in samples().values():
        assert ("file" in each) != ("pipeline" in each)
        assert set(each.get("inputs", {}).values()) <= samples().keys()


@pytest.mark.parametrize("name", ["gaussian", "field", "colour_map"])
def test_an_operation_at_a_glance(call: Caller, name: str) -> None:
    response = call("GET", f"/studio/thumbnails/{name}")
    picture = decode(response.body).pixels
    assert picture.shape[:2] == (HEIGHT, WIDTH)
    assert np.ptp(picture) > 0.2
    again = call("GET", f"/studio/thumbnails/{name}", headers={"if-none-match": response.headers["ETag"]})
    assert again.status == 304


def test_a_thumbnail_of_nothing(call: Caller) -> None:
    problem_of(call("GET", "/studio/thumbnails/gausian"), 404, "unknown-operation")


def test_cases_are_run_and_told(call: Caller, operations: Mapping[str, Any]) -> None:
    listed = {each["name"]: each["cases"] for each in read_json(call("GET", "/studio/cases/all.json"))["operations"]}
    assert listed.keys() == {name for name, each in operations.items() if each.hard_cases}
    assert all(case["name"] and case["why"] for cases in listed.values() for case in cases)
    for index, case in enumerate(operations["gaussian"].hard_cases):
        told = read_json(call("GET", f"/studio/cases/gaussian.{index}.json"))
        assert told["name"] == case.name
        assert told["wrong"] is None
        for part in [*told["inputs"], "result"]:
            width, height, _ = (told["inputs"] | {"result": told["result"]})[part]["size"]
            picture = decode(call("GET", f"/studio/cases/gaussian.{index}.{part}.png").body)
            assert (picture.width, picture.height) == (min(width, 512), min(height, 512)) or max(width, height) > 512


@pytest.mark.parametrize("name", ["gaussian.999.json", "gaussian.json", "gaussian.0.x.png", "gaussian.-1.json", "x"])
def test_cases_that_there_are_not(call: Caller, name: str) -> None:
    problem_of(call("GET", f"/studio/cases/{name}"), 404, "not-found")


def test_what_is_not_finite_can_be_seen() -> None:
    pixels = np.full((1, 4, 1), 0.5, np.float32)
    pixels[0, 1:, 0] = np.nan, np.inf, 3
    made = shown(Image(pixels)).pixels
    np.testing.assert_array_equal(made[0, 1], [1, 0, 1])
    np.testing.assert_array_equal(made[0, 2], [0, 1, 1])
    np.testing.assert_array_equal(made[0, [0, 3]], [[0, 0, 0], [1, 1, 1]])


def test_light_is_shown_as_a_display_needs_it_and_coverage_is_kept() -> None:
    light = np.array([[[0.5, 0.5, 0.5, 0.5]]], np.float32)
    made = shown(Image(light, Space.LINEAR, Alpha.ASSOCIATED)).pixels
    np.testing.assert_allclose(made, [[[1, 1, 1, 0.5]]])


def test_a_vector_has_a_colour_for_its_direction() -> None:
    field = np.array([[[1, 0], [-1, 0], [0, 0], [0, 0.25]]], np.float32)
    made = shown(Image(field)).pixels[0]
    assert made.shape == (4, 3)
    assert np.ptp(made[2]) == 0
    assert np.abs(made[0] - made[1]).max() > 0.5
    assert made[3].max() < made[0].max()
