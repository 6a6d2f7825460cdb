"""The reports on accuracy over HTTP: forms, refusals, tags, and that they answer quickly with what the table says."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from lichen.calibration.table import load
from lichen.files import decode

from .conftest import Caller, pointers, problem_of, read_json

SVG = "{http://www.w3.org/2000/svg}"


def listed(operations: Mapping[str, Any]) -> list[str]:
    """Operations that the table holds."""
    return [name for name in operations if load().of(name)]


def test_the_list_tells_what_every_operation_costs(call: Caller, operations: Mapping[str, Any]) -> None:
    found = read_json(call("GET", "/v1/accuracy"))["operations"]
    assert [each["name"] for each in found] == list(operations)
    for each in found:
        assert each["headline"].endswith(".")
        assert bool(each["front"]) == (each["name"] in listed(operations))
    for each in found[::8]:
        for link in each["links"].values():
            assert call("GET", link).status == 200, link


def test_a_report_holds_every_setting_of_the_table(call: Caller, operations: Mapping[str, Any]) -> None:
    for name in listed(operations):
        for example in range(len(operations[name].examples)):
            report = read_json(call("GET", f"/v1/accuracy/{name}?example={example}"))
            settings = {(each["method"], each["knob"], each["precision"]): each for each in report["settings"]}
            for entry in load().of(name, example):
                setting = settings[(entry.method, entry.knob, entry.precision)]
                assert setting["failed"] or (setting["worst"], setting["typical"]) == (entry.largest, entry.typical_rms)
                assert setting["failed"] or (setting["ciede2000"], setting["flip"]) == (entry.delta_e, entry.flip)
            assert all(each["reason"] for each in report["settings"])
            assert any(each["on_front"] for each in report["settings"])


@pytest.mark.parametrize("name", ["gaussian", "matrix"])
def test_a_point_can_be_replayed(call: Caller, png: bytes, name: str) -> None:
    report = read_json(call("GET", f"/v1/accuracy/{name}?example=0"))
    for setting in report["settings"]:
        if setting["failed"] or setting["peer"]:
            assert setting["replay"] is None
            continue
        answer = call("POST", setting["replay"], png)
        assert answer.status == 200, bytes(answer.body)
        knob = "" if setting["knob"] is None else f"; {setting['knob_name']}={setting['knob']:g}"
        assert answer.headers["Lichen-Method"] == f"{setting['method']}{knob}"


def test_every_operation_is_drawn(call: Caller, operations: Mapping[str, Any]) -> None:
    for name in operations:
        drawn = call("GET", f"/v1/accuracy/{name}.svg")
        assert drawn.headers["Content-Type"] == "image/svg+xml"
        assert "default-src 'none'" in drawn.headers["Content-Security-Policy"]
        root = ElementTree.fromstring(bytes(drawn.body))
        assert root.tag == f"{SVG}svg"
        assert name in (root.findtext(f"{SVG}title") or "")
        assert read_json(call("GET", f"/v1/accuracy/{name}.json"))["operation"] == name


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_painted_plots_have_a_theme(call: Caller, operations: Mapping[str, Any], theme: str) -> None:
    for name in list(operations)[::12]:
        painted = call("GET", f"/v1/accuracy/{name}.png?theme={theme}")
        assert painted.headers["Content-Type"] == "image/png"
        pixels = decode(painted.body).pixels
        assert np.median(pixels) > 0.5 if theme == "light" else np.median(pixels) < 0.5


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("image/*", "image/svg+xml"),
        ("image/png", "image/png"),
        ("image/png;q=0.5, image/svg+xml", "image/svg+xml"),
        ("*/*", "application/json"),
        ("text/html,application/xml;q=0.9,*/*;q=0.8", "application/json"),
    ],
)
def test_forms_by_accept(call: Caller, accept: str, media_type: str) -> None:
    answer = call("GET", "/v1/accuracy/gaussian", headers={"accept": accept})
    assert answer.headers["Content-Type"] == media_type
    assert answer.headers["Vary"] == "Accept"
    suffixed = call("GET", "/v1/accuracy/gaussian.png", headers={"accept": accept})
    assert suffixed.headers["Content-Type"] == "image/png"


def test_a_form_nobody_offers_is_refused(call: Caller) -> None:
    problem_of(call("GET", "/v1/accuracy/gaussian", headers={"accept": "text/csv"}), 406, "not-acceptable")
    problem = problem_of(call("GET", "/v1/accuracy/gaussian.svgz"), 404, "not-found")
    assert "gaussian.svg" in problem["detail"]


@pytest.mark.parametrize("path", ["gausian", "gausian.svg", "gausian.json"])
def test_an_unknown_operation_is_named_with_its_neighbours(call: Caller, path: str) -> None:
    assert "gaussian" in problem_of(call("GET", f"/v1/accuracy/{path}"), 404, "unknown-operation")["detail"]


def test_every_flaw_of_a_query_is_named(call: Caller) -> None:
    asked = call("GET", "/v1/accuracy/gaussian?size=7&device=gpu&theme=pink&exmaple=1&size=9")
    problem = problem_of(asked, 422, "invalid-request")
    assert pointers(problem) == {"/query/size", "/query/device", "/query/theme", "/query/exmaple"}
    assert pointers(problem_of(call("GET", "/v1/accuracy/lic?example=99"), 422, "invalid-request")) == {
        "/query/example"
    }
    assert pointers(problem_of(call("GET", "/v1/accuracy?theme=dark"), 422, "invalid-request")) == {"/query/theme"}


@pytest.mark.parametrize("path", ["/v1/accuracy", *(f"/v1/accuracy/lic{form}" for form in ("", ".svg", ".png"))])
def test_reports_are_kept_by_their_tag(call: Caller, path: str) -> None:
    first = call("GET", path)
    again = call("GET", path, headers={"if-none-match": first.headers["ETag"]})
    assert (again.status, again.body) == (304, b"")
    assert call("HEAD", path).headers == first.headers


def test_size_and_device_change_the_times_and_not_the_errors(call: Caller) -> None:
    small, large = (read_json(call("GET", f"/v1/accuracy/gaussian?size={size}"))["settings"] for size in (128, 1024))
    assert [each["worst"] for each in small] == [each["worst"] for each in large]
    pairs = [(a["milliseconds"], b["milliseconds"]) for a, b in zip(small, large, strict=True)]
    unfit = [pair for pair in pairs if None in pair]  # what is for turned axes alone
    assert unfit
    assert all(pair == (None, None) or pair[0] < pair[1] for pair in pairs)
    assert read_json(call("GET", "/v1/accuracy/gaussian?device=numpy"))["device"] == "numpy"
